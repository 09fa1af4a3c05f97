#pragma once

// Random numbers for tests: the same for a seed with any standard library.

#include <cstdint>
#include <random>

#include "cache/base/vec.h"

namespace spillway::test {

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  float operator()() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }  // in [0, 1)
  uint32_t below(uint32_t n) { return static_cast<uint32_t>(engine_() % n); }
  float in(float lower, float upper) { return lower + (upper - lower) * (*this)(); }
  Float3 point(float size) {
    const float x = in(-size, size), y = in(-size, size);
    return {x, y, in(-size, size)};
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace spillway::test
