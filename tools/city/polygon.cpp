#include "tools/city/polygon.h"

#include <algorithm>
#include <limits>

namespace spillway::tools::city {
namespace {

constexpr double kSamePoint_m = 1e-6;

// Corners that coincide with their successor carry no edge.
void drop_short_edges(Polygon& polygon) {
  Polygon kept;
  for (size_t i = 0; i < polygon.size(); ++i)
    if (length(next_corner(polygon, i).at - polygon[i].at) > kSamePoint_m) kept.push_back(polygon[i]);
  polygon = kept.size() < 3 ? Polygon{} : std::move(kept);
}

double distance_to_segment(Vec2 a, Vec2 b, Vec2 point) {
  const Vec2 along = b - a;
  const double t = std::clamp(dot(point - a, along) / std::max(dot(along, along), 1e-30), 0.0, 1.0);
  return length(point - (a + along * t));
}

// Whether an edge of a has all of b to its right.
bool separates(const Polygon& a, const Polygon& b) {
  for (size_t i = 0; i < a.size(); ++i) {
    const Vec2 origin = a[i].at, along = next_corner(a, i).at - origin;
    if (std::all_of(b.begin(), b.end(), [&](const Corner& c) { return cross(along, c.at - origin) <= 0; })) return true;
  }
  return false;
}

}  // namespace

double area(const Polygon& polygon) {
  double twice = 0;
  for (size_t i = 0; i < polygon.size(); ++i) twice += cross(polygon[i].at, next_corner(polygon, i).at);
  return twice / 2;
}

Vec2 centroid(const Polygon& polygon) {
  Vec2 sum;
  double twice = 0;
  const Vec2 origin = polygon[0].at;
  for (size_t i = 1; i + 1 < polygon.size(); ++i) {
    const Vec2 a = polygon[i].at - origin, b = polygon[i + 1].at - origin;
    sum = sum + (a + b) * cross(a, b), twice += cross(a, b);
  }
  return twice > 0 ? origin + sum * (1 / (3 * twice)) : origin;
}

Interval extent(const Polygon& polygon, Vec2 axis) {
  Interval interval{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (const Corner& c : polygon) {
    interval.low = std::min(interval.low, dot(c.at, axis));
    interval.high = std::max(interval.high, dot(c.at, axis));
  }
  return interval;
}

Polygon rectangle(Vec2 origin, Vec2 along, double width, double depth) {
  const Vec2 x = along * width, y = left_of(along) * depth;
  return {{origin}, {origin + x}, {origin + x + y}, {origin + y}};
}

Polygon left_part(const Polygon& polygon, const Line& line, double street) {
  Polygon part;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Corner& a = polygon[i];
    const Corner& b = next_corner(polygon, i);
    const double sa = cross(line.direction, a.at - line.point), sb = cross(line.direction, b.at - line.point);
    if (sa >= 0) part.push_back(a);
    if ((sa < 0) == (sb < 0)) continue;
    const Vec2 at = a.at + (b.at - a.at) * (sa / (sa - sb));
    // Leaving the left side the cut begins; entering it the polygon's own edge goes on.
    part.push_back({at, sa >= 0 ? street : a.street});
  }
  drop_short_edges(part);
  return part;
}

Polygon right_part(const Polygon& polygon, const Line& line, double street) {
  return left_part(polygon, {line.point, line.direction * -1}, street);
}

Polygon inset_by(const Polygon& polygon, double distance) {
  return inset(polygon, [distance](const Corner&) { return distance; });
}

Polygon chamfered(const Polygon& polygon, double size) {
  Polygon cut;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec2 a = polygon[i].at, along = next_corner(polygon, i).at - a;
    const double step = std::min(size / length(along), 0.3);
    cut.push_back({a + along * step, polygon[i].street});
    cut.push_back({a + along * (1 - step), polygon[i].street});
  }
  return cut;
}

bool contains(const Polygon& polygon, Vec2 point) {
  for (size_t i = 0; i < polygon.size(); ++i)
    if (cross(next_corner(polygon, i).at - polygon[i].at, point - polygon[i].at) < 0) return false;
  return !polygon.empty();
}

bool intersect(const Polygon& a, const Polygon& b) { return !separates(a, b) && !separates(b, a); }

double distance_to_boundary(const Polygon& polygon, Vec2 point) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < polygon.size(); ++i)
    least = std::min(least, distance_to_segment(polygon[i].at, next_corner(polygon, i).at, point));
  return least;
}

double distance_between(const Polygon& a, const Polygon& b) {
  double least = std::numeric_limits<double>::infinity();
  for (const Corner& c : a) least = std::min(least, distance_to_boundary(b, c.at));
  for (const Corner& c : b) least = std::min(least, distance_to_boundary(a, c.at));
  return least;
}

size_t longest_edge(const Polygon& polygon) {
  size_t best = 0;
  double longest = -1;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const double edge = length(next_corner(polygon, i).at - polygon[i].at);
    if (edge > longest) longest = edge, best = i;
  }
  return best;
}

}  // namespace spillway::tools::city
