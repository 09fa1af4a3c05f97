#pragma once

// Boats in the bay: hulls are cages.

#include "tools/city/geometry.h"

namespace spillway::tools::city {

enum class BoatKind : uint8_t { sailboat, trawler, ferry, count };

// About the origin on the water, bow along x.
void boat(Geometry& g, BoatKind kind, TimeOfDay time);

}  // namespace spillway::tools::city
