#pragma once

// Buildings as triangles: masses, facades, roofs and what stands on them.

#include "tools/city/buildings.h"
#include "tools/city/geometry.h"
#include "tools/city/terrain.h"

namespace spillway::tools::city {

struct BuildOptions {
  TimeOfDay time = TimeOfDay::day;
  double detail = 2;  // 0..6: how far windows and roofs are worked out, on average; see facade.h
};

struct Ground {
  double floor_z = 0;  // of the ground floor
  double foot_z = 0;   // where the foundation ends, below the lowest ground
};

[[nodiscard]] Ground ground_of(const Building& building, const Terrain& terrain);

void build(Geometry& g, const Building& building, const Ground& ground, const BuildOptions& options);

}  // namespace spillway::tools::city
