#pragma once

// Segments in grids that wait for densities, and the points at which these are wanted.

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/render/medium_segment.h"

namespace spillway::pipeline {

// A point of a segment: where to look, or, once that was done, what is there.
struct ListedPoint {
  Float3 lattice;
  shading::CellStep step;

  [[nodiscard]] Rgb value() const { return {lattice.x, lattice.y, lattice.z}; }
  void set_value(Rgb value) { lattice = {value.r, value.g, value.b}; }
};
static_assert(sizeof(ListedPoint) == 24);

// Consecutive points of a list in one brick that is not in memory.
struct BrickPoints {
  uint32_t brick, first, count;
};

// What the points of a segment are asked for.
enum class Waiting : uint8_t { to_end, to_pass, at_end };

struct WaitingSegment {
  MediumSegment segment;
  uint32_t ray = 0;
  Waiting waiting = Waiting::to_end;  // to_pass: a shadow ray, which goes through all of it; at_end: of EndPlaces
  bool is_open = false;               // more points may come behind the listed ones
  uint32_t first_point = 0, point_count = 0;
  WalkPlace place{};
  shading::Collisions so_far{};
};

// Segments, and their points: those of a segment are consecutive, front to back.
struct PointList {
  std::vector<WaitingSegment> segments;
  std::vector<ListedPoint> points;
  std::vector<BrickPoints> runs;

  [[nodiscard]] uint64_t size_bytes() const;
  // Once, so that lists do not move while they grow: pages that are never touched cost nothing.
  void reserve(uint64_t limit_bytes);
  void append(const PointList& other);
  void clear() { segments.clear(), points.clear(), runs.clear(); }
};

}  // namespace spillway::pipeline
