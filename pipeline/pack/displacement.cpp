#include "pipeline/pack/displacement.h"

#include <cmath>

#include "cache/base/hash.h"
#include "pipeline/render/shade_path.h"

namespace spillway::pipeline {
namespace {

ShadingPoint shading_point_of(const HeightPlace& place) {
  ShadingPoint point{};
  point.position = place.position;
  point.normal_geometric = point.normal_shading = place.normal;
  point.uv = place.uv;
  point.width_world = place.width, point.width_uv = place.width_uv;
  return point;
}

}  // namespace

HeightsAt Displacement::heights(const SubdivisionCage& cage) const {
  if (!cage.displacement.valid() || cage.displacement_scale == 0) return {};
  return [this, texture = cage.displacement.value, scale = cage.displacement_scale](std::span<const HeightPlace> places,
                                                                                    std::span<float> heights) {
    evaluate(texture, scale, places, heights);
  };
}

void Displacement::evaluate(uint32_t texture, float scale, std::span<const HeightPlace> places,
                            std::span<float> heights) const {
  constexpr size_t kMost = 8;
  std::array<ShadingPoint, kMost> points;
  std::array<TextureQuery, kMost> queries;
  std::array<cache::Texel, kMost> texels;
  for (size_t first = 0; first < places.size(); first += kMost) {
    const size_t count = std::min(kMost, places.size() - first);
    for (size_t i = 0; i < count; ++i) {
      points[i] = shading_point_of(places[first + i]);
      queries[i] = {texture, points[i].uv, points[i].width_uv, &points[i]};
    }
    const Status looked_up = evaluator_.evaluate(std::span(queries).first(count), std::span(texels).first(count), scratch_.local());
    if (!looked_up) {
      const std::lock_guard lock(mutex_);
      if (status_) status_ = looked_up;
    }
    for (size_t i = 0; i < count; ++i) {
      const float height = looked_up ? texels[i].value[0] * scale : 0;
      heights[first + i] = std::isfinite(height) ? height : 0;
    }
  }
}

Status Displacement::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

uint64_t Displacement::node_key(uint32_t index) const {
  TextureNode node = textures_[index];
  uint64_t key = 0;
  for (uint32_t c = 0; c < child_count(node.kind); ++c) key = hash_combine(key, node_key(node.child[c]));
  if (node.kind == TextureKind::image) key = hash_combine(key, infos_[node.image].content);
  // Numbers of nodes and images depend on what else is in the scene.
  node.image = 0;
  for (uint32_t& child : node.child) child = 0;
  return checksum(&node, sizeof(node), key);
}

uint64_t Displacement::key(const SubdivisionCage& cage) const {
  if (!heights(cage)) return 0;
  return checksum(&cage.displacement_scale, sizeof(float), node_key(cage.displacement.value));
}

bool reads_uvs(std::span<const TextureNode> textures, uint32_t texture) {
  const TextureNode& node = textures[texture];
  for (uint32_t c = 0; c < child_count(node.kind); ++c)
    if (reads_uvs(textures, node.child[c])) return true;
  const bool has_place = node.kind == TextureKind::image || node.kind == TextureKind::checkerboard ||
                         node.kind == TextureKind::bilerp || node.kind == TextureKind::dots;
  return has_place && node.mapping == TextureMapping::uv;
}

}  // namespace spillway::pipeline
