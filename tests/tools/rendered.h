#pragma once

// Pictures of the program, with half buffers, and their means with what these are worth.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/support/small_scene.h"
#include "tools/metrics/picture.h"

namespace spillway::tools {

inline Picture rendered(const std::filesystem::path& scene, int samples) {
  const test::TemporaryDirectory directory;
  const std::string out = directory.path() / "out.exr";
  const std::string command = fmt::format(SPILLWAY_PROGRAM " render {} --store {} -o {} --spp {} --half-buffers -q",
                                          scene.string(), (directory.path() / "a.store").string(), out, samples);
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  auto picture = read_picture(out);
  EXPECT_TRUE(picture) << picture.error().message;
  return picture ? *picture : Picture{};
}

struct Mean {
  double value = 0, standard_error = 0;
};
inline Mean mean_of(const Picture& p) {
  Mean mean;
  double variance = 0;
  for (size_t i = 0; i < p.pixels.size(); ++i) {
    mean.value += luminance(p.pixels[i]);
    const double d = luminance(p.half_a[i]) - luminance(p.half_b[i]);
    variance += p.weight_a * (1 - p.weight_a) * d * d;
  }
  const auto count = static_cast<double>(p.pixels.size());
  return {mean.value / count, std::sqrt(variance) / count};
}

}  // namespace spillway::tools
