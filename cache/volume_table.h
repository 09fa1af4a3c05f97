#pragma once

// What stays in memory of volumes: where their bricks are, and the largest value of each cell.
//
// Memory: 4 bytes a brick of a grid's box, present or not, and 4 bytes a cell of the bricks that are.
// Threads: plain arrays; const after they were made.

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "cache/volume_brick.h"

namespace spillway::cache {

struct VolumeGrid {
  int32_t corner[3];  // lattice point where brick (0, 0, 0) begins; multiples of kVolumeAlignmentVoxels
  int32_t brick_count[3];
  int32_t brick_voxels;
  uint32_t first_entry;  // in the entries: one for each brick of the box, x fastest
  uint32_t first_brick;  // bricks of a grid are consecutive in the file
  uint32_t brick_total;  // that are there
  uint32_t first_cell;   // in the cells: those of the first brick
  float value_max;
};
static_assert(sizeof(VolumeGrid) == 48);

// Where a brick is in the file.
struct VolumeBrickLocation {
  uint64_t offset_bytes;
  uint64_t size_bytes;
};

inline constexpr uint32_t kNoBrick = 0xffffffffu;

struct VolumeTables {
  std::span<const VolumeGrid> grids;
  std::span<const uint32_t> entries;  // brick number, or kNoBrick: all zero
  std::span<const float> cell_max;
  std::span<const VolumeBrickLocation> bricks;

  // cell: counted from the grid's corner; must lie in its box.
  [[nodiscard]] uint32_t brick_of(const VolumeGrid& grid, const std::array<int32_t, 3>& cell) const {
    const int by = brick_shift(grid);
    return entries[grid.first_entry + static_cast<uint32_t>(((cell[2] >> by) * grid.brick_count[1] + (cell[1] >> by)) *
                                                                grid.brick_count[0] +
                                                            (cell[0] >> by))];
  }
  [[nodiscard]] float majorant(const VolumeGrid& grid, uint32_t brick, const std::array<int32_t, 3>& cell) const {
    const int by = brick_shift(grid), last = (1 << by) - 1;
    const auto inside = static_cast<uint32_t>(((cell[2] & last) << by | (cell[1] & last)) << by | (cell[0] & last));
    return cell_max[grid.first_cell + ((brick - grid.first_brick) << 3 * by) + inside];
  }

 private:
  // Bricks have 1, 2, 4 or 8 cells an edge.
  [[nodiscard]] static int brick_shift(const VolumeGrid& grid) {
    return std::countr_zero(static_cast<uint32_t>(grid.brick_voxels / kCellVoxels));
  }
};

// The same tables while they grow.
struct VolumeTablesBuilder {
  std::vector<VolumeGrid> grids;
  std::vector<uint32_t> entries;
  std::vector<float> cell_max;
  std::vector<VolumeBrickLocation> bricks;

  // Adds a grid whose samples lie in [lower, upper); its bricks (validated) follow with add_brick().
  void begin_grid(const int32_t (&lower)[3], const int32_t (&upper)[3], int32_t brick_voxels);
  // Fails for a brick outside the grid, or one that is there already.
  Status add_brick(const VolumeBrickView& brick, const VolumeBrickLocation& location, std::string_view where);
  [[nodiscard]] VolumeTables view() const { return {grids, entries, cell_max, bricks}; }
};

// Everything a walk will follow. `where` names the manifest.
Status validate_volume_tables(const VolumeTables& tables, std::string_view where);

}  // namespace spillway::cache
