#pragma once

// LDR-FLIP: how visible the difference of two pictures is when they are flipped between on a screen.
// Based on: Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom, Fairchild, "FLIP: A Difference Evaluator for
// Alternating Images", HPG 2020: opponent-space contrast filters, HyAB distance with Hunt's effect, edges and points.

#include <vector>

#include "tools/metrics/picture.h"

namespace spillway::tools {

struct FlipOptions {
  float exposure_stops = 0;            // values are multiplied by 2^this, then clamped to [0, 1]
  double pixels_per_degree = 67.0206;  // the paper's: a 0.7 m wide screen of 3840 pixels seen from 0.7 m
};

// One value in [0, 1] a pixel: 0 no difference, 1 the largest. Pictures of equal size; not-a-number counts as 0.
[[nodiscard]] std::vector<float> flip(const Picture& a, const Picture& b, const FlipOptions& options = {});

}  // namespace spillway::tools
