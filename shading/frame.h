#pragma once

// Orthonormal frames (Duff et al. 2017, Building an Orthonormal Basis, Revisited), robust ray origins, and handedness.

#include "cache/base/vec.h"

namespace spillway::shading {

struct Frame {
  Float3 x, y, z;
  [[nodiscard]] Float3 local_from_world(Float3 w) const { return {dot(w, x), dot(w, y), dot(w, z)}; }
  [[nodiscard]] Float3 world_from_local(Float3 w) const { return x * w.x + y * w.y + z * w.z; }
};

// z must be unit.
[[nodiscard]] Frame frame_from_z(Float3 z);
// As above with x along the projection of `tangent` when that is not degenerate.
[[nodiscard]] Frame frame_from_z_and_tangent(Float3 z, Float3 tangent);

// The origin of a ray that leaves the surface at p on the side of `direction`: p moved along the geometric normal by
// `distance`, what p and the surface may be apart by rounding.
[[nodiscard]] Float3 ray_origin(Float3 p, Float3 normal_geometric, Float3 direction, float distance);

// Evenly over all directions; z falls with u.x.
[[nodiscard]] Float3 uniform_direction(Float2 u);

// Whether a transform turns right hands into left ones.
[[nodiscard]] bool mirrors(const Affine3& transform);

}  // namespace spillway::shading
