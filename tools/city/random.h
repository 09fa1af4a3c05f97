#pragma once

// Keyed random numbers: what stands at a place depends on the seed and the place's key alone, never on what was made
// before.

#include <cmath>
#include <cstdint>

#include "cache/base/hash.h"

namespace spillway::tools::city {

[[nodiscard]] constexpr uint64_t key_of(uint64_t parent, uint64_t child) { return hash_combine(parent, child); }

// A short stream of numbers for one thing (a lot, a facade, a tree).
class Random {
 public:
  explicit Random(uint64_t key) : state_(mix64(key ^ 0x5b1f00d5c1734a29ull)) {}

  uint64_t next() { return mix64(state_ += 0x9e3779b97f4a7c15ull); }
  double unit() { return static_cast<double>(next() >> 11) * 0x1p-53; }  // [0, 1)
  double between(double low, double high) { return low + (high - low) * unit(); }
  uint32_t below(uint32_t count) { return static_cast<uint32_t>(unit() * count); }  // [0, count), count > 0
  bool chance(double probability) { return unit() < probability; }
  // Mean 0, variance 1 (Box and Muller 1958).
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - unit()));
    return radius * std::cos(6.283185307179586 * unit());
  }

 private:
  uint64_t state_;
};

}  // namespace spillway::tools::city
