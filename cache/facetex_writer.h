#pragma once

// Writes a .facetex file, face after face, with its coarser levels.
//
// Owns: the file under its temporary name.
// Memory: tag pack: 24 bytes a face, 16 a tile; for each image (level of a class) a row of tiles (of narrow faces: a row
//         of faces) and a chunk of kChunkBytes; kBatchBytes of tiles to compress; in add_face, the face and a third.
// Threads: one caller; tiles are compressed on all threads of the current arena.
// Fails: the file's errors; the first is final. Destruction without finish() leaves nothing behind.
// Order: the bytes depend on what was said and in which order, not on threads.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cache/facetex_file.h"
#include "cache/facetex_texel.h"

namespace spillway::cache {

struct FaceTextureShape {
  std::string name;  // cut to 63 bytes
  FaceShape shape = FaceShape::quad;
  FaceBorder u_border = FaceBorder::clamp, v_border = FaceBorder::clamp;
  std::vector<FaceInfo> faces;  // constant ones are given as one texel
};

class FaceTexWriter {
 public:
  static constexpr size_t kChunkBytes = 256 << 10;  // tiles of an image that follow each other in the file
  static constexpr size_t kBatchBytes = 4 << 20;

  static Result<std::unique_ptr<FaceTexWriter>> create(const std::filesystem::path& path, const FaceTexFormat& format,
                                                       IoPurpose purpose = IoPurpose::pack);

  ~FaceTexWriter();

  // The next texture; its faces follow, in order. Errors for faces that name wrong neighbours.
  Status begin_texture(FaceTextureShape texture);
  // 2^(ulog2 + vlog2) texels row by row from v = 0, or one of a constant face.
  Status add_face(std::span<const std::byte> texels);
  // The same of several faces, whose coarser levels are made on all threads of the current arena.
  Status add_faces(std::span<const std::vector<std::byte>> faces);
  // Every face of the last texture given: writes tables and commits.
  Status finish();

  [[nodiscard]] uint32_t texture_count() const { return static_cast<uint32_t>(textures_.size()); }
  [[nodiscard]] const FaceTexFormat& format() const { return format_; }
  [[nodiscard]] const FaceTexTexture& texture(uint32_t index) const { return textures_[index]; }
  [[nodiscard]] uint64_t written_bytes() const { return file_.size_bytes(); }

 private:
  struct Image;
  struct RawTile {
    Image* image;
    std::vector<std::byte> texels;
  };
  FaceTexWriter(WriteFile file, const FaceTexFormat& format);
  using Coarser = std::vector<std::vector<std::byte>>;  // levels 1 and up
  Status end_texture();
  Status check_face(uint64_t face, std::span<const std::byte> texels) const;
  [[nodiscard]] Coarser coarser_levels(const FaceInfo& face, std::span<const std::byte> texels) const;
  Status put_levels(std::span<const std::byte> texels, const Coarser& coarser);
  std::vector<std::unique_ptr<Image>>& class_of(const FaceInfo& face);
  Status put_face(Image& image, uint32_t number, std::span<const std::byte> texels);
  Status put_band(Image& image);
  Status compress_batch();
  Status write_chunk(Image& image);
  void add_to_mean(std::span<const std::byte> texel);

  WriteFile file_;
  FaceTexFormat format_;
  FaceTexDecoder decoder_;
  std::vector<FaceTexTexture> textures_;
  std::vector<FaceInfo> faces_;
  std::vector<uint32_t> numbers_;
  std::map<std::pair<uint32_t, uint32_t>, std::vector<std::unique_ptr<Image>>> classes_;  // by size; a class's levels
  std::vector<RawTile> batch_;
  size_t batch_bytes_ = 0;
  double mean_[4] = {0, 0, 0, 0};
};

}  // namespace spillway::cache
