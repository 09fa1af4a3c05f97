#include "pipeline/render/medium_segment.h"

#include <algorithm>

namespace spillway::pipeline {
namespace {

constexpr float kCell = static_cast<float>(cache::kCellVoxels);

Float3 in_cells(const cache::VolumeGrid& grid, Float3 lattice) {
  Float3 cell;
  for (int a = 0; a < 3; ++a) cell[a] = (lattice[a] - static_cast<float>(grid.corner[a])) / kCell;
  return cell;
}

// The part of what collides that is scattered, or absorbed.
Rgb part_of(Rgb part, Rgb sigma_t) {
  return {sigma_t.r > 0 ? part.r / sigma_t.r : 0, sigma_t.g > 0 ? part.g / sigma_t.g : 0,
          sigma_t.b > 0 ? part.b / sigma_t.b : 0};
}

SegmentResult collided(const Medium& medium, float distance, Rgb weight, Rgb glow) {
  const Rgb sigma_t = medium.sigma_t();
  return {distance, weight * part_of(medium.sigma_s, sigma_t), weight * part_of(medium.sigma_a, sigma_t) * glow};
}

}  // namespace

Rgb black_body(std::span<const Rgb> table, float kelvin) {
  const float at = std::clamp(kelvin / kBlackBodyStep_kelvin, 0.0f, static_cast<float>(kBlackBodyEntries - 1));
  const auto i = std::min(static_cast<uint32_t>(at), kBlackBodyEntries - 2);
  const float f = at - static_cast<float>(i);
  return table[i] * (1 - f) + table[i + 1] * f;
}

SegmentWalk::SegmentWalk(const MediumSegment& segment, const cache::VolumeTables& volumes)
    : segment_(segment),
      volumes_(volumes),
      grid_(volumes.grids[segment.medium->density_volume]),
      origin_lattice_(segment.medium->density_from_world.point(segment.origin_world)),
      direction_lattice_(segment.medium->density_from_world.vector(segment.direction_world)),
      walk_(in_cells(grid_, origin_lattice_), direction_lattice_ * (1 / kCell)) {
  for (int a = 0; a < 3; ++a) cells_.count[a] = grid_.brick_count[a] * (grid_.brick_voxels / cache::kCellVoxels);
}

uint32_t SegmentWalk::brick_of(const shading::CellIndex& cell) const {
  return volumes_.brick_of(grid_, {cell.at[0], cell.at[1], cell.at[2]});
}

// in_cell(cell segment, cell) returns whether to go on to the next cell of the run.
template <class InCell>
void SegmentWalk::for_each_cell(const BrickRun& run, const InCell& in_cell) const {
  shading::GridWalk::Step step;
  walk_.resume(run.first_cell, run.begin, segment_.end, step);
  for (uint32_t i = 0;; ++i) {
    const shading::CellIndex& c = step.cell;
    const float majorant = volumes_.majorant(grid_, run.brick, {c.at[0], c.at[1], c.at[2]});
    if (majorant > 0 && step.begin < step.end &&
        !in_cell(shading::CellSegment{shading::cell_key(c), step.begin, step.end, majorant}, c))
      return;
    if (i + 1 == run.cell_count || !walk_.next(cells_, segment_.end, step)) return;
  }
}

bool SegmentWalk::track(const BrickRun& run, const cache::VolumeBrickView& brick, shading::Collisions& out) const {
  bool whole = true;
  for_each_cell(run, [&](const shading::CellSegment& cell, const shading::CellIndex& at) {
    const auto density = [&](float distance) { return density_at(brick, at, distance); };
    whole &= shading::track_cell(cell, segment_.medium->sigma_t(), segment_.shares, segment_.key, density, out);
    return !out.collided();
  });
  return whole;
}

bool SegmentWalk::pass(const BrickRun& run, const cache::VolumeBrickView& brick, shading::OrderlessProduct (&weight)[3],
                       uint32_t& steps) const {
  bool whole = true;
  for_each_cell(run, [&](const shading::CellSegment& cell, const shading::CellIndex& at) {
    const auto density = [&](float distance) { return density_at(brick, at, distance); };
    whole &= shading::pass_cell(cell, segment_.medium->sigma_t(), segment_.key, density, weight, steps);
    return true;
  });
  return whole;
}

// Held inside the cell, which is the same for bricks of every size.
float SegmentWalk::density_at(const cache::VolumeBrickView& brick, const shading::CellIndex& cell,
                              float distance) const {
  Float3 p = origin_lattice_ + direction_lattice_ * distance;
  for (int a = 0; a < 3; ++a) {
    const auto lower = static_cast<float>(grid_.corner[a] + cell.at[a] * cache::kCellVoxels);
    p[a] = std::clamp(p[a], lower, lower + kCell);
  }
  return brick.interpolate(p);
}

SegmentResult track_homogeneous(const MediumSegment& segment) {
  const Medium& medium = *segment.medium;
  const float channel = shading::hashed_1d(segment.key.sample, shading::SampleStream::media, segment.key.segment, 0, 0);
  const float step = shading::hashed_1d(segment.key.sample, shading::SampleStream::media, segment.key.segment, 0, 1);
  const shading::FreePath path =
      shading::sample_free_path(medium.sigma_t(), segment.shares, segment.end, {channel, step});
  if (path.distance == INFINITY) return {INFINITY, path.weight, {0, 0, 0}};
  return collided(medium, path.distance, path.weight,
                  medium.glow_kind == GlowKind::constant ? medium.glow : Rgb{0, 0, 0});
}

Rgb pass_homogeneous(const MediumSegment& segment) {
  return shading::transmittance(segment.medium->sigma_t(), segment.end);
}

SegmentResult segment_result(const MediumSegment& segment, const shading::Collisions& all, Rgb glow) {
  const Rgb weight{all.weight[0].value(), all.weight[1].value(), all.weight[2].value()};
  if (!all.collided()) return {INFINITY, weight, {0, 0, 0}};
  return collided(*segment.medium, all.distance, weight, glow);
}

GlowPlace glow_place(const MediumSegment& segment, float distance, const MediumTables& tables) {
  const Medium& medium = *segment.medium;
  if (medium.glow_volume == Medium::kNoVolume) return {};
  const cache::VolumeGrid& grid = tables.volumes.grids[medium.glow_volume];
  GlowPlace place;
  place.lattice = medium.glow_from_world.point(segment.origin_world + segment.direction_world * distance);
  int32_t cell[3];
  for (int a = 0; a < 3; ++a) {
    const float at = std::floor((place.lattice[a] - static_cast<float>(grid.corner[a])) / kCell);
    const int32_t count = grid.brick_count[a] * (grid.brick_voxels / cache::kCellVoxels);
    if (!(at >= 0 && at < static_cast<float>(count))) return place;
    cell[a] = static_cast<int32_t>(at);
  }
  place.brick = tables.volumes.brick_of(grid, cell);
  return place;
}

Rgb glow_of_value(const Medium& medium, float value, const MediumTables& tables) {
  switch (medium.glow_kind) {
    case GlowKind::none:
      return {0, 0, 0};
    case GlowKind::constant:
      return medium.glow;
    case GlowKind::scaled:
      return medium.glow * value;
    case GlowKind::temperature:
      break;
  }
  return medium.glow * black_body(tables.black_bodies, (value - medium.kelvin_offset) * medium.kelvin_scale);
}

}  // namespace spillway::pipeline
