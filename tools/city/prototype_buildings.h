#pragma once

// Buildings that stand in more than one place: a few designs of each kind, for the share of the city that has no
// geometry of its own.

#include <vector>

#include "tools/city/buildings.h"

namespace spillway::tools::city {

inline constexpr size_t kDesignsOfKind = 10;

// kDesignsOfKind designs of each kind, in the order of kinds, each with its front left corner at the origin and its
// front along x.
[[nodiscard]] std::vector<Building> design_buildings(uint64_t seed);

// A design of the kind of `drawn` that stands on the lot, and that `refused` takes; none when nothing fits.
template <class Refused>
[[nodiscard]] std::optional<Building> place_design(const std::vector<Building>& designs, const Building& drawn,
                                                   const Lot& lot, const Refused& refused);

// ---- inline ----

// The ground on the lot that a rectangle of the kind may take.
[[nodiscard]] Polygon design_ground(Kind kind, const Lot& lot);
[[nodiscard]] Building placed(const Building& design, size_t number, const Polygon& ground);

template <class Refused>
std::optional<Building> place_design(const std::vector<Building>& designs, const Building& drawn, const Lot& lot,
                                     const Refused& refused) {
  const Polygon ground = design_ground(drawn.kind, lot);
  if (ground.empty()) return std::nullopt;
  const double width = length(ground[1].at - ground[0].at), depth = length(ground[2].at - ground[1].at);
  const size_t first = static_cast<size_t>(drawn.kind) * kDesignsOfKind;
  for (size_t i = 0; i < kDesignsOfKind; ++i) {
    const size_t number = first + (drawn.key + i) % kDesignsOfKind;
    const Building& design = designs[number];
    if (design.width_m() > width || design.depth_m() > depth) continue;
    Building building = placed(design, number, ground);
    building.district = drawn.district;
    if (!refused(building)) return building;
  }
  return std::nullopt;
}

}  // namespace spillway::tools::city
