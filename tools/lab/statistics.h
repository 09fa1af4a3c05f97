#pragma once

// What a few independent seeds tell: means with confidence, and the slopes of errors.

#include <span>
#include <vector>

namespace spillway::tools::lab {

inline constexpr double kConfidence = 0.95;  // of all bands and intervals

[[nodiscard]] double mean(std::span<const double> values);
// With n - 1 below; 0 for fewer than two values.
[[nodiscard]] double sample_variance(std::span<const double> values);

// t with a two-sided probability of 1 - kConfidence under Student's distribution; freedom >= 1.
[[nodiscard]] double student_quantile(double freedom);

// A mean and where the true one lies with kConfidence, for quantities above zero: the interval is that of the logarithm
// (delta method), so that it stays above zero on a logarithmic axis. Of one value low = high = mean: nothing is known.
struct Band {
  double mean = 0, low = 0, high = 0;
};
[[nodiscard]] Band band_of(std::span<const double> values);

struct Point {
  double x = 0, y = 0;
};
// Least squares of log y over log x: y = scale x^slope. Points that are not above zero are passed over.
struct PowerLaw {
  double slope = 0, scale = 0;
  bool is_known = false;  // two different x at least
  [[nodiscard]] double at(double x) const;
  [[nodiscard]] double x_of(double y) const;  // the x where it takes that value
};
[[nodiscard]] PowerLaw fit_power_law(std::span<const Point> points);

// The mean of one fit a seed, with the half width of its interval; half width 0: one seed alone.
struct Slope {
  double value = 0, half_width = 0;
  bool is_known = false;
};
[[nodiscard]] Slope slope_of(std::span<const std::vector<Point>> curve_of_seed);

}  // namespace spillway::tools::lab
