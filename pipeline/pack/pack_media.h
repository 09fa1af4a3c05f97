#pragma once

// The media of a scene: said by the importer, then packed.
//
// In:     media, and the volumes they use: grids of .vdb and .nvdb files, or streams of samples.
// Out:    the media's tables; volumes.bricks, the bricks of one volume after the other.
// Memory: tag pack: a brick, and a slab of given samples, as high as a brick; files are decoded in child processes,
//         beside the limit.
// Order:  volumes as they were added; bytes depend on the samples alone.
// Fails:  as decode_volume and cut_bricks; a transform that cannot be inverted.

#include <filesystem>
#include <vector>

#include "cache/file.h"
#include "cache/volume_table.h"
#include "pipeline/medium.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::pipeline {

struct PackedMedia {
  std::vector<Medium> media;
  cache::VolumeTablesBuilder volumes;
  std::vector<Rgb> black_bodies;
};

struct PackMediaOptions {
  int32_t brick_voxels = 32;  // 8, 16, 32 or 64; larger: fewer, longer reads, and more that is read for nothing
  uint64_t memory_limit_bytes = 2ull << 30;
};

// What a scene says of its media.
class SaidMedia {
 public:
  Result<uint32_t> add_volume(const VolumeInput& volume);
  Result<uint32_t> add_medium(const MediumInput& medium);
  void set_black_bodies(std::span<const Rgb> table) { black_bodies_.assign(table.begin(), table.end()); }
  [[nodiscard]] size_t medium_count() const { return media_.size(); }
  [[nodiscard]] const std::string& name(uint32_t medium) const { return media_[medium].name; }
  [[nodiscard]] bool has_volumes() const { return !volumes_.empty(); }

  // Bricks go to `bricks`; decoders write beside it.
  Result<PackedMedia> pack(cache::WriteFile& bricks, const std::filesystem::path& bricks_path,
                           const PackMediaOptions& options) const;

 private:
  std::vector<VolumeInput> volumes_;
  std::vector<MediumInput> media_;
  std::vector<Rgb> black_bodies_;
};

}  // namespace spillway::pipeline
