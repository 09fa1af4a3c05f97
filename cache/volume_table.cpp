#include "cache/volume_table.h"

#include <algorithm>
#include <cmath>

namespace spillway::cache {
namespace {

int32_t floor_to(int32_t x, int32_t step) { return (x >= 0 ? x / step : -((-x + step - 1) / step)) * step; }

// 64 bit: counts from a damaged file must not overflow.
uint64_t entry_count(const VolumeGrid& grid) {
  return uint64_t{static_cast<uint32_t>(grid.brick_count[0])} * static_cast<uint32_t>(grid.brick_count[1]) *
         static_cast<uint32_t>(grid.brick_count[2]);
}

bool is_possible_box(const VolumeGrid& grid) {
  const int32_t voxels = grid.brick_voxels;
  if (!is_brick_size(voxels)) return false;
  for (int a = 0; a < 3; ++a)
    if (grid.corner[a] < -kMaxLattice || grid.corner[a] > kMaxLattice || grid.corner[a] % kVolumeAlignmentVoxels != 0 ||
        grid.brick_count[a] <= 0 || grid.brick_count[a] > 2 * kMaxLattice / voxels)
      return false;
  return entry_count(grid) <= INT32_MAX;  // what brick_of() counts in
}

Status validate_grid(const VolumeTables& tables, const VolumeGrid& grid, std::string_view where, size_t index) {
  if (!is_possible_box(grid) || grid.first_entry + entry_count(grid) > tables.entries.size())
    return error("{}: volume {}: its box is impossible; pack the scene again", where, index);
  if (uint64_t{grid.first_brick} + grid.brick_total > tables.bricks.size() ||
      grid.first_cell + uint64_t{grid.brick_total} * brick_cell_count(grid.brick_voxels) > tables.cell_max.size())
    return error("{}: volume {}: has bricks that are not there; pack the scene again", where, index);
  if (!(grid.value_max >= 0 && grid.value_max < INFINITY))
    return error("{}: volume {}: its largest value is {}; pack the scene again", where, index, grid.value_max);
  for (uint64_t e = 0; e < entry_count(grid); ++e) {
    const uint32_t brick = tables.entries[grid.first_entry + e];
    if (brick != kNoBrick && (brick < grid.first_brick || brick - grid.first_brick >= grid.brick_total))
      return error("{}: volume {}: entry {} names brick {}; pack the scene again", where, index, e, brick);
  }
  return {};
}

}  // namespace

void VolumeTablesBuilder::begin_grid(const int32_t (&lower)[3], const int32_t (&upper)[3], int32_t brick_voxels) {
  VolumeGrid grid{};
  grid.brick_voxels = brick_voxels;
  for (int a = 0; a < 3; ++a) {
    grid.corner[a] = floor_to(lower[a], kVolumeAlignmentVoxels);
    grid.brick_count[a] = (std::max(upper[a], lower[a] + 1) - grid.corner[a] + brick_voxels - 1) / brick_voxels;
  }
  grid.first_entry = static_cast<uint32_t>(entries.size());
  grid.first_brick = static_cast<uint32_t>(bricks.size());
  grid.first_cell = static_cast<uint32_t>(cell_max.size());
  entries.resize(entries.size() + entry_count(grid), kNoBrick);
  grids.push_back(grid);
}

Status VolumeTablesBuilder::add_brick(const VolumeBrickView& brick, const VolumeBrickLocation& location,
                                      std::string_view where) {
  VolumeGrid& grid = grids.back();
  const VolumeBrickHeader& header = brick.header();
  int32_t at[3];
  for (int a = 0; a < 3; ++a) {
    at[a] = (header.corner[a] - grid.corner[a]) / grid.brick_voxels;
    if (header.voxels != grid.brick_voxels || header.corner[a] < grid.corner[a] || at[a] >= grid.brick_count[a])
      return error("{}: a brick at ({}, {}, {}) lies outside of its grid", where, header.corner[0], header.corner[1],
                   header.corner[2]);
  }
  uint32_t& entry = entries[grid.first_entry +
                            static_cast<uint32_t>((at[2] * grid.brick_count[1] + at[1]) * grid.brick_count[0] + at[0])];
  if (entry != kNoBrick)
    return error("{}: two bricks at ({}, {}, {})", where, header.corner[0], header.corner[1], header.corner[2]);
  entry = static_cast<uint32_t>(bricks.size());
  bricks.push_back(location);
  ++grid.brick_total;
  cell_max.insert(cell_max.end(), brick.cell_max().begin(), brick.cell_max().end());
  grid.value_max = std::max(grid.value_max, *std::max_element(brick.cell_max().begin(), brick.cell_max().end()));
  return {};
}

Status validate_volume_tables(const VolumeTables& tables, std::string_view where) {
  for (size_t g = 0; g < tables.grids.size(); ++g) SPILLWAY_TRY(validate_grid(tables, tables.grids[g], where, g));
  for (size_t b = 0; b < tables.bricks.size(); ++b) {
    const VolumeBrickLocation& brick = tables.bricks[b];
    if (brick.offset_bytes % kVolumeBrickAlignment != 0 || brick.size_bytes == 0 ||
        brick.size_bytes % kVolumeBrickAlignment != 0 ||
        brick.size_bytes > brick_size_bytes(kMaxBrickVoxels, VoxelType::single_float, 3))
      return error("{}: brick {} cannot be {} bytes at {}; pack the scene again", where, b, brick.size_bytes,
                   brick.offset_bytes);
  }
  const auto is_bad = [](float x) { return !(x >= 0 && x < INFINITY); };
  if (const auto at = std::find_if(tables.cell_max.begin(), tables.cell_max.end(), is_bad); at != tables.cell_max.end())
    return error("{}: cell {} of the volumes: its largest value is {}; pack the scene again", where,
                 at - tables.cell_max.begin(), *at);
  return {};
}

}  // namespace spillway::cache
