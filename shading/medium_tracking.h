#pragma once

// What is called for every cell and step, inline; included by shading/medium.h alone.

#include <algorithm>

#include "shading/medium.h"

namespace spillway::shading {

inline CellSteps::CellSteps(const CellSegment& cell, float majorant, const SegmentKey& key, const CellProgress& from)
    : key_(key),
      cell_(cell.cell),
      begin_(cell.begin),
      length_(cell.end - cell.begin),
      majorant_(majorant),
      mean_step_(1 / majorant),
      progress_(from) {}

// Counted from the cell's begin, so that small steps far away are not lost.
inline bool CellSteps::next() {
  const float u = random(0);
  ++progress_.count;
  // Most cells are passed in none: -log(1 - u) is at least u, with room for the logarithm's error.
  if (progress_.gone + 0.99f * u * mean_step_ > length_) return false;
  // 1 - u is above 0, so that the logarithm is finite.
  progress_.gone += -log_of(1 - u) * mean_step_;
  return progress_.gone < length_;
}

inline CellStep CellSteps::step() const { return {begin_ + progress_.gone, majorant_, random(1)}; }

inline float CellSteps::random(uint32_t which) const {
  return hashed_1d(key_.sample, SampleStream::media, key_.segment, cell_, 2 * progress_.count + which);
}

inline StepRule::StepRule(Rgb sigma_t, Rgb shares, bool has_channels)
    : sigma_t_(sigma_t),
      shares_(shares),
      largest_(max_component(sigma_t)),
      mean_(largest_),
      is_grey_(!has_channels && sigma_t.r == largest_ && sigma_t.g == largest_ && sigma_t.b == largest_),
      has_channels_(has_channels) {
  const float sum = shares.r + shares.g + shares.b;
  if (!is_grey_) mean_ = (shares.r * sigma_t.r + shares.g * sigma_t.g + shares.b * sigma_t.b) / sum;
  if (has_channels) shares_ = shares * (1 / sum);
}

inline float StepRule::chance(const CellStep& step, Rgb density) const {
  if (!has_channels_) return std::min(density.r * mean_ / step.majorant, 1.0f);
  const Rgb s = sigma(density);
  return std::min((shares_.r * s.r + shares_.g * s.g + shares_.b * s.b) / step.majorant, 1.0f);
}

inline bool StepRule::track(const CellStep& step, Rgb density, Collisions& out) const {
  ++out.steps;
  const float collides = chance(step, density);
  const bool real = step.decision < collides;
  if (real) out.distance = step.distance;
  if (is_grey_) return real;
  const Rgb s = sigma(density);
  for (int c = 0; c < 3; ++c) {
    const float part = (c == 0 ? s.r : c == 1 ? s.g : s.b) / step.majorant;
    out.weight[c].multiply(real ? part / collides : std::max(1 - part, 0.0f) / (1 - collides));
  }
  return real;
}

inline void StepRule::pass(const CellStep& step, Rgb density, Collisions& out) const {
  ++out.steps;
  if (is_grey_) {
    OrderlessProduct factor;
    factor.multiply(std::max(1 - density.r / step.majorant * largest_, 0.0f));
    for (OrderlessProduct& weight : out.weight) weight.multiply(factor);
    return;
  }
  const Rgb s = sigma(density) * (1 / step.majorant);
  out.weight[0].multiply(std::max(1 - s.r, 0.0f));
  out.weight[1].multiply(std::max(1 - s.g, 0.0f));
  out.weight[2].multiply(std::max(1 - s.b, 0.0f));
}

}  // namespace spillway::shading
