#include "shading/sample_triangle.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "shading/lanes.h"
#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

// Seen from further than this many times its longest edge, a triangle is sampled by area.
constexpr float kFarInEdges = 8;
// Smaller ones (slivers, nearly edge-on) have too few bits left in 32-bit directions.
constexpr float kSmallestSolidAngle = 1e-6f;

// What follows is written for one triangle (F is float) and for eight.
template <class F>
struct Shape {
  Vector<F> position, edge1, edge2;
};
template <class F>
struct Sample {
  Vector<F> point;
  F pdf_solid_angle;
};

// The corners as unit directions, and what the solid angle follows from (Van Oosterom and Strackee 1983).
template <class F>
struct SphericalTriangle {
  Vector<F> v[3];
  F volume;       // |det(v0, v1, v2)|
  F along;        // v0 . v2 + v1 . v2
  F beside;       // 1 + v0 . v1
  F solid_angle;  // 0: sampled by area
};

// In [0, pi], of a point in the upper half plane.
template <class F>
F angle_of(F y, F x) {
  const F size = magnitude(x);
  const auto is_flat = y <= size;
  const F part = atan_of_ratio(is_flat ? y : size, is_flat ? size : y);
  const F eighth = is_flat ? part : kPi / 2 - part;
  return x < 0.0f ? kPi - eighth : eighth;
}

template <class F>
SphericalTriangle<F> spherical(const Shape<F>& t, const Vector<F>& receiver) {
  SphericalTriangle<F> s{};
  const Vector<F> corner[3] = {t.position - receiver, (t.position + t.edge1) - receiver,
                               (t.position + t.edge2) - receiver};
  F squared[3];
  for (int i = 0; i < 3; ++i) squared[i] = length_squared(corner[i]);
  const F nearest = lesser(lesser(squared[0], squared[1]), squared[2]);
  const F longest = greater(greater(length_squared(t.edge1), length_squared(t.edge2)), length_squared(t.edge2 - t.edge1));
  const auto is_near = (nearest > 0.0f) & !(nearest > kFarInEdges * kFarInEdges * longest);
  if (!any(is_near)) return s;
  F size[3];
  for (int i = 0; i < 3; ++i) {
    size[i] = root(squared[i]);
    s.v[i] = corner[i] * (1.0f / size[i]);
  }
  // From the edges, not from the directions, whose difference has fewer bits.
  s.volume = magnitude(dot(corner[0], cross(t.edge1, t.edge2))) / (size[0] * size[1] * size[2]);
  s.along = dot(s.v[0], s.v[2]) + dot(s.v[1], s.v[2]);
  s.beside = 1.0f + dot(s.v[0], s.v[1]);
  const F solid_angle = 2.0f * angle_of(s.volume, s.along + s.beside);
  const auto is_large =
      is_near & (s.volume > 0.0f) & is_finite_number(s.volume) & (solid_angle >= kSmallestSolidAngle);
  s.solid_angle = is_large ? solid_angle : F{};
  return s;
}

// A direction evenly distributed over the spherical triangle: u.x cuts a part of its area off at the edge v1 v2, u.y
// goes along the arc from v1 to the cut.
template <class F>
Vector<F> direction_in(const SphericalTriangle<F>& s, F u_x, F u_y) {
  const auto half = sin_cos_turn(u_x * s.solid_angle * (0.25f / kPi));
  const Vector<F> bisector = s.v[0] * (s.volume * half.cos - s.along * half.sin) + s.v[2] * (s.beside * half.sin);
  const Vector<F> cut = bisector * (2.0f * dot(s.v[0], bisector) / length_squared(bisector)) - s.v[0];
  const F q = 0.5f * length_squared(cut - s.v[1]);  // 1 - cosine of the arc, without cancellation
  const F part = u_y * q;
  const F along = root(greater(F{}, u_y * (2.0f - part) / (2.0f - q)));
  return s.v[1] * ((1.0f - part) - along * (1.0f - q)) + cut * along;
}

// Where the ray meets the triangle's plane, held within the triangle.
template <class F>
Vector<F> point_along(const Shape<F>& t, const Vector<F>& receiver, const Vector<F>& w) {
  const Vector<F> p = cross(w, t.edge2);
  const F determinant = dot(t.edge1, p);
  const Vector<F> from_corner = receiver - t.position;
  F b1 = dot(from_corner, p) / determinant, b2 = dot(w, cross(from_corner, t.edge1)) / determinant;
  const F zero{}, one = zero + 1.0f;
  b1 = b1 > 0.0f ? lesser(b1, one) : zero;  // also of a quotient that is no number
  b2 = b2 > 0.0f ? lesser(b2, 1.0f - b1) : zero;
  return t.position + t.edge1 * b1 + t.edge2 * b2;
}

