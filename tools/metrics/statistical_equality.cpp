#include "tools/metrics/statistical_equality.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace spillway::tools {
namespace {

constexpr int kNeighbourRadius = 2;
// Five connected pixels by chance: 63 shapes, three channels a pixel: 63 * 0.003^5, or 2e-5 a megapixel.
constexpr double kClusterLevel = 0.001;
// Pictures are 32-bit floats: differences of a few units in the last place mean nothing.
constexpr double kFloatError = 4 * 0x1p-24;

double channel(const Rgb& c, int i) { return i == 0 ? c.r : i == 1 ? c.g : c.b; }

// What a region adds up to, for one channel.
struct Region {
  double difference = 0, magnitude = 0, variance = 0, squared_variances = 0;
  uint64_t count = 0;
};

// Variance of the mean of a pixel, from its two halves.
double pixel_variance(const Picture& p, size_t i, int c) {
  const double d = channel(p.half_a[i], c) - channel(p.half_b[i], c);
  return p.weight_a * (1 - p.weight_a) * d * d;
}

void add_variances(const Picture& a, const Picture& b, size_t i, int c, Region& region) {
  const double va = pixel_variance(a, i, c), vb = pixel_variance(b, i, c);
  region.variance += va + vb;
  region.squared_variances += va * va + vb * vb;
}

void add_difference(const Picture& a, const Picture& b, size_t i, int c, Region& region) {
  const double va = channel(a.pixels[i], c), vb = channel(b.pixels[i], c);
  region.difference += va - vb;
  region.magnitude += std::fabs(va) + std::fabs(vb);
}

// p of a difference of this variance, estimated with freedom (sum v)^2 / sum v^2 (Welch, Satterthwaite).
double probability(double difference, double magnitude, double variance, const Region& estimate) {
  const double allowed = kFloatError * magnitude;
  if (std::fabs(difference) <= allowed) return 1;
  if (variance <= 0) return 0;
  const double freedom = std::max(1.0, estimate.variance * estimate.variance / estimate.squared_variances);
  return student_two_sided((std::fabs(difference) - allowed) / std::sqrt(variance), freedom);
}

class Tester {
 public:
  Tester(const Picture& a, const Picture& b, std::span<const uint8_t> mask, const EqualityOptions& options)
      : a_(a), b_(b), mask_(mask), options_(options) {}

  EqualityReport run() {
    test_blocks();
    test_pixels();
    find_clusters();
    report_.equal =
        report_.failing_blocks == 0 && report_.failing_pixels == 0 && report_.largest_cluster <= kLargestCluster;
    return report_;
  }

 private:
  void test_blocks();
  void test_pixels();
  void find_clusters();
  [[nodiscard]] double block_probability(const Rectangle& block, int c) const;
  [[nodiscard]] double pixel_probability(int x, int y, int c) const;
  [[nodiscard]] int cluster_size(size_t first, std::vector<uint8_t>& improbable) const;

