#pragma once

// Unpacks a gzip file into an unnamed temporary file, which takes no memory and is gone when it is closed.
//
// Fails: what is no gzip file, is damaged or cut short; a temporary folder that is full.

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cache/base/result.h"

namespace spillway::tools {

struct CloseFile {
  void operator()(std::FILE* stream) const { std::fclose(stream); }
};
using FileStream = std::unique_ptr<std::FILE, CloseFile>;

struct UnpackedFile {
  FileStream stream;  // at its beginning
  uint64_t size_bytes = 0;
};
Result<UnpackedFile> gunzip(const std::filesystem::path& file);

}  // namespace spillway::tools
