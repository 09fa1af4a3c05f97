#include "pipeline/pack/cut_bricks.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace spillway::pipeline {
namespace {

// Of a grid's box, present or not: a box that a damaged file claims must not keep us for ever.
constexpr uint64_t kMaxBricks = 1 << 22;

int32_t floor_to(int32_t x, int32_t step) { return (x >= 0 ? x / step : -((-x + step - 1) / step)) * step; }

Status check_samples(std::span<const float> samples, const std::array<int32_t, 3>& corner, int32_t side,
                     std::string_view where) {
  for (size_t i = 0; i < samples.size(); ++i) {
    if (samples[i] >= 0 && samples[i] < INFINITY) continue;
    const auto at = static_cast<int32_t>(i % (static_cast<size_t>(side) * side * side));
    return error("{}: the sample at ({}, {}, {}) is {}; samples must be finite and not negative", where,
                 corner[0] + at % side, corner[1] + at / side % side, corner[2] + at / (side * side), samples[i]);
  }
  return {};
}

}  // namespace

Status cut_bricks(SampleSource& source, int32_t brick_voxels, std::string_view where, const AppendBrick& append) {
  const LatticeBox box = source.bounds();
  for (int a = 0; a < 3; ++a)
    if (box.lower[a] < -cache::kMaxLattice || box.upper[a] > cache::kMaxLattice || box.lower[a] >= box.upper[a])
      return error("{}: has samples from {} to {} along axis {}; between -{} and {} are possible, and one at least",
                   where, box.lower[a], box.upper[a], a, cache::kMaxLattice, cache::kMaxLattice);
  uint64_t bricks = 1;
  for (int a = 0; a < 3; ++a) bricks *= static_cast<uint64_t>((box.upper[a] - box.lower[a]) / brick_voxels + 2);
  if (bricks > kMaxBricks)
    return error("{}: its box holds {} bricks of {} voxels an edge; at most {} are possible", where, bricks,
                 brick_voxels, kMaxBricks);
  const auto type = source.is_half() ? cache::VoxelType::half_float : cache::VoxelType::single_float;
  std::vector<float> samples(source.channels() * size_t{cache::brick_sample_count(brick_voxels)});
  // A sample at the lower end reaches into the brick below it.
  const auto first = [&](int a) { return floor_to(box.lower[a] - 1, brick_voxels); };
  for (int32_t z = first(2); z < box.upper[2]; z += brick_voxels) {
    SPILLWAY_TRY(source.load({{first(0), first(1), z}, {box.upper[0], box.upper[1], z + brick_voxels + 1}}));
    for (int32_t y = first(1); y < box.upper[1]; y += brick_voxels)
      for (int32_t x = first(0); x < box.upper[0]; x += brick_voxels) {
        source.copy({x, y, z}, brick_voxels + 1, samples);
        SPILLWAY_TRY(check_samples(samples, {x, y, z}, brick_voxels + 1, where));
        if (std::all_of(samples.begin(), samples.end(), [](float s) { return s == 0; })) continue;
        SPILLWAY_TRY(append(cache::build_volume_brick({x, y, z}, brick_voxels, type, samples)));
      }
  }
  return {};
}

}  // namespace spillway::pipeline
