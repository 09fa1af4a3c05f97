#include "shading/sample_triangle.h"

#include <algorithm>
#include <cmath>

#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

// Seen from further than this many times its longest edge, a triangle is sampled by area.
constexpr float kFarInEdges = 8;
// Smaller ones (slivers, nearly edge-on) have too few bits left in 32-bit directions.
constexpr float kSmallestSolidAngle = 1e-6f;

// The corners as unit directions, and what the solid angle follows from (Van Oosterom and Strackee 1983).
struct SphericalTriangle {
  Float3 v[3];
  float volume;       // |det(v0, v1, v2)|
  float along;        // v0 . v2 + v1 . v2
  float beside;       // 1 + v0 . v1
  float solid_angle;  // 0: sampled by area
};

// In [0, pi], of a point in the upper half plane.
float angle_of(float y, float x) {
  const float size = std::fabs(x);
  const float eighth = y <= size ? atan_of_ratio(y, size) : kPi / 2 - atan_of_ratio(size, y);
  return x < 0 ? kPi - eighth : eighth;
}

SphericalTriangle spherical(const TriangleShape& t, Float3 receiver) {
  SphericalTriangle s{};
  const Float3 corner[3] = {t.position - receiver, (t.position + t.edge1) - receiver,
                            (t.position + t.edge2) - receiver};
  float nearest = INFINITY, product = 1;
  for (int i = 0; i < 3; ++i) {
    const float squared = length_squared(corner[i]);
    nearest = std::min(nearest, squared);
    const float size = std::sqrt(squared);
    product *= size;
    s.v[i] = corner[i] * (1 / size);
  }
  const float longest = std::max({length_squared(t.edge1), length_squared(t.edge2), length_squared(t.edge2 - t.edge1)});
  if (!(nearest > 0) || nearest > kFarInEdges * kFarInEdges * longest) return s;
  // From the edges, not from the directions, whose difference has fewer bits.
  s.volume = std::fabs(dot(corner[0], cross(t.edge1, t.edge2))) / product;
  s.along = dot(s.v[0], s.v[2]) + dot(s.v[1], s.v[2]);
  s.beside = 1 + dot(s.v[0], s.v[1]);
  if (!(s.volume > 0) || !std::isfinite(s.volume)) return s;
  const float solid_angle = 2 * angle_of(s.volume, s.along + s.beside);
  s.solid_angle = solid_angle >= kSmallestSolidAngle ? solid_angle : 0;
  return s;
}

// A direction evenly distributed over the spherical triangle: u.x cuts a part of its area off at the edge v1 v2, u.y
// goes along the arc from v1 to the cut.
Float3 direction_in(const SphericalTriangle& s, Float2 u) {
  const SinCos half = sin_cos_turn(u.x * s.solid_angle * (0.25f / kPi));
  const Float3 bisector = s.v[0] * (s.volume * half.cos - s.along * half.sin) + s.v[2] * (s.beside * half.sin);
  const Float3 cut = bisector * (2 * dot(s.v[0], bisector) / length_squared(bisector)) - s.v[0];
  const float q = 0.5f * length_squared(cut - s.v[1]);  // 1 - cosine of the arc, without cancellation
  const float part = u.y * q;
  const float along = std::sqrt(std::max(0.0f, u.y * (2 - part) / (2 - q)));
  return s.v[1] * ((1 - part) - along * (1 - q)) + cut * along;
}

// Where the ray meets the triangle's plane, held within the triangle.
Float3 point_along(const TriangleShape& t, Float3 receiver, Float3 w) {
  const Float3 p = cross(w, t.edge2);
  const float determinant = dot(t.edge1, p);
  const Float3 from_corner = receiver - t.position;
  float b1 = dot(from_corner, p) / determinant, b2 = dot(w, cross(from_corner, t.edge1)) / determinant;
  b1 = b1 > 0 ? std::min(b1, 1.0f) : 0;  // also of a quotient that is no number
  b2 = b2 > 0 ? std::min(b2, 1 - b1) : 0;
  return t.position + t.edge1 * b1 + t.edge2 * b2;
}

// Uniform on the triangle without a fold.
Float3 point_by_area(const TriangleShape& t, Float2 u) {
  float b1 = u.x * 0.5f, b2 = u.y * 0.5f;
  const float offset = b2 - b1;
  if (offset > 0)
    b2 += offset;
  else
    b1 -= offset;
  return t.position + t.edge1 * b1 + t.edge2 * b2;
}

float area_pdf(const TriangleShape& t, Float3 receiver, Float3 point) {
  const Float3 n = cross(t.edge1, t.edge2);
  const Float3 to_light = point - receiver;
  const float squared = length_squared(to_light);
  const float cosine_times = std::fabs(dot(n, to_light));  // cos * double_area * distance
  if (!(cosine_times > 0)) return 0;
  // distance^2 / (area cos): the length of n, twice the area, cancels against the cosine's.
  return 2 * squared * std::sqrt(squared) / cosine_times;
}

}  // namespace

TrianglePoint sample_triangle(const TriangleShape& triangle, Float3 receiver, Float2 u) {
  const SphericalTriangle s = spherical(triangle, receiver);
  if (s.solid_angle > 0) return {point_along(triangle, receiver, direction_in(s, u)), 1 / s.solid_angle};
  return sample_triangle_by_area(triangle, receiver, u);
}

TrianglePoint sample_triangle_by_area(const TriangleShape& triangle, Float3 receiver, Float2 u) {
  const Float3 point = point_by_area(triangle, u);
  return {point, area_pdf(triangle, receiver, point)};
}

float triangle_pdf_by_area(const TriangleShape& triangle, Float3 receiver, Float3 point) {
  return area_pdf(triangle, receiver, point);
}

float triangle_pdf_solid_angle(const TriangleShape& triangle, Float3 receiver, Float3 point) {
  const float solid_angle = sampled_solid_angle(triangle, receiver);
  return solid_angle > 0 ? 1 / solid_angle : area_pdf(triangle, receiver, point);
}

float sampled_solid_angle(const TriangleShape& triangle, Float3 receiver) {
  return spherical(triangle, receiver).solid_angle;
}

}  // namespace spillway::shading
