#pragma once

// Sine and cosine of our own, so that their bits do not change with the C library.

namespace spillway {

inline constexpr float kPi = 3.14159265358979f;

template <class F>
struct SinCosOf {
  F sin, cos;
};
using SinCos = SinCosOf<float>;

// x in [-pi/4, pi/4]: Taylor polynomials to x^9 and x^8, absolute error below 2e-8 there. Of one number or of several
// side by side.
template <class F>
SinCosOf<F> small_sin_cos(F x) {
  const F s = x * x;
  const F sine = x * (1.0f + s * (-1.0f / 6 + s * (1.0f / 120 + s * (-1.0f / 5040 + s * (1.0f / 362880)))));
  const F cosine = 1.0f + s * (-0.5f + s * (1.0f / 24 + s * (-1.0f / 720 + s * (1.0f / 40320))));
  return {sine, cosine};
}

// Sine and cosine of 2 pi u, u in [0, 1].
inline SinCos sin_cos_turn(float u) {
  const float eighths = u * 4 + 0.5f;
  const int quadrant = static_cast<int>(eighths);
  const SinCos r = small_sin_cos((u * 4 - static_cast<float>(quadrant)) * (kPi / 2));
  switch (quadrant & 3) {
    case 0:
      return r;
    case 1:
      return {r.cos, -r.sin};
    case 2:
      return {-r.sin, -r.cos};
    default:
      return {-r.cos, r.sin};
  }
}

}  // namespace spillway
