#include "tools/lab/first_principles.h"

#include <algorithm>
#include <cmath>

#include "cache/base/hash.h"

namespace spillway::tools::lab {
namespace {

// One number an experiment, so that none repeats another's chances.
enum class Stream : uint64_t { uniform = 1, importance, stratified, darts, stratified_darts, product };

double random(Stream stream, uint64_t trial, uint64_t index) {
  return random_unit(static_cast<uint64_t>(stream), trial, index);
}

double quartic(double x) { return 5 * x * x * x * x; }

double product(uint32_t dimensions, const std::function<double(uint32_t)>& x) {
  double value = 1;
  for (uint32_t i = 0; i < dimensions; ++i) value *= M_PI / 2 * std::sin(M_PI * x(i));
  return value;
}

template <class Value>
double mean_over(uint32_t n, const Value& value) {
  double sum = 0;
  for (uint32_t i = 0; i < n; ++i) sum += value(i);
  return sum / n;
}

bool hits_disk(double x, double y) { return x * x + y * y < 1; }

}  // namespace

double random_unit(uint64_t experiment, uint64_t trial, uint64_t index) {
  return static_cast<double>(hash_combine(hash_combine(experiment, trial), index) >> 11) * 0x1p-53;
}

Moments moments(const Die& die) {
  Moments m;
  for (int face = 1; face <= 6; ++face) m.mean += die.chance[face - 1] * face;
  for (int face = 1; face <= 6; ++face) m.variance += die.chance[face - 1] * (face - m.mean) * (face - m.mean);
  return m;
}

int roll(const Die& die, double u) {
  int face = 1;
  while (face < 6 && u >= die.chance[face - 1]) u -= die.chance[face++ - 1];
  return face;
}

std::vector<Point> squared_errors(const Estimate& estimate, double truth, std::span<const uint32_t> counts,
                                  uint32_t trials) {
  std::vector<Point> points;
  for (const uint32_t n : counts) {
    double sum = 0;
    for (uint32_t trial = 0; trial < trials; ++trial) {
      const double error = estimate(n, trial) - truth;
      sum += error * error;
    }
    points.push_back({static_cast<double>(n), sum / trials});
  }
  return points;
}

double quartic_uniform(uint32_t n, uint64_t trial) {
  return mean_over(n, [&](uint32_t i) { return quartic(random(Stream::uniform, trial, i)); });
}

double quartic_importance(uint32_t n, uint64_t trial) {
  // x = u^(1/4) has the density 4 x^3; f / p = 5 x / 4.
  return mean_over(n, [&](uint32_t i) { return 1.25 * std::sqrt(std::sqrt(random(Stream::importance, trial, i))); });
}

double quartic_stratified(uint32_t n, uint64_t trial) {
  return mean_over(n, [&](uint32_t i) { return quartic((i + random(Stream::stratified, trial, i)) / n); });
}

double quartic_quadrature(uint32_t n, uint64_t) {
  return mean_over(n, [&](uint32_t i) { return quartic((i + 0.5) / n); });
}

double pi_by_darts(uint32_t n, uint64_t trial) {
  return 4 * mean_over(n, [&](uint32_t i) {
           return hits_disk(random(Stream::darts, trial, 2 * i), random(Stream::darts, trial, 2 * i + 1)) ? 1.0 : 0.0;
         });
}

double pi_by_stratified_darts(uint32_t n, uint64_t trial) {
  const auto side = static_cast<uint32_t>(std::sqrt(n));
  return 4 * mean_over(side * side, [&](uint32_t i) {
           const double x = i % side + random(Stream::stratified_darts, trial, 2 * i);
           const double y = i / side + random(Stream::stratified_darts, trial, 2 * i + 1);
           return hits_disk(x / side, y / side) ? 1.0 : 0.0;
         });
}

double product_by_quadrature(uint32_t dimensions, uint32_t n) {
  auto side = static_cast<uint32_t>(std::pow(n, 1.0 / dimensions) + 1e-9);
  side = std::max(1u, side);
  uint32_t cells = 1;
  for (uint32_t i = 0; i < dimensions; ++i) cells *= side;
  return mean_over(cells, [&](uint32_t cell) {
    return product(dimensions, [&](uint32_t) {
      const double x = (cell % side + 0.5) / side;
      cell /= side;
      return x;
    });
  });
}

double product_by_chance(uint32_t dimensions, uint32_t n, uint64_t trial) {
  return mean_over(n, [&](uint32_t i) {
    return product(dimensions, [&](uint32_t k) {
      return random(Stream::product, trial << 8 | dimensions, uint64_t{i} * dimensions + k);
    });
  });
}

double product_variance(uint32_t dimensions) { return std::pow(M_PI * M_PI / 8, dimensions) - 1; }

double share_beyond(double k, uint32_t n, uint32_t trials) {
  const double limit = k * std::sqrt(16.0 / 9 / n);
  uint32_t beyond = 0;
  for (uint32_t trial = 0; trial < trials; ++trial) beyond += std::fabs(quartic_uniform(n, trial) - 1) >= limit;
  return static_cast<double>(beyond) / trials;
}

}  // namespace spillway::tools::lab
