#include "pipeline/pack/bake_micromap.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "cache/trace_page.h"
#include "pipeline/evaluate_texture.h"

namespace spillway::pipeline {
namespace {

using cache::Opacity;

// A micro-triangle over more texels than this is left unknown: scanning it would cost more than it saves.
constexpr uint64_t kMostTexels = 4096;

std::vector<std::byte> micromap(uint32_t level, std::span<const Opacity> states) {
  std::vector<std::byte> bytes(sizeof(cache::OpacityMicromap) + std::max<size_t>(1, states.size() / 4));
  const cache::OpacityMicromap header{level};
  std::memcpy(bytes.data(), &header, sizeof header);
  for (size_t i = 0; i < states.size(); ++i)
    bytes[sizeof header + i / 4] |= static_cast<std::byte>(static_cast<uint32_t>(states[i]) << (2 * (i % 4)));
  return bytes;
}

Opacity opacity(float lowest, float highest) {
  if (lowest >= 1) return Opacity::opaque;
  return highest <= 0 ? Opacity::clear : Opacity::unknown;
}

std::vector<std::byte> uniform(Opacity state) {
  if (state == Opacity::opaque) return {};
  return micromap(0, {&state, 1});
}

// The finest level of an image seen through its node: extremes of alpha over a box of texels.
class AlphaImage {
 public:
  AlphaImage(const TextureNode& node, const cache::ImageInfo& info, cache::TextureCache& images)
      : node_(node), info_(info), images_(images) {}

  [[nodiscard]] Float2 texel_of(Float2 uv) const {
    return {(uv.x * node_.uv_scale[0] + node_.uv_offset[0]) * static_cast<float>(info_.width),
            (1 - (uv.y * node_.uv_scale[1] + node_.uv_offset[1])) * static_cast<float>(info_.height)};
  }

  // Of the texels within [lower, upper] in texel units, grown by what bilinear filtering reaches.
  Result<Opacity> classify(Float2 lower, Float2 upper) {
    // Half a texel for the filter, one for rounding.
    const double x0 = std::floor(lower.x - 1.5), x1 = std::ceil(upper.x + 1.5);
    const double y0 = std::floor(lower.y - 1.5), y1 = std::ceil(upper.y + 1.5);
    if (!((x1 - x0) * (y1 - y0) <= kMostTexels)) return Opacity::unknown;
    requests_.clear();
    for (double y = y0; y < y1; ++y)
      for (double x = x0; x < x1; ++x)
        requests_.push_back({node_.image, node_.wrap, cache::TexelFilter::point,
                             static_cast<float>((x + 0.5) / info_.width),
                             static_cast<float>(1 - (y + 0.5) / info_.height), 0});
    texels_.resize(requests_.size());
    SPILLWAY_TRY(images_.look_up(requests_, texels_));
    float lowest = INFINITY, highest = -INFINITY;
    for (const cache::Texel& texel : texels_) {
      const float alpha = image_value(node_, texel).value[0];
      lowest = std::min(lowest, alpha), highest = std::max(highest, alpha);
    }
    return opacity(lowest, highest);
  }

 private:
  const TextureNode& node_;
  const cache::ImageInfo& info_;
  cache::TextureCache& images_;
  std::vector<cache::TextureRequest> requests_;
  std::vector<cache::Texel> texels_;
};

// About two texels along the longest edge of a micro-triangle.
uint32_t choose_level(const Float2 corner[3]) {
  float longest = 0;
  for (int i = 0; i < 3; ++i) {
    const Float2 edge = corner[(i + 1) % 3] - corner[i];
    longest = std::max({longest, std::fabs(edge.x), std::fabs(edge.y)});
  }
  uint32_t level = 0;
  while (level < cache::kMaxMicromapLevel && longest > 2 * static_cast<float>(1u << level)) ++level;
  return level;
}

// Bounds, in texels, of the micro-triangle at (row, column): its cell's parallelogram, which holds both of the cell.
struct Box2 {
  Float2 lower{INFINITY, INFINITY}, upper{-INFINITY, -INFINITY};
  void grow(Float2 p) {
    lower = {std::min(lower.x, p.x), std::min(lower.y, p.y)};
    upper = {std::max(upper.x, p.x), std::max(upper.y, p.y)};
  }
};

Box2 cell_bounds(const Float2 corner[3], uint32_t row, uint32_t column, uint32_t n, bool inverted) {
  // (column, row) corners of the micro-triangle in the grid; u runs along columns, v along rows.
  const uint32_t grid[3][2] = {{column + (inverted ? 1u : 0u), row + (inverted ? 1u : 0u)}, {column + 1, row}, {column, row + 1}};
  Box2 box;
  for (const auto& g : grid) {
    const float u = static_cast<float>(g[0]) / static_cast<float>(n), v = static_cast<float>(g[1]) / static_cast<float>(n);
    box.grow(corner[0] * (1 - u - v) + corner[1] * u + corner[2] * v);
  }
  return box;
}

Result<std::vector<std::byte>> bake_image(const Float2 uv[3], AlphaImage image) {
  const Float2 corner[3] = {image.texel_of(uv[0]), image.texel_of(uv[1]), image.texel_of(uv[2])};
  const uint32_t level = choose_level(corner), n = 1u << level;
  std::vector<Opacity> states(size_t{1} << (2 * level), Opacity::unknown);
  bool all_opaque = true;
  for (uint32_t row = 0; row < n; ++row) {
    for (uint32_t k = 0; k < 2 * (n - row) - 1; ++k) {
      const Box2 box = cell_bounds(corner, row, k / 2, n, k % 2 == 1);
      SPILLWAY_ASSIGN(const Opacity state, image.classify(box.lower, box.upper));
      states[row * (2 * n - row) + k] = state;
      all_opaque = all_opaque && state == Opacity::opaque;
    }
  }
  return all_opaque ? std::vector<std::byte>{} : micromap(level, states);
}

}  // namespace

Result<std::vector<std::byte>> bake_micromap(const Float2 uv[3], uint32_t alpha_texture,
                                             std::span<const TextureNode> textures,
                                             std::span<const cache::ImageInfo> image_infos,
                                             cache::TextureCache* images) {
  const TextureNode& node = textures[alpha_texture];
  if (node.kind == TextureKind::constant) return uniform(opacity(node.value[0], node.value[0]));
  // Graphs are left to shade_hits: bounding them is rarely worth it. So are images by place, not by uv.
  if (node.kind != TextureKind::image || node.mapping != TextureMapping::uv) return uniform(Opacity::unknown);
  return bake_image(uv, AlphaImage(node, image_infos[node.image], *images));
}

std::vector<std::byte> unknown_micromap() { return uniform(Opacity::unknown); }

}  // namespace spillway::pipeline
