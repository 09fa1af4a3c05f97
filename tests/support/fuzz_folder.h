#pragma once

// A folder for the files of one fuzzer, gone at the end of the process. In memory where the system has a place for that:
// a fuzzer writes a file for every input.

#include <filesystem>
#include <string_view>

namespace spillway::test {

class FuzzFiles {
 public:
  FuzzFiles();
  ~FuzzFiles();
  FuzzFiles(const FuzzFiles&) = delete;
  FuzzFiles& operator=(const FuzzFiles&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const char* name, std::string_view bytes) const;

 private:
  std::filesystem::path path_;
};

const FuzzFiles& fuzz_folder();

}  // namespace spillway::test
