#include "pipeline/render/trace_wave.h"

#include <algorithm>

#include "pipeline/render/stage_timer.h"

namespace spillway::pipeline {
namespace {

// The first `count`, or those behind; of none there is none.
template <class T>
std::span<T> first_of(Buffer<T>& all, size_t count) {
  return std::span<T>(all).first(std::min(count, all.size()));
}
template <class T>
std::span<T> behind(Buffer<T>& all, size_t count) {
  return std::span<T>(all).subspan(std::min(count, all.size()));
}

template <class T>
void make(Buffer<T>& results, size_t count) {
  results.grow(MemoryTag::rays, count);
  results.set_size(count);
}

}  // namespace

// ---- parked rays ----

Status WaveTracer::sweep_lot(WaveReport& report) {
  const StageTimer timer("sweep_parked", report.trace_seconds);
  TraceRaysReport traced;
  SPILLWAY_TRY(parked_.sweep(state_.store.page_tree(), *state_.pages, state_.options.settings.statistics.bounds_world,
                             sort_options(), trace_options(), pair_memory_, traced));
  add(traced, report);
  state_.page_parts->rebalance();
  return {};
}

size_t WaveTracer::choose_returning(const Wave& wave) {
  const size_t paths = wave.paths.hot.size(), most = state_.plan.wave_paths;
  back_paths_ = std::min(parked_.paths().traced_count(), most > paths ? most - paths : 0);
  back_shadows_ = std::min(parked_.shadows().traced_count(), wave.shadows.hot.capacity() - wave.shadows.hot.size());
  return back_paths_;
}

Status WaveTracer::begin(Wave& wave) {
  const size_t paths = wave.paths.hot.size(), shadows = wave.shadows.hot.size();
  make(path_hits_, paths + back_paths_), make(shadow_hits_, shadows + back_shadows_);
  if (state_.costs) make(path_costs_, paths + back_paths_), make(shadow_costs_, shadows + back_shadows_);
  if (back_paths_ > 0)
    SPILLWAY_TRY(parked_.paths().give_back(wave.paths, behind(path_hits_, paths), behind(path_costs_, paths)));
  if (back_shadows_ > 0)
    SPILLWAY_TRY(parked_.shadows().give_back(wave.shadows, behind(shadow_hits_, shadows),
                                             behind(shadow_costs_, shadows),
                                             wave.shadows.ends ? &*wave.shadows.ends : nullptr));
  return {};
}

// ---- a wave ----

Status WaveTracer::trace(const Wave& wave, WaveReport& report) {
  TraceBatch rays = new_rays(wave);
  sort(rays, report);
  rays.order = order_;
  const StageTimer timer("trace_rays", report.trace_seconds);
  std::fill(rays.path_costs.begin(), rays.path_costs.end(), RayCost{});
  std::fill(rays.shadow_costs.begin(), rays.shadow_costs.end(), RayCost{});
  TraceRaysOptions options = trace_options();
  options.park_paths = parked_.paths().room(), options.park_shadows = parked_.shadows().room();
  options.park_pairs = state_.plan.park_pairs;
  TraceRaysReport traced;
  SPILLWAY_TRY(trace_rays(state_.store.page_tree(), *state_.pages, rays, options, pair_memory_, traced));
  add(traced, report);
  // Else all that is wanted is asked for when the lot is swept.
  if (state_.plan.parked_rays == 0) state_.page_parts->rebalance();
  if (traced.parked_count == 0) return {};
  SPILLWAY_TRY(parked_.paths().park(wave.paths, path_hits_, path_costs_));
  return parked_.shadows().park(wave.shadows, shadow_hits_, shadow_costs_,
                                wave.shadows.ends ? &*wave.shadows.ends : nullptr);
}

void WaveTracer::sort(const TraceBatch& rays, WaveReport& report) {
  const StageTimer timer("sort_rays", report.sort_seconds);
  make(order_, rays.path_rays.size() + rays.shadow_rays.size());
  sort_rays(rays.path_rays, rays.shadow_rays, state_.options.settings.statistics.bounds_world, order_, sort_options(),
            sort_scratch_);
  if (state_.options.sort_rays) report_.sorted_count += order_.size();
  if (state_.plan.gives_back) sort_scratch_ = {};
}

TraceBatch WaveTracer::new_rays(const Wave& wave) {
  const size_t paths = wave.paths.hot.size() - back_paths_, shadows = wave.shadows.hot.size() - back_shadows_;
  return {{wave.paths.hot.data(), paths},
          {wave.shadows.hot.data(), shadows},
          first_of(path_hits_, paths),
          first_of(shadow_hits_, shadows),
          {},
          first_of(path_costs_, paths),
          first_of(shadow_costs_, shadows)};
}

TraceBatch WaveTracer::batch(const Wave& wave) {
  return {wave.paths.hot, wave.shadows.hot, path_hits_, shadow_hits_, order_, path_costs_, shadow_costs_};
}

TracedPaths WaveTracer::traced_paths(const Wave& wave, std::span<const SegmentResult> media) const {
  return {wave.paths.hot, path_hits_, &wave.paths.cold, media, path_costs_};
}

TracedShadows WaveTracer::traced_shadows(const Wave& wave, std::span<const SegmentResult> media) const {
  return {wave.shadows.hot,   shadow_hits_,
          &wave.shadows.cold, media,
          shadow_costs_,      wave.shadows.ends ? &*wave.shadows.ends : nullptr};
}

SortRaysOptions WaveTracer::sort_options() const {
  SortRaysOptions options;
  options.enabled = state_.options.sort_rays;
  return options;
}

TraceRaysOptions WaveTracer::trace_options() const {
  TraceRaysOptions options;
  options.pair_limit_bytes = state_.plan.pair_bytes;
  options.resident_first = state_.options.resident_first;
  return options;
}

void WaveTracer::add(const TraceRaysReport& traced, WaveReport& report) {
  report.pages_touched += traced.pages_touched;
  report.pair_count += traced.pair_count;
  report.window_count += traced.window_count;
  report_.trace += traced;
}

}  // namespace spillway::pipeline
