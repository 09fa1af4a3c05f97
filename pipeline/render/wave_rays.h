#pragma once

// The rays of one call of trace_rays, with their results, as its parts see them: paths first, then shadow rays.
//
// Owns: nothing; work counters. Threads: any, each ray by one task at a time.

#include <atomic>
#include <optional>
#include <span>
#include <vector>

#include "cache/trace_kernel.h"
#include "pipeline/render/trace_rays.h"

namespace spillway::pipeline {

constexpr size_t kPrefetch = 8;  // rays ahead: rays and hits lie in another order than the one they are traced in

// Which pages a ray meets, in memory that grows with the longest answer.
class VisitList {
 public:
  // used: see DueVisits.
  explicit VisitList(uint8_t* used = nullptr) : visits_(64), used_(used) {}
  // Traces the ray through what is resident; the rest is due, or more than that.
  std::span<const cache::PageVisit> trace(const cache::PageTree& tree, cache::ResidentPages resident,
                                          cache::TraceMode mode, const cache::TraceRay& ray, cache::TraceHit& hit,
                                          cache::TraceCounters& work) {
    cache::DueVisits due{visits_.data(), visits_.size(), 0, used_};
    if (mode == cache::TraceMode::nearest)
      cache::trace_resident<cache::TraceMode::nearest>(tree, resident, ray, hit, work, due);
    if (mode == cache::TraceMode::occlusion)
      cache::trace_resident<cache::TraceMode::occlusion>(tree, resident, ray, hit, work, due);
    if ((hit.flags & cache::kHitOccluded) != 0) return {};
    if (due.count > visits_.size()) return met(tree, resident, 0, UINT32_MAX, mode, ray, hit);
    return {visits_.data(), due.count};
  }
  // Of the first `count` that were due.
  std::span<const cache::PageVisit> still_due(const cache::PageTree& tree, cache::ResidentPages resident,
                                              cache::TraceMode mode, const cache::TraceRay& ray,
                                              const cache::TraceHit& hit, size_t count) {
    const auto due = std::span(visits_).first(count);
    return due.first(cache::keep_visits_ahead(tree, resident, mode, ray, hit, due));
  }
  std::span<const cache::PageVisit> met(const cache::PageTree& tree, cache::ResidentPages resident, uint32_t first,
                                        uint32_t last, cache::TraceMode mode, const cache::TraceRay& ray,
                                        const cache::TraceHit& hit) {
    while (true) {
      const size_t count =
          cache::pages_met(tree, resident, first, last, mode, ray, hit, visits_.data(), visits_.size());
      if (count <= visits_.size()) return {visits_.data(), count};
      visits_.resize(2 * count);
    }
  }

 private:
  std::vector<cache::PageVisit> visits_;
  uint8_t* used_;
};

class WaveRays {
 public:
  WaveRays(const cache::PageTree& tree, PageViews& pages, const TraceBatch& batch, const TraceRaysOptions& options)
      : tree_(tree),
        pages_(pages),
        batch_(batch),
        absent_(options.resident_first ? Buffer<cache::TracePageView>() : pages.absent()),
        used_(MemoryTag::rays, pages.pages().fits() ? 0 : pages.pages().size()),
        goes_on_(options.goes_on),
        has_costs_(batch.path_costs.size() + batch.shadow_costs.size() > 0) {}

  [[nodiscard]] size_t size() const { return batch_.order.size(); }
  [[nodiscard]] uint32_t in_order(size_t place) const { return batch_.order[place]; }
  [[nodiscard]] PageViews& pages() const { return pages_; }
  [[nodiscard]] uint32_t page_count() const { return static_cast<uint32_t>(pages_.pages().size()); }
  [[nodiscard]] bool has_costs() const { return has_costs_; }
  [[nodiscard]] bool is_path(uint32_t ray) const { return ray < batch_.path_rays.size(); }
  [[nodiscard]] bool is_occluded(uint32_t ray) const { return (hit_at(ray).flags & cache::kHitOccluded) != 0; }
  [[nodiscard]] bool has_hit(uint32_t ray) const { return hit_at(ray).prim != PrimId::kNone; }
  [[nodiscard]] bool waits(uint32_t ray) const { return (hit_at(ray).flags & cache::kHitWaits) != 0; }
  void mark_waiting(uint32_t ray) const { hit_at(ray).flags |= cache::kHitWaits; }
  // Inlined at once: g++ takes a function that only prefetches for one without effect, and drops its calls.
  [[gnu::always_inline]] void prefetch(uint32_t ray) const {
    __builtin_prefetch(&ray_at(ray));
    __builtin_prefetch(&hit_at(ray), 1);
  }

  // Traces the ray through what is in memory, unless it was before. Returns the pages that are not, and remain.
  std::span<const cache::PageVisit> trace_first(uint32_t ray, VisitList& visits, cache::TraceCounters& work) const;
  // Through one page, as seen from an instance. The root of the page's tree is the check whether it is still ahead of
  // the hit.
  void trace_page(const cache::TracePageView& view, uint32_t instance, uint32_t ray, cache::TraceCounters& work) const;
  // The pages in [first, last) that the ray must still visit after trace_first().
  std::span<const cache::PageVisit> pages_ahead(uint32_t ray, uint32_t first, uint32_t last, VisitList& visits) const;
  // Whether a visit that was due still is.
  bool is_ahead(uint32_t ray, cache::PageVisit visit) const;
  // Those it meets before its hit, or before its light when it was occluded. `none`: views of no page.
  std::span<const cache::PageVisit> pages_before_hit(uint32_t ray, const cache::ResidentPages& none,
                                                     VisitList& visits) const;

  // Residents that trace_first() looked into; null when all pages fit.
  [[nodiscard]] uint8_t* used() { return used_.data(); }

  void add_work(const cache::TraceCounters& work) {
    nodes_ += work.nodes, leaves_ += work.leaves, page_visits_ += work.pages;
  }
  [[nodiscard]] cache::TraceCounters work() const { return {nodes_, leaves_, page_visits_}; }

 private:
  [[nodiscard]] const cache::TraceRay& ray_at(uint32_t ray) const {
    return is_path(ray) ? batch_.path_rays[ray] : batch_.shadow_rays[ray - batch_.path_rays.size()];
  }
  [[nodiscard]] cache::TraceHit& hit_at(uint32_t ray) const {
    return is_path(ray) ? batch_.path_hits[ray] : batch_.shadow_hits[ray - batch_.path_rays.size()];
  }
  [[nodiscard]] cache::TraceMode mode_of(uint32_t ray) const {
    return is_path(ray) ? cache::TraceMode::nearest : cache::TraceMode::occlusion;
  }
  // The pages that are traced before the sweep.
  [[nodiscard]] cache::ResidentPages known() const {
    if (goes_on_ && absent_.empty()) return pages_.kept();
    return absent_.empty() ? pages_.resident() : cache::ResidentPages{absent_.data()};
  }
  void keep_hit(uint32_t ray, const cache::TraceHit& hit) const;
  void note_cost(uint32_t ray, const cache::TraceCounters& before, const cache::TraceCounters& after,
                 uint32_t waits) const;

  const cache::PageTree& tree_;
  PageViews& pages_;
  const TraceBatch& batch_;
  const Buffer<cache::TracePageView> absent_;  // when resident pages do not come first: all are swept
  Buffer<uint8_t> used_;
  const bool goes_on_;
  const bool has_costs_;
  std::atomic<uint64_t> nodes_ = 0, leaves_ = 0, page_visits_ = 0;
};

}  // namespace spillway::pipeline
