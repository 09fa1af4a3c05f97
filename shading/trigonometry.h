#pragma once

// Sine, cosine (cache/base/trigonometry.h) and arc tangent of our own, so that their bits do not change with the C library.

#include <algorithm>
#include <cmath>

#include "cache/base/trigonometry.h"
#include "cache/base/vec.h"

namespace spillway::shading {

using spillway::kPi;
using spillway::SinCos;
using spillway::sin_cos_turn;
using spillway::small_sin_cos;

// The angle in [0, pi/4] whose tangent is y / x, for 0 <= y <= x, x > 0: halved twice, then Taylor's series to the 11th
// power, which is off by less than 1e-10.
inline float atan_of_ratio(float y, float x) {
  double t = static_cast<double>(y) / x;
  for (int i = 0; i < 2; ++i) t = t / (1 + std::sqrt(1 + t * t));
  const double s = t * t;
  return static_cast<float>(4 * t * (1 + s * (-1.0 / 3 + s * (1.0 / 5 + s * (-1.0 / 7 + s * (1.0 / 9 - s * (1.0 / 11)))))));
}

// The angle of (x, y) from the x axis towards y, in turns, [0, 1]; 0 at the origin.
inline float turn_of(float y, float x) {
  const float ax = std::fabs(x), ay = std::fabs(y), larger = std::max(ax, ay);
  if (!(larger > 0) || !std::isfinite(larger)) return 0;
  float turn = atan_of_ratio(std::min(ax, ay), larger) / (2 * kPi);
  if (ay > ax) turn = 0.25f - turn;
  if (x < 0) turn = 0.5f - turn;
  return y < 0 ? 1 - turn : turn;
}

// Maps the unit square to the unit disk, preserving area and neighbourhood (Shirley and Chiu 1997).
inline Float2 concentric_disk(Float2 u) {
  const float x = 2 * u.x - 1, y = 2 * u.y - 1;
  if (x == 0 && y == 0) return {0, 0};
  if (std::fabs(x) > std::fabs(y)) {
    const SinCos r = small_sin_cos(kPi / 4 * (y / x));
    return {x * r.cos, x * r.sin};
  }
  const SinCos r = small_sin_cos(kPi / 4 * (x / y));
  return {y * r.sin, y * r.cos};
}

}  // namespace spillway::shading
