#include "pipeline/render/trace_rays.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <optional>
#include <utility>
#include <vector>

#include "cache/base/check.h"
#include "cache/base/parallel.h"
#include "cache/trace_log.h"
#include "pipeline/render/pair_pool.h"

namespace spillway::pipeline {
namespace {

using cache::PageVisit;
using cache::TraceCounters;
using cache::TraceHit;
using cache::TraceMode;
using cache::TracePageView;
using cache::TraceRay;

// Consecutive pages that are swept together.
struct Window {
  uint32_t first_page, last_page;
  uint64_t pair_count;
  bool by_ray;  // too many pairs to hold: every waiting ray asks each page
};

// All that is kept of an occluded shadow ray: what occludes it would depend on the order.
constexpr TraceHit kOccluded = {0, 0, 0, PrimId::kNone, 0, cache::kHitOccluded};

constexpr size_t kMaxCells = 4 << 20;  // 32 MiB
constexpr size_t kMaxChunks = 64;      // tasks of the counting passes: enough for 16 threads at four tasks each
constexpr size_t kWordRays = 64;       // rays a word of the waiting bits
constexpr size_t kPrefetch = 8;        // rays ahead: rays and hits lie in another order than the one they are traced in
// One ray in this many is asked which resident pages it used: rebalance() wants to know the popular ones, and a page
// that so few rays need is a good one to lose. 1/64 keeps the asking below one percent of the tracing.
constexpr size_t kUseSample = 64;

// Work of all threads.
struct WorkSum {
  std::atomic<uint64_t> nodes = 0, leaves = 0, pages = 0;
  void add(const TraceCounters& work) { nodes += work.nodes, leaves += work.leaves, pages += work.pages; }
};

// Which pages a ray meets, in memory that grows with the longest answer.
class VisitList {
 public:
  VisitList() : visits_(64) {}
  // Traces the ray through what is resident; the rest is due, or more than that.
  std::span<const PageVisit> trace(const cache::PageTree& tree, cache::ResidentPages resident, TraceMode mode,
                                   const TraceRay& ray, TraceHit& hit, TraceCounters& work) {
    cache::DueVisits due{visits_.data(), visits_.size()};
    if (mode == TraceMode::nearest) cache::trace_resident<TraceMode::nearest>(tree, resident, ray, hit, work, due);
    if (mode == TraceMode::occlusion) cache::trace_resident<TraceMode::occlusion>(tree, resident, ray, hit, work, due);
    if ((hit.flags & cache::kHitOccluded) != 0) return {};
    if (due.count > visits_.size()) return met(tree, resident, 0, UINT32_MAX, mode, ray, hit);
    return {visits_.data(), due.count};
  }
  std::span<const PageVisit> met(const cache::PageTree& tree, cache::ResidentPages resident, uint32_t first,
                                 uint32_t last, TraceMode mode, const TraceRay& ray, const TraceHit& hit) {
    while (true) {
      const size_t count =
          cache::pages_met(tree, resident, first, last, mode, ray, hit, visits_.data(), visits_.size());
      if (count <= visits_.size()) return {visits_.data(), count};
      visits_.resize(2 * count);
    }
  }

 private:
  std::vector<PageVisit> visits_;
};

class Tracer {
 public:
  Tracer(const cache::PageTree& tree, PageViews& pages, const TraceBatch& batch, const TraceRaysOptions& options,
         TraceRaysReport& report)
      : tree_(tree), pages_(pages), batch_(batch), report_(report),
        page_count_(static_cast<uint32_t>(pages.pages().size())),
        block_((std::max<size_t>(options.block_rays, 1) + kWordRays - 1) / kWordRays * kWordRays),
        pair_capacity_(std::min<uint64_t>(options.pair_limit_bytes / sizeof(Pair), UINT32_MAX)),
        none_(MemoryTag::rays, options.resident_first && options.access == nullptr ? 0 : page_count_),
        resident_first_(options.resident_first),
        costs_(options.costs) {}

  void trace_all_resident();
  bool trace_resident_first();
  void note_pages_used();
  void log_needed(size_t camera_rays_from, WaveAccess& access) const;
  Status sweep();
  [[nodiscard]] TraceCounters work() const { return {work_.nodes, work_.leaves, work_.pages}; }

