#include "tools/metrics/image_metrics.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "pipeline/render/estimate_error.h"

namespace spillway::tools {
namespace {

float channel(const Rgb& c, int i) { return i == 0 ? c.r : i == 1 ? c.g : c.b; }

// Calls body(pixel, channel, value of a, value of b) inside the mask.
template <class Body>
void for_values(const Picture& a, const Picture& b, std::span<const uint8_t> mask, const Body& body) {
  for (size_t i = 0; i < a.pixels.size(); ++i)
    for (int c = 0; mask[i] && c < 3; ++c) body(i, c, channel(a.pixels[i], c), channel(b.pixels[i], c));
}

template <class Error>
double mean_error(const Picture& a, const Picture& b, std::span<const uint8_t> mask, const Error& of) {
  double sum = 0;
  uint64_t count = 0;
  for_values(a, b, mask, [&](size_t, int, double va, double vb) { sum += of(va, vb), ++count; });
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

bool same_bits(const Rgb& a, const Rgb& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

// Means of one block: a's and b's three channels, one pair each.
void add_block(const Picture& a, const Picture& b, std::span<const uint8_t> mask, const Rectangle& block,
               std::vector<std::pair<double, double>>& means) {
  double sums_a[3] = {}, sums_b[3] = {};
  int count = 0, all = 0;
  for (int y = block.y0; y < block.y1; ++y)
    for (int x = block.x0; x < block.x1; ++x) {
      const size_t i = a.index(x, y);
      ++all;
      if (!mask[i]) continue;
      ++count;
      for (int c = 0; c < 3; ++c) sums_a[c] += channel(a.pixels[i], c), sums_b[c] += channel(b.pixels[i], c);
    }
  if (2 * count < all) return;
  for (int c = 0; c < 3; ++c) means.emplace_back(sums_a[c] / count, sums_b[c] / count);
}

double correlation(const std::vector<std::pair<double, double>>& pairs) {
  double mean_a = 0, mean_b = 0, aa = 0, bb = 0, ab = 0;
  for (const auto& [a, b] : pairs) mean_a += a, mean_b += b;
  mean_a /= static_cast<double>(pairs.size()), mean_b /= static_cast<double>(pairs.size());
  for (const auto& [a, b] : pairs) {
    aa += (a - mean_a) * (a - mean_a), bb += (b - mean_b) * (b - mean_b), ab += (a - mean_a) * (b - mean_b);
  }
  if (aa == 0 && bb == 0) return 1;
  return aa == 0 || bb == 0 ? 0 : ab / std::sqrt(aa * bb);
}

}  // namespace

double mse(const Picture& a, const Picture& b, std::span<const uint8_t> mask) {
  return mean_error(a, b, mask, [](double va, double vb) { return (va - vb) * (va - vb); });
}

double rel_mse(const Picture& a, const Picture& b, std::span<const uint8_t> mask) {
  return mean_error(a, b, mask,
                    [](double va, double vb) { return (va - vb) * (va - vb) / (vb * vb + pipeline::kRelativeErrorEpsilon); });
}

double noise_rel_mse(const Picture& picture, std::span<const uint8_t> mask) {
  Picture moved = picture;  // by what the halves differ
  for (size_t i = 0; i < moved.pixels.size(); ++i) moved.pixels[i] += picture.half_a[i] - picture.half_b[i];
  return picture.weight_a * (1 - picture.weight_a) * rel_mse(moved, picture, mask);
}

double mean_ratio(const Picture& a, const Picture& b, std::span<const uint8_t> mask) {
  double sum_a = 0, sum_b = 0;
  for_values(a, b, mask, [&](size_t, int, double va, double vb) { sum_a += va, sum_b += vb; });
  return sum_a == sum_b ? 1 : sum_a / sum_b;
}

LargestDifference largest_difference(const Picture& a, const Picture& b, std::span<const uint8_t> mask) {
  LargestDifference largest;
  for_values(a, b, mask, [&](size_t i, int c, float va, float vb) {
    const float difference = std::fabs(va - vb);
    if (difference <= largest.value) return;
    const auto width = static_cast<size_t>(a.width);
    largest = {difference, static_cast<int>(i % width), static_cast<int>(i / width), c};
  });
  return largest;
}

uint64_t differing_pixels(const Picture& a, const Picture& b) {
  uint64_t count = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) count += !same_bits(a.pixels[i], b.pixels[i]);
  return count;
}

uint64_t not_finite_pixels(const Picture& picture) {
  return static_cast<uint64_t>(
      std::count_if(picture.pixels.begin(), picture.pixels.end(), [](const Rgb& c) { return !is_finite(c); }));
}

BlockComparison compare_blocks(const Picture& a, const Picture& b, std::span<const uint8_t> mask, int size) {
  std::vector<std::pair<double, double>> means;
  for (int y = 0; y < a.height; y += size)
    for (int x = 0; x < a.width; x += size)
      add_block(a, b, mask, {x, y, std::min(x + size, a.width), std::min(y + size, a.height)}, means);
  BlockComparison result;
  result.block_count = means.size() / 3;
  if (means.empty()) return result;
  double ab = 0, bb = 0, b_sum = 0, squares = 0;
  for (const auto& [ma, mb] : means) ab += ma * mb, bb += mb * mb, b_sum += mb;
  result.scale = bb > 0 ? ab / bb : 1;
  for (const auto& [ma, mb] : means) squares += (ma - result.scale * mb) * (ma - result.scale * mb);
  const auto count = static_cast<double>(means.size());
  result.relative_deviation = squares == 0 ? 0 : std::sqrt(squares / count) / std::fabs(result.scale * b_sum / count);
  result.correlation = correlation(means);
  return result;
}

}  // namespace spillway::tools
