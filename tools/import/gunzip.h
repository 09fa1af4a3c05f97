#pragma once

// Reads what is in a gzip file in pieces: neither memory nor disk are taken for all of it.
//
// Fails: what is no gzip file, is damaged or cut short; what unpacks to out of proportion (a bomb).

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cache/base/result.h"

struct gzFile_s;  // zlib's

namespace spillway::tools {

struct GunzipLimits {
  uint64_t always_bytes = 1ull << 30;  // fine, however small the file
  uint64_t most_ratio = 256;           // beyond; deflate reaches 1032 on zeros, meshes hardly 50
};

class GzipFile {
 public:
  // Unpacks it once, to know that it is whole and how much there is.
  static Result<GzipFile> open(const std::filesystem::path& file, const GunzipLimits& limits = {});

  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  // The next bytes; fewer at the end, or when the file cannot be read any more.
  size_t read(void* into, size_t bytes);

 private:
  struct Close {
    void operator()(gzFile_s* file) const;
  };
  Status measure(const std::string& name, uint64_t most_bytes);

  std::unique_ptr<gzFile_s, Close> file_;
  uint64_t size_bytes_ = 0;
};

}  // namespace spillway::tools
