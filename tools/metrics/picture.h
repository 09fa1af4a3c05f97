#pragma once

// A picture in memory, as the metrics see it: linear RGB, with the half buffers when the file has them.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "cache/base/result.h"
#include "cache/base/vec.h"

namespace spillway::tools {

struct Picture {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;          // row by row of the data window
  std::vector<Rgb> half_a, half_b;  // empty, or as many: means over independent samples, pixel = their weighted mean
  double weight_a = 0.5;            // share of half A's samples
  std::string image_hash;           // of the integer film; empty when the file says none
  [[nodiscard]] bool has_halves() const { return !half_a.empty(); }
  [[nodiscard]] size_t index(int x, int y) const { return static_cast<size_t>(y) * width + x; }
};

// Any format that OpenImageIO reads. Images of eight bits are taken as sRGB, others as linear; grey is spread to RGB.
Result<Picture> read_picture(const std::filesystem::path& path);

// Pixels [x0, x1) x [y0, y1).
struct Rectangle {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

// One byte a pixel: 1 where metrics look, 0 inside an excluded rectangle and where either picture is not finite.
std::vector<uint8_t> metric_mask(const Picture& a, const Picture& b, std::span<const Rectangle> excluded);

// Values in [0, 1] as a PNG in a perceptual ramp from black over red and yellow to white.
Status write_heat_png(const std::filesystem::path& path, int width, int height, std::span<const float> values);

}  // namespace spillway::tools
