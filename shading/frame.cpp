#include "shading/frame.h"

#include "shading/trigonometry.h"

#include <algorithm>
#include <cmath>

namespace spillway::shading {

Frame frame_from_z(Float3 z) {
  const float sign = std::copysign(1.0f, z.z);
  const float a = -1 / (sign + z.z);
  const float b = z.x * z.y * a;
  return {{1 + sign * z.x * z.x * a, sign * b, -sign * z.x}, {b, sign + z.y * z.y * a, -z.y}, z};
}

Frame frame_from_z_and_tangent(Float3 z, Float3 tangent) {
  const Float3 projected = tangent - z * dot(z, tangent);
  const float squared = length_squared(projected);
  // A tangent nearly along z has no direction of its own.
  if (!(squared > 1e-12f * length_squared(tangent)) || !std::isfinite(squared)) return frame_from_z(z);
  const Float3 x = projected * (1 / std::sqrt(squared));
  return {x, cross(z, x), z};
}

Float3 ray_origin(Float3 p, Float3 normal_geometric, Float3 direction, float distance) {
  return p + normal_geometric * (dot(normal_geometric, direction) < 0 ? -distance : distance);
}

Float3 uniform_direction(Float2 u) {
  const float z = 1 - 2 * u.x;
  const float r = std::sqrt(std::max(0.0f, 1 - z * z));
  const SinCos phi = sin_cos_turn(u.y);
  return {r * phi.cos, r * phi.sin, z};
}

bool mirrors(const Affine3& transform) {
  const auto& m = transform.m;
  return dot(cross({m[0][0], m[0][1], m[0][2]}, {m[1][0], m[1][1], m[1][2]}), {m[2][0], m[2][1], m[2][2]}) < 0;
}

}  // namespace spillway::shading
