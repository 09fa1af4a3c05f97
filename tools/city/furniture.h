#pragma once

// Where lamps, trees and cars stand: along kerbs, in parks and gardens, beside pavements. Counts are given, places
// follow.

#include <cstdint>
#include <vector>

#include "tools/city/buildings.h"
#include "tools/city/catalogue.h"
#include "tools/city/geometry.h"
#include "tools/city/terrain.h"

namespace spillway::tools::city {

inline constexpr double kLampFromKerb_m = 0.55;

// What a block has room for.
struct Room {
  uint64_t kerb_cm = 0;     // length of its kerb
  uint64_t tree_count = 0;  // trees that stand well apart
  uint64_t car_count = 0;   // places beside the kerb
};
[[nodiscard]] Room room_of(const Block& block, const std::vector<Lot>& lots);

[[nodiscard]] LampKind lamp_kind(District district);
[[nodiscard]] std::vector<Standing> lamps(const Block& block, uint64_t count, const Terrain& terrain);
// Never inside of a footprint.
[[nodiscard]] std::vector<Standing> trees(const Block& block, const std::vector<Lot>& lots,
                                          const std::vector<Building>& buildings, uint64_t count,
                                          const Terrain& terrain);
[[nodiscard]] std::vector<Standing> cars(const Block& block, uint64_t count, const Terrain& terrain);

}  // namespace spillway::tools::city
