#pragma once

// Lights as numbers: selection, sampling and pdfs. One entry a light; every triangle of an emissive mesh is one.

#include <cstdint>
#include <span>

#include "cache/base/vec.h"
#include "shading/environment.h"

namespace spillway::shading {

enum class LightKind : uint32_t { triangle, point, spot, distant, infinite };

struct Light {
  LightKind kind;
  uint32_t two_sided;   // triangle: emits to both sides; else to the side of its geometric normal
  Rgb radiance;         // triangle, infinite: L. point, spot: intensity (W/sr). distant: irradiance across the beam
  Float3 position;      // triangle: p0. point, spot: position
  Float3 edge1, edge2;  // triangle: p1 - p0, p2 - p0. spot, distant: edge1 = unit axis of emission
                        // infinite with an image: position, edge1, edge2 are the light's unit axes in the world
  float cos_total;      // spot: nothing outside
  float cos_falloff;    // spot: full inside; a smoothstep in the cosine between
  float normal_sign;    // triangle: -1 when the emitting side is opposite to cross(edge1, edge2)
  uint32_t has_image;   // infinite: radiance multiplies the scene's environment map; one light of a scene at most
};
static_assert(sizeof(Light) == 72);

struct LightTable {
  std::span<const Light> lights;
  std::span<const float> cdf;      // size lights + 1, cdf[0] = 0, last = 1: in proportion to power
  Float3 scene_center_world{0, 0, 0};
  float scene_radius_world = 1;
  uint32_t first_infinite = 0;  // infinite lights are the last of the table
  EnvironmentMap environment{};  // of the one that has an image
};

// Radiant power, for the selection table; infinite and distant lights use the scene's radius. mean_of_image: luminance,
// of an infinite light's image.
[[nodiscard]] float light_power(const Light& light, float scene_radius_world, float mean_of_image = 1);

struct LightSample {
  Float3 w_next_world{0, 0, 1};  // unit, towards the light
  Float3 point_world{0, 0, 0};   // on the light, where it has a place
  float distance = 0;            // to that point; infinity for distant and infinite lights
  Rgb radiance{0, 0, 0};         // arriving if nothing is in between (point: intensity / distance^2)
  float pdf_solid_angle = 0;     // including the pmf of the light; for deltas: the pmf alone
  bool is_delta = false;
};
// u_select chooses, u places. pdf 0: no contribution.
[[nodiscard]] LightSample sample_light(const LightTable& table, Float3 receiver_world, float u_select, Float2 u);

// Radiance of light `index` (triangle) seen from receiver at p with direction w (unit, receiver to light).
[[nodiscard]] Rgb triangle_radiance(const Light& light, Float3 w_world);
// Density with which sample_light would have chosen this point: equal, bit for bit, to what sampling returned.
[[nodiscard]] float triangle_pdf_solid_angle(const LightTable& table, uint32_t index, Float3 receiver_world, Float3 point_world);

[[nodiscard]] bool has_infinite_light(const LightTable& table);
// Sum over the infinite lights.
[[nodiscard]] Rgb infinite_radiance(const LightTable& table, Float3 w_world);
[[nodiscard]] float infinite_pdf_solid_angle(const LightTable& table, Float3 w_world);

// Veach's power heuristic, exponent 2, for one sample of each strategy.
[[nodiscard]] inline float power_heuristic(float pdf, float other_pdf) {
  const float a = pdf * pdf, b = other_pdf * other_pdf;
  return a > 0 ? a / (a + b) : 0;
}

}  // namespace spillway::shading
