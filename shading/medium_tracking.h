#pragma once

// The templates of shading/medium.h, included by it alone.

#include <algorithm>

#include "shading/medium.h"

namespace spillway::shading {

// The steps of a Poisson process of rate `majorant` along [begin, end), keyed by cell and step.
class CellSteps {
 public:
  CellSteps(const CellSegment& cell, float majorant, const SegmentKey& key)
      : key_(key), cell_(cell.cell), begin_(cell.begin), length_(cell.end - cell.begin), mean_step_(1 / majorant) {}

  // False at the end of the cell.
  bool next() {
    // 1 - u is above 0, so that the logarithm is finite.
    gone_ += -log_of(1 - random(0)) * mean_step_;
    ++step_;
    return gone_ < length_;
  }
  // For what is decided at the step just made.
  [[nodiscard]] float decision() const { return random(1); }
  [[nodiscard]] float at() const { return begin_ + gone_; }
  [[nodiscard]] uint32_t count() const { return step_; }

 private:
  [[nodiscard]] float random(uint32_t which) const {
    return hashed_1d(key_.sample, SampleStream::media, key_.segment, cell_, 2 * step_ + which);
  }

  const SegmentKey& key_;
  uint32_t cell_, step_ = 0;
  float begin_, length_, mean_step_;
  float gone_ = 0;  // from the cell's begin, so that small steps far away are not lost
};

template <class Density>
bool track_cell(const CellSegment& cell, Rgb sigma_t, Rgb shares, const SegmentKey& key, const Density& density,
                Collisions& out) {
  const float largest = max_component(sigma_t), majorant = cell.density_max * largest;
  if (!(majorant > 0)) return true;
  const float sum = shares.r + shares.g + shares.b;
  const bool is_grey = sigma_t.r == largest && sigma_t.g == largest && sigma_t.b == largest;
  const float mean = is_grey ? largest : (shares.r * sigma_t.r + shares.g * sigma_t.g + shares.b * sigma_t.b) / sum;
  CellSteps steps(cell, majorant, key);
  while (steps.next()) {
    if (steps.count() == kMaxCellSteps) return false;
    ++out.steps;
    const float d = density(steps.at());
    const float chance = std::min(d * mean / majorant, 1.0f);  // of a real collision
    const bool is_real = steps.decision() < chance;
    if (!is_grey)
      for (int c = 0; c < 3; ++c) {
        const float sigma = c == 0 ? sigma_t.r : c == 1 ? sigma_t.g : sigma_t.b;
        out.weight[c].multiply(is_real ? sigma / mean : std::max(1 - d * sigma / majorant, 0.0f) / (1 - chance));
      }
    if (!is_real) continue;
    out.distance = steps.at(), out.density = d;
    break;
  }
  return true;
}

template <class Density>
bool pass_cell(const CellSegment& cell, Rgb sigma_t, const SegmentKey& key, const Density& density,
               OrderlessProduct (&weight)[3], uint32_t& steps_made) {
  const float majorant = cell.density_max * max_component(sigma_t);
  if (!(majorant > 0)) return true;
  CellSteps steps(cell, majorant, key);
  while (steps.next()) {
    if (steps.count() == kMaxCellSteps) return false;
    ++steps_made;
    const float d = density(steps.at()) / majorant;
    weight[0].multiply(std::max(1 - d * sigma_t.r, 0.0f));
    weight[1].multiply(std::max(1 - d * sigma_t.g, 0.0f));
    weight[2].multiply(std::max(1 - d * sigma_t.b, 0.0f));
  }
  return true;
}

}  // namespace spillway::shading
