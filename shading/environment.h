#pragma once

// An image of all directions, equal-area octahedral (Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using
// SIMD"; pbrt-v4 section 3.8.3): every texel is the same solid angle, radiance is constant over it, and directions are
// sampled in exact proportion to its luminance.

#include <algorithm>
#include <cstdint>
#include <span>

#include "cache/base/trigonometry.h"
#include "cache/base/vec.h"

namespace spillway::shading {

// Row by row, row 0 at square y = 0. Views of arrays that must outlive it.
struct EnvironmentMap {
  uint32_t size = 0;                 // texels an edge; 0: no map
  std::span<const Rgb> texels;       // size * size
  std::span<const float> row_cdf;    // size + 1
  std::span<const float> texel_cdf;  // size rows of size + 1

  [[nodiscard]] std::span<const float> row(uint32_t y) const {
    return texel_cdf.subspan(size_t{y} * (size + 1), size + 1);
  }
};

// Fills row_cdf and texel_cdf. A row, or an image, without light is sampled evenly.
void build_environment_cdfs(uint32_t size, std::span<const Rgb> texels, std::span<float> row_cdf,
                            std::span<float> texel_cdf);

// Between the unit square and unit directions, both in the light's own frame.
[[nodiscard]] Float3 equal_area_direction(Float2 square);
[[nodiscard]] Float2 equal_area_square(Float3 w);

[[nodiscard]] Float3 sample_environment(const EnvironmentMap& map, Float2 u);

// What lies in a direction, and the density with which it would have been sampled: one look-up for both.
struct EnvironmentValue {
  Rgb radiance;
  float pdf_solid_angle;
};
// Inline, so that who wants one alone does not wait for both.
[[nodiscard]] inline EnvironmentValue environment_value(const EnvironmentMap& map, Float3 w) {
  const Float2 square = equal_area_square(w);
  const auto size = static_cast<float>(map.size);
  const auto index = [&](float s) { return std::min(static_cast<uint32_t>(s * size), map.size - 1); };
  const uint32_t x = index(square.x), y = index(square.y);
  const std::span<const float> row = map.row(y);
  return {map.texels[size_t{y} * map.size + x],
          (map.row_cdf[y + 1] - map.row_cdf[y]) * (row[x + 1] - row[x]) * (size * size * (0.25f / kPi))};
}

}  // namespace spillway::shading
