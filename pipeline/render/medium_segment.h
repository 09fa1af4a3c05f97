#pragma once

// A ray's segment inside a medium: what happens on it, as functions of numbers and of bricks that are in memory.
//
// A grid's segment falls into runs, each inside one brick. Runs may be tracked in any order: their results are joined
// in ray order, and neither the bricks' size nor the order shows in a bit.

#include <cstdint>

#include "pipeline/medium.h"
#include "shading/grid_walk.h"
#include "shading/medium.h"

namespace spillway::pipeline {

struct MediumSegment {
  const Medium* medium = nullptr;
  Float3 origin_world{0, 0, 0}, direction_world{0, 0, 1};  // unit
  float end = INFINITY;                                    // distance
  shading::SegmentKey key{};
  Rgb shares{1, 1, 1};  // magnitudes of the path's throughput; unused by shadow rays
};

// What a segment does to its ray.
struct SegmentResult {
  float distance = INFINITY;  // of the collision that ends it; infinity: it reaches its end
  Rgb weight{1, 1, 1};        // multiplies the throughput; after a collision that of what scatters on
  Rgb emitted{0, 0, 0};       // times the throughput before: what the collision sends to the eye
};

// Consecutive cells of a segment inside one brick.
struct BrickRun {
  uint32_t brick;
  uint32_t cell_count;
  shading::CellIndex first_cell;
  float begin;
};

// A grid's segment in the space of its cells.
class SegmentWalk {
 public:
  SegmentWalk(const MediumSegment& segment, const cache::VolumeTables& volumes);
  // Calls visit(run) front to back, for bricks that are there, until it returns false.
  template <class Visit>
  void for_each_run(const Visit& visit) const;
  // Adds what happens in the run to `out`; false where the number of steps reached its bound.
  bool track(const BrickRun& run, const cache::VolumeBrickView& brick, shading::Collisions& out) const;
  bool pass(const BrickRun& run, const cache::VolumeBrickView& brick, shading::OrderlessProduct (&weight)[3],
            uint32_t& steps) const;

 private:
  template <class InCell>
  void for_each_cell(const BrickRun& run, const InCell& in_cell) const;
  [[nodiscard]] uint32_t brick_of(const shading::CellIndex& cell) const;
  [[nodiscard]] float density_at(const cache::VolumeBrickView& brick, const shading::CellIndex& cell,
                                 float distance) const;

  const MediumSegment& segment_;
  const cache::VolumeTables& volumes_;
  const cache::VolumeGrid& grid_;
  Float3 origin_lattice_, direction_lattice_;
  shading::CellGrid cells_;
  shading::GridWalk walk_;
};

// Homogeneous media need no bricks.
[[nodiscard]] SegmentResult track_homogeneous(const MediumSegment& segment);
[[nodiscard]] Rgb pass_homogeneous(const MediumSegment& segment);
// What a grid's collisions, joined over all runs, come to. `glow`: the medium's emission where they ended, see
// glow_place().
[[nodiscard]] SegmentResult segment_result(const MediumSegment& segment, const shading::Collisions& all, Rgb glow);

// Where a grid's glow is looked up: a brick and a place in it.
struct GlowPlace {
  uint32_t brick = cache::kNoBrick;  // none: the value is zero
  Float3 lattice{0, 0, 0};
};
[[nodiscard]] GlowPlace glow_place(const MediumSegment& segment, float distance, const MediumTables& tables);
// From the volume's value there; constant glow has none.
[[nodiscard]] Rgb glow_of_value(const Medium& medium, float value, const MediumTables& tables);

// ---- templates ----

template <class Visit>
void SegmentWalk::for_each_run(const Visit& visit) const {
  shading::GridWalk::Step step;
  if (!walk_.enter(cells_, segment_.end, step)) return;
  BrickRun run{brick_of(step.cell), 1, step.cell, step.begin};
  while (walk_.next(cells_, segment_.end, step)) {
    const uint32_t brick = brick_of(step.cell);
    if (brick == run.brick) {
      ++run.cell_count;
      continue;
    }
    if (run.brick != cache::kNoBrick && !visit(run)) return;
    run = {brick, 1, step.cell, step.begin};
  }
  if (run.brick != cache::kNoBrick) visit(run);
}

}  // namespace spillway::pipeline
