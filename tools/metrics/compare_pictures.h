#pragma once

// All metrics of two pictures, and the verdict.

#include <optional>
#include <string>
#include <vector>

#include "cache/base/result.h"
#include "tools/metrics/image_metrics.h"
#include "tools/metrics/picture.h"
#include "tools/metrics/statistical_equality.h"

namespace spillway::tools {

// What makes two pictures equal: every limit that is set. With none set: equal bits, or, when both files carry half
// buffers, statistical equality.
struct CompareLimits {
  bool same_bits = false;
  bool statistical = false;
  std::optional<double> rel_mse = {}, flip = {};  // at most
  std::optional<double> correlation = {};         // of block means, at least
  std::optional<double> mean_deviation = {};      // |mean ratio - 1|, at most
  [[nodiscard]] bool any() const {
    return same_bits || statistical || rel_mse || flip || correlation || mean_deviation;
  }
};

struct ComparePicturesOptions {
  CompareLimits limits = {};
  float exposure_stops = 0;  // for FLIP only
  int block_size = 32;       // pixels a side, of the block means
  EqualityOptions equality = {};
  std::vector<Rectangle> excluded = {};  // passed over by everything but the comparison of bits
};

struct PictureComparison {
  double mse = 0, rel_mse = 0, mean_ratio = 1, flip_mean = 0;
  std::optional<double> reference_noise;  // noise_rel_mse of b, when it has half buffers: its part of rel_mse
  LargestDifference largest;
  BlockComparison blocks;
  uint64_t differing_pixels = 0, not_finite_pixels = 0;
  std::optional<EqualityReport> equality;  // when both have half buffers
  std::vector<float> flip;                 // a value a pixel
  bool equal = false;
  std::string reason;  // the limit that was missed, or what was found equal
};

// Fails when the pictures cannot be compared: sizes differ, or a limit asks for half buffers that are not there.
Result<PictureComparison> compare_pictures(const Picture& a, const Picture& b, const ComparePicturesOptions& options);

}  // namespace spillway::tools
