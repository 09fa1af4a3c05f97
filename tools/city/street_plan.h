#pragma once

// The streets: arterials cut the land into quarters, each quarter has a grid of its own, turned as one of its
// arterials, with through streets, missing pieces, and whatever shape is left at its border. A diagonal avenue crosses
// downtown.
//
// A block's cell reaches to the middle of the streets around it, so that cells cover the land without gap or overlap.

#include <cstdint>
#include <vector>

#include "tools/city/polygon.h"
#include "tools/city/terrain.h"

namespace spillway::tools::city {

enum class District : uint8_t { downtown, midtown, old_town, rowhouses, suburb, hillside, industry, harbour, count };
[[nodiscard]] const char* name(District district);

enum class BlockUse : uint8_t { built, park, plaza };

struct Block {
  uint64_t key = 0;
  Polygon cell;  // to the middle of the streets
  Polygon kerb;  // where the pavement begins; inside of the cell, corners cut. Empty: no pavement
  District district = District::suburb;
  BlockUse use = BlockUse::built;
  Vec2 grid_axis{1, 0};   // along the quarter's streets
  double remoteness = 0;  // what is nearest to the centre is built first
};

inline constexpr double kPavement_m = 3.0;  // from the kerb to the lots

struct StreetPlanOptions {
  uint64_t seed = 0;
  double radius_m = 1000;
};

// Blocks by ascending remoteness; all on land.
[[nodiscard]] std::vector<Block> street_plan(const StreetPlanOptions& options, const Terrain& terrain);

// Parts of the city's radius from the centre, bent by noise so that districts do not end in circles.
[[nodiscard]] double centrality_radius(const StreetPlanOptions& options, Vec2 at);

}  // namespace spillway::tools::city
