#include "pipeline/render/park_rays.h"

#include <atomic>
#include <numeric>
#include <vector>

#include "cache/base/check.h"
#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"
#include "cache/radix_sort.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBlock = 2048;
constexpr size_t kBatch = 8 * kBlock;
constexpr size_t kPrefetch = 8;  // rays ahead: slots lie in another order

bool waits(const cache::TraceHit& hit) { return (hit.flags & cache::kHitWaits) != 0; }

}  // namespace

template <class Record>
Status ParkedColumn<Record>::park(const RayColumns<Record>& wave, std::span<const cache::TraceHit> hits,
                                  std::span<const RayCost> costs, const EndStream* ends) {
  const size_t blocks = block_count(hits.size(), kBlock);
  std::vector<size_t> firsts(blocks + 1, 0);  // of a block's rays, among those that are marked
  parallel_blocks(hits.size(), kBlock, [&](size_t b, size_t first, size_t last) {
    firsts[b + 1] = static_cast<size_t>(std::count_if(hits.begin() + first, hits.begin() + last, waits));
  });
  std::partial_sum(firsts.begin(), firsts.end(), firsts.begin());
  const size_t count = firsts.back();
  SPILLWAY_CHECK(count, <=, room());
  std::array<std::atomic<uint64_t>, 2> of_half = {0, 0};
  const Status copied = parallel_status(blocks, [&](size_t b) -> Status {
    if (firsts[b] == firsts[b + 1]) return {};
    const size_t first = b * kBlock;
    std::vector<Record> records(std::min(kBlock, hits.size() - first));
    SPILLWAY_TRY(wave.cold.read(first, records));
    std::vector<shading::LightPlace> places(ends != nullptr ? records.size() : 0);
    if (ends != nullptr) SPILLWAY_TRY(ends->read(first, places));
    size_t which = firsts[b];
    std::array<uint64_t, 2> of_block = {0, 0};
    for (size_t i = 0; i < records.size(); ++i) {
      if (!waits(hits[first + i])) continue;
      const size_t slot = free_slot(which++);
      rays_[slot] = wave.hot[first + i], hits_[slot] = hits[first + i], records_[slot] = records[i];
      if (!costs.empty()) costs_[slot] = costs[first + i];
      if (ends != nullptr) ends_[slot] = places[i];
      ++of_block[records[i].sample & 1];
    }
    for (const int half : {0, 1}) of_half[half] += of_block[half];
    return {};
  });
  SPILLWAY_TRY(copied);
  for (const int half : {0, 1}) of_half_[half] += of_half[half];
  const size_t refilled = std::min(count, given_ - refilled_);
  refilled_ += refilled, end_ += count - refilled;
  return {};
}

template <class Record>
void ParkedColumn<Record>::move_slot(size_t from, size_t to) {
  rays_[to] = rays_[from], hits_[to] = hits_[from], records_[to] = records_[from];
  if (!costs_.empty()) costs_[to] = costs_[from];
  if (!ends_.empty()) ends_[to] = ends_[from];
}

template <class Record>
ParkedBatch ParkedColumn<Record>::gather() {
  SPILLWAY_CHECK(traced_count(), ==, 0u);
  // Rays beyond the count move to the slots below it that are free.
  const size_t count = size();
  Buffer<uint8_t> is_free(MemoryTag::rays, end_);
  for (size_t i = refilled_; i < given_; ++i) is_free[by_hit_[i]] = 1;
  size_t hole = 0;
  for (size_t slot = count; slot < end_; ++slot) {
    if (is_free[slot] != 0) continue;
    while (is_free[hole] == 0) ++hole;
    move_slot(slot, hole++);
  }
  end_ = count;
  traced_ = given_ = refilled_ = 0;
  return {{rays_.data(), count}, {hits_.data(), count}, {costs_.data(), costs_.empty() ? 0 : count}};
}

template <class Record>
void ParkedColumn<Record>::set_traced(SortRaysScratch& scratch) {
  traced_ = end_, given_ = refilled_ = 0;
  scratch.grow(traced_);
  const std::span items(scratch.items.data(), traced_);
  parallel_blocks(traced_, kBlock, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) items[i] = {hits_[i].prim, static_cast<uint32_t>(i)};
  });
  cache::radix_sort(items, {scratch.other.data(), traced_});
  parallel_blocks(traced_, kBlock, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) by_hit_[i] = items[i].index;
  });
}

