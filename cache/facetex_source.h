#pragma once

// A .facetex file as OpenImageIO reads it: an ImageInput of ours, one subimage for each level of each class.
//
// Owns: while it lives, the file under its path in this process: every ImageInput that opens the path reads through it.
// (One that opens another path, as a plugin's does, opens the file itself.)
// Memory: tag textures: the file's tables, and what stage() holds, at most its limit.
// Threads: read_tile by any number at once; stage() while no other call runs.
// Fails: read errors and damaged tiles, with the byte; OpenImageIO is told the same.

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "cache/facetex_file.h"

namespace spillway::cache {

// What this thread has read through sources and other inputs of ours; grows.
struct ReadTally {
  uint64_t tiles = 0, bytes = 0;
};
[[nodiscard]] ReadTally& thread_read_tally();

class FaceTexSource {
 public:
  static constexpr uint64_t kRunBytes = 256 << 10;  // of one read: below, direct reads wait rather than move

  static Result<std::shared_ptr<FaceTexSource>> open(const std::filesystem::path& path, FaceTexFile::Options options);
  ~FaceTexSource();
  FaceTexSource(const FaceTexSource&) = delete;
  FaceTexSource& operator=(const FaceTexSource&) = delete;

  [[nodiscard]] const FaceTexFile& file() const { return file_; }
  // Decoded; staged bytes first. Counts the tile in thread_read_tally(), and its bytes when they come from the file.
  Status read_tile(uint64_t number, std::span<std::byte> out) const;
  // Reads these tiles, ascending and each once, compressed: those that follow each other in runs of up to kRunBytes,
  // several at a time on the current arena's threads. Lets go of what was staged before. Returns how many were staged:
  // what is beyond `limit_bytes` is left to read_tile.
  Result<size_t> stage(std::span<const uint64_t> tiles, uint64_t limit_bytes);

 private:
  explicit FaceTexSource(FaceTexFile file) : file_(std::move(file)) {}

  FaceTexFile file_;
  Buffer<std::byte> staged_;
  std::map<uint64_t, uint64_t> staged_at_;  // tile to place
};

// OpenImageIO's ImageInput::Creator, and what it makes: an OIIO::ImageInput*.
void* make_facetex_input();

}  // namespace spillway::cache
