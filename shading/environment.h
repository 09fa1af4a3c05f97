#pragma once

// An image of all directions, equal-area octahedral (Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using
// SIMD"; pbrt-v4 section 3.8.3): every texel is the same solid angle, radiance is constant over it, and directions are
// sampled in exact proportion to its luminance.

#include <cstdint>
#include <span>

#include "cache/base/vec.h"

namespace spillway::shading {

// Row by row, row 0 at square y = 0. Views of arrays that must outlive it.
struct EnvironmentMap {
  uint32_t size = 0;                 // texels an edge; 0: no map
  std::span<const Rgb> texels;       // size * size
  std::span<const float> row_cdf;    // size + 1
  std::span<const float> texel_cdf;  // size rows of size + 1
};

// Fills row_cdf and texel_cdf. A row, or an image, without light is sampled evenly.
void build_environment_cdfs(uint32_t size, std::span<const Rgb> texels, std::span<float> row_cdf,
                            std::span<float> texel_cdf);

// Between the unit square and unit directions, both in the light's own frame.
[[nodiscard]] Float3 equal_area_direction(Float2 square);
[[nodiscard]] Float2 equal_area_square(Float3 w);

[[nodiscard]] Rgb environment_radiance(const EnvironmentMap& map, Float3 w);
[[nodiscard]] Float3 sample_environment(const EnvironmentMap& map, Float2 u);
// Over solid angle.
[[nodiscard]] float environment_pdf(const EnvironmentMap& map, Float3 w);

}  // namespace spillway::shading
