#pragma once

// Reads .facetex files: many face textures of one kind of texel in one file (docs/facetex.md).
//
// Owns: the open file and its tables. Memory: of the tag given, 24 bytes a face and 16 a tile.
// Threads: const after open(); any number may read tiles at once.
// Fails: `file: byte n: what`, for a file cut short, changed or inconsistent; nothing is taken on a count's word: tables
//        lie in the file, and are checked against its size first.
//
// Format, little endian:
//   FaceTexFront                        at byte 0
//   tiles                               compressed, in any order; those of an image in chunks that follow each other
//   FaceTexTexture[texture_count]       at textures_offset, 8-aligned; the tables follow each other without gaps
//   FaceTexClass[class_count]           ascending by (ulog2, vlog2)
//   FaceInfo[face_count]                texture after texture; neighbours are counted from the texture's first face
//   uint32[face_count]                  a face's number in its class
//   zeros to a multiple of 8
//   FaceTexTile[tile_count]             image after image, row after row
//   FaceTexTrailer                      the last bytes of the file
// A class holds the faces of one size; constant faces are in class (0, 0), whatever their size. It has an image for
// each level 0 .. max(ulog2, vlog2), in which each of its faces has 2^max(ulog2-level, 0) x 2^max(vlog2-level, 0)
// texels. Images lie one after the other, by class, then level. Face number n of an image whose faces have w x h texels
// has its texel (0, 0) in column (n % per_row) * w and row n / per_row * h, where per_row = max(1, edge / w) of a tile's
// edge, which is 32, 64 or 128. The image is max(w, edge) texels wide and cut into tiles of edge x edge; beyond the last
// face tiles are zero.

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/face_layout.h"
#include "cache/facetex_codec.h"
#include "cache/file.h"

namespace spillway::cache {

inline constexpr char kFaceTexMagic[8] = {'S', 'P', 'W', 'F', 'T', 'E', 'X', '\n'};
inline constexpr uint32_t kFaceTexVersion = 2;
// Of the edges that tiles may have; 64 texels are what is chosen by measurement (bench/RESULTS.md).
inline constexpr uint32_t kLeastFaceTileLog2 = 5, kFaceTileLog2 = 6, kMostFaceTileLog2 = 7;

// How texels are to be understood: linear = texel, the sRGB curve of it, or texel^gamma. Alpha and floats are linear.
enum class FaceTexEncoding : uint32_t { linear, srgb, gamma };

struct FaceTexFormat {
  FaceTexelType type = FaceTexelType::uint8;
  uint32_t channels = 3;       // 1 to 4
  int32_t alpha_channel = -1;  // or none; colours are multiplied by it
  FaceTexEncoding encoding = FaceTexEncoding::linear;
  float gamma = 1;  // of FaceTexEncoding::gamma
  FaceTexCodec codec = FaceTexCodec::lz4;
  uint32_t tile_log2 = kFaceTileLog2;  // of a tile's edge; lookups have the same bits whatever it is
  auto operator<=>(const FaceTexFormat&) const = default;

  [[nodiscard]] uint32_t texel_bytes() const { return channels * texel_type_bytes(type); }
  [[nodiscard]] uint32_t tile_edge() const { return 1u << tile_log2; }
  [[nodiscard]] size_t tile_bytes() const { return size_t{texel_bytes()} << 2 * tile_log2; }
};

struct FaceTexFront {
  char magic[8];
  uint32_t version;
  uint32_t reserved;
};
static_assert(sizeof(FaceTexFront) == 16);

struct FaceTexTexture {
  uint64_t first_face;
  uint32_t face_count;
  FaceShape shape;
  FaceBorder u_border, v_border;
  float mean[4];  // of its faces' means, linear
  char name[64];  // ends in a zero
};
static_assert(sizeof(FaceTexTexture) == 104);

struct FaceTexClass {
  uint32_t ulog2, vlog2;
  uint64_t face_count;
};
static_assert(sizeof(FaceTexClass) == 16);

struct FaceTexTile {
  uint64_t offset;
  uint32_t size_bytes;
  uint32_t checksum;  // the lower half of XXH3 of its bytes in the file
};
static_assert(sizeof(FaceTexTile) == 16);

struct FaceTexTrailer {
  uint64_t checksum;         // XXH3 of the rest of the trailer
  uint64_t tables_checksum;  // of the bytes from textures_offset to the trailer
  uint64_t textures_offset;
  uint64_t face_count, tile_count;
  uint32_t texture_count, class_count;
  FaceTexFormat format;  // 28 bytes
  uint32_t version;
  uint32_t reserved[6];
  char magic[8];
};
static_assert(sizeof(FaceTexFormat) == 28 && sizeof(FaceTexTrailer) == 112);

// One level of one class.
struct FaceTexImage {
  uint32_t class_index = 0, level = 0;
  uint32_t ulog2 = 0, vlog2 = 0;  // of its faces
  uint64_t face_count = 0;
  uint32_t width = 0, height = 0;  // texels
  uint64_t first_tile = 0, tile_count = 0;
  uint32_t tile_log2 = kFaceTileLog2;

