#pragma once

// A ray's segment inside a medium: what happens on it, as functions of numbers.
//
// In a grid it meets points at which the density decides what happens. Where they are follows from the cells'
// majorants, which are in memory: bricks are wanted at these points alone, in any order, and neither their size nor the
// order shows in a bit.

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

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

[[nodiscard]] shading::StepRule rule_of(const MediumSegment& segment);

// How far a walk along a segment has come.
struct WalkPlace {
  bool begun = false;
  shading::CellIndex cell{};
  float begin = 0;                // of the cell
  shading::CellProgress steps{};  // in the cell
};

// Where the density decides, and what about.
struct DensityPoint {
  Float3 lattice;
  shading::CellStep step;
};

// A grid's segment in the space of its cells.
class SegmentWalk {
 public:
  SegmentWalk(const MediumSegment& segment, const cache::VolumeTables& volumes);
  // Calls visit(brick, point) front to back from `place` on, until it returns false: `place` is then behind that point.
  // Returns the number of cells whose steps reached their bound.
  template <class Visit>
  uint32_t for_each_point(WalkPlace& place, const Visit& visit) const;
  [[nodiscard]] const shading::StepRule& rule() const { return rule_; }

 private:
  bool begin(const WalkPlace& place, shading::GridWalk::Step& step) const;
  [[nodiscard]] Float3 lattice(const shading::CellIndex& cell, float distance) const;

  const MediumSegment& segment_;
  const cache::VolumeTables& volumes_;
  const cache::VolumeGrid& grid_;
  shading::StepRule rule_;
  Float3 origin_lattice_, direction_lattice_;
  shading::CellGrid cells_;
  shading::GridWalk walk_;
};

// Homogeneous media need no bricks.
[[nodiscard]] SegmentResult track_homogeneous(const MediumSegment& segment);
[[nodiscard]] Rgb pass_homogeneous(const MediumSegment& segment);

// Where volumes are looked up once a segment has collided in a grid.
struct VolumePlace {
  uint32_t brick = cache::kNoBrick;  // none: the value is zero
  Float3 lattice{0, 0, 0};
};
struct EndPlaces {
  std::array<VolumePlace, 3> at;
  uint32_t count = 0;
};
// None of a medium whose colours are the same everywhere.
[[nodiscard]] EndPlaces end_places(const MediumSegment& segment, float distance, const MediumTables& tables);
// What a grid's collisions come to. `values`: of the volumes at the places where the segment collided; as many.
[[nodiscard]] SegmentResult segment_result(const MediumSegment& segment, const shading::Collisions& all,
                                           std::span<const Rgb> values, const MediumTables& tables);
// A brick's values at a point: of three channels, or the first alone.
[[nodiscard]] inline Rgb look(const cache::VolumeBrickView& brick, Float3 lattice) {
  return brick.header().channels == 1 ? Rgb{brick.interpolate(lattice), 0, 0} : brick.interpolate_color(lattice);
}

// ---- what is called for every cell and point ----

// Held inside the cell, which is the same for bricks of every size.
inline Float3 SegmentWalk::lattice(const shading::CellIndex& cell, float distance) const {
  constexpr auto kCell = static_cast<float>(cache::kCellVoxels);
  Float3 p = origin_lattice_ + direction_lattice_ * distance;
  for (int a = 0; a < 3; ++a) {
    const auto lower = static_cast<float>(grid_.corner[a] + cell.at[a] * cache::kCellVoxels);
    p[a] = std::clamp(p[a], lower, lower + kCell);
  }
  return p;
}

template <class Visit>
uint32_t SegmentWalk::for_each_point(WalkPlace& place, const Visit& visit) const {
  shading::GridWalk::Step step;
  if (!begin(place, step)) return 0;
  uint32_t bounded = 0;
  do {
    const uint32_t brick = volumes_.brick_of(grid_, step.cell.at);
    if (brick == cache::kNoBrick) continue;
    const float majorant = rule_.majorant(volumes_.majorant(grid_, brick, step.cell.at));
    if (!(majorant > 0) || !(step.begin < step.end)) continue;
    const shading::CellSegment cell{shading::cell_key(step.cell), step.begin, step.end};
    shading::CellSteps steps(cell, majorant, segment_.key, place.steps);
    place.steps = {};
    while (steps.next()) {
      if (steps.is_bounded()) {
        ++bounded;
        break;
      }
      const shading::CellStep at = steps.step();
      if (visit(brick, DensityPoint{lattice(step.cell, at.distance), at})) continue;
      place = {true, step.cell, step.begin, steps.progress()};
      return bounded;
    }
  } while (walk_.next(cells_, segment_.end, step));
  return bounded;
}

}  // namespace spillway::pipeline
