// The fuzzers' corpus through the fuzzers' entry functions, so that it is checked where there is no clang too.

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/fuzz/entries.h"
#include "tests/support/file_bytes.h"

namespace spillway::tools {
namespace {

using test::bytes_of;

std::vector<std::filesystem::path> corpus(const std::string& format) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(SPILLWAY_SOURCE_DIR) + "/tests/fuzz/corpus/" + format))
    files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST(FuzzCorpus, every_scene_keeps_the_importers_promises) {
  const std::vector<std::filesystem::path> files = corpus("pbrt");
  EXPECT_GE(files.size(), 30u);
  for (const auto& file : files) EXPECT_EQ(fault_of_pbrt(bytes_of(file)), "") << file;
}

TEST(FuzzCorpus, every_ply_keeps_the_readers_promises) {
  const std::vector<std::filesystem::path> files = corpus("ply");
  EXPECT_GE(files.size(), 15u);
  for (const auto& file : files) EXPECT_EQ(fault_of_ply(bytes_of(file)), "") << file;
}

}  // namespace
}  // namespace spillway::tools
