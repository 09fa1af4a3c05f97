#include "pipeline/render/log_needs.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <ctime>
#include <numeric>

#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBlockRays = 512;
constexpr size_t kOccludedBatch = 1 << 17;       // some 12 pairs of 16 bytes each share a sweep
constexpr uint64_t kProbedBytes = 256ull << 20;  // read again to learn how fast that is
constexpr double kRaysAPath = 4;                 // about, shadow rays included: it sets the size of samples alone
constexpr uint64_t kBoxedOfSamples = 8;          // boxes are many
constexpr size_t kMostBoxesBehind = 64;
constexpr size_t kNeedKinds = kRayKinds + 1;

enum : uint8_t { kOfCamera = 1, kOfContinued = 2, kOfShadow = 4, kBoxOfCamera = 8, kBoxOfLater = 16 };

void sort_unique(std::vector<uint32_t>& items) {
  std::ranges::sort(items);
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

bool contains(const std::vector<uint32_t>& list, uint32_t page) { return std::ranges::find(list, page) != list.end(); }

}  // namespace

struct NeedsLog::OccludedPair {
  uint32_t page, ray, instance;
  uint32_t occludes;
};

// The rays of one wave as the log sees them.
class NeedsLog::WaveNeeds {
 public:
  WaveNeeds(const NeedsLog& log, PageViews& pages, const TraceBatch& batch, size_t camera_rays_from)
      : log_(log),
        batch_(batch),
        camera_from_(camera_rays_from),
        rays_(log.tree_, pages, batch, {}),
        flags_(log.with_tops_.size()),
        sampled_(kNeedKinds * log.with_tops_.size()),
        singles_(kNeedKinds * log.with_tops_.size()),
        samples_(block_count(batch.order.size(), kBlockRays)) {
    parallel_blocks(batch.order.size(), kBlockRays, [&](size_t block, size_t first, size_t last) {
      VisitList visits;
      for (size_t i = first; i < last; ++i) add(batch.order[i], visits, samples_[block]);
    });
    add_singles();
  }

  // Shadow rays that something occludes, by their numbers among these.
  [[nodiscard]] const std::vector<uint32_t>& occluded_singles() const { return occluded_singles_; }

  [[nodiscard]] uint8_t flags(uint32_t page) const { return flags_[page].load(std::memory_order_relaxed); }
  // Camera rays in the order in which they begin, others by their paths: near each other.
  std::vector<SampledRay> samples() {
    std::vector<Sample> all;
    for (auto& some : samples_) std::ranges::move(some, std::back_inserter(all));
    std::ranges::sort(all, {}, [](const Sample& s) {
      const RayKind kind = s.ray.needs.kind;
      return std::tuple(kind, kind == RayKind::camera ? s.index : s.ray.path, s.index);
    });
    std::vector<SampledRay> rays;
    for (Sample& sample : all) rays.push_back(std::move(sample.ray));
    return rays;
  }

 private:
  struct Sample {
    uint64_t index;
    SampledRay ray;
  };
  void mark(uint32_t page, uint8_t bit) {
    if ((flags_[page].load(std::memory_order_relaxed) & bit) == 0) flags_[page].fetch_or(bit);
  }
  [[nodiscard]] RayKind kind_of(uint32_t ray) const {
    if (!rays_.is_path(ray)) return RayKind::shadow;
    return ray >= camera_from_ ? RayKind::camera : RayKind::continued;
  }
  [[nodiscard]] const cache::TraceRay& ray_at(uint32_t ray) const {
    return rays_.is_path(ray) ? batch_.path_rays[ray] : batch_.shadow_rays[ray - batch_.path_rays.size()];
  }

