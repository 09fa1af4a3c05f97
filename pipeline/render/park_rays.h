#pragma once

// Stage park_rays: rays that wait for pages leave the wave, until so many wait that a sweep is worth what it reads.
//
// In:  columns of a wave, and its hits, some of them marked kHitWaits by trace_rays.
// Out: those rays, given back to a later wave, which traces them from their beginnings and sweeps.
// Not: in scenes with media, or whose shadow rays carry more than these columns; where waves are spilled; while an access
//      log is written (which tells of each wave's own rays; replay_access parks them).
// Memory: tags rays and paths, for `limit` rays of each kind, at birth.
// Order: as the rays of the wave; which wave a ray is in shows nowhere.
// Why: a wave in memory is a few hundred thousand paths, and a few percent of its rays need most of the pages that are
//      not: a sweep a wave read two MiB for some hundred rays.

#include <algorithm>
#include <array>
#include <span>

#include "pipeline/records.h"
#include "pipeline/render/shade_hits.h"

namespace spillway::pipeline {

// When, of `limit` rays of each kind that may be parked so many are, a wave takes them back and sweeps.
[[nodiscard]] constexpr bool are_nearly_full(double paths, double shadows, double limit) {
  return 4 * std::max(paths, shadows) > 3 * limit;
}

template <class Record>
class ParkedColumn {
 public:
  explicit ParkedColumn(size_t limit)
      : rays_(MemoryTag::rays, limit), records_(MemoryTag::paths, limit), limit_(limit) {}
  [[nodiscard]] size_t size() const { return size_; }
  [[nodiscard]] size_t room() const { return limit_ - size_; }
  [[nodiscard]] const std::array<uint64_t, 2>& of_half() const { return of_half_; }

  // Copies what is marked; there is room for it.
  Status park(const RayColumns<Record>& wave, std::span<const cache::TraceHit> hits);
  // Gives back what the wave has room for, the latest first.
  Status unpark(RayColumns<Record>& wave, size_t wave_limit);

 private:
  Buffer<cache::TraceRay> rays_;
  Buffer<Record> records_;
  size_t limit_ = 0, size_ = 0;
  std::array<uint64_t, 2> of_half_ = {0, 0};
};

class ParkedRays {
 public:
  explicit ParkedRays(size_t limit) : paths_(limit), shadows_(limit), limit_(limit) {}
  [[nodiscard]] bool empty() const { return paths_.size() + shadows_.size() == 0; }
  [[nodiscard]] bool is_nearly_full() const { 
    return are_nearly_full(static_cast<double>(paths_.size()), static_cast<double>(shadows_.size()),
                           static_cast<double>(limit_));
  }
  [[nodiscard]] bool any_of_half(uint32_t half) const { return paths_.of_half()[half] + shadows_.of_half()[half] > 0; }
  [[nodiscard]] size_t path_room() const { return paths_.room(); }
  [[nodiscard]] size_t shadow_room() const { return shadows_.room(); }

  Status park(const RayColumns<PathRecord>& paths, std::span<const cache::TraceHit> path_hits,
              const RayColumns<ShadowRecord>& shadows, std::span<const cache::TraceHit> shadow_hits) {
    SPILLWAY_TRY(paths_.park(paths, path_hits));
    return shadows_.park(shadows, shadow_hits);
  }
  // The wave's columns have room for `most` rays each.
  Status unpark(RayColumns<PathRecord>& paths, RayColumns<ShadowRecord>& shadows, size_t most) {
    SPILLWAY_TRY(paths_.unpark(paths, most));
    return shadows_.unpark(shadows, most);
  }

 private:
  ParkedColumn<PathRecord> paths_;
  ParkedColumn<ShadowRecord> shadows_;
  size_t limit_;
};

}  // namespace spillway::pipeline
