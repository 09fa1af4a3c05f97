#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace spillway::test {

// All of a file; nothing of one that is not there.
[[nodiscard]] inline std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace spillway::test
