#pragma once

// The cells of a regular grid that a ray passes, front to back.
//
// Where a cell begins and ends is a function of ray and cell alone, so that a walk may be taken up at any of its cells
// and finds the same ones: a grid's cells may be dealt out to bricks of any size. Based on: Amanatides and Woo 1987,
// with the planes' distances computed, not added up.

#include <array>
#include <cmath>
#include <cstdint>

#include "cache/base/hash.h"
#include "cache/base/vec.h"

namespace spillway::shading {

struct CellIndex {
  std::array<int32_t, 3> at;
  bool operator==(const CellIndex&) const = default;
};

// Cells are unit cubes: cell (i, j, k) is [i, i + 1) x [j, j + 1) x [k, k + 1).
struct CellGrid {
  std::array<int32_t, 3> count;
};

// A number for a cell that keys its random numbers; it does not depend on how far the grid goes.
[[nodiscard]] inline uint32_t cell_key(const CellIndex& c) {
  const auto bits = [&](int a) { return uint64_t{static_cast<uint32_t>(c.at[a])}; };
  return static_cast<uint32_t>(hash_combine(bits(0) << 32 | bits(1), bits(2)));
}

class GridWalk {
 public:
  // origin and direction in cells; a distance of one is one `direction`.
  GridWalk(Float3 origin, Float3 direction) : origin_(origin), direction_(direction) {
    for (int a = 0; a < 3; ++a) {
      forward_[a] = direction[a] >= 0;
      inverse_[a] = direction[a] != 0 ? 1 / direction[a] : INFINITY;
    }
  }

  struct Step {
    CellIndex cell;
    float begin, end;             // distances
    std::array<float, 3> leaves;  // where the ray passes the cell's far planes
  };

  // The first cell entered in [0, distance_max). False: none.
  bool enter(const CellGrid& grid, float distance_max, Step& step) const {
    float entry = 0, exit = distance_max;
    int entry_axis = -1;
    for (int a = 0; a < 3; ++a) {
      if (direction_[a] == 0) {
        if (!(origin_[a] >= 0 && origin_[a] < static_cast<float>(grid.count[a]))) return false;
        continue;
      }
      const float near = plane(a, forward_[a] ? 0 : grid.count[a]), far = plane(a, forward_[a] ? grid.count[a] : 0);
      if (near > entry) entry = near, entry_axis = a;
      exit = std::min(exit, far);
    }
    if (!(entry < exit)) return false;
    for (int a = 0; a < 3; ++a) {
      const float at = std::floor(origin_[a] + direction_[a] * entry);
      step.cell.at[a] = static_cast<int32_t>(std::clamp(at, 0.0f, static_cast<float>(grid.count[a] - 1)));
      if (a == entry_axis) step.cell.at[a] = forward_[a] ? 0 : grid.count[a] - 1;
    }
    resume(step.cell, entry, distance_max, step);
    return true;
  }

  // The step in `cell`, which the ray enters at `begin`.
  void resume(const CellIndex& cell, float begin, float distance_max, Step& step) const {
    step.cell = cell, step.begin = begin;
    for (int a = 0; a < 3; ++a) step.leaves[a] = leaves_at(a, cell);
    end(distance_max, step);
  }

  // The cell after `step`. False: the grid, or the segment, ends.
  bool next(const CellGrid& grid, float distance_max, Step& step) const {
    if (step.end >= distance_max) return false;
    const int axis = exit_axis(step);
    const int32_t at = step.cell.at[axis] + (forward_[axis] ? 1 : -1);
    if (at < 0 || at >= grid.count[axis]) return false;
    step.cell.at[axis] = at, step.begin = step.end;
    step.leaves[axis] = leaves_at(axis, step.cell);
    end(distance_max, step);
    return true;
  }

 private:
  [[nodiscard]] float plane(int axis, int32_t at) const {
    return (static_cast<float>(at) - origin_[axis]) * inverse_[axis];
  }
  [[nodiscard]] float leaves_at(int axis, const CellIndex& cell) const {
    return direction_[axis] == 0 ? INFINITY : plane(axis, cell.at[axis] + (forward_[axis] ? 1 : 0));
  }
  [[nodiscard]] static int exit_axis(const Step& step) {
    const auto [x, y, z] = step.leaves;
    return x <= y ? (x <= z ? 0 : 2) : (y <= z ? 1 : 2);
  }
  static void end(float distance_max, Step& step) {
    step.end = std::max(step.begin, std::min(distance_max, step.leaves[exit_axis(step)]));
  }

  Float3 origin_, direction_;
  std::array<float, 3> inverse_;
  std::array<bool, 3> forward_;
};

}  // namespace spillway::shading
