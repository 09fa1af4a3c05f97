#pragma once

// Points of the city in double precision, and places with a heading.

#include <cmath>

#include "cache/base/vec.h"
#include "tools/city/polygon.h"

namespace spillway::tools::city {

struct Vec3 {
  double x = 0, y = 0, z = 0;
};
inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(Vec3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline Vec3 normalize(Vec3 a) { return a * (1 / std::sqrt(dot(a, a))); }

// A place and a heading.
struct Frame {
  Vec3 origin;
  Vec2 x_axis{1, 0};

  [[nodiscard]] Vec3 world(Vec3 local) const {
    const Vec2 flat = x_axis * local.x + left_of(x_axis) * local.y;
    return {origin.x + flat.x, origin.y + flat.y, origin.z + local.z};
  }
  [[nodiscard]] Float3 point(Vec3 local) const {
    const Vec3 p = world(local);
    return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
  }
  // The same heading elsewhere.
  [[nodiscard]] Frame at(Vec3 local) const { return {world(local), x_axis}; }
  [[nodiscard]] Frame turned(double angle_rad) const {
    const Vec2 d = direction_of(angle_rad);
    return {origin, x_axis * d.x + left_of(x_axis) * d.y};
  }
};

}  // namespace spillway::tools::city