  const Picture &a_, &b_;
  std::span<const uint8_t> mask_;
  EqualityOptions options_;
  EqualityReport report_;
  std::vector<uint8_t> improbable_;
};

double Tester::block_probability(const Rectangle& block, int c) const {
  Region region;
  for (int y = block.y0; y < block.y1; ++y)
    for (int x = block.x0; x < block.x1; ++x) {
      const size_t i = a_.index(x, y);
      if (!mask_[i]) continue;
      add_variances(a_, b_, i, c, region);
      add_difference(a_, b_, i, c, region);
    }
  return probability(region.difference, region.magnitude, region.variance, region);
}

void Tester::test_blocks() {
  const int size = options_.block_size;
  std::vector<double> probabilities;
  for (int y = 0; y < a_.height; y += size)
    for (int x = 0; x < a_.width; x += size)
      for (int c = 0; c < 3; ++c) {
        const Rectangle block{x, y, std::min(x + size, a_.width), std::min(y + size, a_.height)};
        const double p = block_probability(block, c);
        probabilities.push_back(p);
        if (p >= report_.least_block_p) continue;
        report_.least_block_p = p, report_.worst_x = (x + block.x1) / 2, report_.worst_y = (y + block.y1) / 2;
      }
  report_.block_level = sidak_level(options_.significance, probabilities.size());
  for (const double p : probabilities) report_.failing_blocks += p < report_.block_level;
}

// The pixel's own variance is one poor estimate: its neighbours' mean, or its own when that is larger.
double Tester::pixel_probability(int x, int y, int c) const {
  const size_t i = a_.index(x, y);
  Region neighbours, own;
  for (int ny = std::max(y - kNeighbourRadius, 0); ny <= std::min(y + kNeighbourRadius, a_.height - 1); ++ny)
    for (int nx = std::max(x - kNeighbourRadius, 0); nx <= std::min(x + kNeighbourRadius, a_.width - 1); ++nx) {
      if (!mask_[a_.index(nx, ny)]) continue;
      add_variances(a_, b_, a_.index(nx, ny), c, neighbours);
      ++neighbours.count;
    }
  add_variances(a_, b_, i, c, own);
  add_difference(a_, b_, i, c, own);
  const double pooled = neighbours.variance / static_cast<double>(neighbours.count);
  const bool own_is_larger = own.variance > pooled;
  return probability(own.difference, own.magnitude, std::max(own.variance, pooled), own_is_larger ? own : neighbours);
}

void Tester::test_pixels() {
  improbable_.assign(a_.pixels.size(), 0);
  const auto tested = static_cast<uint64_t>(std::count(mask_.begin(), mask_.end(), uint8_t{1}));
  report_.pixel_level = sidak_level(options_.significance, 3 * tested);
  for (int y = 0; y < a_.height; ++y)
    for (int x = 0; x < a_.width; ++x) {
      const size_t i = a_.index(x, y);
      double p = 1;
      for (int c = 0; mask_[i] && c < 3; ++c) p = std::min(p, pixel_probability(x, y, c));
      improbable_[i] = p < kClusterLevel;
      report_.failing_pixels += p < report_.pixel_level;
      report_.least_pixel_p = std::min(report_.least_pixel_p, p);
    }
}

// Counts and clears the improbable pixels that are connected to the first by sides.
int Tester::cluster_size(size_t first, std::vector<uint8_t>& improbable) const {
  int size = 0;
  std::vector<size_t> open{first};
  improbable[first] = 0;
  const auto width = static_cast<size_t>(a_.width);
  while (!open.empty()) {
    const size_t i = open.back(), x = i % width, y = i / width;
    open.pop_back();
    ++size;
    const auto visit = [&](bool inside, size_t neighbour) {
      if (!inside || !improbable[neighbour]) return;
      improbable[neighbour] = 0;
      open.push_back(neighbour);
    };
    visit(x > 0, i - 1), visit(x + 1 < width, i + 1);
    visit(y > 0, i - width), visit(y + 1 < static_cast<size_t>(a_.height), i + width);
  }
  return size;
}

void Tester::find_clusters() {
  std::vector<uint8_t> improbable = improbable_;
  for (size_t i = 0; i < improbable.size(); ++i)
    if (improbable[i]) report_.largest_cluster = std::max(report_.largest_cluster, cluster_size(i, improbable));
}

// The continued fraction of the incomplete beta function (Abramowitz and Stegun 26.5.8), by Lentz's method.
double beta_fraction(double a, double b, double x) {
  constexpr double kTiny = 1e-300, kPrecision = 1e-15;
  const auto away_from_zero = [](double v) { return std::fabs(v) < kTiny ? kTiny : v; };
  double c = 1, d = 1 / away_from_zero(1 - (a + b) * x / (a + 1)), value = d;
  for (int m = 1; m < 1000; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1 / away_from_zero(1 + even * d), c = away_from_zero(1 + even / c), value *= c * d;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 / away_from_zero(1 + odd * d), c = away_from_zero(1 + odd / c), value *= c * d;
    if (std::fabs(c * d - 1) < kPrecision) break;
  }
  return value;
}

double incomplete_beta(double a, double b, double x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x));
  // Converges fast on one side of the mean; the other is its complement.
  if (x < (a + 1) / (a + b + 2)) return front * beta_fraction(a, b, x) / a;
  return 1 - front * beta_fraction(b, a, 1 - x) / b;
}

}  // namespace

double student_two_sided(double t, double freedom) {
  return incomplete_beta(freedom / 2, 0.5, freedom / (freedom + t * t));
}

double sidak_level(double significance, uint64_t count) {
  return count == 0 ? 0 : -std::expm1(std::log1p(-significance) / static_cast<double>(count));
}

EqualityReport statistical_equality(const Picture& a, const Picture& b, std::span<const uint8_t> mask,
                                    const EqualityOptions& options) {
  return Tester(a, b, mask, options).run();
}

}  // namespace spillway::tools
