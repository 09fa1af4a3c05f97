#include "cache/volume_brick.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "cache/base/check.h"
#include "cache/base/hash.h"

namespace spillway::cache {
namespace {

constexpr uint64_t kChecksummedFrom = offsetof(VolumeBrickHeader, size_bytes);

uint64_t sample_bytes(VoxelType type) { return type == VoxelType::half_float ? 2 : 4; }

uint16_t half_from_float(float x) {
  return static_cast<uint16_t>(_mm_cvtsi128_si32(_mm_cvtps_ph(_mm_set_ss(x), _MM_FROUND_TO_NEAREST_INT)));
}
float float_from_half(uint16_t x) { return _cvtsh_ss(x); }

uint64_t samples_offset(int32_t voxels) {
  return sizeof(VolumeBrickHeader) + uint64_t{brick_cell_count(voxels)} * sizeof(float);
}

// The largest sample that interpolation in each cell may use, as it is stored, where what was there is not larger.
void find_cell_maxima(std::span<const float> samples, int32_t voxels, float* cell_max) {
  const int32_t side = voxels + 1;
  for (int32_t z = 0; z < voxels; z += kCellVoxels)
    for (int32_t y = 0; y < voxels; y += kCellVoxels)
      for (int32_t x = 0; x < voxels; x += kCellVoxels) {
        float largest = 0;
        for (int32_t k = z; k <= z + kCellVoxels; ++k)
          for (int32_t j = y; j <= y + kCellVoxels; ++j) {
            const float* row = samples.data() + (k * side + j) * side;
            for (int32_t i = x; i <= x + kCellVoxels; ++i) largest = std::max(largest, row[i]);
          }
        *cell_max = std::max(*cell_max, largest);
        ++cell_max;
      }
}

Status validate_header(std::span<const std::byte> brick, std::string_view where) {
  VolumeBrickHeader header;
  if (brick.size() < sizeof header)
    return error("{}: a brick of {} bytes is shorter than its header; pack the scene again", where, brick.size());
  std::memcpy(&header, brick.data(), sizeof header);
  if (header.magic != kVolumeBrickMagic) return error("{}: byte 0: is no brick of a volume", where);
  if (header.version != kVolumeBrickVersion)
    return error("{}: byte 4: a brick of version {}, this program reads version {}; pack the scene again", where,
                 header.version, kVolumeBrickVersion);
  if (header.size_bytes != brick.size())
    return error("{}: byte 16: a brick should have {} bytes but {} are there; pack the scene again", where,
                 header.size_bytes, brick.size());
  if (header.checksum != checksum(brick.data() + kChecksummedFrom, brick.size() - kChecksummedFrom))
    return error("{}: byte 8: the checksum of a brick does not match; pack the scene again", where);
  if (!is_brick_size(header.voxels) || header.type > VoxelType::single_float ||
      (header.channels != 1 && header.channels != 3) ||
      brick.size() != brick_size_bytes(header.voxels, header.type, header.channels))
    return error("{}: byte 36: a brick cannot have {} voxels an edge in {} bytes; pack the scene again", where,
                 header.voxels, brick.size());
  for (const int32_t corner : header.corner)
    if (corner % header.voxels != 0 || corner < -kMaxLattice || corner > kMaxLattice)
      return error("{}: byte 24: a brick cannot begin at {}; pack the scene again", where, corner);
  return {};
}

}  // namespace

uint64_t brick_size_bytes(int32_t voxels, VoxelType type, uint32_t channels) {
  const uint64_t used = samples_offset(voxels) + channels * brick_sample_count(voxels) * sample_bytes(type);
  return (used + kVolumeBrickAlignment - 1) / kVolumeBrickAlignment * kVolumeBrickAlignment;
}

Buffer<std::byte> build_volume_brick(const std::array<int32_t, 3>& corner, int32_t voxels, VoxelType type,
                                     std::span<const float> samples) {
  SPILLWAY_CHECK(is_brick_size(voxels), ==, true);
  const size_t per_channel = brick_sample_count(voxels);
  const uint32_t channels = samples.size() == per_channel ? 1 : 3;
  SPILLWAY_CHECK(samples.size(), ==, channels * per_channel);
  Buffer<std::byte> brick(MemoryTag::pack, brick_size_bytes(voxels, type, channels));
  VolumeBrickHeader header{
      kVolumeBrickMagic, kVolumeBrickVersion, 0, brick.size(), {corner[0], corner[1], corner[2]}, voxels, type,
      channels};
  auto* cells = reinterpret_cast<float*>(brick.data() + sizeof header);
  std::byte* stored = brick.data() + samples_offset(voxels);
  for (uint32_t c = 0; c < channels; ++c)
    find_cell_maxima(samples.subspan(c * per_channel, per_channel), voxels, cells);
  if (type == VoxelType::single_float) std::memcpy(stored, samples.data(), samples.size_bytes());
  if (type == VoxelType::half_float) {
    for (size_t i = 0; i < samples.size(); ++i) {
      const uint16_t half = half_from_float(samples[i]);
      std::memcpy(stored + 2 * i, &half, sizeof half);
    }
    for (uint32_t c = 0; c < brick_cell_count(voxels); ++c) cells[c] = float_from_half(half_from_float(cells[c]));
  }
  std::memcpy(brick.data(), &header, sizeof header);
  header.checksum = checksum(brick.data() + kChecksummedFrom, brick.size() - kChecksummedFrom);
  std::memcpy(brick.data(), &header, sizeof header);
  return brick;
}

Status validate_volume_brick(std::span<const std::byte> brick, std::string_view where) {
  SPILLWAY_TRY(validate_header(brick, where));
  const VolumeBrickView view(brick);
  const auto is_bad = [](float x) { return !(x >= 0 && x < INFINITY); };
  if (std::any_of(view.cell_max().begin(), view.cell_max().end(), is_bad))
    return error("{}: a cell's largest value is negative or not finite; pack the scene again", where);
  for (uint32_t i = 0; i < view.header().channels * brick_sample_count(view.header().voxels); ++i)
    if (is_bad(view.sample(i))) return error("{}: sample {} is negative or not finite; pack the scene again", where, i);
  return {};
}

VolumeBrickView::VolumeBrickView(std::span<const std::byte> brick)
    : header_(reinterpret_cast<const VolumeBrickHeader*>(brick.data())),
      cells_(reinterpret_cast<const float*>(brick.data() + sizeof(VolumeBrickHeader))),
      samples_(brick.data() + samples_offset(header_->voxels)) {}

float VolumeBrickView::sample(uint32_t index) const {
  if (header_->type == VoxelType::half_float) {
    uint16_t half;
    std::memcpy(&half, samples_ + 2 * size_t{index}, sizeof half);
    return float_from_half(half);
  }
  float value;
  std::memcpy(&value, samples_ + 4 * size_t{index}, sizeof value);
  return value;
}

VolumeBrickView::Place VolumeBrickView::place(Float3 lattice) const {
  const int32_t voxels = header_->voxels, side = voxels + 1;
  int32_t at[3];
  Place place{};
  for (int a = 0; a < 3; ++a) {
    // The fraction is of the point alone, not of the point seen from this brick.
    const float whole = std::floor(std::clamp(lattice[a], static_cast<float>(header_->corner[a]),
                                              static_cast<float>(header_->corner[a] + voxels)));
    at[a] = std::clamp(static_cast<int32_t>(whole) - header_->corner[a], 0, voxels - 1);
    place.f[a] = std::clamp(lattice[a] - static_cast<float>(at[a] + header_->corner[a]), 0.0f, 1.0f);
  }
  place.row = static_cast<uint32_t>((at[2] * side + at[1]) * side + at[0]);
  return place;
}

float VolumeBrickView::interpolate(const Place& place, uint32_t channel) const {
  const auto dy = static_cast<uint32_t>(header_->voxels + 1), dz = dy * dy;
  const uint32_t row = channel * dz * dy + place.row;
  const auto& f = place.f;
  const auto along_x = [&](uint32_t i) { return sample(i) * (1 - f[0]) + sample(i + 1) * f[0]; };
  const float near = along_x(row) * (1 - f[1]) + along_x(row + dy) * f[1];
  const float far = along_x(row + dz) * (1 - f[1]) + along_x(row + dz + dy) * f[1];
  return near * (1 - f[2]) + far * f[2];
}

float VolumeBrickView::interpolate(Float3 lattice) const { return interpolate(place(lattice), 0); }

Rgb VolumeBrickView::interpolate_color(Float3 lattice) const {
  const Place at = place(lattice);
  if (header_->channels == 1) {
    const float grey = interpolate(at, 0);
    return {grey, grey, grey};
  }
  return {interpolate(at, 0), interpolate(at, 1), interpolate(at, 2)};
}

}  // namespace spillway::cache