  // Of the wave's rays that are no samples the first ones, by a number of their paths, that need each page.
  void note_need(uint32_t page, size_t kind, uint32_t ray, bool is_sampled) {
    const size_t cell = page * kNeedKinds + kind;
    if (is_sampled) {
      sampled_[cell].store(true, std::memory_order_relaxed);
      return;
    }
    if (sampled_[cell].load(std::memory_order_relaxed)) return;
    const uint64_t rank = (mix64(log_.keys_[ray]) >> 32 << 32 | ray) + 1;
    uint64_t least = singles_[cell].load(std::memory_order_relaxed);
    while ((least == 0 || rank < least) && !singles_[cell].compare_exchange_weak(least, rank)) {
    }
  }

  void add_singles() {
    std::vector<uint32_t> chosen;
    for (size_t cell = 0; cell < singles_.size(); ++cell)
      if (!sampled_[cell] && singles_[cell] != 0) chosen.push_back(static_cast<uint32_t>(singles_[cell] - 1));
    sort_unique(chosen);
    VisitList visits;
    samples_.emplace_back();
    for (const uint32_t ray : chosen) {
      if (rays_.is_occluded(ray)) {
        occluded_singles_.push_back(ray - static_cast<uint32_t>(batch_.path_rays.size()));
        continue;
      }
      add_needs(ray, rays_.pages_before_hit(ray, {log_.with_tops_.data()}, visits), visits, samples_.back());
      samples_.back().back().ray.needs.is_single = true;
    }
  }

  void add(uint32_t ray, VisitList& visits, std::vector<Sample>& samples) {
    const bool is_sampled = log_.is_sampled(log_.keys_[ray]), is_occluded = rays_.is_occluded(ray);
    const RayKind kind = kind_of(ray);
    const auto met = rays_.pages_before_hit(ray, {log_.with_tops_.data()}, visits);
    for (const cache::PageVisit& visit : met)
      note_need(visit.page, is_occluded ? kRayKinds : static_cast<size_t>(kind), ray, is_sampled);
    if (is_occluded) return;
    for (const cache::PageVisit& visit : met) mark(visit.page, static_cast<uint8_t>(1u << static_cast<int>(kind)));
    if (is_sampled) add_needs(ray, met, visits, samples);
  }

  void add_needs(uint32_t ray, std::span<const cache::PageVisit> met, VisitList& visits, std::vector<Sample>& samples) {
    const RayKind kind = kind_of(ray);
    const uint64_t path = log_.keys_[ray];
    RayNeeds& needs = samples.emplace_back(Sample{ray, {path, {.kind = kind}}}).ray.needs;
    for (const cache::PageVisit& visit : met) needs.pages.push_back(visit.page);
    if (rays_.is_path(ray) && batch_.path_hits[ray].prim != PrimId::kNone) {
      // Front to back: the hit is in the last one that is seen from its instance, most often.
      for (const cache::PageVisit& visit : met)
        if (visit.instance == batch_.path_hits[ray].instance) needs.stops = {visit.page};
      if (!needs.stops.empty()) add_behind(ray, visits, needs);
    }
    sort_unique(needs.pages);
    if (log_.is_boxed(path))
      log_.add_boxes(ray_at(ray), rays_.is_path(ray) ? cache::TraceMode::nearest : cache::TraceMode::occlusion,
                     rays_.is_path(ray) ? batch_.path_hits[ray].t : ray_at(ray).t_max, visits, needs);
    const uint8_t box = kind == RayKind::camera ? kBoxOfCamera : kBoxOfLater;
    for (const cache::PageVisit& visit : rays_.pages_before_hit(ray, {log_.none_.data()}, visits))
      mark(visit.page, box);
  }

  // What the ray would meet without its hit.
  void add_behind(uint32_t ray, VisitList& visits, RayNeeds& needs) const {
    for (const cache::PageVisit& visit :
         visits.met(log_.tree_, {log_.with_tops_.data()}, 0, UINT32_MAX, cache::TraceMode::nearest, ray_at(ray),
                    cache::no_hit(ray_at(ray)))) {
      if (needs.stops.size() > RayNeeds::kMostBehind) return;
      if (!contains(needs.pages, visit.page) && !contains(needs.stops, visit.page)) needs.stops.push_back(visit.page);
    }
  }

