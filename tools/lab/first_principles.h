#pragma once

// Integrals of one dimension and a few more, whose answers are known: what the slopes and bands of the charts mean.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "tools/lab/chart.h"
#include "tools/lab/statistics.h"

namespace spillway::tools::lab {

// Uniform in [0, 1), a pure function of its keys.
[[nodiscard]] double random_unit(uint64_t experiment, uint64_t trial, uint64_t index);

// Chances of the faces one to six. Symmetric dice of mean 3.5 have the variance 11/12 = 0.91667 (of 35/12 for a fair
// one) when p2 = 1/6 - 3 p1; of those this is the one whose four outer faces are alike: 1, 1, 10, 10, 1, 1 in 24.
struct Die {
  double chance[6];
};
inline constexpr Die kFairDie = {{1 / 6.0, 1 / 6.0, 1 / 6.0, 1 / 6.0, 1 / 6.0, 1 / 6.0}};
inline constexpr Die kLoadedDie = {{1 / 24.0, 1 / 24.0, 10 / 24.0, 10 / 24.0, 1 / 24.0, 1 / 24.0}};
struct Moments {
  double mean = 0, variance = 0;
};
[[nodiscard]] Moments moments(const Die& die);
[[nodiscard]] int roll(const Die& die, double u);

// Estimates of a known value from n evaluations; trials differ, but for quadrature.
using Estimate = std::function<double(uint32_t n, uint64_t trial)>;
// Mean over trials of (estimate - truth)^2 at each n.
[[nodiscard]] std::vector<Point> squared_errors(const Estimate& estimate, double truth,
                                                std::span<const uint32_t> counts, uint32_t trials);

// The integral of 5 x^4 over [0, 1], which is 1.
[[nodiscard]] double quartic_uniform(uint32_t n, uint64_t trial);     // variance 16/9 over n
[[nodiscard]] double quartic_importance(uint32_t n, uint64_t trial);  // by the density 4 x^3: variance 1/24 over n
[[nodiscard]] double quartic_stratified(uint32_t n, uint64_t trial);  // one point in each nth: slope -3
[[nodiscard]] double quartic_quadrature(uint32_t n, uint64_t trial);  // midpoints: slope -4

// Four times the share of n darts in the square that hit the quarter disk: pi, variance pi (4 - pi) over n.
[[nodiscard]] double pi_by_darts(uint32_t n, uint64_t trial);
// The same, one dart in each cell of a grid of floor(sqrt n) a side: slope -3/2.
[[nodiscard]] double pi_by_stratified_darts(uint32_t n, uint64_t trial);

// The integral of the product of pi/2 sin(pi x_i) over [0, 1]^d, which is 1, with at most n evaluations.
[[nodiscard]] double product_by_quadrature(uint32_t dimensions,
                                           uint32_t n);  // midpoints of floor(n^(1/d)) a side: slope -4/d
[[nodiscard]] double product_by_chance(uint32_t dimensions, uint32_t n, uint64_t trial);
[[nodiscard]] double product_variance(uint32_t dimensions);  // (pi^2 / 8)^d - 1, over n

// The share of trials whose mean of n uniform samples of 5 x^4 is at least k standard errors off: at most 1 / k^2.
[[nodiscard]] double share_beyond(double k, uint32_t n, uint32_t trials);

// What the page shows: a chart, and what to see in it.
struct Lesson {
  Chart chart;
  std::string text;
};
[[nodiscard]] std::vector<Lesson> first_principles();

}  // namespace spillway::tools::lab
