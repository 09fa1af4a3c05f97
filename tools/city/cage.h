#pragma once

// Catmull-Clark cages of four-cornered faces: what is round in the city.

#include <vector>

#include "pipeline/pack/scene_sink.h"
#include "tools/city/geometry.h"

namespace spillway::tools::city {

// Rings of as many points each, one above the other, joined by faces. The points of a ring go counterclockwise seen
// from the end of the stack. Where an end is closed its ring is covered by faces around a middle; rings there have even
// counts.
struct RingStack {
  std::vector<std::vector<Vec3>> rings;
  bool closed_low = false, closed_high = false;
  double low_bulge = 0, high_bulge = 0;  // of the middles, out of their rings, along the stack
};
[[nodiscard]] Cage ring_cage(Surface surface, const Frame& frame, const RingStack& stack);

// Creases along a ring, and along a column of points; sharpness 10 stays sharp.
void crease_ring(Cage& cage, const RingStack& stack, size_t ring, float sharpness);
void crease_column(Cage& cage, const RingStack& stack, size_t point, size_t first_ring, size_t last_ring,
                   float sharpness);

[[nodiscard]] std::vector<Vec3> circle_ring(size_t points, double radius, double z);

// An onion or half sphere on a circle; ribs are creases from its foot to its top.
void dome_cage(Geometry& g, Surface surface, const Frame& frame, double radius, double z, double height, bool ribs);

// What dicing at a fixed rate makes of a cage: with normals.
Result<SurfaceMesh> tessellated(const Cage& cage, uint32_t pieces);

}  // namespace spillway::tools::city
