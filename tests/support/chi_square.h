#pragma once

// Pearson's test of frequencies against what was expected of them.

#include <cmath>

namespace spillway::test {

class ChiSquare {
 public:
  // Bins that expect too few for the normal approximation are put together.
  void add(double seen, double expected) {
    constexpr double kLeast = 20;
    if (expected < kLeast) {
      rest_seen_ += seen, rest_expected_ += expected;
      return;
    }
    sum_ += (seen - expected) * (seen - expected) / expected, ++bins_;
  }

  [[nodiscard]] int bins() const { return bins_; }
  // The sum as standard deviations of a normal (Wilson and Hilferty 1931), with n - 1 degrees of freedom or n when part
  // of the samples falls elsewhere: the difference does not matter at the limits of these tests.
  [[nodiscard]] double deviations() const {
    const bool has_rest = rest_expected_ > 5;
    const double rest = has_rest ? (rest_seen_ - rest_expected_) * (rest_seen_ - rest_expected_) / rest_expected_ : 0;
    const double n = bins_ + (has_rest ? 1 : 0);
    return (std::cbrt((sum_ + rest) / n) - (1 - 2 / (9 * n))) / std::sqrt(2 / (9 * n));
  }

 private:
  double sum_ = 0, rest_seen_ = 0, rest_expected_ = 0;
  int bins_ = 0;
};

}  // namespace spillway::test
