#pragma once

// Packed images, looked up in blocks through OpenImageIO's tile cache.
//
// Owns: its images in the process's one OpenImageIO ImageCache; with two of these at a time the later limit holds.
// Memory: tag textures: Options::memory_limit_bytes, of which, where there are face textures, an eighth, 16 MiB at
// most, is for what is read ahead, half of it for what is being read; and bytes_beside_tiles(): what the library holds besides (about 20 KiB a file, 1 MiB
// an open handle of an image and 4 KiB a subimage of face textures) and the tables of face textures.
// Threads: look_up may be called from any number of threads at once, one block each; no lock of ours is held over I/O.
// Fails: a missing or damaged image fails open() or look_up() with the file's name; never a black texel instead.
// Bits: a value depends on the image and the request alone, not on the budget, the block or the thread.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "cache/base/ids.h"
#include "cache/base/result.h"
#include "cache/base/vec.h"
#include "cache/face_lookup.h"

namespace spillway::cache {

enum class WrapMode : uint32_t { repeat, clamp, black };
enum class TexelEncoding : uint32_t { linear, srgb };  // of the stored texels; values come out linear
enum class TexelFilter : uint32_t { point, bilinear, trilinear };

// One line a packed image, as the store's manifest holds it.
struct ImageInfo {
  char file_name[64];  // inside the store's textures folder
  uint32_t width, height, channels, levels;
  TexelEncoding encoding;
  uint32_t texel_bytes;  // of one channel: 1 (8 bit) or 4 (float)
  float mean[4];         // linear, of the finest level
  uint64_t content;      // checksum of the finest level's texels
  uint64_t not_finite;   // 1 + the number of the first texel that came infinite or as no number; 0: there is none
};

// Sizes of a level: halved and rounded down, at least one.
[[nodiscard]] constexpr uint32_t level_size(uint32_t size, uint32_t level) {
  return size >> level > 0 ? size >> level : 1;
}

// The sRGB transfer function (IEC 61966-2-1), encoded to linear.
[[nodiscard]] float linear_from_srgb(float encoded);
[[nodiscard]] float srgb_from_linear(float linear);

struct TextureRequest {
  uint32_t image;
  WrapMode wrap;
  TexelFilter filter;
  float u, v;      // v up: image row is (1 - v) * height
  float width_uv;  // footprint diameter in uv units (of the shorter image axis); 0 asks for the finest level
};

struct Texel {
  float value[4];  // linear; channels missing in the image: grey is spread to rgb, alpha is 1
};
[[nodiscard]] inline Texel spread_channels(const float* sum, uint32_t channels) {
  switch (channels) {
    case 1:
      return {{sum[0], sum[0], sum[0], 1}};
    case 2:
      return {{sum[0], sum[0], sum[0], sum[1]}};
    case 3:
      return {{sum[0], sum[1], sum[2], 1}};
    default:
      return {{sum[0], sum[1], sum[2], sum[3]}};
  }
}

// log2 of x > 0, exact at powers of two and linear between: within 0.09, and the same on every machine.
[[nodiscard]] float approximate_log2(float x);

// A file of face textures, as the store's manifest holds it.
struct FaceContainerInfo {
  char file_name[64];  // inside the store's textures folder
  uint64_t face_count, tile_count;
  uint32_t tile_bytes, image_count;
};
static_assert(sizeof(FaceContainerInfo) == 88);

// One line a face texture.
struct FaceTextureInfo {
  uint32_t container, texture;  // in that file
  uint32_t face_count;
  FaceShape shape;
  uint32_t channels;
  float mean[4];  // linear
};
static_assert(sizeof(FaceTextureInfo) == 36);

class TextureCache {
 public:
  struct Options {
    uint64_t memory_limit_bytes = 256 << 20;  // of tiles; larger: fewer are read again. A MiB at least
    bool direct = false;                      // face textures bypass the page cache where possible
    bool is_logged = false;                   // what waves read is asked for by tile: four bytes more a tile
  };
  static Result<std::unique_ptr<TextureCache>> open(const std::filesystem::path& textures_directory,
                                                    std::span<const ImageInfo> images, Options options,
                                                    std::span<const FaceContainerInfo> containers = {},
                                                    std::span<const FaceTextureInfo> face_textures = {});
  ~TextureCache();
  // A limit that never bites: all tiles of all levels decoded, and what is read ahead.
  [[nodiscard]] static uint64_t bytes_for_all(std::span<const ImageInfo> images,
                                              std::span<const FaceContainerInfo> containers = {});
  // Taken whatever the limit.
  [[nodiscard]] static uint64_t bytes_beside_tiles(std::span<const ImageInfo> images,
                                                   std::span<const FaceContainerInfo> containers);

  // values[i] answers requests[i]. Fastest when neighbours in the block share tiles. users[i]: who asks, where first
  // users are noted.
  Status look_up(std::span<const TextureRequest> requests, std::span<Texel> values,
                 std::span<const uint64_t> users = {});
  Status look_up_faces(std::span<const FaceTextureRequest> requests, std::span<Texel> values,
                       std::span<const uint64_t> users = {});
  // What lookups need and has probably not been kept, nor been staged for the lookups before, and whose it is.
  struct WantedTile {
    uint32_t container, owner;
    uint64_t tile;  // of its file
  };
  // Appends what these lookups want, some of it more than once. From any number of threads at once, while none stages.
  void append_wanted(std::span<const FaceTextureRequest> requests, std::vector<WantedTile>& wanted) const;
  // Begins to read it ahead, compressed. While no thread looks up; the lookups before may go on while it is read.
  Status begin_staging(std::vector<WantedTile> wanted);
  // Waits for it: lookups find it from here on, and no longer what was staged before. While no thread looks up.
  Status finish_staging();
  Status stage_faces(std::span<const FaceTextureRequest> requests);  // all at once
  [[nodiscard]] bool has_face_textures() const;
  // The tiles there are, which is how they are numbered.
  [[nodiscard]] static uint64_t tile_count(std::span<const ImageInfo> images,
                                           std::span<const FaceContainerInfo> containers);
  // The least of the users that look into each tile goes there, unless a lesser one is there; empty: nobody asks. While
  // no thread looks up.
  void note_first_users(std::span<uint64_t> by_tile);

  // Tiles count anew as touched and read, see TextureCounters. While no thread looks up.
  void begin_wave();
  [[nodiscard]] TextureCounters counters() const;
  // Images first, then face textures.
  [[nodiscard]] std::vector<TextureCounters> counters_by_texture() const;
  // What the wave touched and, with Options::is_logged, read so far, by tile; while no thread looks up.
  struct WaveTileUse {
    std::span<const uint64_t> touched_bits;
    std::span<const uint32_t> read_counts;
  };
  [[nodiscard]] WaveTileUse wave_tiles() const;
  // What each tile takes in its file, as TextureCounters count it.
  [[nodiscard]] std::vector<uint32_t> file_bytes_of_tiles() const;
  // The limit that would hold all tiles that the most demanding wave so far touched; and all that were ever touched.
  [[nodiscard]] uint64_t limit_for_waves() const;
  [[nodiscard]] uint64_t limit_for_touched() const;

 private:
  struct State;
  explicit TextureCache(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace spillway::cache
