#include "tests/support/damage.h"

#include <fcntl.h>
#include <unistd.h>

namespace spillway::test {
namespace {

bool flip_bit(int descriptor, uint64_t offset_bytes) {
  const auto offset = static_cast<off_t>(offset_bytes);
  unsigned char byte = 0;
  if (pread(descriptor, &byte, 1, offset) != 1) return false;
  byte ^= 0x10;
  return pwrite(descriptor, &byte, 1, offset) == 1 && fdatasync(descriptor) == 0;
}

}  // namespace

bool damage_scratch_file(const std::filesystem::path& directory, uint64_t offset_bytes) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code code;
    const std::string target = std::filesystem::read_symlink(entry.path(), code);
    if (code || !target.starts_with(directory.string() + "/") || !target.ends_with(" (deleted)")) continue;
    // Opened anew, without direct I/O and its alignment.
    const int descriptor = open(entry.path().c_str(), O_RDWR | O_CLOEXEC);
    if (descriptor < 0) continue;
    const bool flipped = flip_bit(descriptor, offset_bytes);
    close(descriptor);
    return flipped;
  }
  return false;
}

}  // namespace spillway::test