  const NeedsLog& log_;
  const TraceBatch& batch_;
  const size_t camera_from_;
  WaveRays rays_;
  std::vector<std::atomic<uint8_t>> flags_;
  // Of each page, by kind, those that are occluded last: whether a sample needs it, else which ray, plus one.
  std::vector<std::atomic<bool>> sampled_;
  std::vector<std::atomic<uint64_t>> singles_;
  std::vector<uint32_t> occluded_singles_;
  std::vector<std::vector<Sample>> samples_;
};

uint64_t NeedsLog::sampled_of(const SceneFacts& facts) {
  const double rays = static_cast<double>(facts.pixel_count) * facts.samples_per_pixel * kRaysAPath;
  const double most = static_cast<double>(kMostSamples);
  return rays <= most ? 1 : std::bit_ceil(static_cast<uint64_t>(std::min(rays / most, 1e9)));
}

NeedsLog::NeedsLog(const cache::PageTree& tree, AccessLog& log, uint64_t sampled_of)
    : tree_(tree),
      log_(log),
      sampled_of_(sampled_of),
      boxed_of_(sampled_of == 1 ? 1 : sampled_of * kBoxedOfSamples),
      stride_(log.facts.scene.samples_per_pixel + 1) {}

// The same paths for any waves.
Status NeedsLog::read_keys(const TraceBatch& batch, const cache::RecordStream<PathRecord>& paths,
                           const cache::RecordStream<ShadowRecord>& shadows) {
  const size_t path_count = batch.path_rays.size(), shadow_count = batch.shadow_rays.size();
  keys_.resize(path_count + shadow_count);
  const auto read = [&](const auto& stream, auto record, size_t count, uint64_t* keys) {
    return parallel_status(block_count(count, kBlockRays), [&](size_t block) -> Status {
      const size_t first = block * kBlockRays;
      std::vector<decltype(record)> records(std::min(kBlockRays, count - first));
      SPILLWAY_TRY(stream.read(first, records));
      for (size_t i = 0; i < records.size(); ++i) keys[first + i] = key_of(records[i].sink, records[i].sample);
      return {};
    });
  };
  SPILLWAY_TRY(read(paths, PathRecord{}, path_count, keys_.data()));
  return read(shadows, ShadowRecord{}, shadow_count, keys_.data() + path_count);
}

// Those before the hit, and, as far as is known of what lies behind it, where they come among that.
void NeedsLog::add_boxes(const cache::TraceRay& ray, cache::TraceMode mode, float t_hit, VisitList& visits,
                         RayNeeds& needs) const {
  needs.knows_boxes = true;
  cache::TraceHit hit = cache::no_hit(ray);
  hit.t = t_hit;
  const auto is_top = [&](uint32_t page) { return contains(needs.pages, page) || contains(needs.stops, page); };
  for (const cache::PageVisit& visit : visits.met(tree_, {none_.data()}, 0, UINT32_MAX, mode, ray, hit))
    if (!contains(needs.pages, visit.page)) needs.boxes.push_back(visit.page);
  sort_unique(needs.boxes);
  if (mode == cache::TraceMode::occlusion || needs.stops.empty()) return;
  uint32_t place = 1;
  std::vector<uint32_t> seen;
  for (const cache::PageVisit& visit :
       visits.met(tree_, {none_.data()}, 0, UINT32_MAX, mode, ray, cache::no_hit(ray))) {
    if (place > RayNeeds::kMostBehind || seen.size() == kMostBoxesBehind) return;
    if (place < needs.stops.size() && needs.stops[place] == visit.page) ++place;
    if (is_top(visit.page) || contains(needs.boxes, visit.page) || contains(seen, visit.page)) continue;
    seen.push_back(visit.page);
    needs.boxes_behind.emplace_back(place, visit.page);
  }
}

