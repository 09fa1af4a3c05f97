#include "tools/lab/statistics.h"

#include <cmath>

#include "tools/metrics/statistical_equality.h"

namespace spillway::tools::lab {

double mean(std::span<const double> values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

double sample_variance(std::span<const double> values) {
  if (values.size() < 2) return 0;
  const double m = mean(values);
  double sum = 0;
  for (const double v : values) sum += (v - m) * (v - m);
  return sum / static_cast<double>(values.size() - 1);
}

double student_quantile(double freedom) {
  double low = 0, high = 1000;  // one degree of freedom asks for 12.7
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (student_two_sided(middle, freedom) > 1 - kConfidence ? low : high) = middle;
  }
  return high;
}

Band band_of(std::span<const double> values) {
  Band band;
  band.mean = band.low = band.high = mean(values);
  if (values.size() < 2 || !(band.mean > 0)) return band;
  const auto n = static_cast<double>(values.size());
  const double relative = student_quantile(n - 1) * std::sqrt(sample_variance(values) / n) / band.mean;
  band.low *= std::exp(-relative), band.high *= std::exp(relative);
  return band;
}

double PowerLaw::at(double x) const { return scale * std::pow(x, slope); }

double PowerLaw::x_of(double y) const { return std::pow(y / scale, 1 / slope); }

PowerLaw fit_power_law(std::span<const Point> points) {
  double n = 0, x_sum = 0, y_sum = 0, xx = 0, xy = 0;
  for (const Point& p : points) {
    if (!(p.x > 0) || !(p.y > 0)) continue;
    const double x = std::log(p.x), y = std::log(p.y);
    n += 1, x_sum += x, y_sum += y, xx += x * x, xy += x * y;
  }
  const double spread = n * xx - x_sum * x_sum;
  if (n < 2 || !(spread > 1e-12 * n * xx)) return {};
  const double slope = (n * xy - x_sum * y_sum) / spread;
  return {slope, std::exp((y_sum - slope * x_sum) / n), true};
}

Slope slope_of(std::span<const std::vector<Point>> curve_of_seed) {
  std::vector<double> slopes;
  for (const std::vector<Point>& curve : curve_of_seed)
    if (const PowerLaw law = fit_power_law(curve); law.is_known) slopes.push_back(law.slope);
  if (slopes.empty()) return {};
  Slope slope{mean(slopes), 0, true};
  const auto n = static_cast<double>(slopes.size());
  if (n > 1) slope.half_width = student_quantile(n - 1) * std::sqrt(sample_variance(slopes) / n);
  return slope;
}

}  // namespace spillway::tools::lab
