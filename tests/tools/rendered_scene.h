#pragma once

// What the program (SPILLWAY_PROGRAM) makes of a scene, with both half-buffers, so that its noise is known.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "tests/support/small_scene.h"
#include "tools/metrics/picture.h"

namespace spillway::tools {

inline Picture rendered(const char* program, const std::filesystem::path& scene, int samples) {
  const test::TemporaryDirectory directory;
  const std::string out = directory.path() / "out.exr";
  const std::string command = fmt::format("{} render {} --store {} -o {} --spp {} --half-buffers -q", program,
                                          scene.string(), (directory.path() / "a.store").string(), out, samples);
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  auto picture = read_picture(out);
  EXPECT_TRUE(picture) << picture.error().message;
  return picture ? *picture : Picture{};
}

}  // namespace spillway::tools
