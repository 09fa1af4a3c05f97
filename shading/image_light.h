#pragma once

// Images that lights of one place throw: around them (goniometric, equal-area octahedral like environment.h) or before
// them (projection). Intensity is constant over a texel.
//
// Based on: pbrt-v4, sections 12.2.2 and 12.2.3 and lights.cpp: frames, the field of view of the shorter axis.
// Different here: integrals weigh each texel by its solid angle, where pbrt takes that of its middle.

#include <cstdint>
#include <span>

#include "cache/base/vec.h"

namespace spillway::shading {

// What one light makes of its image.
struct LightImage {
  Float3 axis[3];                 // unit, in the world: the frame of the image, which may be mirrored
  float half_width, half_height;  // projection: at distance 1 along axis[2]. goniometric: 0
  uint32_t width, height;         // texels
  uint32_t first_texel;           // of all images'; row by row, row 0 at the least y
  float integral;                 // of the luminance over all directions, sr
};
static_assert(sizeof(LightImage) == 60);

// Views of arrays that must outlive it.
struct LightImages {
  std::span<const LightImage> images;
  std::span<const Rgb> texels;
};

// Half the image at distance 1, when `tangent` is that of half the field of view of the shorter axis.
[[nodiscard]] Float2 projected_half_size(uint32_t width, uint32_t height, float tangent);

// What the light's intensity is multiplied by along w_world (unit, away from the light).
[[nodiscard]] Rgb light_image_value(const LightImages& images, const LightImage& image, Float3 w_world);
// Over all directions, for LightImage::integral.
[[nodiscard]] double light_image_integral(const LightImages& images, const LightImage& image);

}  // namespace spillway::shading
