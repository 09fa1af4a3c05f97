// Where a hit is on its face: the inverse of the bilinear patch.

#include <algorithm>
#include <cmath>

#include "cache/base/clamp_unit.h"
#include "pipeline/render/shade_path.h"

namespace spillway::pipeline {
namespace {

// Keeps level choices apart from alpha and mix decisions.
constexpr uint32_t kLevelDecision = 0xfffffffeu;

float cross2(Float2 a, Float2 b) { return a.x * b.y - a.y * b.x; }

// (u, v) of the patch over corners q at p: v solves a quadratic, u follows (Quilez 2010, "inverse bilinear
// interpolation"). Of its two roots the one at which
// the patch turns as the quad does.
Float2 inverse_bilinear(const Float2 q[4], Float2 p) {
  const Float2 e = q[1] - q[0], f = q[3] - q[0], g = q[0] - q[1] + q[2] - q[3], h = p - q[0];
  const float k2 = cross2(g, f), k1 = cross2(e, f) + cross2(h, g), k0 = cross2(h, e);
  const float size = std::sqrt(std::max(0.0f, k1 * k1 - 4 * k2 * k0));
  const float root = cross2(q[2] - q[0], q[3] - q[1]) < 0 ? -size : size;
  // The same number twice, without the difference of like ones.
  const float v = clamp_unit(k1 * root < 0 ? (root - k1) / (2 * k2) : -2 * k0 / (k1 + root));
  const Float2 along = e + g * v, rest = h - f * v;
  const float u = std::fabs(along.x) > std::fabs(along.y) ? rest.x / along.x : rest.y / along.y;
  return {clamp_unit(u), v};
}

}  // namespace

FacePoint face_point(const cache::TriangleAttributes& triangle, const HitRecord& hit, const InstanceTransform& instance,
                     float width_world, uint32_t seed) {
  FacePoint point{triangle.face.face, 0, 0, 0, 0, 0};
  Float3 e1 = triangle.position_object[1] - triangle.position_object[0];
  Float3 e2 = triangle.position_object[2] - triangle.position_object[0];
  if (instance.world_from_object != nullptr)
    e1 = instance.world_from_object->vector(e1), e2 = instance.world_from_object->vector(e2);
  // Corners in the plane of the triangle: its own at (0,0), (1,0), (0,1).
  const uint32_t a = triangle.face.corners & 3, b = triangle.face.corners >> 2 & 3, c = triangle.face.corners >> 4 & 3;
  Float2 q[4] = {{0, 0}, {0, 0}, {0, 0}, {0, 0}};
  q[a] = {0, 0}, q[b] = {1, 0}, q[c] = {0, 1};
  Float2 du, dv;
  if (triangle.face.corners & cache::kWholeFace) {
    float weight[4] = {0, 0, 0, 0};
    weight[a] = 1 - hit.hit.u - hit.hit.v, weight[b] = hit.hit.u, weight[c] = hit.hit.v;
    point.u = weight[1], point.v = weight[2];
    du = q[1] - q[0], dv = q[2] - q[0];
  } else {
    q[(6 - a - b - c) & 3] = {triangle.face.fourth[0], triangle.face.fourth[1]};
    const Float2 uv = inverse_bilinear(q, {hit.hit.u, hit.hit.v});
    point.u = uv.x, point.v = uv.y;
    const Float2 g = q[0] - q[1] + q[2] - q[3];
    du = q[1] - q[0] + g * uv.y, dv = q[3] - q[0] + g * uv.x;
  }
  const float length_u = length(e1 * du.x + e2 * du.y), length_v = length(e1 * dv.x + e2 * dv.y);
  point.width_u = length_u > 0 ? width_world / length_u : 0, point.width_v = length_v > 0 ? width_world / length_v : 0;
  point.random = shading::hashed_1d(sample_key(hit.path, seed), shading::SampleStream::decisions, hit.path.bounce, 0,
                                    kLevelDecision);
  return point;
}

}  // namespace spillway::pipeline
