#pragma once

// Stage route_hits: sends what trace_rays found on its way.
//
// In: hot columns and results of a wave, in memory; cold columns, read front to back once.
// Out: surfaces, and places in media, to be shaded -> the hit sort, keyed by (material, mesh, face, place on the face,
// path); light from
//      outside the scene and shadow rays that arrived -> film; those that arrived where emission is looked up -> the
//      hit sort, at the place on their light.
// Memory: a block of rays a thread, and one batch of cold records where these are spilled (tag paths). What does not fit of
// the hits is spilled by the sort.
// Order: hits by their keys; film adds are integers, so their order does not matter.
// Based on: deferred shading sorted by shading context (Eisenacher et al. 2013, section 4).

#include <tbb/enumerable_thread_specific.h>

#include <array>
#include <cstdint>
#include <span>

#include "cache/external_sort.h"
#include "cache/record_stream.h"
#include "pipeline/records.h"
#include "pipeline/render/film.h"
#include "pipeline/render/medium_segment.h"
#include "pipeline/render/pixel_costs.h"
#include "pipeline/render/shade_path.h"

namespace spillway::pipeline {

struct TracedPaths {
  std::span<const cache::TraceRay> rays;
  std::span<const cache::TraceHit> hits;
  const cache::RecordStream<PathRecord>* records;
  std::span<const SegmentResult> media = {};  // what media did to each, in scenes that have some
  std::span<const RayCost> costs = {};        // what each took to trace, when pixel costs are counted
};

struct TracedShadows {
  std::span<const cache::TraceRay> rays;
  std::span<const cache::TraceHit> hits;
  const cache::RecordStream<ShadowRecord>* records;
  std::span<const SegmentResult> media = {};
  std::span<const RayCost> costs = {};
  const cache::RecordStream<shading::LightPlace>* ends = nullptr;  // where on their lights, when emission is looked up
};

struct RouteHitsReport {
  uint64_t hit_count = 0, escaped_count = 0, arrived_count = 0, occluded_count = 0, alpha_shadow_count = 0;
  uint64_t medium_count = 0;    // of the hits
  uint64_t parked_count = 0;    // not traced to their ends yet: passed over
  uint64_t absorbed_count = 0;  // paths that ended in a medium

  RouteHitsReport& operator+=(const RouteHitsReport& other);
};

// Reused from wave to wave.
struct RouteHitsScratch {
  static constexpr size_t kBatchRecords = 1 << 15;
  // A thread's block of rays and what it turned into: small enough to stay in the processor's caches.
  struct Block {
    static constexpr size_t kRecords = 256;
    std::array<PathRecord, kRecords> paths;
    std::array<ShadowRecord, kRecords> shadows;
    std::array<HitRecord, kRecords> hits;
    std::array<cache::SortKey, kRecords> keys;
    std::array<SplatRecord, 2 * kRecords> splats;  // of each what its medium emits, and what it brought
    size_t hit_count = 0, splat_count = 0;
    RouteHitsReport report;
  };
  tbb::enumerable_thread_specific<Block> blocks;
  Buffer<PathRecord> paths;    // a batch of spilled ones
  Buffer<ShadowRecord> shadows;
  Buffer<shading::LightPlace> ends;  // where emission is looked up
};

// Hits by (prim: material-major, place on the face), then by the ray and its event, which make keys unique.
[[nodiscard]] cache::SortKey hit_key(const HitRecord& hit);

// Where a path collides in its medium, at a distance in world units.
[[nodiscard]] HitRecord medium_hit(const cache::TraceRay& ray, const PathRecord& path, float distance);

// How hits are keyed; see RenderOptions. Unsorted ones keep the order of their rays, paths first, those in media last.
struct HitOrder {
  bool is_sorted = true;
  uint32_t batch_rays = 0;  // hits of so many rays are sorted together, one batch after the other; 0: all
  bool descends = false;    // of all that are sorted together the last comes first
};

// pixel_costs: each ray's cost is added to its pixel; null: none is.
Status route_hits(const PathSettings& settings, const TracedPaths& paths, const TracedShadows& shadows,
                  cache::ExternalSort<HitRecord>& hits, Film& film, RouteHitsScratch& scratch, RouteHitsReport& report,
                  const HitOrder& order = {}, PixelCosts* pixel_costs = nullptr);

}  // namespace spillway::pipeline
