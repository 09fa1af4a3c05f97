#pragma once

// Exponential and logarithm of our own, so that their bits do not change with the C library; and products of factors that
// are not negative that do not depend on the order of multiplication.

#include <bit>
#include <cmath>
#include <cstdint>

namespace spillway::shading {

// Base-two logarithm of a finite x > 0. The series of the inverse hyperbolic tangent around the mantissa in
// [sqrt(1/2), sqrt(2)): off by less than 2e-11.
inline double log2_of(float x) {
  const double wide = x;
  const auto bits = std::bit_cast<uint64_t>(wide);
  // Adds half an exponent, so that the mantissa is split at sqrt(2).
  const auto exponent = static_cast<int64_t>((bits + 0x00095f619980c433u) >> 52) - 1023;
  const double mantissa = std::bit_cast<double>(bits - (static_cast<uint64_t>(exponent) << 52));
  const double s = (mantissa - 1) / (mantissa + 1), q = s * s;
  const double series = 1 + q * (1.0 / 3 + q * (1.0 / 5 + q * (1.0 / 7 + q * (1.0 / 9 + q * (1.0 / 11)))));
  return static_cast<double>(exponent) + 2.8853900817779268 * s * series;  // 2 / ln 2
}

// Two to the power of x <= 126; 0 below 2^-149. Taylor's series on [-1/2, 1/2] to the 8th power: off by 2e-10
// relatively.
inline float exp2_of(double x) {
  if (!(x > -149)) return 0;
  const double whole = std::floor(x + 0.5);
  const double y = (x - whole) * 0.69314718055994531;
  const double series =
      1 +
      y * (1 +
           y * (0.5 + y * (1.0 / 6 +
                           y * (1.0 / 24 + y * (1.0 / 120 + y * (1.0 / 720 + y * (1.0 / 5040 + y * (1.0 / 40320))))))));
  return static_cast<float>(series *
                            std::bit_cast<double>(static_cast<uint64_t>(static_cast<int64_t>(whole) + 1023) << 52));
}

inline float exp_of(float x) { return exp2_of(x * 1.4426950408889634); }
inline float log_of(float x) { return static_cast<float>(log2_of(x) * 0.69314718055994531); }

// A product kept as the sum of base-two logarithms in units of 2^-40: integers add up to the same whatever the order.
// A factor is rounded to 7e-13 of itself.
class OrderlessProduct {
 public:
  // factor >= 0, finite.
  void multiply(float factor) {
    if (factor == 1) return;
    if (!(factor > 0)) zero_ = 1;
    if (factor > 0) sum_ += static_cast<int64_t>(std::nearbyint(log2_of(factor) * 0x1p40));
  }
  void multiply(const OrderlessProduct& other) { sum_ += other.sum_, zero_ |= other.zero_; }
  [[nodiscard]] float value() const { return zero_ != 0 ? 0 : exp2_of(static_cast<double>(sum_) * 0x1p-40); }

 private:
  int64_t sum_ = 0;
  uint64_t zero_ = 0;
};

}  // namespace spillway::shading
