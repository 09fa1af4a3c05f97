#include "pipeline/render/sweep_pages.h"

#include <algorithm>
#include <bit>

#include "cache/base/parallel.h"
#include "cache/trace_log.h"

namespace spillway::pipeline {
namespace {

using cache::PageVisit;
using cache::TraceCounters;
using cache::TracePageView;

constexpr size_t kMaxCells = 4 << 20;  // 32 MiB
constexpr size_t kMaxChunks = 64;      // tasks of the counting passes: enough for 16 threads at four tasks each
constexpr size_t kWordRays = 64;       // rays a word of the waiting bits

}  // namespace

PageSweep::PageSweep(WaveRays& rays, const TraceRaysOptions& options, PairMemory& memory, TraceRaysReport& report)
    : rays_(rays),
      memory_(memory),
      report_(report),
      page_count_(rays.page_count()),
      block_((std::max<size_t>(options.block_rays, 1) + kWordRays - 1) / kWordRays * kWordRays),
      pair_capacity_(std::min<uint64_t>(options.pair_limit_bytes / sizeof(Pair), UINT32_MAX)),
      park_paths_(options.park_paths),
      park_shadows_(options.park_shadows),
      park_pairs_(options.park_pairs) {}

// ---- which rays wait for which pages ----

// Lists the pair while there is room for all of them, and counts it in any case.
void PageSweep::add_due(uint32_t ray, Cell& cell, uint32_t instance) {
  if (listed_.load(std::memory_order_relaxed) && pool_->add(cell, {ray, instance})) return;
  listed_.store(false, std::memory_order_relaxed);
  ++cell.count;
}

// Pages that are sure to be visited are read while other rays are still being traced through what is in memory. Sure are
// those that enough of this and earlier chunks' rays wait for, while it looks as if half of the room did for all pairs:
// several windows would each visit others. Which pages are first then hangs on time, and so does what rays take.
void PageSweep::read_early(size_t chunk, size_t ray_count) {
  if (rays_.has_costs()) return;  // those are the same for any number of threads
  const uint64_t enough = park_paths_ + park_shadows_ > 0 ? park_pairs_ : 1;
  const std::lock_guard lock(early_);
  counted_rays_ += ray_count;
  for (uint32_t page = 0; page < page_count_; ++page) counted_pairs_ += cell(chunk, page).count;
  const bool fit = 2 * counted_pairs_ * rays_.size() <= pair_capacity_ * counted_rays_;
  for (uint32_t page = 0; page < page_count_; ++page) {
    const uint64_t before = page_pairs_[page];
    page_pairs_[page] += cell(chunk, page).count;
    if (fit && before < enough && page_pairs_[page] >= enough) rays_.pages().pages().read_early(page);
  }
}

bool PageSweep::list_waiting() {
  cut_chunks();
  page_pairs_.assign(page_count_, 0);
  pool_.emplace(memory_, pair_capacity_ - pair_capacity_ / 32, chunk_count_ * page_count_);  // its links are the 32nd part
  listed_ = true;
  waiting_ = Buffer<uint64_t>(MemoryTag::rays, block_count(rays_.size(), kWordRays));
  std::atomic<uint64_t> waiting_count = 0;
  for_each_chunk([&](size_t chunk, size_t first, size_t last) {
    VisitList visits(rays_.used());
    TraceCounters work;
    uint64_t count = 0;
    for (size_t i = first; i < last; ++i) {
      if (i + kPrefetch < last) rays_.prefetch(rays_.in_order(i + kPrefetch));
      const uint32_t ray = rays_.in_order(i);
      const std::span<const PageVisit> due = rays_.trace_first(ray, visits, work);
      if (due.empty()) continue;
      waiting_[i / kWordRays] |= uint64_t{1} << (i % kWordRays);
      for (const PageVisit& visit : due) add_due(ray, cell(chunk, visit.page), visit.instance);
      ++count;
    }
    waiting_count += count;
    rays_.add_work(work);
    read_early(chunk, last - first);
  });
  report_.resident_only_count = rays_.size() - waiting_count;
  return waiting_count != 0;
}

// Calls body(ray) for the rays of [first, last) of the order that still wait, and lets those go for which it returns
// false or that are occluded by now; first is a multiple of kWordRays.
template <class Body>
void PageSweep::for_each_waiting(size_t first, size_t last, const Body& body) {
  for (size_t word = first / kWordRays; word < block_count(last, kWordRays); ++word) {
    for (uint64_t bits = waiting_[word]; bits != 0; bits &= bits - 1) {
      const uint32_t ray = rays_.in_order(word * kWordRays + static_cast<size_t>(std::countr_zero(bits)));
      if (rays_.is_occluded(ray) || !body(ray)) waiting_[word] &= ~(bits & -bits);
    }
  }
}

template <class Body>
void PageSweep::for_each_chunk(const Body& body) {
  parallel_blocks(rays_.size(), chunk_rays_, body);
}

// Chunks of the order, each counted by one task; they are multiples of the waiting bits' words.
void PageSweep::cut_chunks() {
  const size_t ray_count = rays_.size();
  const size_t most = std::clamp<size_t>(kMaxCells / std::max(page_count_, 1u), 1, kMaxChunks);
  chunk_rays_ = block_count(block_count(ray_count, most), block_) * block_;
  chunk_count_ = block_count(ray_count, chunk_rays_);
  cells_ = Buffer<Cell>(MemoryTag::rays, chunk_count_ * page_count_);
}

// Consecutive pages whose pairs fit together; pages that do not fit alone are met ray by ray.
std::vector<PageSweep::Window> PageSweep::cut_windows() {
  page_pairs_.assign(page_count_, 0);
  for (size_t chunk = 0; chunk < chunk_count_; ++chunk)
    for (uint32_t page = 0; page < page_count_; ++page) page_pairs_[page] += cell(chunk, page).count;
  std::vector<Window> windows;
  for (uint32_t page = 0; page < page_count_; ++page) {
    const uint64_t count = page_pairs_[page];
    if (count == 0) continue;
    const bool by_ray = count > pair_capacity_;
    const bool goes_on = !windows.empty() && windows.back().by_ray == by_ray &&
                         (by_ray || windows.back().pair_count + count <= pair_capacity_);
    if (!goes_on) windows.push_back({page, page, 0, by_ray});
    windows.back().last_page = page + 1;
    windows.back().pair_count += count;
  }
  return windows;
}

void PageSweep::place_cells(const Window& window) {
  uint32_t start = 0;
  for (uint32_t page = window.first_page; page < window.last_page; ++page) {
    for (size_t chunk = 0; chunk < chunk_count_; ++chunk) {
      Cell& c = cell(chunk, page);
      c.start = start;
      start += std::exchange(c.count, 0);
    }
  }
}

// Rays are shorter now than when they were counted, so that a cell never outgrows its place.
void PageSweep::emit_pairs(const Window& window) {
  place_cells(window);
  for_each_chunk([&](size_t chunk, size_t first, size_t last) {
    VisitList visits;
    for_each_waiting(first, last, [&](uint32_t ray) {
      for (const PageVisit& visit : rays_.pages_ahead(ray, window.first_page, window.last_page, visits)) {
        Cell& c = cell(chunk, visit.page);
        pairs_[c.start + c.count++] = {ray, visit.instance};
      }
      return true;
    });
  });
}

// Whether a waiting ray must visit the page; most often one of the first that are asked.
bool PageSweep::is_needed(uint32_t page) {
  std::atomic<bool> needed = false;
  for_each_chunk([&](size_t, size_t first, size_t last) {
    VisitList visits;
    for_each_waiting(first, last, [&](uint32_t ray) {
      if (!needed.load(std::memory_order_relaxed) && !rays_.pages_ahead(ray, page, page + 1, visits).empty())
        needed = true;
      return true;
    });
  });
  return needed;
}

// The pages of the window that some ray must still visit.
void PageSweep::list_pages(const Window& window) {
  window_pages_.clear();
  for (uint32_t page = window.first_page; page < window.last_page; ++page) {
    if (page_pairs_[page] == 0 || (!page_is_late_.empty() && page_is_late_[page] != 0)) continue;
    bool needed = window.by_ray && is_needed(page);
    for (size_t chunk = 0; chunk < chunk_count_ && !window.by_ray; ++chunk) needed |= cell(chunk, page).count > 0;
    if (needed) window_pages_.push_back(page);
  }
}

// ---- tracing a page ----

// Blocks of pairs for tasks; they end where a ray ends, since only one task may write its hit.
void PageSweep::cut_blocks(uint32_t page) {
  blocks_.clear();
  for (size_t chunk = 0; chunk < chunk_count_; ++chunk) {
    const Cell& c = cell(chunk, page);
    const uint32_t end = c.start + c.count;
    for (uint32_t first = c.start; first < end;) {
      uint32_t last = static_cast<uint32_t>(std::min<uint64_t>(end, first + uint64_t{block_}));
      while (last < end && pairs_[last].ray == pairs_[last - 1].ray) ++last;
      blocks_.emplace_back(first, last);
      first = last;
    }
  }
}

void PageSweep::trace_span(const TracePageView& view, std::span<const Pair> pairs, TraceCounters& work) const {
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (i + kPrefetch < pairs.size()) rays_.prefetch(pairs[i + kPrefetch].ray);
    rays_.trace_page(view, pairs[i].instance, pairs[i].ray, work);
  }
}