template <class Record>
Status ParkedColumn<Record>::give_back(RayColumns<Record>& wave, std::span<cache::TraceHit> hits,
                                       std::span<RayCost> costs, EndStream* ends) {
  const size_t count = hits.size(), held = wave.hot.size();
  SPILLWAY_CHECK(count, <=, traced_count());
  SPILLWAY_CHECK(held + count, <=, wave.hot.capacity());
  wave.hot.set_size(held + count);
  if (ends != nullptr) SPILLWAY_TRY(give_back_ends(*ends, count));
  // The records in batches: they are copied once more, into the stream.
  Buffer<Record> records(MemoryTag::paths, std::min(count, kBatch));
  for (size_t start = 0; start < count; start += kBatch) {
    const size_t in_batch = std::min(kBatch, count - start);
    copy_next({wave.hot.data() + held + start, in_batch}, hits.subspan(start, in_batch),
              costs.empty() ? costs : costs.subspan(start, in_batch), records);
    SPILLWAY_TRY(wave.cold.append({records.data(), in_batch}));
  }
  return {};
}

// Before the rays: they are the next ones.
template <class Record>
Status ParkedColumn<Record>::give_back_ends(EndStream& ends, size_t count) const {
  std::vector<shading::LightPlace> places;
  for (size_t start = 0; start < count; start += kBatch) {
    places.clear();
    for (size_t i = start; i < std::min(count, start + kBatch); ++i) places.push_back(ends_[by_hit_[given_ + i]]);
    SPILLWAY_TRY(ends.append(places));
  }
  return {};
}

template <class Record>
void ParkedColumn<Record>::copy_next(std::span<cache::TraceRay> rays, std::span<cache::TraceHit> hits,
                                     std::span<RayCost> costs, std::span<Record> records) {
  const uint32_t* const slots = by_hit_.data() + given_;
  std::array<std::atomic<uint64_t>, 2> of_half = {0, 0};
  parallel_blocks(rays.size(), kBlock, [&](size_t, size_t first, size_t last) {
    std::array<uint64_t, 2> of_block = {0, 0};
    for (size_t i = first; i < last; ++i) {
      if (i + kPrefetch < last) {
        const uint32_t ahead = slots[i + kPrefetch];
        __builtin_prefetch(&rays_[ahead]), __builtin_prefetch(&hits_[ahead]), __builtin_prefetch(&records_[ahead]);
      }
      const uint32_t slot = slots[i];
      rays[i] = rays_[slot], hits[i] = hits_[slot], records[i] = records_[slot];
      if (!costs.empty()) costs[i] = costs_[slot];
      ++of_block[records[i].sample & 1];
    }
    for (const int half : {0, 1}) of_half[half] += of_block[half];
  });
  for (const int half : {0, 1}) of_half_[half] -= of_half[half];
  given_ += rays.size();
}

template class ParkedColumn<PathRecord>;
template class ParkedColumn<ShadowRecord>;

Status ParkedRays::sweep(const cache::PageTree& tree, PageViews& pages, const Bounds3& scene_bounds_world,
                         const SortRaysOptions& sort_options, TraceRaysOptions trace_options, PairMemory& memory,
                         TraceRaysReport& report) {
  const ParkedBatch paths = paths_.gather(), shadows = shadows_.gather();
  const size_t count = paths.rays.size() + shadows.rays.size();
  order_.grow(MemoryTag::rays, count);
  const std::span order(order_.data(), count);
  sort_rays(paths.rays, shadows.rays, scene_bounds_world, order, sort_options, sort_scratch_);
  trace_options.goes_on = true;
  const TraceBatch batch{paths.rays, shadows.rays, paths.hits, shadows.hits, order, paths.costs, shadows.costs};
  SPILLWAY_TRY(trace_rays(tree, pages, batch, trace_options, memory, report));
  pages.keep();  // nothing waits now
  paths_.set_traced(sort_scratch_);
  shadows_.set_traced(sort_scratch_);
  return {};
}

}  // namespace spillway::pipeline