 private:
  [[nodiscard]] bool is_path(uint32_t ray) const { return ray < batch_.path_rays.size(); }
  [[nodiscard]] const TraceRay& ray_at(uint32_t ray) const {
    return is_path(ray) ? batch_.path_rays[ray] : batch_.shadow_rays[ray - batch_.path_rays.size()];
  }
  [[nodiscard]] TraceHit& hit_at(uint32_t ray) const {
    return is_path(ray) ? batch_.path_hits[ray] : batch_.shadow_hits[ray - batch_.path_rays.size()];
  }
  // The pages in [first, last) that the ray must still visit.
  std::span<const PageVisit> pages_ahead(uint32_t ray, uint32_t first, uint32_t last, VisitList& visits) const {
    const TraceMode mode = is_path(ray) ? TraceMode::nearest : TraceMode::occlusion;
    return visits.met(tree_, known(), first, last, mode, ray_at(ray), hit_at(ray));
  }
  // The pages that are traced before the sweep.
  [[nodiscard]] cache::ResidentPages known() const {
    return resident_first_ ? pages_.resident() : cache::ResidentPages{none_.data()};
  }
  // Inlined at once: g++ takes a function that only prefetches for one without effect, and drops its calls.
  [[gnu::always_inline]] void prefetch(uint32_t ray) const {
    __builtin_prefetch(&ray_at(ray));
    __builtin_prefetch(&hit_at(ray), 1);
  }
  std::span<const PageVisit> trace_first(uint32_t ray, VisitList& visits, TraceCounters& work) const;
  void note_cost(uint32_t ray, const TraceCounters& before, const TraceCounters& after, uint32_t waits) const {
    if (costs_.empty()) return;
    costs_[ray].tree_steps += static_cast<uint32_t>(after.nodes + after.leaves - before.nodes - before.leaves);
    costs_[ray].pages_waited += waits;
  }
  void add_due(uint32_t ray, Cell& cell, uint32_t instance);
  void trace_page(const TracePageView& view, uint32_t instance, uint32_t ray, TraceCounters& work) const;
  void trace_span(const TracePageView& view, std::span<const Pair> pairs, TraceCounters& work) const;
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
  void cut_blocks(uint32_t page);
  void trace_pairs(uint32_t page, const TracePageView& view);
  void trace_listed(uint32_t page, const TracePageView& view);
  Status sweep_window(const Window& window);
  void trace_by_ray(uint32_t page, const TracePageView& view);

  const cache::PageTree& tree_;
  PageViews& pages_;
  const TraceBatch& batch_;
  TraceRaysReport& report_;
  const uint32_t page_count_;
  const size_t block_;
  const uint64_t pair_capacity_;
  const Buffer<TracePageView> none_;  // with nothing resident, all pages are met
  const bool resident_first_;
  const std::span<RayCost> costs_;  // one task at a time has a ray

