#pragma once

// Boxes, prisms, cones, roofs and beams. All in the frame given; outsides face outwards.

#include "tools/city/geometry.h"

namespace spillway::tools::city {

enum BoxFace : unsigned {
  kFront = 1,  // y low
  kBack = 2,   // y high
  kLeft = 4,   // x low
  kRight = 8,  // x high
  kTop = 16,
  kBottom = 32,
  kSides = kFront | kBack | kLeft | kRight,
  kStanding = kSides | kTop,
  kAllFaces = 63
};
void box(Geometry& g, Surface surface, const Frame& frame, Vec3 low, Vec3 high, unsigned faces = kStanding);

// The plan's polygon upright between two heights, and flat at one. In the world.
void prism_sides(Geometry& g, Surface surface, const Polygon& polygon, double z0, double z1);
void cap(Geometry& g, Surface surface, const Polygon& polygon, double z);

// About the frame's z axis, radius r0 at z0 and r1 at z1; a radius of 0 is a tip.
void cone(Geometry& g, Surface surface, const Frame& frame, int sides, double r0, double z0, double r1, double z1);
void disk(Geometry& g, Surface surface, const Frame& frame, int sides, double radius, double z);
void octahedron(Geometry& g, Surface surface, const Frame& frame, double radius, double half_height);

// A bar of square section between two points.
void beam(Geometry& g, Surface surface, const Frame& frame, Vec3 from, Vec3 to, double thickness);

// Over the rectangle [0, width] x [0, depth] at z, ridge along x; eaves stand out by `eaves`. Gables are of `wall`.
void gable_roof(Geometry& g, Surface roof, Surface wall, const Frame& frame, double width, double depth, double z,
                double rise, double eaves);
void hip_roof(Geometry& g, Surface roof, const Frame& frame, double width, double depth, double z, double rise,
              double eaves);

}  // namespace spillway::tools::city
