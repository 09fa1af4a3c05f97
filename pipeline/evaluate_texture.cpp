#include "pipeline/evaluate_texture.h"

#include <algorithm>
#include <cmath>

namespace spillway::pipeline {

// Scale first, then inversion, which never goes below zero (pbrt-v4, ImageTexture).
cache::Texel image_value(const TextureNode& node, cache::Texel texel) {
  if (node.is_float) {
    const float mean = (texel.value[0] + texel.value[1] + texel.value[2]) * (1.0f / 3);
    // Grey keeps its bits.
    if (texel.value[0] != texel.value[1] || texel.value[1] != texel.value[2])
      texel.value[0] = texel.value[1] = texel.value[2] = mean;
  }
  for (int c = 0; c < 4; ++c) texel.value[c] *= node.value[c];
  if (node.invert)
    for (int c = 0; c < 3; ++c) texel.value[c] = std::max(0.0f, 1 - texel.value[c]);
  return texel;
}

Status TextureEvaluator::evaluate(std::span<const TextureQuery> queries, std::span<cache::Texel> values,
                                  Scratch& scratch) const {
  scratch.requests.clear();
  for (const TextureQuery& query : queries) collect(query.texture, query, scratch.requests);
  scratch.texels.resize(scratch.requests.size());
  if (!scratch.requests.empty()) SPILLWAY_TRY(images_->look_up(scratch.requests, scratch.texels));
  const cache::Texel* next = scratch.texels.data();
  for (size_t i = 0; i < queries.size(); ++i) values[i] = combine(queries[i].texture, next);
  return {};
}

// Image lookups of a node, in the order in which combine() takes their texels.
void TextureEvaluator::collect(uint32_t node, const TextureQuery& query,
                               std::vector<cache::TextureRequest>& requests) const {
  const TextureNode& n = nodes_[node];
  switch (n.kind) {
    case TextureKind::constant: return;
    case TextureKind::image:
      requests.push_back({n.image, n.wrap, n.filter, query.uv.x * n.uv_scale[0] + n.uv_offset[0],
                          query.uv.y * n.uv_scale[1] + n.uv_offset[1],
                          query.width_uv * std::max(std::fabs(n.uv_scale[0]), std::fabs(n.uv_scale[1]))});
      return;
    case TextureKind::scale:
    case TextureKind::mix:
      for (int c = 0; c < (n.kind == TextureKind::mix ? 3 : 2); ++c) collect(n.child[c], query, requests);
  }
}

cache::Texel TextureEvaluator::combine(uint32_t node, const cache::Texel*& next) const {
  const TextureNode& n = nodes_[node];
  if (n.kind == TextureKind::constant) return {{n.value[0], n.value[1], n.value[2], n.value[3]}};
  if (n.kind == TextureKind::image) return image_value(n, *next++);
  const cache::Texel a = combine(n.child[0], next), b = combine(n.child[1], next);
  cache::Texel result;
  if (n.kind == TextureKind::scale) {
    for (int c = 0; c < 4; ++c) result.value[c] = a.value[c] * b.value[c];
    return result;
  }
  const float amount = combine(n.child[2], next).value[0];
  for (int c = 0; c < 4; ++c) result.value[c] = a.value[c] * (1 - amount) + b.value[c] * amount;
  return result;
}

}  // namespace spillway::pipeline