  [[nodiscard]] uint32_t tiles_across() const { return width >> tile_log2; }
  [[nodiscard]] uint32_t faces_per_row() const { return 1u << faces_per_row_log2(); }
  [[nodiscard]] uint32_t faces_per_row_log2() const { return ulog2 < tile_log2 ? tile_log2 - ulog2 : 0; }
  // Of a face's texel (0, 0).
  [[nodiscard]] uint32_t x_of(uint32_t number) const { return (number & (faces_per_row() - 1)) << ulog2; }
  [[nodiscard]] uint32_t y_of(uint32_t number) const { return number >> faces_per_row_log2() << vlog2; }
  // The tile, of the file, that texel (x, y) lies in.
  [[nodiscard]] uint64_t tile_at(uint32_t x, uint32_t y) const {
    return first_tile + uint64_t{y >> tile_log2} * tiles_across() + (x >> tile_log2);
  }
};

[[nodiscard]] constexpr uint32_t reduced_log2(uint32_t log2, uint32_t level) { return log2 > level ? log2 - level : 0; }

// The images of a class; false when one would be larger than images can be.
[[nodiscard]] bool append_images(uint32_t class_index, const FaceTexClass& of, uint32_t tile_log2,
                                 std::vector<FaceTexImage>& images);

class FaceTexFile {
 public:
  struct Options {
    MemoryTag tag = MemoryTag::textures;
    IoPurpose purpose = IoPurpose::textures;
    bool direct = false;  // bypass the page cache where possible; whole pages are read then
  };
  static Result<FaceTexFile> open(const std::filesystem::path& path, Options options);
  [[nodiscard]] static bool is_face_tex(const std::filesystem::path& path);

  [[nodiscard]] const std::filesystem::path& path() const { return file_.path(); }
  [[nodiscard]] const FaceTexFormat& format() const { return format_; }
  [[nodiscard]] std::span<const FaceTexTexture> textures() const { return textures_; }
  [[nodiscard]] std::span<const FaceTexClass> classes() const { return classes_; }
  [[nodiscard]] std::span<const FaceTexImage> images() const { return images_; }
  [[nodiscard]] std::span<const FaceTexTile> tiles() const { return tiles_; }
  // Of a texture.
  [[nodiscard]] std::span<const FaceInfo> faces(const FaceTexTexture& t) const {
    return std::span<const FaceInfo>(faces_).subspan(t.first_face, t.face_count);
  }
  [[nodiscard]] std::span<const uint32_t> numbers(const FaceTexTexture& t) const {
    return std::span<const uint32_t>(numbers_).subspan(t.first_face, t.face_count);
  }
  // The image of level 0 of a face's class; those of its other levels follow.
  [[nodiscard]] uint32_t first_image(const FaceInfo& face) const {
    return face.flags & kFaceIsConstant ? image_of_[0] : image_of_[face.ulog2 << 4 | face.vlog2];
  }
  [[nodiscard]] uint64_t tables_bytes() const;

  // Tile `number` of the file, decoded.
  Status read_tile(uint64_t number, std::span<std::byte> out) const;
  // The same of bytes that read() brought.
  Status decode_tile(uint64_t number, std::span<const std::byte> packed, std::span<std::byte> out) const;
  Status read(uint64_t offset, std::span<std::byte> bytes) const { return file_.read(offset, bytes); }
  [[nodiscard]] uint64_t size_bytes() const { return file_.size_bytes(); }
  // Of what is read at least, and at a time.
  [[nodiscard]] uint64_t block_bytes() const { return file_.direct_effective() ? kDirectAlignment : 1; }
  // The texels of a face at a level, row by row from v = 0.
  Result<std::vector<std::byte>> texels(const FaceTexTexture& texture, uint32_t face, uint32_t level) const;

 private:
  explicit FaceTexFile(ReadFile file) : file_(std::move(file)) {}
  [[nodiscard]] Error damaged(uint64_t offset, std::string_view what) const;
  Status read_trailer(FaceTexTrailer& trailer) const;
  Status read_tables(const FaceTexTrailer& trailer, MemoryTag tag);
  Status make_images(const FaceTexTrailer& trailer);
  Status check_faces(const FaceTexTrailer& trailer) const;
  Status check_tiles(const FaceTexTrailer& trailer) const;

  ReadFile file_;
  FaceTexFormat format_;
  Buffer<FaceTexTexture> textures_;
  Buffer<FaceTexClass> classes_;
  Buffer<FaceInfo> faces_;
  Buffer<uint32_t> numbers_;
  Buffer<FaceTexTile> tiles_;
  std::vector<FaceTexImage> images_;
  uint32_t image_of_[256] = {};
};

}  // namespace spillway::cache
