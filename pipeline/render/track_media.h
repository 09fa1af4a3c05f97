#pragma once

// Stage track_media: what media do to the rays of a wave. Runs only in scenes that have media.
//
// In:     traced rays of one kind with their cold records (medium, random keys, throughput).
// Out:    a SegmentResult a ray; identity for rays outside of media.
// Memory: tag rays: the results, 28 bytes a ray; tag volumes: bricks, within the store's limit, and lists of points in
//         them, see medium_rounds.h.
// Reads:  bricks in which a ray has a point where the density decides, and which are not in memory: in rounds, each a
//         sweep in file order.
// Order:  random numbers are keyed, what a segment's points decide is decided in ray order, weights are multiplied in
//         integers. Nothing of this shows.
// Based on: DESIGN.md section 9; shading/medium.h.

#include <memory>
#include <vector>

#include "cache/part_store.h"
#include "cache/radix_sort.h"
#include "cache/record_stream.h"
#include "pipeline/records.h"
#include "pipeline/render/medium_points.h"

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
  uint64_t run_limit_bytes = 256 << 20;  // of listed points and their segments; smaller: more sweeps
};

struct TrackMediaReport {
  uint64_t segment_count = 0, collision_count = 0;
  uint64_t step_count = 0;
  uint64_t round_count = 0, run_count = 0, bricks_touched = 0;  // runs: of points that were looked up in one brick
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
  PointList list;
  std::vector<cache::KeyIndex<uint32_t>> order, order_scratch;
  MemoryClaim claim;  // of the lists
  uint64_t claimed_bytes = 0;
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
