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

VolumePlace volume_place(const MediumSegment& segment, float distance, const Affine3& lattice_from_world,
                         const cache::VolumeGrid& grid, const cache::VolumeTables& volumes) {
  VolumePlace place;
  place.lattice = lattice_from_world.point(segment.origin_world + segment.direction_world * distance);
  std::array<int32_t, 3> cell;
  for (int a = 0; a < 3; ++a) {
    const float at = std::floor((place.lattice[a] - static_cast<float>(grid.corner[a])) / kCell);
    const int32_t count = grid.brick_count[a] * (grid.brick_voxels / cache::kCellVoxels);
    if (!(at >= 0 && at < static_cast<float>(count))) return place;
    cell[a] = static_cast<int32_t>(at);
  }
  place.brick = volumes.brick_of(grid, cell);
  return place;
}

// The medium's emission where its volume has the value.
Rgb glow_of(const Medium& medium, Rgb value, std::span<const Rgb> black_bodies) {
  switch (medium.glow_kind) {
    case GlowKind::none:
      return {0, 0, 0};
    case GlowKind::constant:
      return medium.glow;
    case GlowKind::scaled:
      return medium.glow * value.r;
    case GlowKind::colors:
      return medium.glow * value;
    case GlowKind::temperature:
      break;
  }
  return medium.glow * black_body(black_bodies, (value.r - medium.kelvin_offset) * medium.kelvin_scale);
}

}  // namespace

Rgb black_body(std::span<const Rgb> table, float kelvin) {
  const float at = std::clamp(kelvin / kBlackBodyStep_kelvin, 0.0f, static_cast<float>(kBlackBodyEntries - 1));
  const auto i = std::min(static_cast<uint32_t>(at), kBlackBodyEntries - 2);
  const float f = at - static_cast<float>(i);
  return table[i] * (1 - f) + table[i + 1] * f;
}

shading::StepRule rule_of(const MediumSegment& segment) {
  return {segment.medium->sigma_t(), segment.shares, segment.medium->kind == MediumKind::color_grid};
}

SegmentWalk::SegmentWalk(const MediumSegment& segment, const cache::VolumeTables& volumes)
    : segment_(segment),
      volumes_(volumes),
      grid_(volumes.grids[segment.medium->density_volume]),
      rule_(rule_of(segment)),
      origin_lattice_(segment.medium->density_from_world.point(segment.origin_world)),
      direction_lattice_(segment.medium->density_from_world.vector(segment.direction_world)),
      walk_(in_cells(grid_, origin_lattice_), direction_lattice_ * (1 / kCell)) {
  for (int a = 0; a < 3; ++a) cells_.count[a] = grid_.brick_count[a] * (grid_.brick_voxels / cache::kCellVoxels);
}

bool SegmentWalk::begin(const WalkPlace& place, shading::GridWalk::Step& step) const {
  if (!place.begun) return walk_.enter(cells_, segment_.end, step);
  walk_.resume(place.cell, place.begin, segment_.end, step);
  return true;
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

EndPlaces end_places(const MediumSegment& segment, float distance, const MediumTables& tables) {
  const Medium& medium = *segment.medium;
  EndPlaces places;
  const auto add = [&](uint32_t volume, const Affine3& lattice_from_world) {
    places.at[places.count++] =
        volume_place(segment, distance, lattice_from_world, tables.volumes.grids[volume], tables.volumes);
  };
  if (medium.glow_volume != Medium::kNoVolume) add(medium.glow_volume, medium.glow_from_world);
  if (medium.kind != MediumKind::color_grid) return places;
  add(medium.density_volume, medium.density_from_world);
  add(medium.scatter_volume, medium.density_from_world);
  return places;
}

SegmentResult segment_result(const MediumSegment& segment, const shading::Collisions& all, std::span<const Rgb> values,
                             const MediumTables& tables) {
  const Medium& medium = *segment.medium;
  const Rgb weight{all.weight[0].value(), all.weight[1].value(), all.weight[2].value()};
  if (!all.collided()) return {INFINITY, weight, {0, 0, 0}};
  const bool looks = medium.glow_volume != Medium::kNoVolume;
  const Rgb glow = glow_of(medium, looks ? values[0] : Rgb{0, 0, 0}, tables.black_bodies);
  if (medium.kind != MediumKind::color_grid) return collided(medium, all.distance, weight, glow);
  const Rgb total = values[looks ? 1 : 0], scatters = part_of(values[looks ? 2 : 1], total);
  const Rgb scattered{std::min(scatters.r, 1.0f), std::min(scatters.g, 1.0f), std::min(scatters.b, 1.0f)};
  return {all.distance, weight * scattered, weight * (Rgb{1, 1, 1} - scattered) * glow};
}

}  // namespace spillway::pipeline
