#include "pipeline/render/epochs.h"

#include <algorithm>

namespace spillway::pipeline {

EpochSchedule::EpochSchedule(EpochOptions options, std::array<uint32_t, 2> samples_done)
    : options_(options), opened_(samples_done), closed_(samples_done) {
  target_ = {(options.samples_per_pixel + 1) / 2, options.samples_per_pixel / 2};
}

std::optional<Epoch> EpochSchedule::open_next() {
  // The half that is behind goes first; A on a tie.
  const uint32_t half = opened_[0] <= opened_[1] ? 0 : 1;
  for (const uint32_t candidate : {half, 1 - half}) {
    if (open_[candidate] || opened_[candidate] >= target_[candidate]) continue;
    // Powers of two that double the half, so that early stops leave whole Sobol' prefixes.
    const uint32_t doubling = std::max(options_.smallest_samples, opened_[candidate]);
    const uint32_t count =
        std::min({doubling, options_.largest_samples, target_[candidate] - opened_[candidate]});
    const Epoch epoch{candidate, opened_[candidate], count};
    opened_[candidate] += count;
    open_[candidate] = true;
    return epoch;
  }
  return std::nullopt;
}

void EpochSchedule::close(uint32_t half) {
  open_[half] = false;
  closed_[half] = opened_[half];
  ++closed_epochs_;
}

bool EpochSchedule::finished() const { return !any_open() && closed_ == target_; }

void EpochSchedule::stop_early() {
  const uint32_t common = std::max(opened_[0], opened_[1]);
  target_ = {std::min(target_[0], common), std::min(target_[1], common)};
}

}  // namespace spillway::pipeline
