#include "pipeline/evaluate_texture.h"

#include <algorithm>
#include <cmath>

namespace spillway::pipeline {
namespace {

Float2 mapped(const TextureNode& node, Float2 uv) {
  return {uv.x * node.uv_scale[0] + node.uv_offset[0], uv.y * node.uv_scale[1] + node.uv_offset[1]};
}

cache::Texel product(const cache::Texel& a, const cache::Texel& b) {
  cache::Texel result;
  for (int c = 0; c < 4; ++c) result.value[c] = a.value[c] * b.value[c];
  return result;
}

cache::Texel mixed(const cache::Texel& a, const cache::Texel& b, float amount) {
  cache::Texel result;
  for (int c = 0; c < 4; ++c) result.value[c] = a.value[c] * (1 - amount) + b.value[c] * amount;
  return result;
}

// The sign of a cell, +1 where it is even, under a triangle filter of radius r: the second difference of the sign's second
// integral (pbrt-v4, section 10.2.3).
float filtered_sign(float x, float r) {
  const float low = std::floor(x - r), high = std::floor(x + r);
  if (low == high) return 1 - 2 * (low - 2 * std::floor(low / 2));
  const auto integral = [](float at) {
    const float y = at / 2 - std::floor(at / 2) - 0.5f;
    return at / 2 + y * (1 - 2 * std::fabs(y));
  };
  return (integral(x + r) - 2 * integral(x) + integral(x - r)) / (r * r);
}

// How much of the footprint lies in cells of unlike parity.
float checkerboard(const TextureNode& node, const TextureQuery& query) {
  const Float2 st = mapped(node, query.uv);
  const float rx = 1.5f * query.width_uv * std::fabs(node.uv_scale[0]), ry = 1.5f * query.width_uv * std::fabs(node.uv_scale[1]);
  return 0.5f - filtered_sign(st.x, rx) * filtered_sign(st.y, ry) / 2;
}

}  // namespace

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
  for (size_t i = 0; i < queries.size(); ++i) values[i] = combine(queries[i].texture, queries[i], next);
  return {};
}

// Image lookups of a node, in the order in which combine() takes their texels.
void TextureEvaluator::collect(uint32_t node, const TextureQuery& query,
                               std::vector<cache::TextureRequest>& requests) const {
  const TextureNode& n = nodes_[node];
  if (n.kind == TextureKind::image) {
    const Float2 st = mapped(n, query.uv);
    requests.push_back({n.image, n.wrap, n.filter, st.x, st.y,
                        query.width_uv * std::max(std::fabs(n.uv_scale[0]), std::fabs(n.uv_scale[1]))});
  }
  for (uint32_t c = 0; c < child_count(n.kind); ++c) collect(n.child[c], query, requests);
}

cache::Texel TextureEvaluator::combine(uint32_t node, const TextureQuery& query, const cache::Texel*& next) const {
  const TextureNode& n = nodes_[node];
  if (n.kind == TextureKind::constant) return {{n.value[0], n.value[1], n.value[2], n.value[3]}};
  if (n.kind == TextureKind::image) return image_value(n, *next++);
  cache::Texel child[4];
  for (uint32_t c = 0; c < child_count(n.kind); ++c) child[c] = combine(n.child[c], query, next);
  switch (n.kind) {
    case TextureKind::scale: return product(child[0], child[1]);
    case TextureKind::mix: return mixed(child[0], child[1], child[2].value[0]);
    case TextureKind::checkerboard: return mixed(child[0], child[1], checkerboard(n, query));
    default: break;
  }
  const Float2 st = mapped(n, query.uv);
  return mixed(mixed(child[0], child[1], st.y), mixed(child[2], child[3], st.y), st.x);
}

}  // namespace spillway::pipeline
