#include "pipeline/render/track_media.h"

#include <algorithm>
#include <atomic>
#include <vector>

#include "cache/base/parallel.h"
#include "cache/radix_sort.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBatchRecords = 1 << 15;
constexpr size_t kBlockRecords = 256;
constexpr size_t kBlockRuns = 64;

const Rgb& carried(const PathRecord& record) { return record.throughput; }
const Rgb& carried(const ShadowRecord& record) { return record.contribution; }
constexpr bool is_shadow(const PathRecord&) { return false; }
constexpr bool is_shadow(const ShadowRecord&) { return true; }

}  // namespace

template <class Record>
bool make_segment(const MediaInputs& inputs, const cache::TraceRay& ray, const cache::TraceHit& hit,
                  const Record& record, MediumSegment& segment) {
  if (record.medium == kNoMedium || (hit.flags & cache::kHitOccluded) != 0 || is_black(carried(record))) return false;
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

// ---- everything resident: a segment at a time ----

struct Work {
  uint64_t runs = 0, steps = 0, bounded = 0;
};

Rgb values_of(const shading::OrderlessProduct (&weight)[3]) {
  return {weight[0].value(), weight[1].value(), weight[2].value()};
}

Rgb resident_glow(const MediaInputs& inputs, const MediumSegment& segment, float distance) {
  const GlowPlace place = glow_place(segment, distance, inputs.tables);
  const float value =
      place.brick == cache::kNoBrick ? 0 : inputs.volumes->resident(place.brick).interpolate(place.lattice);
  return glow_of_value(*segment.medium, value, inputs.tables);
}

SegmentResult pass_resident(const MediaInputs& inputs, const MediumSegment& segment, Work& work) {
  shading::OrderlessProduct weight[3];
  uint32_t steps = 0;
  const SegmentWalk walk(segment, inputs.tables.volumes);
  walk.for_each_run([&](const BrickRun& run) {
    work.bounded += walk.pass(run, inputs.volumes->resident(run.brick), weight, steps) ? 0 : 1;
    ++work.runs;
    return true;
  });
  work.steps += steps;
  return {INFINITY, values_of(weight), {0, 0, 0}};
}

SegmentResult track_resident(const MediaInputs& inputs, const MediumSegment& segment, Work& work) {
  shading::Collisions all;
  const SegmentWalk walk(segment, inputs.tables.volumes);
  walk.for_each_run([&](const BrickRun& run) {
    work.bounded += walk.track(run, inputs.volumes->resident(run.brick), all) ? 0 : 1;
    ++work.runs;
    return !all.collided();
  });
  work.steps += all.steps;
  return segment_result(segment, all, all.collided() ? resident_glow(inputs, segment, all.distance) : Rgb{0, 0, 0});
}

SegmentResult track_one(const MediaInputs& inputs, const MediumSegment& segment, bool shadow, Work& work) {
  if (segment.medium->kind == MediumKind::homogeneous)
    return shadow ? SegmentResult{INFINITY, pass_homogeneous(segment), {0, 0, 0}} : track_homogeneous(segment);
  return shadow ? pass_resident(inputs, segment, work) : track_resident(inputs, segment, work);
}

// ---- bricks that come and go: runs, brick by brick ----

struct Run {
  BrickRun run;
  uint32_t segment;  // of the round
};

// A segment in a grid that waits for its bricks.
struct Waiting {
  MediumSegment segment;
  uint32_t ray;
  uint32_t first_run = 0, run_count = 0;
  float nearest = INFINITY;  // collision so far
};

// Segments have at least one run: what join() makes of each is part of it.
constexpr uint64_t kBytesPerRun = sizeof(Run) + sizeof(Waiting) + 2 * sizeof(shading::Collisions) + sizeof(GlowPlace) +
                                  sizeof(float) + sizeof(uint32_t) + 2 * sizeof(cache::KeyIndex<uint32_t>);

// Collects the segments of one kind of rays and tracks them in rounds, each one sweep over the bricks they meet.
class Rounds {
 public:
  Rounds(const MediaInputs& inputs, bool shadow, uint64_t limit_bytes, std::span<SegmentResult> results,
         TrackMediaReport& report)
      : inputs_(inputs), shadow_(shadow), most_runs_(limit_bytes / kBytesPerRun), results_(results), report_(report) {}

  // Segments of a batch, in the order of its rays.
  Status add(std::span<const Waiting> segments) {
    if (!segments.empty())
      runs_.reserve(most_runs_), waiting_.reserve(most_runs_);  // pages that are never touched cost nothing
    for (Waiting waiting : segments) {
      waiting.first_run = static_cast<uint32_t>(runs_.size());
      SegmentWalk(waiting.segment, inputs_.tables.volumes).for_each_run([&](const BrickRun& run) {
        runs_.push_back({run, static_cast<uint32_t>(waiting_.size())});
        return true;
      });
      waiting.run_count = static_cast<uint32_t>(runs_.size()) - waiting.first_run;
      if (waiting.run_count == 0) continue;  // nothing in its way
      waiting_.push_back(waiting);
      if (runs_.size() >= most_runs_) SPILLWAY_TRY(finish());
    }
    return {};
  }

  // Tracks what was collected.
  Status finish() {
    if (waiting_.empty()) return {};
    ++report_.round_count, report_.run_count += runs_.size();
    const MemoryClaim claim(MemoryTag::volumes, runs_.size() * kBytesPerRun);
    collisions_.assign(runs_.size(), {});
    sort_by_brick(runs_.size(), [&](size_t i) { return runs_[i].run.brick; });
    SPILLWAY_TRY(sweep([&](const cache::VolumeBrickView& brick, uint32_t r) { track(brick, r); }));
    SPILLWAY_TRY(join());
    runs_.clear(), waiting_.clear();
    return {};
  }

 private:
  template <class BrickOf>
  void sort_by_brick(size_t count, const BrickOf& brick_of) {
    order_.resize(count), order_scratch_.resize(count);
    for (size_t i = 0; i < count; ++i) order_[i] = {brick_of(i), static_cast<uint32_t>(i)};
    cache::radix_sort(std::span(order_), std::span(order_scratch_));
  }

  // Visits the bricks of `order_` in file order; body(brick, index) for each of its entries, in parallel.
  template <class Body>
  Status sweep(const Body& body) {
    std::vector<uint32_t> bricks;
    for (const auto& item : order_)
      if (bricks.empty() || bricks.back() != item.key) bricks.push_back(item.key);
    report_.bricks_touched += bricks.size();
    size_t first = 0;
    return inputs_.volumes->parts().sweep(bricks, [&](uint32_t part, std::span<const std::byte> bytes) -> Status {
      const cache::VolumeBrickView brick(bytes);
      size_t last = first;
      while (last < order_.size() && order_[last].key == part) ++last;
      parallel_blocks(last - first, kBlockRuns, [&](size_t, size_t from, size_t to) {
        for (size_t i = first + from; i < first + to; ++i) body(brick, order_[i].index);
      });
      first = last;
      return {};
    });
  }

  // A brick is convex: no other run of the segment is in it, and its fields are this task's alone.
  void track(const cache::VolumeBrickView& brick, uint32_t r) {
    const Run& run = runs_[r];
    Waiting& waiting = waiting_[run.segment];
    if (run.run.begin > waiting.nearest) return;
    const SegmentWalk walk(waiting.segment, inputs_.tables.volumes);
    shading::Collisions& out = collisions_[r];
    const bool whole = shadow_ ? walk.pass(run.run, brick, out.weight, out.steps) : walk.track(run.run, brick, out);
    if (!whole) ++bounded_;
    waiting.nearest = std::min(waiting.nearest, out.distance);
  }

  Status join() {
    std::vector<shading::Collisions> joined(waiting_.size());
    std::vector<GlowPlace> places(waiting_.size());
    parallel_blocks(waiting_.size(), kBlockRecords, [&](size_t, size_t first, size_t last) {
      for (size_t w = first; w < last; ++w) {
        const Waiting& waiting = waiting_[w];
        for (uint32_t r = 0; r < waiting.run_count; ++r) joined[w].append(collisions_[waiting.first_run + r]);
        if (joined[w].collided()) places[w] = glow_place(waiting.segment, joined[w].distance, inputs_.tables);
      }
    });
    std::vector<float> values(waiting_.size(), 0);
    SPILLWAY_TRY(look_up(places, values));
    for (size_t w = 0; w < waiting_.size(); ++w) {
      const Waiting& waiting = waiting_[w];
      const Rgb glow = glow_of_value(*waiting.segment.medium, values[w], inputs_.tables);
      results_[waiting.ray] = segment_result(waiting.segment, joined[w], glow);
      report_.step_count += joined[w].steps;
    }
    report_.bounded_count += bounded_.exchange(0);
    return {};
  }

  // The glow where segments ended, brick by brick.
  Status look_up(std::span<const GlowPlace> places, std::span<float> values) {
    std::vector<uint32_t> wanted;
    for (uint32_t w = 0; w < places.size(); ++w)
      if (places[w].brick != cache::kNoBrick) wanted.push_back(w);
    if (wanted.empty()) return {};
    sort_by_brick(wanted.size(), [&](size_t i) { return places[wanted[i]].brick; });
    return sweep([&](const cache::VolumeBrickView& brick, uint32_t i) {
      values[wanted[i]] = brick.interpolate(places[wanted[i]].lattice);
    });
  }

  const MediaInputs& inputs_;
  const bool shadow_;
  const uint64_t most_runs_;
  const std::span<SegmentResult> results_;
  TrackMediaReport& report_;
  std::vector<Run> runs_;
  std::vector<Waiting> waiting_;
  std::vector<shading::Collisions> collisions_;
  std::vector<cache::KeyIndex<uint32_t>> order_, order_scratch_;
  std::atomic<uint64_t> bounded_ = 0;
};

// ---- the rays of a wave ----

// What a block of rays came to.
struct BlockWork {
  Work work;
  uint64_t segments = 0;
  std::vector<Waiting> waiting;
};

template <class Record>
Status track_kind(const MediaInputs& inputs, const MediaRays<Record>& rays, const TrackMediaOptions& options,
                  Buffer<SegmentResult>& results, TrackMediaReport& report) {
  results.renew(MemoryTag::rays, rays.rays.size());
  results.set_size(rays.rays.size());
  const bool resident = inputs.volumes == nullptr || inputs.volumes->parts().all_resident();
  Rounds rounds(inputs, is_shadow(Record{}), options.run_limit_bytes, results, report);
  std::vector<Record> records(std::min(rays.rays.size(), kBatchRecords));
  const MemoryClaim claim(MemoryTag::paths, records.size() * sizeof(Record));
  for (size_t start = 0; start < rays.rays.size(); start += kBatchRecords) {
    const std::span batch(records.data(), std::min(kBatchRecords, rays.rays.size() - start));
    SPILLWAY_TRY(rays.records->read(start, batch));
    std::vector<BlockWork> blocks(block_count(batch.size(), kBlockRecords));
    parallel_blocks(batch.size(), kBlockRecords, [&](size_t b, size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) {
        SegmentResult& result = results[start + i] = SegmentResult{};
        MediumSegment segment;
        if (!make_segment(inputs, rays.rays[start + i], rays.hits[start + i], batch[i], segment)) continue;
        ++blocks[b].segments;
        if (resident || segment.medium->kind == MediumKind::homogeneous)
          result = track_one(inputs, segment, is_shadow(Record{}), blocks[b].work);
        else
          blocks[b].waiting.push_back({segment, static_cast<uint32_t>(start + i)});
      }
    });
    for (const BlockWork& block : blocks) {
      report.segment_count += block.segments;
      report.run_count += block.work.runs, report.step_count += block.work.steps;
      report.bounded_count += block.work.bounded;
      SPILLWAY_TRY(rounds.add(block.waiting));
    }
  }
  return rounds.finish();
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
  SPILLWAY_TRY(track_kind(inputs, paths, options, scratch.path_results, report));
  for (const SegmentResult& result : scratch.path_results) report.collision_count += result.distance < INFINITY ? 1 : 0;
  return track_kind(inputs, shadows, options, scratch.shadow_results, report);
}

SegmentResult track_segment(const MediaInputs& inputs, const MediumSegment& segment, bool shadow) {
  Work work;
  return track_one(inputs, segment, shadow, work);
}

}  // namespace spillway::pipeline