void PageSweep::trace_pairs(uint32_t page, const TracePageView& view) {
  cut_blocks(page);
  parallel_blocks(blocks_.size(), 1, [&](size_t block, size_t, size_t) {
    const auto [first, last] = blocks_[block];
    TraceCounters work;
    trace_span(view, {pairs_.data() + first, last - first}, work);
    rays_.add_work(work);
  });
  for (const auto& [first, last] : blocks_) report_.pair_count += last - first;
}

// A chunk's list is one task: a ray's pairs lie in one chunk.
void PageSweep::trace_listed(uint32_t page, const TracePageView& view) {
  parallel_blocks(chunk_count_, 1, [&](size_t chunk, size_t, size_t) {
    TraceCounters work;
    pool_->for_each_piece(cell(chunk, page), [&](std::span<const Pair> pairs) { trace_span(view, pairs, work); });
    rays_.add_work(work);
  });
  report_.pair_count += page_pairs_[page];
}

void PageSweep::trace_by_ray(uint32_t page, const TracePageView& view) {
  std::atomic<uint64_t> pair_count = 0;
  parallel_blocks(rays_.size(), block_, [&](size_t, size_t first, size_t last) {
    VisitList visits;
    TraceCounters work;
    uint64_t count = 0;
    for_each_waiting(first, last, [&](uint32_t ray) {
      const std::span<const PageVisit> ahead = rays_.pages_ahead(ray, page, page + 1, visits);
      for (const PageVisit& visit : ahead) rays_.trace_page(view, visit.instance, ray, work);
      count += ahead.size();
      return true;
    });
    pair_count += count;
    rays_.add_work(work);
  });
  report_.pair_count += pair_count;
}

