#pragma once

// Which texture tiles each wave touched, and which it read how often: the part of an access log that textures fill.
//
// Owns: the encoded sets of all waves. Memory: tag trace_log, kMemoryBytes at most and one wave's set (about a byte a
// tile of it); what is beyond lies on scratch. Threads: one at a time. Fails: a full disk.
// Format: chunks of about kChunkBytes, each of whole waves. A wave: how many tiles it touched, and the differences of
//         their ascending numbers; how many it read, and of each the difference and how often. Numbers as in
//         ascending_list.h.
//
// What was touched depends on the rays alone: the same for any budget and the same waves. What was read is this run's.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cache/base/result.h"
#include "cache/record_stream.h"
#include "cache/section_file.h"
#include "cache/texture_cache.h"

namespace spillway::pipeline {

// Of one wave, decoded.
struct WaveTiles {
  std::vector<uint64_t> touched;                    // ascending
  std::vector<std::pair<uint64_t, uint64_t>> read;  // tile, times; ascending
};

class TileLog {
 public:
  static constexpr uint64_t kMemoryBytes = 4 << 20, kChunkBytes = 1 << 20;

  // Where a wave's tiles have these bytes in files. Before the first wave.
  Status open(const std::filesystem::path& scratch_directory, std::vector<uint32_t> tile_bytes);
  [[nodiscard]] bool is_open() const { return stream_.has_value(); }
  // One wave more.
  Status append(const cache::TextureCache::WaveTileUse& use);
  // No more waves; then add_to(), for the sections of a file: tile_bytes, and tiles0, tiles1, ... of a chunk each.
  Status finish();
  void add_to(cache::SectionWriter& writer) const;

  using Visit = std::function<void(size_t wave, const WaveTiles& tiles)>;
  // The waves of such a file, which has as many of them or none; everything in it is checked.
  static Status visit(const cache::SectionReader& file, size_t wave_count, const Visit& visit);

 private:
  std::unique_ptr<cache::Scratch> scratch_;
  std::optional<cache::RecordStream<std::byte>> stream_;
  std::vector<uint32_t> tile_bytes_;
  std::vector<uint64_t> chunk_ends_;  // in the stream, of all but the last that is being filled
};

}  // namespace spillway::pipeline
