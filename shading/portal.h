#pragma once

// A rectangle that an infinite light is seen through, and not beside (pbrt's "portal" of infinite lights).

#include <cstdint>

#include "cache/base/vec.h"

namespace spillway::shading {

// Light comes through against cross(edge1, edge2): directions along it look out.
struct Portal {
  Float3 corner, edge1, edge2;  // the edges are perpendicular
  uint32_t light;               // which of the infinite lights, in their order
};
static_assert(sizeof(Portal) == 40);

// Whether a ray from there looks out through it; w is unit.
[[nodiscard]] bool looks_through(const Portal& portal, Float3 from_world, Float3 w_world);
// Towards a point of it, uniform over its area; unit.
[[nodiscard]] Float3 sample_portal(const Portal& portal, Float3 from_world, Float2 u);
// Density of that over solid angle; 0 beside it.
[[nodiscard]] float portal_pdf_solid_angle(const Portal& portal, Float3 from_world, Float3 w_world);

}  // namespace spillway::shading
