#pragma once

// Which building stands on which lot: kind, footprint, height, materials. Its geometry is massing.h's.

#include <optional>
#include <vector>

#include "tools/city/lots.h"
#include "tools/city/palette.h"

namespace spillway::tools::city {

enum class Kind : uint8_t {
  glass_tower,
  setback_tower,
  art_deco,
  podium_tower,
  slab,
  office_block,
  walk_up,
  loft,
  corner_shop,
  row_house,
  villa,
  cottage,
  warehouse,
  factory,
  parking_garage,
  church,
  domed_hall,
  pagoda,
  count
};
inline constexpr size_t kKindCount = static_cast<size_t>(Kind::count);
[[nodiscard]] const char* name(Kind kind);

inline constexpr uint32_t kNoDesign = UINT32_MAX;

struct Building {
  Kind kind = Kind::walk_up;
  District district = District::midtown;
  uint64_t key = 0;
  Polygon footprint;  // convex; the first edge is the front
  int floors = 1;
  double floor_m = 3;
  uint32_t design = kNoDesign;  // of prototype_buildings.h, when it has no geometry of its own
  Surface wall = Surface::brick_red, trim = Surface::trim_stone, roof = Surface::roof_tar, glass = Surface::glass_dark;

  [[nodiscard]] double width_m() const { return length(footprint[1].at - footprint[0].at); }
  [[nodiscard]] double depth_m() const { return length(footprint[2].at - footprint[1].at); }  // of a rectangle
  [[nodiscard]] double height_m() const { return floors * floor_m; }
};

struct BuildingPlan {
  StreetPlanOptions streets;
  double unique = 1;              // the share of buildings with geometry of their own
  std::vector<Building> designs;  // of the others
};

// One building a lot, in the order of the lots. Lots that touch differ: never the same wall, nor the same kind with the
// same number of floors and roof.
[[nodiscard]] std::vector<Building> plan_buildings(const Block& block, const std::vector<Lot>& lots,
                                                   const BuildingPlan& plan);

// Whether lots of one block share a piece of boundary.
[[nodiscard]] bool adjacent(const Lot& a, const Lot& b);

}  // namespace spillway::tools::city
