#pragma once

// How far two pictures are apart. All functions take pictures of equal size and a mask of one byte a pixel (0: pass
// over); sums are made in double, row by row: the same numbers every time.

#include <cstdint>
#include <span>
#include <vector>

#include "tools/metrics/picture.h"

namespace spillway::tools {

// Mean over pixels and channels of (a - b)^2.
[[nodiscard]] double mse(const Picture& a, const Picture& b, std::span<const uint8_t> mask);

// Mean over pixels and channels of (a - b)^2 / (b^2 + 0.01), b the reference (Rousselle et al. 2011, with its epsilon).
[[nodiscard]] double rel_mse(const Picture& a, const Picture& b, std::span<const uint8_t> mask);

// rel_mse that a picture with half buffers is expected to have by its own noise: to be taken off what is measured against
// it as the reference.
[[nodiscard]] double noise_rel_mse(const Picture& picture, std::span<const uint8_t> mask);

// Mean of a over mean of b, over pixels and channels.
[[nodiscard]] double mean_ratio(const Picture& a, const Picture& b, std::span<const uint8_t> mask);

struct LargestDifference {
  float value = 0;
  int x = 0, y = 0, channel = 0;
};
[[nodiscard]] LargestDifference largest_difference(const Picture& a, const Picture& b, std::span<const uint8_t> mask);

// Pixels whose bits differ in any channel (-0 and 0 differ, equal NaNs do not). Takes no mask.
[[nodiscard]] uint64_t differing_pixels(const Picture& a, const Picture& b);
[[nodiscard]] uint64_t not_finite_pixels(const Picture& picture);

// Means of blocks of size x size pixels; blocks less than half inside the mask are left out.
struct BlockComparison {
  size_t block_count = 0;
  double scale = 1;               // least squares: a is about scale * b
  double correlation = 1;         // Pearson, of the block means of all channels; 1 when neither varies
  double relative_deviation = 0;  // root mean square of a - scale * b, over the mean of scale * b
};
[[nodiscard]] BlockComparison compare_blocks(const Picture& a, const Picture& b, std::span<const uint8_t> mask,
                                             int size);

}  // namespace spillway::tools
