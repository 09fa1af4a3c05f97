#include "pipeline/render/track_media.h"

#include <algorithm>
#include <vector>

#include "cache/base/parallel.h"
#include "pipeline/render/medium_rounds.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBatchRecords = 1 << 15,
                 kSweptBatchRecords = 1 << 13;  // points are listed of a batch before they wait
constexpr size_t kBlockRecords = 256;

const Rgb& carried(const PathRecord& record) { return record.throughput; }
const Rgb& carried(const ShadowRecord& record) { return record.contribution; }
constexpr bool is_shadow(const PathRecord&) { return false; }
constexpr bool is_shadow(const ShadowRecord&) { return true; }

}  // namespace

template <class Record>
bool make_segment(const MediaInputs& inputs, const cache::TraceRay& ray, const cache::TraceHit& hit,
                  const Record& record, MediumSegment& segment) {
  if (record.medium == kNoMedium || is_black(carried(record))) return false;
  if ((hit.flags & (cache::kHitOccluded | cache::kHitWaits)) != 0) return false;  // it will come back
  const float size = length(ray.direction_world);
  segment.medium = &inputs.tables.media[record.medium];
  segment.origin_world = ray.origin_world;
  segment.direction_world = ray.direction_world * (1 / size);
  segment.end = (hit.prim != PrimId::kNone ? hit.t : ray.t_max) * size;
  segment.key = shading::segment_key({record.sink, record.sample, inputs.seed}, record.bounce, is_shadow(record),
                                     ray.origin_world);
  const Rgb c = carried(record);
  segment.shares = {std::fabs(c.r), std::fabs(c.g), std::fabs(c.b)};
  return true;
}

template bool make_segment(const MediaInputs&, const cache::TraceRay&, const cache::TraceHit&, const PathRecord&,
                           MediumSegment&);
template bool make_segment(const MediaInputs&, const cache::TraceRay&, const cache::TraceHit&, const ShadowRecord&,
                           MediumSegment&);

namespace {

SegmentResult track_one(const MediaInputs& inputs, const MediumSegment& segment, bool shadow, MediumBlock& block) {
  if (segment.medium->kind != MediumKind::homogeneous) return track_resident(inputs, segment, shadow, block);
  return shadow ? SegmentResult{INFINITY, pass_homogeneous(segment), {0, 0, 0}} : track_homogeneous(segment);
}

// ---- the rays of a wave ----

template <class Record>
void track_ray(const MediaInputs& inputs, const MediaRays<Record>& rays, size_t ray, const Record& record,
               bool resident, MediumBlock& block, SegmentResult& result) {
  result = SegmentResult{};
  WaitingSegment waiting;
  waiting.ray = static_cast<uint32_t>(ray);
  if (!make_segment(inputs, rays.rays[ray], rays.hits[ray], record, waiting.segment)) return;
  ++block.segments;
  if (is_shadow(record)) waiting.waiting = Waiting::to_pass;
  if (resident || waiting.segment.medium->kind == MediumKind::homogeneous)
    result = track_one(inputs, waiting.segment, is_shadow(record), block);
  else
    MediumRounds::advance(inputs, waiting, block, result);
}

template <class Record>
Status track_kind(const MediaInputs& inputs, const MediaRays<Record>& rays, MediumRounds& rounds,
                  Buffer<SegmentResult>& results) {
  results.grow(MemoryTag::rays, rays.rays.size());
  results.set_size(rays.rays.size());
  const bool resident = inputs.volumes == nullptr || inputs.volumes->parts().all_resident();
  const size_t batch_records = resident ? kBatchRecords : kSweptBatchRecords;
  std::vector<Record> records(std::min(rays.rays.size(), batch_records));
  const MemoryClaim claim(MemoryTag::paths, records.size() * sizeof(Record));
  for (size_t start = 0; start < rays.rays.size(); start += batch_records) {
    const std::span batch(records.data(), std::min(batch_records, rays.rays.size() - start));
    SPILLWAY_TRY(rays.records->read(start, batch));
    std::vector<MediumBlock> blocks(block_count(batch.size(), kBlockRecords));
    parallel_blocks(batch.size(), kBlockRecords, [&](size_t b, size_t first, size_t last) {
      for (size_t i = first; i < last; ++i)
        track_ray(inputs, rays, start + i, batch[i], resident, blocks[b], results[start + i]);
    });
    for (const MediumBlock& block : blocks) SPILLWAY_TRY(rounds.add(block));
  }
  return {};
}

}  // namespace

VolumeStore::VolumeStore(std::unique_ptr<cache::PartStore> parts) : parts_(std::move(parts)) {}

TrackMediaReport& TrackMediaReport::operator+=(const TrackMediaReport& other) {
  segment_count += other.segment_count, collision_count += other.collision_count;
  run_count += other.run_count, step_count += other.step_count;
  round_count += other.round_count, bricks_touched += other.bricks_touched;
  bounded_count += other.bounded_count;
  return *this;
}

Status track_media(const MediaInputs& inputs, const MediaRays<PathRecord>& paths,
                   const MediaRays<ShadowRecord>& shadows, const TrackMediaOptions& options, TrackMediaScratch& scratch,
                   TrackMediaReport& report) {
  MediumRounds rounds(inputs, options, scratch, report);
  SPILLWAY_TRY(track_kind(inputs, paths, rounds, scratch.path_results));
  SPILLWAY_TRY(track_kind(inputs, shadows, rounds, scratch.shadow_results));
  SPILLWAY_TRY(rounds.finish());
  for (const SegmentResult& result : scratch.path_results) report.collision_count += result.distance < INFINITY ? 1 : 0;
  return {};
}

SegmentResult track_segment(const MediaInputs& inputs, const MediumSegment& segment, bool shadow) {
  MediumBlock block;
  return track_one(inputs, segment, shadow, block);
}

}  // namespace spillway::pipeline
