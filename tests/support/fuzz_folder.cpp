#include "tests/support/fuzz_folder.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <string>

namespace spillway::test {

FuzzFiles::FuzzFiles() {
  std::string name = (std::filesystem::temp_directory_path() / "spillway_fuzz_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) std::abort();
  path_ = name;
}

FuzzFiles::~FuzzFiles() {
  std::error_code code;
  std::filesystem::remove_all(path_, code);
}

std::filesystem::path FuzzFiles::write(const char* name, std::string_view bytes) const {
  std::ofstream(path_ / name, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return path_ / name;
}

const FuzzFiles& fuzz_folder() {
  static const FuzzFiles folder;
  return folder;
}

}  // namespace spillway::test
