#pragma once

// What stands in the water: piers with sheds, and a suspension bridge to an island.

#include "tools/city/geometry.h"
#include "tools/city/terrain.h"

namespace spillway::tools::city {

// Piers number part, part + parts, ... along the quay; the bridge belongs to the first part.
void waterfront(Geometry& g, const Terrain& terrain, uint64_t seed, TimeOfDay time, int part, int parts);

}  // namespace spillway::tools::city