// ---- before the first wave ----

Status NeedsLog::read_tops(cache::PartStore& pages, uint32_t nodes_a_page) {
  const auto page_count = static_cast<uint32_t>(pages.size());
  tops_ = cache::PageTops(page_count, nodes_a_page);
  none_ = Buffer<cache::TracePageView>(MemoryTag::trace_log, page_count);
  with_tops_ = Buffer<cache::TracePageView>(MemoryTag::trace_log, page_count);
  std::vector<uint32_t> all(page_count);
  std::iota(all.begin(), all.end(), 0u);
  SPILLWAY_TRY(pages.sweep(all, [&](uint32_t page, std::span<const std::byte> bytes) -> Status {
    tops_.note(page, cache::trace_page_view(bytes));
    return {};
  }));
  for (uint32_t page = 0; page < page_count; ++page) with_tops_[page] = tops_.view(page), none_[page] = {};
  // They are known now, as pages are that a render reads again.
  const uint64_t before = pages.counters().bytes_read;
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t cpu_start = std::clock();  // of all threads
  for (uint32_t first = 0; first < page_count && pages.counters().bytes_read - before < kProbedBytes; first += 32) {
    const std::span<const uint32_t> some = std::span(all).subspan(first, std::min(32u, page_count - first));
    SPILLWAY_TRY(pages.sweep(some, [](uint32_t, std::span<const std::byte>) -> Status { return {}; }));
  }
  log_.facts.probe_bytes = pages.counters().bytes_read - before;
  log_.facts.probe_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  log_.facts.probe_cpu_seconds = static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC;
  log_.facts.threads = static_cast<uint64_t>(tbb::this_task_arena::max_concurrency());
  log_.facts.sampled_of = sampled_of_, log_.facts.boxed_of = boxed_of_;
  return {};
}

// ---- each wave ----

void NeedsLog::add_lists(const WaveNeeds& needs) {
  WaveAccess& access = log_.wave();
  for (uint32_t page = 0; page < with_tops_.size(); ++page) {
    const uint8_t flags = needs.flags(page);
    if (flags & kOfCamera) access.camera_pages.push_back(page);
    if (flags & kOfContinued) access.continued_pages.push_back(page);
    if (flags & kOfShadow) access.shadow_pages.push_back(page);
    if (flags & kBoxOfCamera) access.camera_boxes.push_back(page);
    if (flags & kBoxOfLater) access.later_boxes.push_back(page);
  }
}

void NeedsLog::add_occluded(const TraceBatch& batch, const std::vector<uint32_t>& singles) {
  const auto wave = static_cast<uint32_t>(log_.waves.size() - 1);
  const std::span<const uint64_t> keys = std::span(keys_).subspan(batch.path_rays.size());
  for (size_t i = 0; i < batch.shadow_rays.size(); ++i)
    if ((batch.shadow_hits[i].flags & cache::kHitOccluded) != 0 && is_sampled(keys[i]))
      occluded_.push_back({batch.shadow_rays[i], keys[i], wave, false});
  for (const uint32_t i : singles) occluded_.push_back({batch.shadow_rays[i], keys[i], wave, true});
  claim_ = MemoryClaim(MemoryTag::trace_log, occluded_.capacity() * sizeof(OccludedRay) + log_.sample_bytes.capacity() +
                                                  keys_.capacity() * sizeof(uint64_t));
}

Status NeedsLog::log_wave(PageViews& pages, const TraceBatch& batch, const cache::RecordStream<PathRecord>& paths,
                          const cache::RecordStream<ShadowRecord>& shadows, size_t camera_rays_from) {
  if (batch.order.empty()) return {};
  SPILLWAY_TRY(read_keys(batch, paths, shadows));
  WaveNeeds needs(*this, pages, batch, camera_rays_from);
  add_lists(needs);
  put_samples(log_.sample_bytes, static_cast<uint32_t>(log_.waves.size() - 1), needs.samples());
  add_occluded(batch, needs.occluded_singles());
  return {};
}

