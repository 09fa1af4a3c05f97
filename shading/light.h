#pragma once

// Lights as numbers: selection, sampling and pdfs. Emissive meshes are emitters, a triangle each; all else is a Light.

#include <cstdint>
#include <span>

#include "cache/base/ids.h"
#include "cache/base/vec.h"
#include "shading/environment.h"
#include "shading/image_light.h"
#include "shading/light_tree.h"
#include "shading/portal.h"
#include "shading/sample_triangle.h"

namespace spillway::shading {

enum class LightKind : uint32_t { point, spot, distant, infinite, goniometric, projection };

struct Light {
  LightKind kind;
  Rgb radiance;         // infinite: L. distant: irradiance across the beam. all others: intensity (W/sr)
  Float3 position;      // of all but distant and infinite
  Float3 edge1, edge2;  // spot, distant, projection: edge1 = unit axis of emission
                        // infinite with an image: position, edge1, edge2 are the light's unit axes in the world
  float cos_total;      // spot: nothing outside
  float cos_falloff;    // spot: full inside; a smoothstep in the cosine between
  // 0: none. infinite: 1, radiance multiplies the scene's environment map; one light of a scene at most.
  // goniometric, projection: one more than the place in the table of light images.
  uint32_t image;
};
static_assert(sizeof(Light) == 64);

// A triangle that emits, in the space of its object; cross(edge1, edge2) points to the side it emits to.
struct Emitter {
  TriangleShape shape;
  uint32_t emission;  // of the table of emissions
};
static_assert(sizeof(Emitter) == 40);

inline constexpr uint32_t kNoEmissionTexture = 0x7fffffffu;

// What a mesh emits.
struct Emission {
  Rgb radiance;  // of a mesh with a texture: what its texels multiply
  uint32_t two_sided : 1 = 0;
  uint32_t texture : 31 = kNoEmissionTexture;
};
static_assert(sizeof(Emission) == 16);

// A place on a mesh's face, as hits have it; of light samples whose emission a texture says.
struct LightPlace {
  uint32_t prim = PrimId::kNone;  // none: what the sample brings is known
  float u = 0, v = 0;
};
static_assert(sizeof(LightPlace) == sizeof(Float3));

// Where the emitters of an emission are on meshes; of scenes that look emissions up.
struct EmissionPlace {
  uint32_t first_prim = 0;    // added to an emitter's number, modulo 2^32: its face
  uint32_t is_flipped = 0;    // the emitters' edges are the faces' second and first
  uint32_t is_looked_up = 0;  // by a texture of radiance, or one of opacity
};

// Selection is by `cdf` over choices: first the emitters one by one, or in scenes with very many of them the tree,
// which then holds point and spot lights too; after that the lights.
struct LightTable {
  std::span<const Emitter> emitters;
  std::span<const Emission> emissions;
  std::span<const Light> lights;
  std::span<const float> cdf;  // choices + 1: cdf[0] = 0, last = 1: in proportion to power, see pack_lights
  float scene_radius_world = 1;
  uint32_t first_infinite = 0;   // infinite lights are the last of the table
  EnvironmentMap environment{};  // of the one that has an image
  std::span<const Portal> portals{};  // none, or the one of the scene
  LightTree tree{};              // empty: emitters are choices of their own
  LightImages images{};          // of goniometric lights and projections
  std::span<const EmissionPlace> places{};  // by emission; empty: no emission is looked up
  bool emitters_by_area = false;  // points on emitters are spread over the area alone, see sample_triangle_by_area
  [[nodiscard]] bool empty() const { return emitters.empty() && lights.empty(); }
};

[[nodiscard]] inline bool has_place(const Light& light) {
  return light.kind != LightKind::distant && light.kind != LightKind::infinite;
}
// Whether it has an image of its own.
[[nodiscard]] inline bool throws_image(const Light& light) {
  return light.kind == LightKind::goniometric || light.kind == LightKind::projection;
}

// Radiant power, for selection; infinite and distant lights use the scene's radius. of_image: of an infinite light's
// image the mean luminance, of others' LightImage::integral.
[[nodiscard]] float light_power(const Light& light, float scene_radius_world, float of_image = 1);
[[nodiscard]] float emitter_power(const TriangleShape& shape, const Emission& emission);

struct LightSample {
  Float3 w_next_world{0, 0, 1};  // unit, towards the light
  Float3 point_world{0, 0, 0};   // on the light, where it has a place
  float distance = 0;            // to that point; infinity for distant and infinite lights
  Rgb radiance{0, 0, 0};         // arriving if nothing is in between (point: intensity / distance^2); times what is at
  LightPlace place{};            // that place, where one is named
  float pdf_solid_angle = 0;     // including the pmf of the light; for deltas: the pmf alone
  bool is_delta = false;
};
// u_select chooses (its x, with y for the bits that x does not have), u places. pdf 0: no contribution.
[[nodiscard]] LightSample sample_light(const LightTable& table, const LightReceiver& receiver, Float2 u_select,
                                       Float2 u);

// The same for several, samples[i] of queries[i]: the bits of sample_light() in less time.
struct LightQuery {
  LightReceiver receiver;
  Float2 u_select, u;
};
void sample_lights(const LightTable& table, std::span<const LightQuery> queries, std::span<LightSample> samples);

// A triangle of an instance (0: of the world) where it stands.
[[nodiscard]] TriangleShape emitter_in_world(const LightTable& table, uint32_t instance, uint32_t emitter);
// Its radiance, seen along w (unit, receiver to light).
[[nodiscard]] Rgb emitter_radiance(const TriangleShape& shape_world, const Emission& emission, Float3 w_world);
// Density with which sample_light would have chosen this point: equal, bit for bit, to what sampling returned.
[[nodiscard]] float emitter_pdf_solid_angle(const LightTable& table, const LightReceiver& receiver, uint32_t instance,
                                            uint32_t emitter, const TriangleShape& shape_world, Float3 point_world);

[[nodiscard]] bool has_infinite_light(const LightTable& table);
// Sum over the infinite lights, as seen from a place: a portal hides what is beside it. The density is that of sampling
// any of them, the choice of the light included.
[[nodiscard]] EnvironmentValue infinite_value(const LightTable& table, Float3 from_world, Float3 w_world);

// Veach's power heuristic, exponent 2, for one sample of each strategy.
[[nodiscard]] inline float power_heuristic(float pdf, float other_pdf) {
  const float a = pdf * pdf, b = other_pdf * other_pdf;
  return a > 0 ? a / (a + b) : 0;
}
[[nodiscard]] inline float balance_heuristic(float pdf, float other_pdf) {
  return pdf > 0 ? pdf / (pdf + other_pdf) : 0;
}

}  // namespace spillway::shading
