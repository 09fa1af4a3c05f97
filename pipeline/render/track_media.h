#pragma once

// Stage track_media: what media do to the rays of a wave. Runs only in scenes that have media.
//
// In:     traced rays of one kind with their cold records (medium, random keys, throughput).
// Out:    a SegmentResult a ray; identity for rays outside of media.
// Memory: tag rays: the results, 28 bytes a ray; tag volumes: bricks, within the store's limit; runs of segments in
//         grids, within run_limit_bytes: more than fit are tracked in several rounds, each a sweep of its own.
// Reads:  what bricks in memory tell comes first, and many path rays end there. The others wait for a sweep over the brick
//         that each meets next, and for a second over all that is left to those that went on; shadow rays wait once.
// Order:  runs that wait are tracked brick by brick, in file order; random numbers are keyed, the nearest collision of a ray
//         wins, weights are multiplied in integers. Nothing of this shows.
// Based on: DESIGN.md section 9; shading/medium.h.

#include <memory>

#include "cache/part_store.h"
#include "cache/record_stream.h"
#include "pipeline/records.h"
#include "pipeline/render/medium_segment.h"

namespace spillway::pipeline {

// The bricks of all volumes, in memory as far as the budget allows.
class VolumeStore {
 public:
  explicit VolumeStore(std::unique_ptr<cache::PartStore> parts);
  [[nodiscard]] cache::PartStore& parts() { return *parts_; }
  [[nodiscard]] cache::VolumeBrickView resident(uint32_t brick) const {
    const auto bytes = parts_->resident(brick);
    return bytes.empty() ? cache::VolumeBrickView() : cache::VolumeBrickView(bytes);
  }

 private:
  std::unique_ptr<cache::PartStore> parts_;
};

struct TrackMediaOptions {
  uint64_t run_limit_bytes = 256 << 20;  // smaller: more sweeps
};

struct TrackMediaReport {
  uint64_t segment_count = 0, collision_count = 0;
  uint64_t run_count = 0, step_count = 0;
  uint64_t round_count = 0, bricks_touched = 0;
  uint64_t bounded_count = 0;  // cells whose rest was passed as if it were empty: the picture is too bright there
  TrackMediaReport& operator+=(const TrackMediaReport& other);
};

struct MediaInputs {
  MediumTables tables;
  VolumeStore* volumes = nullptr;  // null: no grids
  uint32_t seed = 0;
};

template <class Record>
struct MediaRays {
  std::span<const cache::TraceRay> rays;
  std::span<const cache::TraceHit> hits;
  const cache::RecordStream<Record>* records;
};

// Kept from wave to wave.
struct TrackMediaScratch {
  Buffer<SegmentResult> path_results, shadow_results;
};

Status track_media(const MediaInputs& inputs, const MediaRays<PathRecord>& paths,
                   const MediaRays<ShadowRecord>& shadows, const TrackMediaOptions& options, TrackMediaScratch& scratch,
                   TrackMediaReport& report);

// The segment of a ray. False: it is in no medium, or nothing can come of it.
template <class Record>
bool make_segment(const MediaInputs& inputs, const cache::TraceRay& ray, const cache::TraceHit& hit,
                  const Record& record, MediumSegment& segment);

// One segment whose bricks are all resident: the depth-first reference.
[[nodiscard]] SegmentResult track_segment(const MediaInputs& inputs, const MediumSegment& segment, bool is_shadow);

}  // namespace spillway::pipeline
