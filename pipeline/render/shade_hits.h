#pragma once

// Stage shade_hits: surfaces in the order of (material, mesh, face) become rays of the next wave and light on the film.
//
// In: sorted hits, partition by partition; attribute blocks, read in file order or against it, each once a wave.
// Out: path and shadow rays of the next wave, hot and cold columns; splats and AOVs -> film.
// Memory: one batch of outputs (ShadeHitsScratch, tag paths); the next wave's columns spill as planned. A batch of hits
// that are not sorted, of attributes that do not fit, is gathered first: 4 MiB more; so are two half as large where tiles
// of face textures are read ahead.
// Order: outputs are appended in the order of hits; a vertex depends on its own records alone.
// Based on: deferred, sorted shading (Eisenacher et al. 2013, section 4).

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "cache/external_sort.h"
#include "cache/record_stream.h"
#include "cache/trace_page.h"
#include "pipeline/records.h"
#include "pipeline/render/attribute_store.h"
#include "pipeline/render/film.h"
#include "pipeline/render/pixel_costs.h"
#include "pipeline/render/resolve_material.h"
#include "pipeline/render/shade_path.h"

namespace spillway::pipeline {

// Rays of one kind: hot in memory, cold in a stream that may spill. hot.size() == cold.size().
template <class Record>
struct RayColumns {
  Buffer<cache::TraceRay> hot;
  cache::RecordStream<Record> cold;
};

// Shadow rays; in scenes that look emission up, with where on their lights they end.
struct ShadowColumns : RayColumns<ShadowRecord> {
  std::optional<cache::RecordStream<shading::LightPlace>> ends;  // as many
};

struct ShadeInputs {
  PathSettings settings;
  MaterialTables tables;
  std::span<const cache::Instance> instances;
  std::span<const Motion> motions;
  const MaterialResolver* resolver = nullptr;
  bool wants_aovs = false;
  PixelCosts* costs = nullptr;        // lookups and scatterings are added; null: nobody asks
  bool hits_are_sorted = true;        // else in the order in which they arrived, those in media last (ablation)
  bool hits_come_in_runs = false;     // the sorted ones: those of one batch of rays after the other (ablation)
  bool hits_descend = false;          // this wave's sorted hits come from the last to the first
  bool stages_face_textures = false;  // reads their tiles, of a batch at a time, while the batch before is shaded
};

// Reused from wave to wave.
struct ShadeHitsScratch {
  static constexpr size_t kBatchHits = 1 << 14;
  static constexpr size_t kBlockHits = 256;
  std::vector<uint32_t>* touched_blocks = nullptr;  // attribute blocks that hits lie in are added here, for a log
  Buffer<cache::TraceRay> path_rays{MemoryTag::paths, kBatchHits};
  Buffer<PathRecord> paths{MemoryTag::paths, kBatchHits};
  Buffer<cache::TraceRay> shadow_rays{MemoryTag::paths, kBatchHits};
  Buffer<ShadowRecord> shadows{MemoryTag::paths, kBatchHits};
  Buffer<shading::LightPlace> shadow_ends;  // where emission is looked up
};

struct ShadeHitsReport {
  uint64_t shaded_count = 0, let_through_count = 0, path_count = 0, shadow_count = 0;
  uint64_t partition_count = 0, attribute_blocks_touched = 0;
  uint64_t other_medium_count = 0;                // met in another medium than they say is there; of scenes with media
  std::array<uint64_t, 2> rays_of_half = {0, 0};  // sent on, of both kinds: what keeps an epoch open
};

// Where the instance that was hit is at the time of the path; `moved` holds the transforms of one that moves.
[[nodiscard]] InstanceTransform instance_transform(const ShadeInputs& inputs, const HitRecord& hit, Pose& moved);

// What the film's AOV layers hold of a camera ray's first surface (alpha it passes does not count).
[[nodiscard]] AovRecord first_hit_aovs(const SurfaceQuery& q);

// Shades every hit of the sort. The hot buffers of the outputs have room for all (capacity checked by the caller).
Status shade_hits(const ShadeInputs& inputs, cache::ExternalSort<HitRecord>& hits, AttributeStore& attributes,
                  Film& film, RayColumns<PathRecord>& next_paths, ShadowColumns& next_shadows,
                  ShadeHitsScratch& scratch, ShadeHitsReport& report);

}  // namespace spillway::pipeline
