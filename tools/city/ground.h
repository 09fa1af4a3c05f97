#pragma once

// Streets, kerbs, pavements, lawns, markings; the land around the city; the sea's surface.

#include "tools/city/buildings.h"
#include "tools/city/geometry.h"
#include "tools/city/terrain.h"

namespace spillway::tools::city {

inline constexpr double kKerbHeight_m = 0.15;

// A polygon of the plan laid on the ground, `above` metres over it; cut finely where the ground is not flat.
void lay(Geometry& g, Surface surface, const Polygon& polygon, const Terrain& terrain, double above_m);

void block_ground(Geometry& g, const Block& block, const std::vector<Lot>& lots, const Terrain& terrain);

// The ground under and around the city, in `parts` strips of which this is one. A little below the streets.
void land(Geometry& g, const Terrain& terrain, uint64_t seed, int part, int parts);

inline constexpr double kSeaTile_m = 400;
// One square of waves about the origin, whose edges fit each other; smooth normals.
void sea_tile(Geometry& g);
// Where squares of sea lie.
[[nodiscard]] std::vector<Vec2> sea_places(const Terrain& terrain);
// A boat's place and heading.
[[nodiscard]] std::vector<Frame> boat_places(const Terrain& terrain, uint64_t seed);

}  // namespace spillway::tools::city
