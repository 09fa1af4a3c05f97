#include "tests/support/fuzz_folder.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace spillway::test {

FuzzFiles::FuzzFiles() {
  for (const std::filesystem::path& parent :
       {std::filesystem::path("/dev/shm"), std::filesystem::temp_directory_path()}) {
    std::string name = (parent / "spillway_fuzz_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) continue;
    path_ = name;
    return;
  }
  std::abort();
}

FuzzFiles::~FuzzFiles() {
  std::error_code code;
  std::filesystem::remove_all(path_, code);
}

std::filesystem::path FuzzFiles::write(const char* name, std::string_view bytes) const {
  std::filesystem::path path = path_ / name;
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) std::abort();
  const ssize_t written = ::write(file, bytes.data(), bytes.size());
  ::close(file);
  if (written != static_cast<ssize_t>(bytes.size())) std::abort();
  return path;
}

const FuzzFiles& fuzz_folder() {
  static const FuzzFiles folder;
  return folder;
}

}  // namespace spillway::test
