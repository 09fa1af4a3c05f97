#include "pipeline/render/estimate_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cache/base/parallel.h"

namespace spillway::pipeline {
namespace {

// One-sided 95 % of a normal distribution, times the root of two: two independent values, the picture's and its
// estimate's.
constexpr double kBoundDeviations = 1.645 * 1.41421356;
constexpr size_t kBlockRows = 16;

struct Sums {
  double errors = 0, squares = 0;
};

float channel(const Rgb& c, int i) { return i == 0 ? c.r : i == 1 ? c.g : c.b; }

// The picture's rows around a block, each pixel made once.
class Means {
 public:
  Means(const Film& film, uint32_t y0, uint32_t y1)
      : window_(film.shape().window), first_(std::max(y0, window_.y0 + 1) - 1), last_(std::min(y1 + 1, window_.y1)) {
    rows_.reserve(size_t{last_ - first_} * window_.width());
    for (uint32_t y = first_; y < last_; ++y)
      for (uint32_t x = window_.x0; x < window_.x1; ++x) rows_.push_back(film.pixel(x, y));
  }
  [[nodiscard]] Rgb at(uint32_t x, uint32_t y) const {
    return rows_[size_t{y - first_} * window_.width() + (x - window_.x0)];
  }
  // Mean over the pixels around (x, y), inside the window, without it; of a window of one pixel, itself.
  [[nodiscard]] Rgb around(uint32_t x, uint32_t y) const {
    const uint32_t u0 = std::max(x, window_.x0 + 1) - 1, u1 = std::min(x + 2, window_.x1);
    const uint32_t v0 = std::max(y, first_ + 1) - 1, v1 = std::min(y + 2, last_);
    const uint32_t count = (u1 - u0) * (v1 - v0) - 1;
    if (count == 0) return at(x, y);
    Rgb sum{0, 0, 0};
    for (uint32_t v = v0; v < v1; ++v)
      for (uint32_t u = u0; u < u1; ++u)
        if (u != x || v != y) sum += at(u, v);
    return sum * (1.0f / static_cast<float>(count));
  }

 private:
  FilmWindow window_;
  uint32_t first_, last_;
  std::vector<Rgb> rows_;
};

// Relative squared error of a pixel, mean of its channels.
double pixel_error(const Film& film, const Means& means, uint32_t x, uint32_t y, double share_product) {
  const Rgb a = film.half_pixel(0, x, y), b = film.half_pixel(1, x, y), mean = means.at(x, y),
            around = means.around(x, y);
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    const double difference = double{channel(a, c)} - channel(b, c);
    const double value = std::min(std::fabs(channel(mean, c)), std::fabs(channel(around, c)));
    sum += share_product * difference * difference / (value * value + kRelativeErrorEpsilon);
  }
  return sum / 3;
}

Sums sum_rows(const Film& film, uint32_t y0, uint32_t y1, double share_product) {
  const Means means(film, y0, y1);
  Sums sums;
  for (uint32_t y = y0; y < y1; ++y)
    for (uint32_t x = film.shape().window.x0; x < film.shape().window.x1; ++x) {
      const double error = pixel_error(film, means, x, y, share_product);
      sums.errors += error, sums.squares += error * error;
    }
  return sums;
}

}  // namespace

double ErrorEstimate::relative_error() const { return std::sqrt(rel_mse); }
double ErrorEstimate::relative_error_bound() const { return std::sqrt(rel_mse + kBoundDeviations * standard_error); }

std::optional<ErrorEstimate> estimate_error(const Film& film) {
  if (film.half_samples(0) == 0 || film.half_samples(1) == 0) return std::nullopt;
  const double share = static_cast<double>(film.half_samples(0)) / film.samples();
  const FilmWindow& w = film.shape().window;
  std::vector<Sums> blocks(block_count(w.height(), kBlockRows));
  parallel_blocks(w.height(), kBlockRows, [&](size_t block, size_t first, size_t last) {
    blocks[block] =
        sum_rows(film, w.y0 + static_cast<uint32_t>(first), w.y0 + static_cast<uint32_t>(last), share * (1 - share));
  });
  Sums sums;
  for (const Sums& block : blocks) sums.errors += block.errors, sums.squares += block.squares;
  const auto pixels = static_cast<double>(film.shape().pixel_count());
  const double mean = sums.errors / pixels;
  const double variance = std::max(0.0, sums.squares / pixels - mean * mean);
  return ErrorEstimate{mean, std::sqrt(variance / pixels)};
}

}  // namespace spillway::pipeline
