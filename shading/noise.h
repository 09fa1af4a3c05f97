#pragma once

// Textures made of noise: Perlin's improved gradient noise (Perlin 2002, Improving Noise) with pbrt-v4's choice of
// gradients, so that pictures match, and what pbrt makes of it (Texture fbm, wrinkled, windy, dots, marble).
//
// p: place in texture space. width: footprint there; octaves finer than half of it are faded out, or stand for their
// mean in turbulence. Finite for any p.

#include <cstdint>

#include "cache/base/vec.h"

namespace spillway::shading {

inline constexpr uint32_t kMaxOctaves = 32;  // the last of them is 1.99^31 times as fine: beyond any float's place

// Zero at whole numbers and far from the origin, about -1 to 1 in between; repeats every 256.
[[nodiscard]] float gradient_noise(Float3 p);

// Sums of noise of growing frequency, each `persistence` times the one before: signed, and of magnitudes (Perlin 1985).
[[nodiscard]] float fractal_noise(Float3 p, float width, float persistence, uint32_t octaves);
[[nodiscard]] float turbulence(Float3 p, float width, float persistence, uint32_t octaves);

// Waves where wind is: noise times the magnitude of slower noise.
[[nodiscard]] float windy_waves(Float3 p, float width);

// Whether st lies in a dot: about half of the unit cells around whole numbers hold one, shifted a little.
[[nodiscard]] bool is_inside_dot(Float2 st);

struct MarbleParams {
  float persistence = 0.5f, scale = 1, variation = 0.2f;
  uint32_t octaves = 8;
};
// Veins across y, disturbed by fractal noise, in pbrt's colours.
[[nodiscard]] Rgb marble_color(Float3 p, float width, const MarbleParams& marble);

struct CloudParams {
  float density = 1, wispiness = 1, frequency = 5;
};
// Of pbrt-v4's medium "cloud": five octaves of noise at a place that slower noise has moved, thinner with height and
// full below y = 1/2. 0 to 1.
[[nodiscard]] float cloud_density(Float3 p, const CloudParams& cloud);

}  // namespace spillway::shading
