#pragma once

// What the rays of each wave need, for an access log: by their final hits and the tree of pages with its tops alone, so
// that it is the same for any budget.
//
// Owns: the tops of all pages, and the shadow rays that something occludes and that are logged. Memory: tags page_tree (tops) and
// trace_log: 8 bytes a ray of the wave, 48 one of the latter, kMostSamples at most in all; while read_tops() runs some of the largest
// pages. Threads: one at a time; log_wave() uses the arena. Order: none of it depends on threads or memory. What
// occludes a ray is found after the last wave, by one sweep for many rays: a wave that does not have the pages in
// memory does not look. Its reads are no part of the run's counters, nor is its time.

#include <memory>
#include <vector>

#include "cache/base/hash.h"
#include "cache/page_tops.h"
#include "cache/part_store.h"
#include "cache/record_stream.h"
#include "cache/trace_kernel.h"
#include "pipeline/records.h"
#include "pipeline/render/access_log.h"
#include "pipeline/render/trace_rays.h"
#include "pipeline/render/wave_rays.h"

namespace spillway::pipeline {

class NeedsLog {
 public:
  // Sampled rays of a frame, about; larger: a larger log. Of a city's street of 14.7 M paths one in four took 44 MiB. Beside
  // them, of each page that no sample of a wave and kind needs, one ray that does: without these 0.76 of what was read
  // within a quarter of the geometry was foretold, not 0.85.
  static constexpr uint64_t kMostSamples = 16 << 20;
  // Those of one path in so many, a power of two: by the frame alone.
  [[nodiscard]] static uint64_t sampled_of(const SceneFacts& facts);

  NeedsLog(const cache::PageTree& tree, AccessLog& log, uint64_t sampled_of);

  // Reads all pages once, through `pages`, which is nobody else's; and some again, to learn how fast that is.
  Status read_tops(cache::PartStore& pages, uint32_t nodes_a_page);
  // The rays of a wave, traced, and their records. Path rays from camera_rays_from on come from the camera.
  Status log_wave(PageViews& pages, const TraceBatch& batch, const cache::RecordStream<PathRecord>& paths,
                  const cache::RecordStream<ShadowRecord>& shadows, size_t camera_rays_from);
  // After the last wave.
  Status find_occluders(cache::PartStore& pages);

 private:
  struct OccludedRay {
    cache::TraceRay ray;
    uint64_t path;
    uint32_t wave;
    bool is_single;
  };
  struct OccludedPair;
  class WaveNeeds;

  [[nodiscard]] bool is_sampled(uint64_t path) const { return (mix64(path) & (sampled_of_ - 1)) == 0; }
  [[nodiscard]] bool is_boxed(uint64_t path) const { return (mix64(path) & (boxed_of_ - 1)) == 0; }
  [[nodiscard]] uint64_t key_of(uint32_t sink, uint32_t sample) const { return sink * stride_ + sample; }
  Status read_keys(const TraceBatch& batch, const cache::RecordStream<PathRecord>& paths,
                   const cache::RecordStream<ShadowRecord>& shadows);
  void add_boxes(const cache::TraceRay& ray, cache::TraceMode mode, float t_hit, VisitList& visits,
                 RayNeeds& needs) const;
  void add_lists(const WaveNeeds& needs);
  void add_occluded(const TraceBatch& batch, const std::vector<uint32_t>& singles);
  Status find_batch(cache::PartStore& pages, std::span<const OccludedRay> rays);
  void write_batch(std::span<const OccludedRay> rays, std::span<const OccludedPair> pairs);

  const cache::PageTree tree_;  // spans
  AccessLog& log_;
  const uint64_t sampled_of_, boxed_of_;
  const uint64_t stride_;  // of paths' keys, a pixel
  cache::PageTops tops_;
  Buffer<cache::TracePageView> none_, with_tops_;  // of pages that are not in memory
  std::vector<uint64_t> keys_;  // of the wave's rays: of which paths they are
  std::vector<OccludedRay> occluded_;
  MemoryClaim claim_;
};

}  // namespace spillway::pipeline