// Uniform on the triangle without a fold.
template <class F>
Vector<F> point_by_area(const Shape<F>& t, F u_x, F u_y) {
  const F b1 = u_x * 0.5f, b2 = u_y * 0.5f, offset = b2 - b1;
  return t.position + t.edge1 * (offset > 0.0f ? b1 : b1 - offset) + t.edge2 * (offset > 0.0f ? b2 + offset : b2);
}

template <class F>
F area_pdf(const Shape<F>& t, const Vector<F>& receiver, const Vector<F>& point) {
  const Vector<F> n = cross(t.edge1, t.edge2);
  const Vector<F> to_light = point - receiver;
  const F squared = length_squared(to_light);
  const F cosine_times = magnitude(dot(n, to_light));  // cos * double_area * distance
  // distance^2 / (area cos): the length of n, twice the area, cancels against the cosine's.
  const F pdf = 2.0f * squared * root(squared) / cosine_times;
  return cosine_times > 0.0f ? pdf : F{};
}

template <class F>
Sample<F> sample_by_area(const Shape<F>& t, const Vector<F>& receiver, F u_x, F u_y) {
  const Vector<F> point = point_by_area(t, u_x, u_y);
  return {point, area_pdf(t, receiver, point)};
}

template <class F, class Mask>
Vector<F> choose(Mask mask, const Vector<F>& a, const Vector<F>& b) {
  return {mask ? a.x : b.x, mask ? a.y : b.y, mask ? a.z : b.z};
}

template <class F>
Sample<F> sample(const Shape<F>& t, const Vector<F>& receiver, F u_x, F u_y) {
  const SphericalTriangle<F> s = spherical(t, receiver);
  const auto by_angle = s.solid_angle > 0.0f;
  if (!any(by_angle)) return sample_by_area(t, receiver, u_x, u_y);
  const Sample<F> in_angle{point_along(t, receiver, direction_in(s, u_x, u_y)), 1.0f / s.solid_angle};
  if (!any(!by_angle)) return in_angle;
  const Sample<F> in_area = sample_by_area(t, receiver, u_x, u_y);
  return {choose<F>(by_angle, in_angle.point, in_area.point),
          by_angle ? in_angle.pdf_solid_angle : in_area.pdf_solid_angle};
}

Shape<float> shape_of(const TriangleShape& t) { return {t.position, t.edge1, t.edge2}; }

// Eight queries or less; the lanes that are left repeat the last.
struct QueryLanes {
  static constexpr size_t kLanes = 8, kNumbers = sizeof(TriangleQuery) / sizeof(float);
  alignas(32) float of[kNumbers][kLanes];

  explicit QueryLanes(std::span<const TriangleQuery> queries) {
    for (size_t lane = 0; lane < kLanes; ++lane) {
      float numbers[kNumbers];
      std::memcpy(numbers, &queries[std::min(lane, queries.size() - 1)], sizeof numbers);
      for (size_t i = 0; i < kNumbers; ++i) of[i][lane] = numbers[i];
    }
  }
  [[nodiscard]] Float8 number(size_t i) const { return _mm256_load_ps(of[i]); }
  [[nodiscard]] Float3x8 vector(size_t i) const { return {number(i), number(i + 1), number(i + 2)}; }
};

}  // namespace

TrianglePoint sample_triangle(const TriangleShape& triangle, Float3 receiver, Float2 u) {
  const Sample<float> s = sample(shape_of(triangle), receiver, u.x, u.y);
  return {s.point, s.pdf_solid_angle};
}

void sample_triangles(std::span<const TriangleQuery> queries, std::span<TrianglePoint> points) {
  for (size_t first = 0; first < queries.size(); first += QueryLanes::kLanes) {
    const size_t count = std::min(QueryLanes::kLanes, queries.size() - first);
    const QueryLanes lanes(queries.subspan(first, count));
    const Sample<Float8> s = sample(Shape<Float8>{lanes.vector(0), lanes.vector(3), lanes.vector(6)}, lanes.vector(9),
                                    lanes.number(12), lanes.number(13));
    for (size_t i = 0; i < count; ++i)
      points[first + i] = {{s.point.x[i], s.point.y[i], s.point.z[i]}, s.pdf_solid_angle[i]};
  }
}

TrianglePoint sample_triangle_by_area(const TriangleShape& triangle, Float3 receiver, Float2 u) {
  const Sample<float> s = sample_by_area(shape_of(triangle), receiver, u.x, u.y);
  return {s.point, s.pdf_solid_angle};
}

float triangle_pdf_by_area(const TriangleShape& triangle, Float3 receiver, Float3 point) {
  return area_pdf<float>(shape_of(triangle), receiver, point);
}

float triangle_pdf_solid_angle(const TriangleShape& triangle, Float3 receiver, Float3 point) {
  const float solid_angle = sampled_solid_angle(triangle, receiver);
  return solid_angle > 0 ? 1 / solid_angle : triangle_pdf_by_area(triangle, receiver, point);
}

float sampled_solid_angle(const TriangleShape& triangle, Float3 receiver) {
  return spherical<float>(shape_of(triangle), receiver).solid_angle;
}

}  // namespace spillway::shading
