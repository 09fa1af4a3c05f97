#pragma once

// What the tracing kernel reads and writes: the hot columns of a wave.

#include <cstdint>

#include "cache/base/ids.h"
#include "cache/base/vec.h"

namespace spillway::cache {

// A ray in world space; t counts in lengths of direction_world, which need not be one.
struct TraceRay {
  Float3 origin_world;
  float t_max;
  Float3 direction_world;
  float time;  // between the two keys of what moves, 0 to 1 (pipeline/shutter.h); 0 where nothing does
};
static_assert(sizeof(TraceRay) == 32);

// The nearest hit so far. prim is none and t is the ray's t_max when there is none.
// Order of hits: smaller t, then smaller (instance, prim): the same for every page layout.
struct TraceHit {
  float t;
  float u, v;  // p = (1 - u - v) p0 + u p1 + v p2
  uint32_t prim = PrimId::kNone;
  uint32_t instance = 0;  // 0 is the world itself
  uint32_t flags = 0;
};
static_assert(sizeof(TraceHit) == 24);

enum TraceHitFlag : uint32_t {
  kHitAlphaUnknown = 1,  // the opacity micromap could not tell; shade_hits decides
  kHitWaits = 4,         // the ray was not traced to its end: it waits for pages; the hit is the nearest so far
  kHitOccluded = 2,      // shadow rays: something opaque lies in between; t, u, v, prim are then meaningless
};

}  // namespace spillway::cache
