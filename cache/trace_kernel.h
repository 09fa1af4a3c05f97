#pragma once

// Our one tracing kernel (AVX2): traces single rays through pages, in every memory regime.
//
// Returns the exact nearest hit whatever the order of pages and the shape of the trees: watertight triangle test on the
// stored vertices (Woop, Benthin, Wald 2013) whose (t, u, v) depends on ray and triangle alone; boxes rounded outwards
// at build time and padded by a margin a ray (some roundings of max(|origin|, scene extent)); a box is skipped only when
// its entry is greater than the nearest hit; equal t goes to the smaller (instance, prim).
//
// Threads: pure functions of their arguments. Memory: a fixed stack.

#include <cstdint>

#include "cache/ray.h"
#include "cache/trace_page.h"

namespace spillway::cache {

enum class TraceMode : uint8_t {
  nearest,    // paths
  occlusion,  // shadow rays: stops at the first opaque hit (kHitOccluded); else the nearest alpha-unknown hit
};

// Work counters; per call, added by the caller.
struct TraceCounters {
  uint64_t nodes = 0, leaves = 0, pages = 0;
};

// Which pages are in memory: view(page).header is null when it is not; its nodes are then the page's top (page_tops.h),
// or null where that is not known.
struct ResidentPages {
  const TracePageView* views = nullptr;
  [[nodiscard]] const TracePageView& view(uint32_t page) const { return views[page]; }
};

// No hit yet.
inline TraceHit no_hit(const TraceRay& ray) { return {ray.t_max, 0, 0, PrimId::kNone, 0, 0}; }

// Traces one ray through one page as seen from `instance` (0: no transform), shortening `hit`.
template <TraceMode mode>
void trace_page(const TracePageView& page, uint32_t instance, const PageTree& tree, const TraceRay& ray, TraceHit& hit,
                TraceCounters& work);

// A page that a ray must still be traced through, as seen from an instance.
struct PageVisit {
  uint32_t page, instance;
};
// Visits that are due, as far as there is room for them; `count` goes on.
struct DueVisits {
  PageVisit* visits = nullptr;
  size_t capacity = 0;
  size_t count = 0;
  uint8_t* used = nullptr;  // one a page, set where a triangle of a resident page was looked at; null: nobody asks
};

// Traces one ray through all resident pages, front to back. `due` gets the pages that are not resident and that the ray
// met on its way: all that pages_met() names afterwards, and some that lie behind the hit that was then found.
template <TraceMode mode>
void trace_resident(const PageTree& tree, const ResidentPages& pages, const TraceRay& ray, TraceHit& hit,
                    TraceCounters& work, DueVisits& due);

// Every page in [first_page, last_page) that is not resident and whose box (in every enclosing tree, and in its own as
// far as that is known) the ray enters at t <= hit.t. Writes at most `capacity` visits, returns how many there are;
// front to back inside each tree.
size_t pages_met(const PageTree& tree, const ResidentPages& pages, uint32_t first_page, uint32_t last_page,
                 TraceMode mode, const TraceRay& ray, const TraceHit& hit, PageVisit* visits, size_t capacity);

// Of visits that were due, moves those to the front that pages_met() names for what is now the hit, and returns how
// many they are: one look into each page's own tree. One that another box alone excludes, by its rounding, may remain.
size_t keep_visits_ahead(const PageTree& tree, const ResidentPages& pages, TraceMode mode, const TraceRay& ray,
                         const TraceHit& hit, std::span<PageVisit> visits);

}  // namespace spillway::cache
