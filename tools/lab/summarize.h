#pragma once

// From the rows of an axis to its curves: bands, slopes, efficiencies, and the time to equal error.

#include "tools/lab/experiment.h"

namespace spillway::tools::lab {

// Sums of a pixel's values over seeds (Welford 1962), for its variance.
class PixelVariance {
 public:
  void add(const Picture& picture);
  // Mean over pixels and channels of the variance over reference^2 + 0.01; 0 for fewer than two pictures.
  [[nodiscard]] double relative_to(const Picture& reference) const;

 private:
  std::vector<Rgb> mean_, squares_;
  int count_ = 0;
};

// rows: of one configuration and number of samples, a seed each.
[[nodiscard]] CurvePoint curve_point(std::span<const Measurement> rows, double variance, double reference_noise);

// Slope and law of time from the points; rows: of the configuration.
void fit_curve(std::span<const Measurement> rows, Curve& curve);

// The error that all curves can be compared at, and the time each takes to it.
void compare_at_equal_error(AxisResult& result);

// Of an axis that keeps bits: whether the pictures of each seed and number of samples are equal; "DEFECT..." when not.
[[nodiscard]] std::string equality_of_bits(std::span<const Measurement> rows);

// What the numbers say in words, best first.
[[nodiscard]] std::string verdict(const AxisResult& result);

// Times beyond what was measured that a fitted line is followed; further off, an error is not reached.
inline constexpr double kFarthestExtrapolation = 8;

// An error counts as measured where it is this many times the noise of the reference.
inline constexpr double kAboveReferenceNoise = 4;

}  // namespace spillway::tools::lab