// ---- after the last wave ----

Status NeedsLog::find_occluders(cache::PartStore& pages) {
  for (size_t first = 0; first < occluded_.size(); first += kOccludedBatch)
    SPILLWAY_TRY(
        find_batch(pages, std::span(occluded_).subspan(first, std::min(kOccludedBatch, occluded_.size() - first))));
  return {};
}

Status NeedsLog::find_batch(cache::PartStore& pages, std::span<const OccludedRay> rays) {
  std::vector<OccludedPair> pairs;
  VisitList visits;
  for (uint32_t r = 0; r < rays.size(); ++r) {
    const cache::TraceHit hit = cache::no_hit(rays[r].ray);
    for (const cache::PageVisit& visit :
         visits.met(tree_, {with_tops_.data()}, 0, UINT32_MAX, cache::TraceMode::occlusion, rays[r].ray, hit))
      pairs.push_back({visit.page, r, visit.instance, 0});
  }
  const MemoryClaim claim(MemoryTag::trace_log, pairs.capacity() * sizeof(OccludedPair));
  std::ranges::sort(pairs, {}, [](const OccludedPair& p) { return std::tuple(p.page, p.ray, p.instance); });
  std::vector<uint32_t> swept;
  for (const OccludedPair& pair : pairs)
    if (swept.empty() || swept.back() != pair.page) swept.push_back(pair.page);
  auto next = pairs.begin();
  SPILLWAY_TRY(pages.sweep(swept, [&](uint32_t page, std::span<const std::byte> bytes) -> Status {
    const cache::TracePageView view = cache::trace_page_view(bytes);
    const auto end = std::find_if(next, pairs.end(), [&](const OccludedPair& p) { return p.page != page; });
    const std::span<OccludedPair> here(next, end);
    parallel_blocks(here.size(), kBlockRays, [&](size_t, size_t first, size_t last) {
      cache::TraceCounters work;
      for (OccludedPair& pair : here.subspan(first, last - first)) {
        cache::TraceHit hit = cache::no_hit(rays[pair.ray].ray);
        cache::trace_page<cache::TraceMode::occlusion>(view, pair.instance, tree_, rays[pair.ray].ray, hit, work);
        pair.occludes = (hit.flags & cache::kHitOccluded) != 0 ? 1 : 0;
      }
    });
    next = end;
    return {};
  }));
  std::ranges::sort(pairs, {}, [](const OccludedPair& p) { return std::tuple(p.ray, p.page); });
  write_batch(rays, pairs);
  return {};
}

void NeedsLog::write_batch(std::span<const OccludedRay> rays, std::span<const OccludedPair> pairs) {
  std::vector<SampledRay> samples;
  VisitList visits;
  size_t at = 0;
  for (uint32_t r = 0; r < rays.size(); ++r) {
    RayNeeds& needs = samples.emplace_back(SampledRay{rays[r].path, {.kind = RayKind::shadow}}).needs;
    for (; at < pairs.size() && pairs[at].ray == r; ++at) {
      needs.pages.push_back(pairs[at].page);
      if (pairs[at].occludes != 0) needs.stops.push_back(pairs[at].page);
    }
    sort_unique(needs.pages), sort_unique(needs.stops);
    needs.is_single = rays[r].is_single;
    if (is_boxed(rays[r].path))
      add_boxes(rays[r].ray, cache::TraceMode::occlusion, rays[r].ray.t_max, visits, needs);
    if (r + 1 < rays.size() && rays[r + 1].wave == rays[r].wave) continue;
    std::ranges::stable_sort(samples, {}, &SampledRay::path);
    put_samples(log_.sample_bytes, rays[r].wave, samples);
    samples.clear();
  }
}

}  // namespace spillway::pipeline
