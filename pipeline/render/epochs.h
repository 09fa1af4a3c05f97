#pragma once

// Epochs: when work is complete.
//
// An epoch is a range of samples of one half, over all pixels of the window; epochs alternate between the halves
// (A: even samples, B: odd), and at most two are open, one a half. So the half a live path belongs to names its epoch,
// a half's accumulator is whole whenever its epoch has closed, and no accumulator of an epoch's own is needed.
// Sizes change nothing in the image: sample i of a half has the same numbers whatever epoch it is drawn in.

#include <array>
#include <cstdint>
#include <optional>

namespace spillway::pipeline {

struct EpochOptions {
  uint32_t samples_per_pixel = 16;  // of both halves; the first gets the odd one
  uint32_t largest_samples = 16;    // of an epoch; larger: fewer drained waves, later stops
  uint32_t smallest_samples = 1;    // of the first epoch of a half, a power of two: large waves starve on small ones
  // Halves wait for each other after each epoch, so that both are whole and equal and can be looked at. Epochs are then
  // kFirstCheckedSamples, and powers of two that add a third to a half of what a half has: sizes that no plan changes, so
  // that a render stops at the same count for any budget.
  bool checked = false;
};

// A half's samples at the first look: fewer do not tell of their error.
inline constexpr uint32_t kFirstCheckedSamples = 8;

struct Epoch {
  uint32_t half = 0;
  uint32_t first_sample = 0;  // index inside the half
  uint32_t sample_count = 0;
};

class EpochSchedule {
 public:
  explicit EpochSchedule(EpochOptions options, std::array<uint32_t, 2> samples_done = {0, 0});

  // The next epoch to open, if its half has none open and samples remain. Opens it.
  std::optional<Epoch> open_next();
  void close(uint32_t half);
  [[nodiscard]] bool is_open(uint32_t half) const { return open_[half]; }
  [[nodiscard]] bool any_open() const { return open_[0] || open_[1]; }
  [[nodiscard]] bool finished() const;

  // Both halves whole, equal and not empty: only then does a checked schedule open the next epochs.
  [[nodiscard]] bool halves_are_equal() const;
  // No more samples than what makes both halves whole and equal: --time-limit, --error, Ctrl-C.
  void stop_early();
  [[nodiscard]] std::array<uint32_t, 2> closed_samples() const { return closed_; }
  [[nodiscard]] std::array<uint32_t, 2> target_samples() const { return target_; }
  [[nodiscard]] uint32_t closed_epoch_count() const { return closed_epochs_; }

 private:
  [[nodiscard]] bool may_open(uint32_t half) const;
  [[nodiscard]] uint32_t next_count(uint32_t half) const;

  EpochOptions options_;
  std::array<uint32_t, 2> target_;
  std::array<uint32_t, 2> opened_;  // samples in epochs opened so far
  std::array<uint32_t, 2> closed_;
  std::array<bool, 2> open_ = {false, false};
  uint32_t closed_epochs_ = 0;
};

}  // namespace spillway::pipeline
