#pragma once

// A .facetex file as OpenImageIO reads it: an ImageInput of ours, one subimage for each level of each class.
//
// Owns: while it lives, the file under its path in this process: every ImageInput that opens the path reads through it.
// (One that opens another path, as a plugin's does, opens the file itself.)
// Memory: tag textures: the file's tables, and what is staged, at most the limits given for what is read and for what was.
// Threads: read_tile by any number at once, also while what begin_stage() found is read; begin_stage() and turn_stage()
//          while no other call runs.
// Fails: read errors and damaged tiles, with the byte; OpenImageIO is told the same.

#include <functional>
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
  // How to read these tiles, ascending and each once, compressed, and beside what is staged: those that follow each
  // other in runs of up to kRunBytes, to be read in any order, by any number of threads. Direct reads bring whole blocks,
  // straight into their place; a run goes on as long as no block lies between its tiles. What is beyond `limit_bytes`
  // is left to read_tile.
  struct Stage {
    size_t tile_count = 0;  // of those given, the first
    uint64_t bytes = 0;  // of memory, which are those read
    std::vector<std::function<Status()>> reads;
  };
  [[nodiscard]] Stage begin_stage(std::span<const uint64_t> tiles, uint64_t limit_bytes);
  // They have been read: read_tile finds them, and no longer those before.
  void turn_stage();

 private:
  explicit FaceTexSource(FaceTexFile file) : file_(std::move(file)) {}

  FaceTexFile file_;
  struct Place {
    uint64_t tile, at;
  };
  struct Staged {
    Buffer<std::byte> bytes;
    std::vector<Place> places;  // ascending by tile
    [[nodiscard]] const std::byte* find(uint64_t tile) const;  // null: it is not there
  };
  Staged staged_, next_staged_;
};

// OpenImageIO's ImageInput::Creator, and what it makes: an OIIO::ImageInput*.
void* make_facetex_input();

}  // namespace spillway::cache
