#pragma once

// The bricks of a volume: boxes of samples of a sparse grid, each ready to interpolate by itself.
//
// Samples sit on lattice points (integers); between them a value is trilinear, outside of all bricks it is zero. A
// brick covers [corner, corner + voxels) in lattice units and holds voxels + 1 samples an axis: those of its far sides
// again. Cells are cubes of 8 lattice units, aligned to multiples of 8 whatever the bricks; each has the largest of its
// samples, of all channels: a volume has one, or three for a colour.
//
// Format, little endian, each brick at a 4096-aligned offset, size_bytes a multiple of 4096 (zeros at the end):
//   VolumeBrickHeader
//   float cell_max[(voxels / 8)^3]     x fastest
//   half or float samples[channels][(voxels + 1)^3], x fastest
// A file of bricks holds nothing else; bricks without a sample other than zero are left out.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/base/vec.h"

namespace spillway::cache {

inline constexpr uint32_t kVolumeBrickMagic = 0x42565053;  // "SPVB"
inline constexpr uint32_t kVolumeBrickVersion = 2;
inline constexpr uint32_t kVolumeBrickAlignment = 4096;
inline constexpr int32_t kCellVoxels = 8;
inline constexpr int32_t kMaxBrickVoxels = 64;
// Corners of bricks are multiples of this, for bricks of every size, so that cells are the same cells.
inline constexpr int32_t kVolumeAlignmentVoxels = kMaxBrickVoxels;
// Coordinates beyond this would lose their fraction in a float.
inline constexpr int32_t kMaxLattice = 1 << 20;

enum class VoxelType : uint32_t { half_float, single_float };

struct VolumeBrickHeader {
  uint32_t magic;
  uint32_t version;
  uint64_t checksum;  // XXH3 of everything after this field, to size_bytes
  uint64_t size_bytes;
  int32_t corner[3];  // multiples of `voxels`
  int32_t voxels;     // 8, 16, 32 or 64
  VoxelType type;
  uint32_t channels;  // 1 or 3
};
static_assert(sizeof(VolumeBrickHeader) == 48);

[[nodiscard]] constexpr bool is_brick_size(int32_t voxels) {
  return voxels == 8 || voxels == 16 || voxels == 32 || voxels == kMaxBrickVoxels;
}
[[nodiscard]] constexpr uint32_t brick_cell_count(int32_t voxels) {
  const auto cells = static_cast<uint32_t>(voxels / kCellVoxels);
  return cells * cells * cells;
}
[[nodiscard]] constexpr uint32_t brick_sample_count(int32_t voxels) {
  const auto side = static_cast<uint32_t>(voxels + 1);
  return side * side * side;
}
[[nodiscard]] uint64_t brick_size_bytes(int32_t voxels, VoxelType type, uint32_t channels = 1);

// Samples (voxels + 1)^3, x fastest, finite; of three channels one after the other. Values that are not halves are
// rounded to them with half_float.
Buffer<std::byte> build_volume_brick(const std::array<int32_t, 3>& corner, int32_t voxels, VoxelType type,
                                     std::span<const float> samples);

// Checks everything a reader will follow. `where` names file and brick.
Status validate_volume_brick(std::span<const std::byte> brick, std::string_view where);

// A validated brick. Points into the caller's bytes.
class VolumeBrickView {
 public:
  VolumeBrickView() = default;
  explicit VolumeBrickView(std::span<const std::byte> brick);
  [[nodiscard]] explicit operator bool() const { return header_ != nullptr; }
  [[nodiscard]] const VolumeBrickHeader& header() const { return *header_; }
  [[nodiscard]] std::span<const float> cell_max() const { return {cells_, brick_cell_count(header_->voxels)}; }
  // x fastest, (voxels + 1)^3 of them a channel.
  [[nodiscard]] float sample(uint32_t index) const;
  // Trilinear at a point of the brick, in lattice units; points outside are taken to its side. The same bits from
  // every brick that covers the point. Of the first channel; as a colour, one channel is grey.
  [[nodiscard]] float interpolate(Float3 lattice) const;
  [[nodiscard]] Rgb interpolate_color(Float3 lattice) const;

 private:
  struct Place {
    uint32_t row;
    float f[3];
  };
  [[nodiscard]] Place place(Float3 lattice) const;
  [[nodiscard]] float interpolate(const Place& place, uint32_t channel) const;

  const VolumeBrickHeader* header_ = nullptr;
  const float* cells_ = nullptr;
  const std::byte* samples_ = nullptr;
};

}  // namespace spillway::cache
