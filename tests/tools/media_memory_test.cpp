// Grids that a scene gives or describes are never held whole while it is packed.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tests/support/small_scene.h"

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which hold more than the program

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;

// Of all that a process of its own holds while it packs the scene: a maximum that the system keeps.
uint64_t peak_of_packing(const fs::path& scene) {
  const std::string store = scene.string() + ".store";
  const pid_t child = fork();
  if (child == 0) {
    execl(SPILLWAY_PROGRAM, SPILLWAY_PROGRAM, "pack", "-q", "-o", store.c_str(), scene.c_str(), nullptr);
    _exit(127);
  }
  int status = 0;
  rusage used{};
  EXPECT_EQ(wait4(child, &status, 0, &used), child);
  EXPECT_EQ(status, 0) << scene;
  EXPECT_TRUE(fs::remove_all(store) > 0);
  return static_cast<uint64_t>(used.ru_maxrss) << 10;
}

// A medium whose samples are all different from their neighbours, and a triangle.
void write_scene(const fs::path& path, const std::string& medium, const std::string& list, size_t count) {
  std::ofstream out(path);
  out << "WorldBegin\nMakeNamedMedium \"m\" \"string type\" " << medium;
  if (count > 0) out << " \"" << list << "\" [";
  for (size_t i = 0; i < count; ++i) out << i % 7 << ' ';
  if (count > 0) out << ']';
  out << "\nShape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n";
}

// Samples of 42 to 64 MiB within 32 MiB of what a grid of a few takes: slabs of 6 to 10 MiB, and a MiB or three a
// stream.
TEST(MediaMemory, given_grids_are_never_held_whole) {
  struct Kind {
    const char *type, *list;
    size_t channels, side;
  };
  const test::TemporaryDirectory directory;
  const fs::path scene = directory.path() / "scene.pbrt";
  for (const Kind& kind : {Kind{"uniformgrid", "float density", 1, 224}, Kind{"rgbgrid", "rgb sigma_s", 3, 160}}) {
    const auto peak = [&](size_t side) {
      const std::string counts =
          fmt::format("\"{}\" \"integer nx\" {} \"integer ny\" {} \"integer nz\" {}", kind.type, side, side, side);
      write_scene(scene, counts, kind.list, kind.channels * side * side * side);
      return peak_of_packing(scene);
    };
    const uint64_t little = peak(2);
    EXPECT_LT(peak(kind.side), little + (32 << 20)) << kind.type;
  }
}

TEST(MediaMemory, clouds_are_never_held_whole) {
  const test::TemporaryDirectory directory;
  const fs::path scene = directory.path() / "scene.pbrt";
  const auto peak = [&](const char* frequency) {
    write_scene(scene, fmt::format("\"cloud\" \"float frequency\" {}", frequency), "", 0);
    return peak_of_packing(scene);
  };
  const uint64_t little = peak("0.1");  // 16 samples an axis, then 256
  EXPECT_LT(peak("8"), little + (32 << 20));
}

}  // namespace
}  // namespace spillway::tools

#endif
