#pragma once

// Stage trace_rays: every ray of a wave meets every page it must, resident pages first, then one sweep.
//
// In: hot columns of path and shadow rays, and the order (a permutation of all of them) that sort_rays chose.
// Out: a TraceHit each, at the ray's own index. Occluded shadow rays: kHitOccluded and nothing else.
// Memory: tag rays. None when every page is resident. Else one bit a ray, and when rays wait for pages: (page, ray)
//         pairs up to pair_limit_bytes, listed as they are found, and a table of them by page and range of rays (at
//         most 32 MiB). More pairs: they are found again, window of pages by window of pages; a page with more pairs
//         than the limit is met ray by ray, without pairs.
// Order: the nearest hit is a minimum over (t, instance, prim): any order of rays, pages, windows gives the same.
//        Within a page all pairs of a ray belong to one task.
// Based on: Hyperion (Eisenacher et al. 2013) for sorted batches; PantaRay (Pantaleoni et al. 2010) for paged geometry.
//           Here resident pages come first and shorten the rays, so that a page is read only when a ray still needs it.

#include <cstdint>
#include <span>

#include "cache/page_tops.h"
#include "cache/part_store.h"
#include "cache/ray.h"
#include "cache/trace_kernel.h"
#include "pipeline/render/pair_pool.h"
#include "pipeline/render/pixel_costs.h"

namespace spillway::pipeline {

struct TraceRaysOptions {
  uint64_t pair_limit_bytes = 64 << 20;  // 8 bytes a pair; larger: fewer windows, fewer passes through the page tree
  uint32_t block_rays = 512;             // rays or pairs a task
  bool resident_first = true;            // off: all pages are swept in file order (ablation)
  // Pages that fewer visits than park_pairs wait for are not read, when no more rays than these need one of them: the
  // rays are marked kHitWaits, and their hits are the nearest so far.
  size_t park_paths = 0, park_shadows = 0;
  uint64_t park_pairs = UINT64_MAX;
  // The hits given are such ones: what PageViews::kept() has was met.
  bool goes_on = false;
};

struct TraceRaysReport {
  uint64_t ray_count = 0, resident_only_count = 0, pair_count = 0, window_count = 0;
  uint64_t parked_count = 0;  // left to wait; not among ray_count
  uint64_t pages_touched = 0;  // swept: not resident at the wave's start, and some ray had to visit them
  cache::TraceCounters work;

  TraceRaysReport& operator+=(const TraceRaysReport& other);
};

// The pages of a store as the kernel sees them: views follow residency, through the store's on_residency().
class PageViews {
 public:
  // top_nodes: of each page kept once it was read, for as long as it is not in memory; 0: none.
  explicit PageViews(cache::PartStore& pages, uint32_t top_nodes = 0);
  PageViews(const PageViews&) = delete;
  PageViews& operator=(const PageViews&) = delete;
  ~PageViews();

  [[nodiscard]] cache::ResidentPages resident() const { return {views_.data()}; }
  // The pages that have been resident ever since keep(), the others as if they were not.
  void keep();
  [[nodiscard]] cache::ResidentPages kept() const { return {kept_.data()}; }
  // All pages as if none were in memory.
  [[nodiscard]] Buffer<cache::TracePageView> absent() const;
  // A page was read: its top is kept from now on.
  void note_read(uint32_t page, const cache::TracePageView& view);
  [[nodiscard]] cache::PartStore& pages() { return *pages_; }

 private:
  cache::PartStore* pages_;
  cache::PageTops tops_;
  Buffer<cache::TracePageView> views_, kept_;
};

struct TraceBatch {
  std::span<const cache::TraceRay> path_rays, shadow_rays;
  std::span<cache::TraceHit> path_hits, shadow_hits;
  std::span<const uint32_t> order;  // indices below path_rays.size() are paths, the rest shadow rays
  std::span<RayCost> path_costs = {}, shadow_costs = {};  // what each ray took is added. Empty: nobody asks
};

// Replaces `report`; `memory` is what pairs are listed in. Fails when a page cannot be read or is damaged; hits are then
// incomplete.
Status trace_rays(const cache::PageTree& tree, PageViews& pages, const TraceBatch& batch,
                  const TraceRaysOptions& options, PairMemory& memory, TraceRaysReport& report);

}  // namespace spillway::pipeline
