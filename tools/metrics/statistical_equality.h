#pragma once

// Are two noisy pictures pictures of the same thing? Answered from their half buffers, which say how noisy they are.
//
// Method: with half buffers A and B of independent samples, w the share of A's samples, the pixel w A + (1 - w) B has
// the variance w (1 - w) (A - B)^2 in expectation: an estimate of one degree of freedom. Estimates are pooled over a
// block (for its mean) or over the 5 x 5 neighbours (for a pixel); the difference of the pictures over its standard
// error is then Student distributed, with the degrees of freedom of Welch and Satterthwaite. Every channel of every
// block and pixel is tested at the level that Sidak's correction gives for the whole; besides, no more than
// kLargestCluster connected pixels may each be improbable, which finds seams that no single pixel betrays.

#include <cstdint>
#include <span>

#include "tools/metrics/picture.h"

namespace spillway::tools {

inline constexpr int kLargestCluster = 4;

struct EqualityOptions {
  double significance = 0.01;  // chance that equal pictures are called different, by blocks and by pixels each
  int block_size = 8;
};

struct EqualityReport {
  bool equal = false;
  double least_block_p = 1;  // not corrected
  double least_pixel_p = 1;
  double block_level = 0;  // Sidak: p below this in any test is a difference
  double pixel_level = 0;
  uint64_t failing_blocks = 0;  // channels counted apart
  uint64_t failing_pixels = 0;
  int largest_cluster = 0;       // connected pixels with p below 0.001 each
  int worst_x = 0, worst_y = 0;  // centre of the least probable block
};

// Both pictures must have half buffers and equal size.
[[nodiscard]] EqualityReport statistical_equality(const Picture& a, const Picture& b, std::span<const uint8_t> mask,
                                                  const EqualityOptions& options = {});

// Probability of a |t| at least this large under Student's distribution with `freedom` > 0 degrees of freedom.
[[nodiscard]] double student_two_sided(double t, double freedom);

// Level of one of `count` tests so that all together err with probability `significance` (Sidak 1967).
[[nodiscard]] double sidak_level(double significance, uint64_t count);

}  // namespace spillway::tools