Status PageSweep::sweep_window(const Window& window) {
  list_pages(window);
  if (window_pages_.empty()) return {};
  ++report_.window_count;
  report_.pages_touched += window_pages_.size();
  const cache::TraceSpan span("sweep", "sweep");
  return rays_.pages().pages().sweep(window_pages_, [&](uint32_t page, std::span<const std::byte> bytes) -> Status {
    const cache::TraceSpan page_span("sweep", "page");
    const TracePageView view = cache::trace_page_view(bytes);
    rays_.pages().note_read(page, view);
    if (window.by_ray)
      trace_by_ray(page, view);
    else
      listed_ ? trace_listed(page, view) : trace_pairs(page, view);
    return {};
  });
}

// ---- parking ----

// Those that few rays wait for are late, when all of these rays have room.
void PageSweep::choose_late_pages() {
  if (park_paths_ + park_shadows_ == 0) return;
  page_is_late_.assign(page_count_, 0);
  for (uint32_t page = 0; page < page_count_; ++page)
    page_is_late_[page] = page_pairs_[page] != 0 && page_pairs_[page] < park_pairs_;
  if (!mark_late_rays()) page_is_late_.clear();
}

bool PageSweep::mark_late_rays() {
  ray_is_late_ = Buffer<uint8_t>(MemoryTag::rays, rays_.size());
  std::atomic<size_t> paths = 0, shadows = 0;
  parallel_blocks(chunk_count_, 1, [&](size_t chunk, size_t, size_t) {
    size_t of_kind[2] = {0, 0};
    for (uint32_t page = 0; page < page_count_; ++page) {
      if (page_is_late_[page] == 0) continue;
      pool_->for_each_piece(cell(chunk, page), [&](std::span<const Pair> pairs) {
        for (const Pair& pair : pairs)
          if (std::exchange(ray_is_late_[pair.ray], 1) == 0) ++of_kind[rays_.is_path(pair.ray)];
      });
    }
    shadows += of_kind[0], paths += of_kind[1];
  });
  return paths + shadows > 0 && paths <= park_paths_ && shadows <= park_shadows_;
}

// Late rays whose late pages still lie before what they hit.
void PageSweep::park_late_rays() {
  std::atomic<uint64_t> parked = 0;
  parallel_blocks(chunk_count_, 1, [&](size_t chunk, size_t, size_t) {
    uint64_t count = 0;
    for (uint32_t page = 0; page < page_count_; ++page) {
      if (page_is_late_[page] == 0) continue;
      pool_->for_each_piece(cell(chunk, page), [&](std::span<const Pair> pairs) {
        for (const auto& [ray, instance] : pairs) {
          if (rays_.is_occluded(ray) || rays_.waits(ray)) continue;
          if (rays_.has_hit(ray) && !rays_.is_ahead(ray, {page, instance})) continue;
          rays_.mark_waiting(ray), ++count;
        }
      });
    }
    parked += count;
  });
  report_.parked_count = parked;
  report_.ray_count -= parked;
}

Status PageSweep::sweep() {
  const std::vector<Window> windows = cut_windows();
  if (listed_) {
    choose_late_pages();
    SPILLWAY_TRY(sweep_window({0, page_count_, 0, false}));
    if (!page_is_late_.empty()) park_late_rays();
    return {};
  }
  pool_.reset();
  uint64_t most = 0;
  for (const Window& window : windows)
    if (!window.by_ray) most = std::max(most, window.pair_count);
  memory_.pairs.grow(MemoryTag::rays, most);
  pairs_ = std::span(memory_.pairs).first(most);
  for (const Window& window : windows) {
    if (!window.by_ray) emit_pairs(window);
    SPILLWAY_TRY(sweep_window(window));
  }
  return {};
}

}  // namespace spillway::pipeline
