#pragma once

// What a light tree knows of a light, or of many: where, how much, and to which sides.

#include <span>

#include "cache/base/vec.h"
#include "shading/light.h"

namespace spillway::pipeline {

// One light, or a subtree that is done. The normals of what is in it lie within `cos_cone` of the axis.
struct LightItem {
  Bounds3 box;
  Float3 axis{0, 0, 1};  // unit
  float cos_cone = 1;    // -1: all sides
  float energy = 0;      // power / pi: what shines along a normal, for a triangle that emits to one side
  uint32_t two_sided = 0;
  uint32_t child = 0;  // shading::light_child
};

// The energy of one triangle or light that has a place may be zero; not finite is an error of the caller's.
[[nodiscard]] LightItem emitter_item(const shading::TriangleShape& shape, const shading::Emission& emission,
                                     uint32_t index);
[[nodiscard]] LightItem light_item(const shading::Light& light, uint32_t index, float of_image = 1);

// cos(a + b) of two angles given by their cosines; -1 beyond a half turn.
[[nodiscard]] double cosine_of_sum(double cos_a, double cos_b);

// The smallest box, the sum of energies, and a cone that holds all cones; child is left to the caller.
[[nodiscard]] LightItem bounds_of(std::span<const LightItem> items);

// Energy-weighed squares of normals, from which follows how a transform that shears stretches their areas.
struct NormalMoments {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, energy = 0;
  void add(const LightItem& item);
};

// The bounds of an object's lights where an instance puts them: the box and the cone hold what they must, the energy is
// exact for transforms that keep angles and never too small (Cauchy and Schwarz) for others.
[[nodiscard]] LightItem instance_item(const LightItem& object, const NormalMoments& moments,
                                      const Affine3& world_from_object, uint32_t instance);

}  // namespace spillway::pipeline
