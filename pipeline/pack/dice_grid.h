#pragma once

// Triangles of one quad whose sides are cut into different numbers of pieces, all powers of two.
//
// The quad is a grid of u() x v() cells. A point of the grid that lies on a side, but is none of the side's own points,
// is taken to the nearest of those; triangles that lose their area go. Thus each piece of a side belongs to exactly one
// triangle, whatever the other sides do, and no triangle turns over: the cell at each corner is cut from that corner, so
// that both of its triangles keep a point inside.

#include <algorithm>
#include <cstdint>
#include <vector>

namespace spillway::pipeline {

// Side 0 runs along v = 0, side 1 along u = 1, side 2 along v = 1, side 3 along u = 0.
struct QuadRates {
  uint32_t side[4];
  [[nodiscard]] uint32_t u() const { return std::max(side[0], side[2]); }
  [[nodiscard]] uint32_t v() const { return std::max(side[1], side[3]); }
  [[nodiscard]] uint32_t grid_index(uint32_t i, uint32_t j) const { return j * (u() + 1) + i; }
  [[nodiscard]] uint32_t grid_size() const { return (u() + 1) * (v() + 1); }
};

[[nodiscard]] uint64_t triangle_count(const QuadRates& rates);
// Appends three indices of the grid a triangle, counterclockwise in (u, v).
void dice_quad(const QuadRates& rates, std::vector<uint32_t>& corners);

}  // namespace spillway::pipeline
