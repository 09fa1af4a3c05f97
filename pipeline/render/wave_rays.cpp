#include "pipeline/render/wave_rays.h"

namespace spillway::pipeline {
namespace {

using cache::PageVisit;
using cache::TraceCounters;
using cache::TraceHit;
using cache::TraceMode;
using cache::TracePageView;

// All that is kept of an occluded shadow ray: what occludes it would depend on the order.
constexpr TraceHit kOccluded = {0, 0, 0, PrimId::kNone, 0, cache::kHitOccluded};

}  // namespace

void WaveRays::keep_hit(uint32_t ray, const TraceHit& hit) const {
  hit_at(ray) = (hit.flags & cache::kHitOccluded) != 0 ? kOccluded : hit;
}

void WaveRays::note_cost(uint32_t ray, const TraceCounters& before, const TraceCounters& after, uint32_t waits) const {
  if (!has_costs_) return;
  RayCost& cost = is_path(ray) ? batch_.path_costs[ray] : batch_.shadow_costs[ray - batch_.path_rays.size()];
  cost.tree_steps += static_cast<uint32_t>(after.nodes + after.leaves - before.nodes - before.leaves);
  cost.pages_waited += waits;
}

std::span<const PageVisit> WaveRays::trace_first(uint32_t ray, VisitList& visits, TraceCounters& work) const {
  if (goes_on_) {
    hit_at(ray).flags &= ~uint32_t{cache::kHitWaits};
    return pages_ahead(ray, 0, page_count(), visits);
  }
  TraceHit hit = cache::no_hit(ray_at(ray));
  const TraceCounters before = work;
  std::span<const PageVisit> due = visits.trace(tree_, known(), mode_of(ray), ray_at(ray), hit, work);
  note_cost(ray, before, work, 0);
  keep_hit(ray, hit);
  // What was due before the hit may lie behind it.
  if (is_path(ray) && hit.prim != PrimId::kNone && !due.empty())
    due = visits.still_due(tree_, known(), TraceMode::nearest, ray_at(ray), hit, due.size());
  return due;
}

void WaveRays::trace_page(const TracePageView& view, uint32_t instance, uint32_t ray, TraceCounters& work) const {
  TraceHit hit = hit_at(ray);
  if ((hit.flags & cache::kHitOccluded) != 0) return;
  const TraceCounters before = work;
  if (is_path(ray)) cache::trace_page<TraceMode::nearest>(view, instance, tree_, ray_at(ray), hit, work);
  if (!is_path(ray)) cache::trace_page<TraceMode::occlusion>(view, instance, tree_, ray_at(ray), hit, work);
  note_cost(ray, before, work, 1);
  keep_hit(ray, hit);
}

std::span<const PageVisit> WaveRays::pages_ahead(uint32_t ray, uint32_t first, uint32_t last, VisitList& visits) const {
  return visits.met(tree_, known(), first, last, mode_of(ray), ray_at(ray), hit_at(ray));
}

bool WaveRays::is_ahead(uint32_t ray, PageVisit visit) const {
  return cache::keep_visits_ahead(tree_, known(), mode_of(ray), ray_at(ray), hit_at(ray), {&visit, 1}) != 0;
}

std::span<const PageVisit> WaveRays::pages_before_hit(uint32_t ray, const cache::ResidentPages& none,
                                                      VisitList& visits) const {
  return visits.met(tree_, none, 0, page_count(), mode_of(ray), ray_at(ray), hit_at(ray));
}

}  // namespace spillway::pipeline
