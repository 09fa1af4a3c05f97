#pragma once

// Every record that flows between stages, on one page. Hot columns (cache/ray.h: TraceRay, TraceHit) stay in memory for
// the sweep; everything below is cold and may be spilled.

#include <cstdint>
#include <type_traits>

#include "cache/base/ids.h"
#include "cache/base/vec.h"
#include "cache/ray.h"

namespace spillway::pipeline {

// What a ray is in: a medium's number, or nothing. It shares a word with the sample, of which there are 2^20 at most.
inline constexpr uint32_t kMediumBits = 12;
inline constexpr uint32_t kNoMedium = (1u << kMediumBits) - 1;

// Instead of a prim: the ray ended in a medium. Behind all prims in the order of hits.
inline constexpr uint32_t kMediumPrim = PrimId::kNone - 1;

// The journey of a path so far, beside its TraceRay. Written by generate_rays and shade_hits, read by route_rays.
struct PathRecord {
  uint32_t sink;             // y * full_width + x
  uint32_t sample : 32 - kMediumBits;  // half = sample & 1
  uint32_t medium : kMediumBits = kNoMedium;
  uint16_t bounce;           // scattering events so far, as pbrt counts depth
  uint16_t normal_previous;  // of the receiver below, as selection used it (shading::LightReceiver); 0: it used none
  float pdf_previous;        // solid angle, of the direction; 0 after a camera or a delta: next-event estimation had no part
  Rgb throughput;            // signed when the pixel filter is
  float cone_width;          // world units at the ray's origin
  float cone_spread;         // growth of the width per unit length
  float eta_scale;           // product of squared relative indices over the exposure, for Russian roulette
  Float3 position_previous;  // receiver of the next-event estimation that competes with this ray, not offset;
                             // of a hit in a medium: the place of the hit, which is the next receiver
};
static_assert(sizeof(PathRecord) == 52);

// What a shadow ray brings when it arrives. Written by shade_hits, read by route_rays.
struct ShadowRecord {
  uint32_t sink;
  uint32_t sample : 32 - kMediumBits;
  uint32_t medium : kMediumBits = kNoMedium;
  uint32_t bounce;  // of the hit that sent it
  Rgb contribution;
};
static_assert(sizeof(ShadowRecord) == 24);

// What HitRecord::is_shadow holds of a shadow ray that arrived at a place whose emission is looked up.
inline constexpr uint32_t kShadowArrived = 2;

// A surface, or a place in a medium, to be shaded, ordered by (material, mesh, face, place on the face). Written by route_rays, read by shade_hits.
struct HitRecord {
  cache::TraceHit hit;
  Float3 direction_world;
  float t_max;     // shadow rays: how far the light is, in lengths of direction_world
  PathRecord path;  // shadow rays: throughput holds the contribution, position_previous the bits of the LightPlace that
                    // they end at; the path's journey is otherwise unused
  uint32_t is_shadow;  // 0, 1, or kShadowArrived
};
static_assert(sizeof(HitRecord) == 96);

// A contribution on its way to the film. Written by the shade stages and route_rays, read by the film.
struct SplatRecord {
  uint32_t sink;
  uint32_t sample;
  uint32_t event;  // unique inside a path: keys the rounding
  Rgb value;
};
static_assert(sizeof(SplatRecord) == 24);

// Longer paths would leave 16 bits; roulette ends them long before.
inline constexpr uint32_t kMostBounces = 32767;

// Events of a path that splat: what the ray of bounce b found, and what its shadow ray brought.
constexpr uint32_t emission_event(uint32_t bounce) { return 2 * bounce; }
constexpr uint32_t shadow_event(uint32_t bounce) { return 2 * bounce + 1; }

// What a camera ray hit first. Written by shade_hits at bounce 0 when the film has such layers; a miss writes none.
struct AovRecord {
  uint32_t sink;
  uint32_t sample;
  float depth;  // along the ray, world units
  Float3 normal_world;
  Rgb albedo;
  uint32_t mesh, material, instance;
};
static_assert(sizeof(AovRecord) == 48);

static_assert(std::is_trivially_copyable_v<PathRecord> && std::is_trivially_copyable_v<HitRecord>);

}  // namespace spillway::pipeline
