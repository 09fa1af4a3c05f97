// The charts of the first section of the page.

#include <fmt/format.h>

#include <cmath>

#include "tools/lab/first_principles.h"

namespace spillway::tools::lab {
namespace {

constexpr uint32_t kTrials = 400;
const std::vector<uint32_t> kCounts = {4, 16, 64, 256, 1024};

Series measured(const std::string& name, const std::vector<Point>& points) {
  const PowerLaw law = fit_power_law(points);
  Series series{law.is_known ? fmt::format("{}: slope {:.2f}", name, law.slope) : name, {}};
  for (const Point& p : points)
    series.points.push_back({p.x, p.y, 0, 0, false, fmt::format("{}: n = {:.0f}, {:.3g}", name, p.x, p.y)});
  return series;
}

Series theory(const std::string& name, const std::vector<uint32_t>& counts,
              const std::function<double(double)>& value) {
  Series series{name, {}, true};
  for (const uint32_t n : counts) series.points.push_back({static_cast<double>(n), value(n)});
  return series;
}

Chart squared_error_chart(const std::string& title) {
  return {.title = title, .x_title = "evaluations", .y_title = "mean squared error", .series = {}};
}

Lesson dice() {
  Chart chart = squared_error_chart("Fair and loaded: the mean of rolls of a die");
  chart.x_title = "rolls";
  const auto rolls_of = [](const Die& die, uint64_t experiment) {
    return [&die, experiment](uint32_t n, uint64_t trial) {
      double sum = 0;
      for (uint32_t i = 0; i < n; ++i) sum += roll(die, random_unit(100 + experiment, trial, i));
      return sum / n;
    };
  };
  chart.series = {measured("fair", squared_errors(rolls_of(kFairDie, 0), 3.5, kCounts, kTrials)),
                  measured("loaded", squared_errors(rolls_of(kLoadedDie, 1), 3.5, kCounts, kTrials)),
                  theory("35/12 over n", kCounts, [](double n) { return 35.0 / 12 / n; }),
                  theory("11/12 over n", kCounts, [](double n) { return 11.0 / 12 / n; })};
  const Moments m = moments(kLoadedDie);
  return {chart,
          fmt::format(
              "Both dice have mean {:.1f}. The loaded one (chances 1, 1, 10, 10, 1, 1 in 24) has the variance {:.4f} "
              "instead of {:.4f}: the same slope, a third of the rolls for the same error. A better estimator moves "
              "the line down; it does not make it steeper.",
              m.mean, m.variance, moments(kFairDie).variance)};
}

Lesson quartic() {
  Chart chart = squared_error_chart("The integral of 5x⁴ over [0, 1], which is 1");
  chart.series = {measured("uniform", squared_errors(quartic_uniform, 1, kCounts, kTrials)),
                  measured("importance", squared_errors(quartic_importance, 1, kCounts, kTrials)),
                  measured("stratified", squared_errors(quartic_stratified, 1, kCounts, kTrials)),
                  measured("quadrature", squared_errors(quartic_quadrature, 1, kCounts, 1))};
  return {chart,
          "Importance sampling by 4x³ divides the variance by 42.7 (16/9 to 1/24) and keeps the slope of -1. One "
          "sample in each "
          "stratum is steeper (-3), midpoints steeper still (-4): in one dimension, and where the function is smooth."};
}

Lesson darts() {
  Chart chart = squared_error_chart("Pi by throwing darts");
  chart.x_title = "darts";
  chart.series = {measured("thrown", squared_errors(pi_by_darts, M_PI, kCounts, kTrials)),
                  measured("one a cell", squared_errors(pi_by_stratified_darts, M_PI, kCounts, kTrials)),
                  theory("pi (4 - pi) over n", kCounts, [](double n) { return M_PI * (4 - M_PI) / n; })};
  return {
      chart,
      "Only the cells that the edge of the disk crosses are uncertain, and there are as many as the root of all cells: "
      "slope -3/2. This is what well-spread samples do at the silhouettes of a picture."};
}

Lesson dimensions() {
  constexpr uint32_t kEvaluations = 4096;
  Chart chart{.title = "Quadrature against chance, 4096 evaluations",
              .x_title = "dimensions",
              .y_title = "squared error",
              .series = {},
              .is_log_x = false};
  Series quadrature{"midpoints", {}}, chance{"chance", {}}, law{"((pi²/8)^d - 1) over n", {}, true};
  for (uint32_t d = 1; d <= 12; ++d) {
    const double error = product_by_quadrature(d, kEvaluations) - 1;
    quadrature.points.push_back({static_cast<double>(d), error * error});
    const auto estimate = [d](uint32_t n, uint64_t trial) { return product_by_chance(d, n, trial); };
    chance.points.push_back(
        {static_cast<double>(d), squared_errors(estimate, 1, std::vector{kEvaluations}, 8).front().y});
    law.points.push_back({static_cast<double>(d), product_variance(d) / kEvaluations});
  }
  chart.series = {quadrature, chance, law};
  return {
      chart,
      "A grid of 4096 points has 4096 a side in one dimension and two in twelve: the slope of midpoints is -4/d. "
      "Chance does "
      "not know how many dimensions there are, and wins from four on. A path of five bounces has more than twenty."};
}

Lesson chebyshev() {
  constexpr uint32_t kSamples = 16, kMeans = 20000;
  Chart chart{.title = "Chebyshev's bound",
              .x_title = "k, standard errors",
              .y_title = "share of means further off",
              .series = {},
              .is_log_x = false};
  Series seen{fmt::format("observed, means of {}", kSamples), {}}, bound{"1/k²", {}, true},
      normal{"normal law", {}, true};
  for (double k = 1; k <= 4.01; k += 0.5) {
    seen.points.push_back({k, share_beyond(k, kSamples, kMeans)});
    bound.points.push_back({k, 1 / (k * k)});
    normal.points.push_back({k, std::erfc(k / std::sqrt(2.0))});
  }
  chart.series = {seen, bound, normal};
  return {chart,
          "Whatever is integrated, at most 1/k² of all means are k standard errors off; nothing has to be normal. What "
          "is lopsided "
          "as 5x⁴ is has more outliers than the normal law says, and keeps the bound."};
}

}  // namespace

std::vector<Lesson> first_principles() { return {dice(), quartic(), darts(), dimensions(), chebyshev()}; }

}  // namespace spillway::tools::lab
