#include "pipeline/render/epochs.h"

#include <algorithm>
#include <bit>

namespace spillway::pipeline {

EpochSchedule::EpochSchedule(EpochOptions options, std::array<uint32_t, 2> samples_done)
    : options_(options), opened_(samples_done), closed_(samples_done) {
  target_ = {(options.samples_per_pixel + 1) / 2, options.samples_per_pixel / 2};
}

bool EpochSchedule::may_open(uint32_t half) const {
  if (open_[half] || opened_[half] >= target_[half]) return false;
  return !options_.checked || std::min(closed_[0], closed_[1]) >= opened_[half];
}

uint32_t EpochSchedule::next_count(uint32_t half) const {
  const uint32_t done = opened_[half], left = target_[half] - done;
  if (options_.checked) return std::min(done < kFirstCheckedSamples ? kFirstCheckedSamples : std::bit_floor(done) / 2, left);
  // Powers of two that double the half, so that early stops leave whole Sobol' prefixes.
  return std::min({std::max(options_.smallest_samples, done), options_.largest_samples, left});
}

bool EpochSchedule::halves_are_equal() const { return !any_open() && closed_[0] == closed_[1] && closed_[0] > 0; }

std::optional<Epoch> EpochSchedule::open_next() {
  // The half that is behind goes first; A on a tie.
  const uint32_t half = opened_[0] <= opened_[1] ? 0 : 1;
  for (const uint32_t candidate : {half, 1 - half}) {
    if (!may_open(candidate)) continue;
    const uint32_t count = next_count(candidate);
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
