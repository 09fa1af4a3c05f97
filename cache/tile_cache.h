#pragma once

// The process's one tile cache of OpenImageIO, and what its users count.
//
// Owns: nothing of the library's; a TileCache is one user of it, with its files and counters.
// Memory: the library's limit on tiles, set by the latest user, in which what threads keep at hand is counted, a
//         quarter of it at most; 35 bits a tile, tag textures.
// Threads: each thread has a TileThread, and fetches through it; begin_wave(), note_first_users() and
//         counters() while no thread fetches.
// Fails: fetch() gives null when a tile cannot be read; failure() says why.

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/facetex_source.h"

namespace spillway::cache {

inline constexpr uint32_t kTileSize = 64;  // of packed images; files of face textures have theirs

// Bytes are those in files: compressed where tiles are. A tile that several textures share counts for the one that
// touches it first.
struct TextureCounters {
  uint64_t lookups = 0;
  uint64_t tiles_touched = 0, unique_bytes = 0;  // since the cache was opened, each tile once
  uint64_t tiles_read = 0, bytes_read = 0;
  uint64_t wave_tiles_touched = 0, wave_unique_bytes = 0;  // each tile once a wave, summed over waves
  uint64_t tiles_read_again = 0;                           // in one wave: there was no room for the wave's tiles
  uint64_t wave_decoded_bytes = 0;                         // of the tiles touched in this wave: room enough for it
};
TextureCounters& operator+=(TextureCounters& a, const TextureCounters& b);
// What was counted since.
[[nodiscard]] TextureCounters gained(TextureCounters now, const TextureCounters& before);

// A file of tiles as its user sees it.
struct TileFile {
  std::string path;
  void* handle = nullptr;   // the library's
  uint64_t first_tile = 0;  // in the user's numbering
  uint64_t tile_bytes = 0;  // decoded
  const FaceTexFile* face_tex = nullptr;
};

class TileCache;

// What one thread keeps at hand.
class TileThread {
 public:
  // More than a block's neighbours touch; fewer where the limit is small, see TileCache::held_tiles().
  static constexpr size_t kHeldTiles = 64, kLeastHeldTiles = 4;

  explicit TileThread(TileCache& cache);
  TileThread(const TileThread&) = delete;
  TileThread& operator=(const TileThread&) = delete;
  ~TileThread();

  // Call before a block of lookups.
  void begin_block();
  // Who asks from here on, where first users are noted.
  void set_user(uint64_t user) { user_ = user; }
  // Pixels of the tile at (x, y), number `number`; null when it cannot be read. `owner`: whose counters it goes to.
  const std::byte* tile(const TileFile& file, uint32_t subimage, uint32_t level, uint32_t x, uint32_t y,
                        uint64_t number, uint32_t owner) {
    const Held& held = held_[number & held_mask_];
    if (held.number == number && held.wave == wave_) return held.pixels;
    return fetch(file, subimage, level, x, y, number, owner);
  }
  // Its pixels when this thread has it at hand, else null: for prefetching alone.
  [[nodiscard]] const std::byte* at_hand(uint64_t number) const {
    const Held& held = held_[number & held_mask_];
    return held.number == number ? held.pixels : nullptr;
  }
  std::vector<TextureCounters> counters;  // by owner

 private:
  struct Held {
    uint64_t number = UINT64_MAX;
    uint64_t wave = 0;
    void* tile = nullptr;
    const std::byte* pixels = nullptr;
  };
  const std::byte* fetch(const TileFile& file, uint32_t subimage, uint32_t level, uint32_t x, uint32_t y,
                         uint64_t number, uint32_t owner);

  TileCache& cache_;
  void* perthread_ = nullptr;
  uint64_t wave_ = 0, held_mask_, user_ = UINT64_MAX;
  std::array<Held, kHeldTiles> held_;
};

class TileCache {
 public:
  static constexpr int kOpenHandles = 64;

  // Sets the library's limit on decoded tiles; a MiB at least.
  explicit TileCache(uint64_t tile_limit_bytes);
  ~TileCache();
  TileCache(const TileCache&) = delete;
  TileCache& operator=(const TileCache&) = delete;

  // A tiled image of `levels` levels, one channel of which takes texel_bytes; checked against what the file says.
  struct ImageShape {
    uint32_t width, height, channels, texel_bytes;
  };
  Result<TileFile> add_image(const std::string& path, const ImageShape& shape, uint64_t tile_count);
  // A source must live longer than this.
  Result<TileFile> add_face_tex(const FaceTexSource& source);

  // All files added: takes the tables that count; those of reads by tile (tag trace_log) when a log is kept.
  void begin(uint32_t owner_count, bool is_logged);
  void begin_wave();
  // From here on: the least user who looks into each tile is written there, by tile, unless a lesser one is. A lookup
  // then tells of every tile, also of those at hand. Empty: nobody asks.
  void note_first_users(std::span<uint64_t> by_tile) { first_users_ = by_tile; }
  [[nodiscard]] uint64_t tile_count() const { return tile_count_; }
  // That a thread keeps at hand: a power of two.
  [[nodiscard]] uint64_t held_tiles() const { return held_tiles_; }
  // Of the wave under way, while no thread fetches: a bit for each tile that was touched; and, when a log is kept, how
  // often each tile was read from its file.
  [[nodiscard]] std::span<const uint64_t> touched_in_wave() const { return touched_in_wave_; }
  [[nodiscard]] std::span<const uint32_t> reads_in_wave() const { return reads_of_tile_; }
  void log_read(uint64_t number, uint32_t times) {
    if (!reads_of_tile_.empty()) std::atomic_ref(reads_of_tile_[number]).fetch_add(times, std::memory_order_relaxed);
  }
  // A guess: it was in use within as many reads as the limit holds tiles, or nothing has had to leave yet. One that is
  // held and thought to be gone is read for nothing; one that is gone and thought to be held is read by itself.
  [[nodiscard]] bool probably_holds(uint64_t number, uint64_t tile_bytes) const;
  bool is_full();  // tiles have had to leave, or soon will
  [[nodiscard]] std::unique_ptr<TileThread> make_thread() { return std::make_unique<TileThread>(*this); }
  [[nodiscard]] std::string failure() const;

 private:
  friend class TileThread;
  static bool set(Buffer<uint64_t>& bits, uint64_t number);  // whether it was
  void note_user(uint64_t number, uint64_t user);

  std::vector<std::string> paths_;
  uint64_t limit_bytes_, tile_count_ = 0, largest_tile_bytes_ = 1, held_tiles_ = TileThread::kHeldTiles;
  uint32_t owner_count_ = 0;
  bool is_full_ = false;  // as of the last is_full()
  std::atomic<uint64_t> wave_{0};
  Buffer<uint64_t> touched_, touched_in_wave_, read_in_wave_;  // a bit a tile
  Buffer<uint32_t> used_at_;                                   // a tile: reads_ when it was last fetched
  Buffer<uint32_t> reads_of_tile_;                             // in this wave; none without a log
  std::span<uint64_t> first_users_;
  std::atomic<uint32_t> reads_{1};
};

}  // namespace spillway::cache
