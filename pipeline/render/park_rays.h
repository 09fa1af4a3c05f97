#pragma once

// Stage park_rays: rays that wait for pages leave their wave for the lot, where one sweep of pages serves all of them.
//
// In:  columns of a wave, and its hits, some of them marked kHitWaits by trace_rays.
// Out: those rays, traced to their ends where they lie; later waves take them back with their hits, a portion each, in
//      the order of the triangles they hit, so that shading reads attributes in the order of their file. What media do
//      to them is found when they are back.
// Not: where waves are spilled; while an access log is written for `whatif`, which tells of each wave's own rays.
// Memory: tags rays and paths, for each of `limit` rays of each kind, at birth; while a sweep is on,
//         what trace_rays and sort_rays take besides.
// Order: which wave a ray is in, and in which it is traced, shows nowhere.
// Why: a wave in memory is some hundred thousand paths at 640 bytes each, and a sweep reads most of the pages that are
//      not there, however few rays need them. A path and a shadow ray in the lot take 276, those of the sweep included.
// Based on: the ray queues of Pharr et al. 1997, kept for all pages together instead of one a voxel.

#include <algorithm>
#include <array>
#include <span>

#include "pipeline/records.h"
#include "pipeline/render/shade_hits.h"
#include "pipeline/render/sort_rays.h"
#include "pipeline/render/trace_rays.h"

namespace spillway::pipeline {

// What a sweep traces.
struct ParkedBatch {
  std::span<const cache::TraceRay> rays;
  std::span<cache::TraceHit> hits;
  std::span<RayCost> costs;  // none when nobody asks
};

// When, of `limit` rays of each kind that may be parked so many are, they are swept.
[[nodiscard]] constexpr bool are_nearly_full(double paths, double shadows, double limit) {
  return 8 * std::max(paths, shadows) > 7 * limit;
}

// Where shadow rays end on their lights; see ShadowColumns.
using EndStream = cache::RecordStream<shading::LightPlace>;

// Rays of one kind. Slots below end_ hold rays, but for those that were given back and not taken again since.
template <class Record>
class ParkedColumn {
 public:
  // has_ends: of shadow rays, in scenes that look emission up.
  explicit ParkedColumn(size_t limit, bool has_costs, bool has_ends = false)
      : rays_(MemoryTag::rays, limit),
        hits_(MemoryTag::rays, limit),
        costs_(MemoryTag::rays, has_costs ? limit : 0),
        records_(MemoryTag::paths, limit),
        ends_(MemoryTag::paths, has_ends ? limit : 0),
        by_hit_(MemoryTag::rays, limit),
        limit_(limit) {}
  [[nodiscard]] size_t size() const { return end_ - (given_ - refilled_); }
  [[nodiscard]] size_t room() const { return limit_ - size(); }
  [[nodiscard]] size_t traced_count() const { return traced_ - given_; }
  [[nodiscard]] const std::array<uint64_t, 2>& of_half() const { return of_half_; }

  // Copies what is marked; there is room for it.
  Status park(const RayColumns<Record>& wave, std::span<const cache::TraceHit> hits, std::span<const RayCost> costs,
              const EndStream* ends = nullptr);

  // What a sweep is to trace: all rays, side by side. Only when none that was traced is left.
  ParkedBatch gather();
  // They are traced.
  void set_traced(SortRaysScratch& scratch);
  // Moves the next traced rays to the end of a wave's columns, which have room for them, and their hits and costs.
  Status give_back(RayColumns<Record>& wave, std::span<cache::TraceHit> hits, std::span<RayCost> costs,
                   EndStream* ends = nullptr);

 private:
  void move_slot(size_t from, size_t to);
  Status give_back_ends(EndStream& ends, size_t count) const;
  // Copies out the rays that are given back next, as many as there are places.
  void copy_next(std::span<cache::TraceRay> rays, std::span<cache::TraceHit> hits, std::span<RayCost> costs,
                 std::span<Record> records);
  [[nodiscard]] size_t free_slot(size_t which) const {
    const size_t freed = given_ - refilled_;
    return which < freed ? by_hit_[refilled_ + which] : end_ + which - freed;
  }

  Buffer<cache::TraceRay> rays_;
  Buffer<cache::TraceHit> hits_;
  Buffer<RayCost> costs_;
  Buffer<Record> records_;
  Buffer<shading::LightPlace> ends_;
  Buffer<uint32_t> by_hit_;  // slots that the last sweep traced, by triangle
  size_t limit_, end_ = 0;
  size_t traced_ = 0, given_ = 0, refilled_ = 0;  // of by_hit_: all; given back; of those, the slots that hold new rays
  std::array<uint64_t, 2> of_half_ = {0, 0};
};

class ParkedRays {
 public:
  ParkedRays(size_t limit, bool has_costs, bool has_ends)
      : paths_(limit, has_costs), shadows_(limit, has_costs, has_ends), limit_(limit) {}
  [[nodiscard]] bool empty() const { return paths_.size() + shadows_.size() == 0; }
  // Those that are to be given back first.
  [[nodiscard]] bool has_traced() const { return paths_.traced_count() + shadows_.traced_count() > 0; }
  [[nodiscard]] bool is_nearly_full() const {
    return are_nearly_full(static_cast<double>(paths_.size()), static_cast<double>(shadows_.size()),
                           static_cast<double>(limit_));
  }
  [[nodiscard]] bool any_of_half(uint32_t half) const { return paths_.of_half()[half] + shadows_.of_half()[half] > 0; }
  [[nodiscard]] ParkedColumn<PathRecord>& paths() { return paths_; }
  [[nodiscard]] ParkedColumn<ShadowRecord>& shadows() { return shadows_; }

  // Traces all that wait. Replaces `report`.
  Status sweep(const cache::PageTree& tree, PageViews& pages, const Bounds3& scene_bounds_world,
               const SortRaysOptions& sort_options, TraceRaysOptions trace_options, PairMemory& memory,
               TraceRaysReport& report);

 private:
  ParkedColumn<PathRecord> paths_;
  ParkedColumn<ShadowRecord> shadows_;
  size_t limit_;
  SortRaysScratch sort_scratch_;
  Buffer<uint32_t> order_;
};

}  // namespace spillway::pipeline
