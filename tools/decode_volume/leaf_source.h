#pragma once

// A sparse tree with leaves of 8^3 samples, as both libraries have it, as a source of samples.

#include <array>
#include <span>

#include "pipeline/pack/cut_bricks.h"

namespace spillway::tools {

class LeafSource : public pipeline::SampleSource {
 public:
  static constexpr int32_t kLeafSide = 8;

  void copy(const std::array<int32_t, 3>& corner, int32_t side, std::span<float> samples) const final;

 protected:
  // Of 8^3 points: those of a leaf, x slowest, or the one that all of them have.
  struct Values {
    const float* leaf = nullptr;
    float all = 0;
  };
  // `cell`: multiples of 8, in the slab that is loaded.
  [[nodiscard]] virtual Values find(const std::array<int32_t, 3>& cell) const = 0;
};

}  // namespace spillway::tools
