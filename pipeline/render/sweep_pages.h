#pragma once

// The part of trace_rays that waits for pages: which rays need which pages that are not in memory, and one sweep over
// these.
//
// Memory: tag rays; as trace_rays.h says. Order: any gives the same hits; within a page all pairs of a ray belong to
// one task.

#include <atomic>
#include <mutex>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/render/pair_pool.h"
#include "pipeline/render/wave_rays.h"

namespace spillway::pipeline {

class PageSweep {
 public:
  PageSweep(WaveRays& rays, const TraceRaysOptions& options, PairMemory& memory, TraceRaysReport& report);

  // Traces what is in memory, and lists for each page the rays that still need it. Returns whether there are any.
  bool list_waiting();
  // Visits these pages, each once a window; but for those that few rays wait for, when there is room to park these.
  Status sweep();

 private:
  // Consecutive pages that are swept together.
  struct Window {
    uint32_t first_page, last_page;
    uint64_t pair_count;
    bool by_ray;  // too many pairs to hold: every waiting ray asks each page
  };

  void add_due(uint32_t ray, Cell& cell, uint32_t instance);
  void read_early(size_t chunk, size_t ray_count);
  void trace_span(const cache::TracePageView& view, std::span<const Pair> pairs, cache::TraceCounters& work) const;
  template <class Body>
  void for_each_waiting(size_t first, size_t last, const Body& body);

  Cell& cell(size_t chunk, uint32_t page) { return cells_[chunk * page_count_ + page]; }
  template <class Body>
  void for_each_chunk(const Body& body);
  void cut_chunks();
  std::vector<Window> cut_windows();
  void place_cells(const Window& window);
  void emit_pairs(const Window& window);
  bool is_needed(uint32_t page);
  void list_pages(const Window& window);
  void choose_late_pages();
  bool mark_late_rays();
  void park_late_rays();
  void cut_blocks(uint32_t page);
  void trace_pairs(uint32_t page, const cache::TracePageView& view);
  void trace_listed(uint32_t page, const cache::TracePageView& view);
  Status sweep_window(const Window& window);
  void trace_by_ray(uint32_t page, const cache::TracePageView& view);

  WaveRays& rays_;
  PairMemory& memory_;
  TraceRaysReport& report_;
  const uint32_t page_count_;
  const size_t block_;
  const uint64_t pair_capacity_;
  const size_t park_paths_, park_shadows_;
  const uint64_t park_pairs_;
  Buffer<uint64_t> waiting_;  // a bit for each place in the order: the ray met pages that are not in memory
  size_t chunk_count_ = 0, chunk_rays_ = 0;
  Buffer<Cell> cells_;  // [chunk][page]
  std::mutex early_;
  uint64_t counted_rays_ = 0, counted_pairs_ = 0;  // of the chunks that are done
  std::vector<uint64_t> page_pairs_;
  std::optional<PairPool> pool_;      // pairs as they were found,
  std::atomic<bool> listed_ = false;  // all of them;
  std::span<Pair> pairs_;             // else those of a window
  std::vector<uint32_t> window_pages_;
  std::vector<uint8_t> page_is_late_;  // for another wave; none: all are swept
  Buffer<uint8_t> ray_is_late_;        // needs a late page
  std::vector<std::pair<uint32_t, uint32_t>> blocks_;
};

}  // namespace spillway::pipeline
