#pragma once

// Eight numbers side by side. What is written once for one number and for eight has the same bits for both: every
// operation is rounded by itself, in the same order. Functions here are those that operators do not give; comparisons
// make masks, and `mask ? a : b` chooses lane by lane, both having been computed.

#include <immintrin.h>

#include <cmath>
#include <limits>

#include "cache/base/vec.h"

namespace spillway::shading {

using Float8 = float __attribute__((vector_size(32)));
using Int8 = int __attribute__((vector_size(32)));
using Double4 = double __attribute__((vector_size(32)));

inline float root(float x) { return std::sqrt(x); }
inline double root(double x) { return std::sqrt(x); }
inline Float8 root(Float8 x) { return _mm256_sqrt_ps(x); }
inline Double4 root(Double4 x) { return _mm256_sqrt_pd(x); }

inline float magnitude(float x) { return std::fabs(x); }
inline Float8 magnitude(Float8 x) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0f), x); }

// As std::min and std::max choose, also among what is no number.
template <class F>
F lesser(F a, F b) {
  return b < a ? b : a;
}
template <class F>
F greater(F a, F b) {
  return a < b ? b : a;
}
template <class F>
auto is_finite_number(F x) {
  return magnitude(x) <= std::numeric_limits<float>::max();
}

inline bool any(bool mask) { return mask; }
inline bool any(Int8 mask) { return _mm256_movemask_ps(_mm256_castsi256_ps(reinterpret_cast<__m256i>(mask))) != 0; }

inline Float8 in_every_lane(float x) { return _mm256_set1_ps(x); }

// As Float3. Functions are found by their arguments alone: those of Float3 go on being found by names.
struct Float3x8 {
  Float8 x, y, z;
  friend Float3x8 operator+(const Float3x8& a, const Float3x8& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Float3x8 operator-(const Float3x8& a, const Float3x8& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Float3x8 operator*(const Float3x8& a, Float8 s) { return {a.x * s, a.y * s, a.z * s}; }
  friend Float8 dot(const Float3x8& a, const Float3x8& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
  friend Float8 length_squared(const Float3x8& a) { return dot(a, a); }
  friend Float3x8 cross(const Float3x8& a, const Float3x8& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
};

// The type of a vector of such numbers.
template <class F>
struct VectorOf;
template <>
struct VectorOf<float> {
  using Type = Float3;
};
template <>
struct VectorOf<Float8> {
  using Type = Float3x8;
};
template <class F>
using Vector = typename VectorOf<F>::Type;

}  // namespace spillway::shading
