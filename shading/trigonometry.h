#pragma once

// Sine, cosine (cache/base/trigonometry.h) and arc tangent of our own, so that their bits do not change with the C library.

#include <algorithm>
#include <cmath>

#include "cache/base/trigonometry.h"
#include "cache/base/vec.h"
#include "shading/lanes.h"

namespace spillway::shading {

using spillway::kPi;
using spillway::SinCos;
using spillway::SinCosOf;
using spillway::small_sin_cos;

// The angle in [0, pi/4] whose tangent is y / x, for 0 <= y <= x, x > 0: halved twice, then Taylor's series to the 11th
// power, which is off by less than 1e-10.
template <class D>
D atan_of_quotient(D y, D x) {
  D t = y / x;
  for (int i = 0; i < 2; ++i) t = t / (1.0 + root(1.0 + t * t));
  const D s = t * t;
  return 4.0 * t * (1.0 + s * (-1.0 / 3 + s * (1.0 / 5 + s * (-1.0 / 7 + s * (1.0 / 9 - s * (1.0 / 11))))));
}
inline float atan_of_ratio(float y, float x) { return static_cast<float>(atan_of_quotient<double>(y, x)); }
inline Float8 atan_of_ratio(Float8 y, Float8 x) {
  const __m128 low = _mm256_cvtpd_ps(atan_of_quotient<Double4>(_mm256_cvtps_pd(_mm256_castps256_ps128(y)),
                                                               _mm256_cvtps_pd(_mm256_castps256_ps128(x))));
  const __m128 high = _mm256_cvtpd_ps(atan_of_quotient<Double4>(_mm256_cvtps_pd(_mm256_extractf128_ps(y, 1)),
                                                                _mm256_cvtps_pd(_mm256_extractf128_ps(x, 1))));
  return _mm256_set_m128(high, low);
}

using spillway::sin_cos_turn;
inline SinCosOf<Float8> sin_cos_turn(Float8 u) {
  const Int8 quadrant = __builtin_convertvector(u * 4.0f + 0.5f, Int8);
  const SinCosOf<Float8> r = small_sin_cos((u * 4.0f - __builtin_convertvector(quadrant, Float8)) * (kPi / 2));
  const Float8 sine = (quadrant & 1) != 0 ? r.cos : r.sin, cosine = (quadrant & 1) != 0 ? r.sin : r.cos;
  return {(quadrant & 2) != 0 ? -sine : sine, ((quadrant + 1) & 2) != 0 ? -cosine : cosine};
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