  WorkSum work_;
  Buffer<uint64_t> waiting_;  // a bit for each place in the order: the ray met pages that are not in memory
  size_t chunk_count_ = 0, chunk_rays_ = 0;
  Buffer<Cell> cells_;  // [chunk][page]
  std::vector<uint64_t> page_pairs_;
  std::optional<PairPool> pool_;      // pairs as they were found,
  std::atomic<bool> listed_ = false;  // all of them;
  Buffer<Pair> pairs_;                // else those of a window
  std::vector<uint32_t> window_pages_;
  std::vector<std::pair<uint32_t, uint32_t>> blocks_;
};

// ---- resident pages ----

// Returns the pages that are not in memory and remain for the ray.
std::span<const PageVisit> Tracer::trace_first(uint32_t ray, VisitList& visits, TraceCounters& work) const {
  const TraceRay& r = ray_at(ray);
  TraceHit hit = cache::no_hit(r);
  const TraceMode mode = is_path(ray) ? TraceMode::nearest : TraceMode::occlusion;
  const TraceCounters before = work;
  std::span<const PageVisit> due = visits.trace(tree_, pages_.resident(), mode, r, hit, work);
  note_cost(ray, before, work, 0);
  hit_at(ray) = (hit.flags & cache::kHitOccluded) != 0 ? kOccluded : hit;
  // What was due before the hit may lie behind it.
  if (!due.empty() && is_path(ray) && hit.prim != PrimId::kNone) due = pages_ahead(ray, 0, page_count_, visits);
  return due;
}

void Tracer::trace_all_resident() {
  parallel_blocks(batch_.order.size(), block_, [&](size_t, size_t first, size_t last) {
    VisitList visits;
    TraceCounters work;
    for (size_t i = first; i < last; ++i) {
      if (i + kPrefetch < last) prefetch(batch_.order[i + kPrefetch]);
      trace_first(batch_.order[i], visits, work);
    }
    work_.add(work);
  });
}

// Lists the pair while there is room for all of them, and counts it in any case.
void Tracer::add_due(uint32_t ray, Cell& cell, uint32_t instance) {
  if (listed_.load(std::memory_order_relaxed) && pool_->add(cell, {ray, instance})) return;
  listed_.store(false, std::memory_order_relaxed);
  ++cell.count;
}

// Traces what is in memory, and lists for each page the rays that still need it. Returns whether there are any.
bool Tracer::trace_resident_first() {
  cut_chunks();
  pool_.emplace(pair_capacity_ - pair_capacity_ / 32, chunk_count_ * page_count_);  // its links are the 32nd part
  listed_ = true;
  waiting_ = Buffer<uint64_t>(MemoryTag::rays, block_count(batch_.order.size(), kWordRays));
  std::atomic<uint64_t> waiting_count = 0;
  for_each_chunk([&](size_t chunk, size_t first, size_t last) {
    VisitList visits;
    TraceCounters work;
    uint64_t count = 0;
    for (size_t i = first; i < last; ++i) {
      if (i + kPrefetch < last) prefetch(batch_.order[i + kPrefetch]);
      const uint32_t ray = batch_.order[i];
      const std::span<const PageVisit> due = trace_first(ray, visits, work);
      if (due.empty()) continue;
      waiting_[i / kWordRays] |= uint64_t{1} << (i % kWordRays);
      for (const PageVisit& visit : due) add_due(ray, cell(chunk, visit.page), visit.instance);
      ++count;
    }
    waiting_count += count;
    work_.add(work);
  });
  report_.resident_only_count = batch_.order.size() - waiting_count;
  return waiting_count != 0;
}

void Tracer::note_pages_used() {
  Buffer<TracePageView> none(MemoryTag::rays, page_count_);  // with nothing resident, pages_met() names all pages
  std::vector<std::atomic<uint8_t>> used(page_count_);
  const size_t samples = block_count(batch_.order.size(), kUseSample);
  parallel_blocks(samples, block_, [&](size_t, size_t first, size_t last) {
    VisitList visits;
    for (size_t i = first; i < last; ++i) {
      const uint32_t ray = batch_.order[i * kUseSample];
      const TraceMode mode = is_path(ray) ? TraceMode::nearest : TraceMode::occlusion;
      for (const PageVisit& visit :
           visits.met(tree_, {none.data()}, 0, page_count_, mode, ray_at(ray), hit_at(ray)))
        used[visit.page].store(1, std::memory_order_relaxed);
    }
  });
  for (uint32_t page = 0; page < page_count_; ++page)
    if (used[page].load(std::memory_order_relaxed) != 0 && pages_.resident().view(page).header != nullptr)
      pages_.pages().note_use(page);
}

// By the final hits, as if nothing were in memory: the least that any run must look at. (What an occluded shadow ray
// needs depends on what is looked at first; it is left out.)
void Tracer::log_needed(size_t camera_rays_from, WaveAccess& access) const {
  enum : uint8_t { camera = 1, continued = 2, shadow = 4, sampled = 8 };
  std::vector<std::atomic<uint8_t>> needed(page_count_);
  parallel_blocks(batch_.order.size(), block_, [&](size_t, size_t first, size_t last) {
    VisitList visits;
    for (size_t i = first; i < last; ++i) {
      const uint32_t ray = batch_.order[i];
      const TraceMode mode = is_path(ray) ? TraceMode::nearest : TraceMode::occlusion;
      const uint8_t kind = static_cast<uint8_t>((!is_path(ray) ? shadow : ray >= camera_rays_from ? camera : continued) |
                                                (i % kUseSample == 0 ? sampled : 0));
      for (const PageVisit& visit : visits.met(tree_, {none_.data()}, 0, page_count_, mode, ray_at(ray), hit_at(ray)))
        if ((needed[visit.page].load(std::memory_order_relaxed) & kind) != kind) needed[visit.page].fetch_or(kind);
    }
  });
  for (uint32_t page = 0; page < page_count_; ++page) {
    const uint8_t kinds = needed[page].load(std::memory_order_relaxed);
    if (kinds & camera) access.camera_pages.push_back(page);
    if (kinds & continued) access.continued_pages.push_back(page);
    if (kinds & shadow) access.shadow_pages.push_back(page);
    if (kinds & sampled) access.sampled_pages.push_back(page);
  }
}

// ---- the sweep: which rays wait for which pages ----

// Calls body(ray) for the rays of [first, last) of the order that still wait, and lets those go for which it returns
// false or that are occluded by now; first is a multiple of kWordRays.
template <class Body>
void Tracer::for_each_waiting(size_t first, size_t last, const Body& body) {
  for (size_t word = first / kWordRays; word < block_count(last, kWordRays); ++word) {
    for (uint64_t bits = waiting_[word]; bits != 0; bits &= bits - 1) {
      const uint32_t ray = batch_.order[word * kWordRays + static_cast<size_t>(std::countr_zero(bits))];
      const bool occluded = (hit_at(ray).flags & cache::kHitOccluded) != 0;
      if (occluded || !body(ray)) waiting_[word] &= ~(bits & -bits);
    }
  }
}

template <class Body>
void Tracer::for_each_chunk(const Body& body) {
  parallel_blocks(batch_.order.size(), chunk_rays_, body);
}

// Chunks of the order, each counted by one task; they are multiples of the waiting bits' words.
void Tracer::cut_chunks() {
  const size_t ray_count = batch_.order.size();
  const size_t most = std::clamp<size_t>(kMaxCells / std::max(page_count_, 1u), 1, kMaxChunks);
  chunk_rays_ = block_count(block_count(ray_count, most), block_) * block_;
  chunk_count_ = block_count(ray_count, chunk_rays_);
  cells_ = Buffer<Cell>(MemoryTag::rays, chunk_count_ * page_count_);
}

// Consecutive pages whose pairs fit together; pages that do not fit alone are met ray by ray.
std::vector<Window> Tracer::cut_windows() {
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

void Tracer::place_cells(const Window& window) {
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
void Tracer::emit_pairs(const Window& window) {
  place_cells(window);
  for_each_chunk([&](size_t chunk, size_t first, size_t last) {
    VisitList visits;
    for_each_waiting(first, last, [&](uint32_t ray) {
      for (const PageVisit& visit : pages_ahead(ray, window.first_page, window.last_page, visits)) {
        Cell& c = cell(chunk, visit.page);
        pairs_[c.start + c.count++] = {ray, visit.instance};
      }
      return true;
    });
  });
}

// Whether a waiting ray must visit the page; most often one of the first that are asked.
bool Tracer::is_needed(uint32_t page) {
  std::atomic<bool> needed = false;
  for_each_chunk([&](size_t, size_t first, size_t last) {
    VisitList visits;
    for_each_waiting(first, last, [&](uint32_t ray) {
      if (!needed.load(std::memory_order_relaxed) && !pages_ahead(ray, page, page + 1, visits).empty()) needed = true;
      return true;
    });
  });
  return needed;
}

// The pages of the window that some ray must still visit.
void Tracer::list_pages(const Window& window) {
  window_pages_.clear();
  for (uint32_t page = window.first_page; page < window.last_page; ++page) {
    if (page_pairs_[page] == 0) continue;
    bool needed = window.by_ray && is_needed(page);
    for (size_t chunk = 0; chunk < chunk_count_ && !window.by_ray; ++chunk) needed |= cell(chunk, page).count > 0;
    if (needed) window_pages_.push_back(page);
  }
}

// ---- the sweep: tracing a page ----

// The root of the page's tree is the check whether the page is still ahead of the hit.
void Tracer::trace_page(const TracePageView& view, uint32_t instance, uint32_t ray, TraceCounters& work) const {
  TraceHit hit = hit_at(ray);
  if ((hit.flags & cache::kHitOccluded) != 0) return;
  const TraceCounters before = work;
  if (is_path(ray)) cache::trace_page<TraceMode::nearest>(view, instance, tree_, ray_at(ray), hit, work);
  if (!is_path(ray)) cache::trace_page<TraceMode::occlusion>(view, instance, tree_, ray_at(ray), hit, work);
  note_cost(ray, before, work, 1);
  hit_at(ray) = (hit.flags & cache::kHitOccluded) != 0 ? kOccluded : hit;
}

// Blocks of pairs for tasks; they end where a ray ends, since only one task may write its hit.
void Tracer::cut_blocks(uint32_t page) {
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

void Tracer::trace_span(const TracePageView& view, std::span<const Pair> pairs, TraceCounters& work) const {
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (i + kPrefetch < pairs.size()) prefetch(pairs[i + kPrefetch].ray);
    trace_page(view, pairs[i].instance, pairs[i].ray, work);
  }
}

void Tracer::trace_pairs(uint32_t page, const TracePageView& view) {
  cut_blocks(page);
  parallel_blocks(blocks_.size(), 1, [&](size_t block, size_t, size_t) {
    const auto [first, last] = blocks_[block];
    TraceCounters work;
    trace_span(view, {pairs_.data() + first, last - first}, work);
    work_.add(work);
  });
  for (const auto& [first, last] : blocks_) report_.pair_count += last - first;
}

// A chunk's list is one task: a ray's pairs lie in one chunk.
void Tracer::trace_listed(uint32_t page, const TracePageView& view) {
  parallel_blocks(chunk_count_, 1, [&](size_t chunk, size_t, size_t) {
    TraceCounters work;
    pool_->for_each_piece(cell(chunk, page), [&](std::span<const Pair> pairs) { trace_span(view, pairs, work); });
    work_.add(work);
  });
  report_.pair_count += page_pairs_[page];
}

void Tracer::trace_by_ray(uint32_t page, const TracePageView& view) {
  std::atomic<uint64_t> pair_count = 0;
  parallel_blocks(batch_.order.size(), block_, [&](size_t, size_t first, size_t last) {
    VisitList visits;
    TraceCounters work;
    uint64_t count = 0;
    for_each_waiting(first, last, [&](uint32_t ray) {
      const std::span<const PageVisit> ahead = pages_ahead(ray, page, page + 1, visits);
      for (const PageVisit& visit : ahead) trace_page(view, visit.instance, ray, work);
      count += ahead.size();
      return true;
    });
    pair_count += count;
    work_.add(work);
  });
  report_.pair_count += pair_count;
}

Status Tracer::sweep_window(const Window& window) {
  list_pages(window);
  ++report_.window_count;
  report_.pages_touched += window_pages_.size();
  const cache::TraceSpan span("sweep", "sweep");
  return pages_.pages().sweep(window_pages_, [&](uint32_t page, std::span<const std::byte> bytes) -> Status {
    const cache::TraceSpan page_span("sweep", "page");
    const TracePageView view = cache::trace_page_view(bytes);
    if (window.by_ray)
      trace_by_ray(page, view);
    else
      listed_ ? trace_listed(page, view) : trace_pairs(page, view);
    return {};
  });
}

Status Tracer::sweep() {
  const std::vector<Window> windows = cut_windows();
  if (listed_) return sweep_window({0, page_count_, 0, false});
  pool_.reset();
  uint64_t most = 0;
  for (const Window& window : windows)
    if (!window.by_ray) most = std::max(most, window.pair_count);
  pairs_ = Buffer<Pair>(MemoryTag::rays, most);
  for (const Window& window : windows) {
    if (!window.by_ray) emit_pairs(window);
    SPILLWAY_TRY(sweep_window(window));
  }
  return {};
}

}  // namespace

// ---- the stage ----

PageViews::PageViews(cache::PartStore& pages) : pages_(&pages), views_(MemoryTag::page_tree, pages.size()) {
  const auto follow = [this](uint32_t page, std::span<const std::byte> bytes) {
    views_[page] = bytes.empty() ? cache::TracePageView{} : cache::trace_page_view(bytes);
  };
  for (uint32_t page = 0; page < pages.size(); ++page) follow(page, pages.resident(page));
  pages.on_residency(follow);
}

PageViews::~PageViews() { pages_->on_residency({}); }

Status trace_rays(const cache::PageTree& tree, PageViews& pages, const TraceBatch& batch,
                  const TraceRaysOptions& options, TraceRaysReport& report) {
  SPILLWAY_CHECK(batch.order.size(), ==, batch.path_rays.size() + batch.shadow_rays.size());
  SPILLWAY_CHECK(batch.path_hits.size(), ==, batch.path_rays.size());
  SPILLWAY_CHECK(batch.shadow_hits.size(), ==, batch.shadow_rays.size());
  report = {};
  report.ray_count = report.resident_only_count = batch.order.size();
  if (batch.order.empty()) return {};
  Tracer tracer(tree, pages, batch, options, report);
  Status status;
  if (options.resident_first && pages.pages().all_resident()) {
    tracer.trace_all_resident();
  } else {
    const bool more = tracer.trace_resident_first();
    if (!pages.pages().fits()) tracer.note_pages_used();
    if (more) status = tracer.sweep();
  }
  if (options.access != nullptr && status) tracer.log_needed(options.camera_rays_from, *options.access);
  report.work = tracer.work();
  return status;
}

TraceRaysReport& TraceRaysReport::operator+=(const TraceRaysReport& other) {
  ray_count += other.ray_count, resident_only_count += other.resident_only_count;
  pair_count += other.pair_count, window_count += other.window_count, pages_touched += other.pages_touched;
  work.nodes += other.work.nodes, work.leaves += other.work.leaves, work.pages += other.work.pages;
  return *this;
}

}  // namespace spillway::pipeline
