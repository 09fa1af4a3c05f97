#pragma once

// Convex polygons of the plan: cells, blocks, lots, footprints. Counter-clockwise, in metres, double precision.

#include <cmath>
#include <vector>

namespace spillway::tools::city {

struct Vec2 {
  double x = 0, y = 0;
};
inline Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
inline Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
inline Vec2 operator*(Vec2 a, double s) { return {a.x * s, a.y * s}; }
inline double dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }
inline double cross(Vec2 a, Vec2 b) { return a.x * b.y - a.y * b.x; }
inline double length(Vec2 a) { return std::hypot(a.x, a.y); }
inline Vec2 normalize(Vec2 a) { return a * (1 / length(a)); }
inline Vec2 left_of(Vec2 a) { return {-a.y, a.x}; }
inline Vec2 direction_of(double angle_rad) { return {std::cos(angle_rad), std::sin(angle_rad)}; }

// A corner, and the edge from it to the next one: half the width of the street along that edge; 0 where there is none.
struct Corner {
  Vec2 at;
  double street = 0;
};
using Polygon = std::vector<Corner>;

struct Line {
  Vec2 point, direction;
};

struct Interval {
  double low, high;
  [[nodiscard]] double size() const { return high - low; }
  [[nodiscard]] double middle() const { return (low + high) / 2; }
};

[[nodiscard]] double area(const Polygon& polygon);
[[nodiscard]] Vec2 centroid(const Polygon& polygon);
[[nodiscard]] Interval extent(const Polygon& polygon, Vec2 axis);
[[nodiscard]] Polygon rectangle(Vec2 origin, Vec2 along, double width, double depth);  // depth to the left of `along`

// What lies to the left of the line; the edge along the cut gets `street`. Empty when nothing is left.
[[nodiscard]] Polygon left_part(const Polygon& polygon, const Line& line, double street);
[[nodiscard]] Polygon right_part(const Polygon& polygon, const Line& line, double street);
// Each edge moved inwards by distance(corner). Edges keep their streets.
template <class Distance>
[[nodiscard]] Polygon inset(const Polygon& polygon, const Distance& distance);
[[nodiscard]] Polygon inset_by(const Polygon& polygon, double distance);
// Corners cut off at `size` along each edge, so far as edges are long enough.
[[nodiscard]] Polygon chamfered(const Polygon& polygon, double size);

[[nodiscard]] bool contains(const Polygon& polygon, Vec2 point);
// Whether the insides meet: no edge of either separates them (separating axes; exact for convex polygons up to
// rounding).
[[nodiscard]] bool intersect(const Polygon& a, const Polygon& b);
[[nodiscard]] double distance_to_boundary(const Polygon& polygon, Vec2 point);
// Smallest distance between the boundaries of two polygons that do not intersect.
[[nodiscard]] double distance_between(const Polygon& a, const Polygon& b);
[[nodiscard]] size_t longest_edge(const Polygon& polygon);

inline const Corner& next_corner(const Polygon& polygon, size_t i) {
  return polygon[i + 1 == polygon.size() ? 0 : i + 1];
}

template <class Distance>
Polygon inset(const Polygon& polygon, const Distance& distance) {
  Polygon rest = polygon;
  for (size_t i = 0; i < polygon.size() && !rest.empty(); ++i) {
    const Vec2 a = polygon[i].at, along = next_corner(polygon, i).at - a;
    if (length(along) < 1e-9) continue;
    const Vec2 unit = normalize(along);
    rest = left_part(rest, {a + left_of(unit) * distance(polygon[i]), unit}, polygon[i].street);
  }
  return rest;
}

}  // namespace spillway::tools::city
