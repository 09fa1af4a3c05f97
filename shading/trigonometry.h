#pragma once

// Sine, cosine and arc tangent of our own, so that their bits do not change with the C library.

#include <algorithm>
#include <cmath>

#include "cache/base/vec.h"

namespace spillway::shading {

inline constexpr float kPi = 3.14159265358979f;

struct SinCos {
  float sin, cos;
};

// x in [-pi/4, pi/4]: Taylor polynomials to x^9 and x^8, absolute error below 2e-8 there.
inline SinCos small_sin_cos(float x) {
  const float s = x * x;
  const float sine = x * (1 + s * (-1.0f / 6 + s * (1.0f / 120 + s * (-1.0f / 5040 + s * (1.0f / 362880)))));
  const float cosine = 1 + s * (-0.5f + s * (1.0f / 24 + s * (-1.0f / 720 + s * (1.0f / 40320))));
  return {sine, cosine};
}

// Sine and cosine of 2 pi u, u in [0, 1].
inline SinCos sin_cos_turn(float u) {
  const float eighths = u * 4 + 0.5f;
  const int quadrant = static_cast<int>(eighths);
  const SinCos r = small_sin_cos((u * 4 - static_cast<float>(quadrant)) * (kPi / 2));
  switch (quadrant & 3) {
    case 0: return r;
    case 1: return {r.cos, -r.sin};
    case 2: return {-r.sin, -r.cos};
    default: return {-r.cos, r.sin};
  }
}

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
