#pragma once

// From a wave's rays to what they hit: stages sort_rays, trace_rays and park_rays, wave after wave.
//
// Owns: orders, hits and costs of the wave, and the lot of parked rays.
// Memory: tags rays and paths, as those stages say; kept from wave to wave, but for waves that are spilled.
// Threads: one caller. Fails: a page that cannot be read or is damaged.

#include <span>

#include "pipeline/render/park_rays.h"
#include "pipeline/render/render_state.h"
#include "pipeline/render/route_hits.h"
#include "pipeline/render/shade_hits.h"
#include "pipeline/render/sort_rays.h"

namespace spillway::pipeline {

// One wave's rays of both kinds.
struct Wave {
  RayColumns<PathRecord> paths;
  ShadowColumns shadows;
  [[nodiscard]] bool empty() const { return paths.hot.empty() && shadows.hot.empty(); }
};

class WaveTracer {
 public:
  WaveTracer(RenderState& state, RenderReport& report)
      : state_(state),
        report_(report),
        parked_(state.plan.parked_rays, state.options.cost_layers, !state.inputs.settings.lights.places.empty()) {}

  // Whether there are many parked rays, and none is on its way back.
  [[nodiscard]] bool lot_is_full() const { return parked_.is_nearly_full() && !parked_.has_traced(); }
  // Traces the parked rays, of which there are some, where they lie.
  Status sweep_lot(WaveReport& report);
  [[nodiscard]] const ParkedRays& parked() const { return parked_; }

  // Chooses which traced rays come back to a wave that holds these rays so far, and returns how many paths.
  size_t choose_returning(const Wave& wave);
  // Room for what tracing finds, once the wave is full; rays that come back are its last, with what was found of them.
  Status begin(Wave& wave);
  // Finds what the others hit, or parks them.
  Status trace(const Wave& wave, WaveReport& report);

  [[nodiscard]] TraceBatch batch(const Wave& wave);  // of all rays, with what was found
  [[nodiscard]] TracedPaths traced_paths(const Wave& wave, std::span<const SegmentResult> media) const;
  [[nodiscard]] TracedShadows traced_shadows(const Wave& wave, std::span<const SegmentResult> media) const;
  // What is not needed while shading.
  void give_back() { order_ = {}, path_hits_ = {}, shadow_hits_ = {}, pair_memory_ = {}; }

 private:
  [[nodiscard]] TraceBatch new_rays(const Wave& wave);  // those that did not come back
  [[nodiscard]] SortRaysOptions sort_options() const;
  [[nodiscard]] TraceRaysOptions trace_options() const;
  void sort(const TraceBatch& rays, WaveReport& report);
  void add(const TraceRaysReport& traced, WaveReport& report);

  RenderState& state_;
  RenderReport& report_;
  ParkedRays parked_;
  size_t back_paths_ = 0, back_shadows_ = 0;  // of the wave: those that came back
  SortRaysScratch sort_scratch_;
  PairMemory pair_memory_;
  Buffer<uint32_t> order_;
  Buffer<cache::TraceHit> path_hits_, shadow_hits_;
  Buffer<RayCost> path_costs_, shadow_costs_;  // none when nobody asks
};

}  // namespace spillway::pipeline
