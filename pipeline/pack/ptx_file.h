#pragma once

// Reads .ptx files (the format of wdas/ptex, version 1.x): a small image for each face of a mesh.
//
// Owns: the open file and its tables.
// Memory: 20 bytes and a texel a face, 12 bytes a face and level; what texels() returns.
// Threads: const after open().
// Fails: `file: byte n: what`, for any file cut short or inconsistent, and before memory is taken that the file's size
//        does not justify (deflate packs at most 1032 to 1) or that is above Options::memory_limit_bytes.
// Left out: metadata, which is skipped.
//
// Format, little endian: PtxHeader; PtxExtraHeader (as much of it as header_size says); the faces' FaceInfo, deflated;
// one texel a face (its constant or its mean), deflated; PtxLevel[level_count]; the levels; metadata; eight bytes;
// large metadata; edits, each a type byte and a size. Level 0 has the faces in order at full resolution; level n has
// those of the n times halved faces that the writer kept, ordered by their smaller size, largest first (a constant face
// counts as two texels), equal ones as in the file. A level is a deflated table of block headers (30 bits of size, 2 of
// encoding), then the blocks: a texel; texels deflated, channel after channel, perhaps as differences; or tiles, each
// such a block.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/face_layout.h"
#include "cache/file.h"

namespace spillway::pipeline {

struct PtxInfo {
  cache::FaceShape shape = cache::FaceShape::quad;
  cache::FaceTexelType type = cache::FaceTexelType::uint8;
  uint32_t channels = 0;
  int32_t alpha_channel = -1;  // -1: none
  cache::FaceBorder u_border = cache::FaceBorder::clamp, v_border = cache::FaceBorder::clamp;
};

class PtxFile {
 public:
  struct Options {
    bool premultiply = false;  // texels of full resolution by their alpha; those of lower ones always are
    uint64_t memory_limit_bytes = 4ull << 30;
  };
  static Result<PtxFile> open(const std::filesystem::path& path, Options options);
  static Result<PtxFile> open(const std::filesystem::path& path) { return open(path, Options{}); }

  [[nodiscard]] const PtxInfo& info() const { return info_; }
  [[nodiscard]] std::span<const cache::FaceInfo> faces() const { return faces_; }
  [[nodiscard]] uint32_t texel_bytes() const { return info_.channels * cache::texel_type_bytes(info_.type); }
  // A constant face's texel; of others the mean, rounded.
  [[nodiscard]] std::span<const std::byte> constant(uint32_t face) const;

  // 2^(ulog2 + vlog2) texels, row by row from v = 0, channels side by side; at most the face's own resolution.
  // Where the file has no such reduction, it is made as the reference library does, rounding down at every step.
  [[nodiscard]] Result<std::vector<std::byte>> texels(uint32_t face, uint32_t ulog2, uint32_t vlog2) const;
  [[nodiscard]] Result<std::vector<std::byte>> texels(uint32_t face) const {
    return texels(face, faces_[face].ulog2, faces_[face].vlog2);
  }

 private:
  struct Header;
  struct Extra;
  struct Block {
    uint64_t offset = 0;
    uint32_t header = 0;
    [[nodiscard]] uint32_t size_bytes() const { return header & 0x3fffffffu; }
    [[nodiscard]] uint32_t encoding() const { return header >> 30; }
  };

  explicit PtxFile(cache::ReadFile file) : file_(std::move(file)) {}
  [[nodiscard]] Error damaged(uint64_t offset, std::string_view what) const;
  template <class T>
  Result<T> read(uint64_t offset, uint64_t end) const;
  Status inflate_at(uint64_t offset, uint64_t zipped_bytes, std::span<std::byte> out) const;
  Status check_expansion(uint64_t offset, uint64_t zipped_bytes, uint64_t unpacked_bytes) const;
  Status check_faces(uint64_t offset) const;
  Status read_header(Header& header);
  Status read_faces(const Header& header, uint64_t faces_offset, uint64_t constants_offset);
  Status read_levels(const Header& header, uint64_t infos_offset, uint64_t levels_offset);
  Status read_blocks(uint64_t offset, uint64_t zipped_bytes, uint64_t end, std::span<Block> blocks) const;
  Status read_edits(uint64_t offset, uint64_t end);
  Status read_edit(uint64_t offset, uint64_t end);
  void number_by_size();

  Result<std::vector<std::byte>> block_texels(const Block& block, uint32_t ulog2, uint32_t vlog2,
                                              bool may_be_tiled) const;
  Status flat_texels(const Block& block, uint32_t ulog2, uint32_t vlog2, std::span<std::byte> out) const;
  Status tiled_texels(const Block& block, uint32_t ulog2, uint32_t vlog2, std::span<std::byte> out) const;
  Result<std::vector<std::byte>> reduced(uint32_t face, uint32_t ulog2, uint32_t vlog2) const;
  void multiply_by_alpha(std::span<std::byte> texels) const;

  cache::ReadFile file_;
  Options options_;
  PtxInfo info_;
  std::vector<cache::FaceInfo> faces_;
  std::vector<std::byte> constants_;
  std::vector<uint32_t> number_by_size_;  // of each face, in levels above 0
  std::vector<std::vector<Block>> levels_;
};

}  // namespace spillway::pipeline
