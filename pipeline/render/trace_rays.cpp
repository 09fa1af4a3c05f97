#include "pipeline/render/trace_rays.h"

#include <algorithm>

#include "cache/base/check.h"
#include "cache/base/parallel.h"
#include "pipeline/render/sweep_pages.h"
#include "pipeline/render/wave_rays.h"

namespace spillway::pipeline {
namespace {

void trace_all_resident(WaveRays& rays, size_t block) {
  parallel_blocks(rays.size(), block, [&](size_t, size_t first, size_t last) {
    VisitList visits;
    cache::TraceCounters work;
    for (size_t i = first; i < last; ++i) {
      if (i + kPrefetch < last) rays.prefetch(rays.in_order(i + kPrefetch));
      rays.trace_first(rays.in_order(i), visits, work);
    }
    rays.add_work(work);
  });
}

// Residents that rays looked into are wanted, as much as pages that a sweep reads.
void note_pages_used(WaveRays& rays) {
  for (uint32_t page = 0; page < rays.page_count(); ++page)
    if (rays.used()[page] != 0) rays.pages().pages().note_use(page);
}

}  // namespace

// ---- pages as the kernel sees them ----

PageViews::PageViews(cache::PartStore& pages, uint32_t top_nodes)
    : pages_(&pages), tops_(pages.size(), top_nodes), views_(MemoryTag::page_tree, pages.size()), kept_(MemoryTag::page_tree, pages.size()) {
  const auto follow = [this](uint32_t page, std::span<const std::byte> bytes) {
    views_[page] = bytes.empty() ? tops_.view(page) : cache::trace_page_view(bytes);
    if (bytes.empty()) kept_[page] = views_[page];
  };
  for (uint32_t page = 0; page < pages.size(); ++page) follow(page, pages.resident(page));
  pages.on_residency(follow);
}

Buffer<cache::TracePageView> PageViews::absent() const {
  Buffer<cache::TracePageView> views(MemoryTag::rays, views_.size());
  for (uint32_t page = 0; page < views.size(); ++page) views[page] = tops_.view(page);
  return views;
}

void PageViews::keep() { std::copy(views_.begin(), views_.end(), kept_.begin()); }

void PageViews::note_read(uint32_t page, const cache::TracePageView& view) {
  tops_.note(page, view);
  for (Buffer<cache::TracePageView>* const views : {&views_, &kept_})
    if ((*views)[page].header == nullptr) (*views)[page] = tops_.view(page);
}

PageViews::~PageViews() { pages_->on_residency({}); }

// ---- the stage ----

Status trace_rays(const cache::PageTree& tree, PageViews& pages, const TraceBatch& batch,
                  const TraceRaysOptions& options, PairMemory& memory, TraceRaysReport& report) {
  SPILLWAY_CHECK(batch.order.size(), ==, batch.path_rays.size() + batch.shadow_rays.size());
  SPILLWAY_CHECK(batch.path_hits.size(), ==, batch.path_rays.size());
  SPILLWAY_CHECK(batch.shadow_hits.size(), ==, batch.shadow_rays.size());
  report = {};
  report.ray_count = report.resident_only_count = batch.order.size();
  if (batch.order.empty()) return {};
  WaveRays rays(tree, pages, batch, options);
  const size_t block = std::max<size_t>(options.block_rays, 1);
  Status status;
  if (options.resident_first && pages.pages().all_resident()) {
    trace_all_resident(rays, block);
  } else {
    PageSweep sweep(rays, options, memory, report);
    const bool more = sweep.list_waiting();
    if (!pages.pages().fits()) note_pages_used(rays);
    if (more) status = sweep.sweep();
  }
  report.work = rays.work();
  return status;
}

TraceRaysReport& TraceRaysReport::operator+=(const TraceRaysReport& other) {
  parked_count += other.parked_count;
  ray_count += other.ray_count, resident_only_count += other.resident_only_count;
  pair_count += other.pair_count, window_count += other.window_count, pages_touched += other.pages_touched;
  work.nodes += other.work.nodes, work.leaves += other.work.leaves, work.pages += other.work.pages;
  return *this;
}

}  // namespace spillway::pipeline
