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
  std::vector<uint32_t> bricks;  // that were in memory and used, where not all are
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
  bool shadow;
  shading::Collisions head{};  // of the runs so far; of a path ray front to back
  uint32_t head_runs = 0;
  uint32_t run_count = 0;    // of the rest, while they are tracked
  float nearest = INFINITY;  // collision in the rest
};

// What a block of rays came to.
struct BlockWork {
  Work work;
  uint64_t segments = 0;
  std::vector<Waiting> waiting;
  std::vector<Run> runs;  // whose bricks are to be read; their segments are counted from the block's first
};

// Tracks what can be tracked in bricks that are in memory: of a path ray front to back, up to the first that is not; of a
// shadow ray everything, for its weights may be multiplied in any order. Lists the runs that are wanted next. True:
// nothing is left to wait for, and `result` is what the segment comes to.
bool track_head(const MediaInputs& inputs, Waiting& waiting, BlockWork& block, SegmentResult& result) {
  const SegmentWalk walk(waiting.segment, inputs.tables.volumes);
  const auto index = static_cast<uint32_t>(block.waiting.size());
  shading::Collisions& head = waiting.head;
  bool is_whole = true;
  walk.for_each_run([&](const BrickRun& run) {
    const cache::VolumeBrickView brick = inputs.volumes->resident(run.brick);
    if (!brick) {
      is_whole = false;
      block.runs.push_back({run, index});
      return waiting.shadow;
    }
    const bool whole = waiting.shadow ? walk.pass(run, brick, head.weight, head.steps) : walk.track(run, brick, head);
    block.work.bounded += whole ? 0 : 1, ++block.work.runs, ++waiting.head_runs;
    if (block.work.bricks.empty() || block.work.bricks.back() != run.brick) block.work.bricks.push_back(run.brick);
    return !head.collided();
  });
  if (!is_whole) return false;
  Rgb glow{0, 0, 0};
  if (head.collided()) {
    const GlowPlace place = glow_place(waiting.segment, head.distance, inputs.tables);
    if (place.brick != cache::kNoBrick && !inputs.volumes->resident(place.brick)) return false;
    glow = resident_glow(inputs, waiting.segment, head.distance);
  }
  block.work.steps += head.steps;
  result = segment_result(waiting.segment, head, glow);
  return true;
}

// A segment has one run of a round at least, or ends where its glow is looked up: what that takes is part of it.
constexpr uint64_t kBytesPerRun = sizeof(Run) + sizeof(Waiting) + sizeof(shading::Collisions) + sizeof(GlowPlace) +
                                  sizeof(float) + sizeof(uint32_t) + 2 * sizeof(cache::KeyIndex<uint32_t>);

// Collects segments of both kinds of rays and tracks them in rounds. The first sweep of a round is over the bricks that
// path rays meet next, where most of them end, and over all that shadow rays meet; the second, over what is left to path
// rays that went on.
class Rounds {
 public:
  Rounds(const MediaInputs& inputs, uint64_t limit_bytes, TrackMediaScratch& scratch, TrackMediaReport& report)
      : inputs_(inputs), most_runs_(limit_bytes / kBytesPerRun), scratch_(scratch), report_(report) {}

  // What waits of a block, in the order of its rays.
  Status add(const BlockWork& block) {
    if (block.waiting.empty()) return {};
    runs_.reserve(most_runs_), waiting_.reserve(most_runs_);  // pages that are never touched cost nothing
    const auto base = static_cast<uint32_t>(waiting_.size());
    waiting_.insert(waiting_.end(), block.waiting.begin(), block.waiting.end());
    for (const Run& run : block.runs) runs_.push_back({run.run, run.segment + base});
    return std::max(runs_.size(), waiting_.size()) >= most_runs_ ? finish() : Status{};
  }

  // Tracks what was collected.
  Status finish() {
    if (waiting_.empty()) return {};
    const MemoryClaim claim(MemoryTag::volumes, std::max(runs_.size(), waiting_.size()) * kBytesPerRun);
    SPILLWAY_TRY(sweep_runs([&](const cache::VolumeBrickView& brick, uint32_t r) { track_next(brick, runs_[r]); }));
    SPILLWAY_TRY(track_rest());
    SPILLWAY_TRY(end_segments());
    waiting_.clear();
    return {};
  }

 private:
  // One sweep over the bricks of the runs that are listed.
  template <class Body>
  Status sweep_runs(const Body& body) {
    ++report_.round_count, report_.run_count += runs_.size();
    sort_by_brick(runs_.size(), [&](size_t i) { return runs_[i].run.brick; });
    SPILLWAY_TRY(sweep(body));
    runs_.clear();
    report_.bounded_count += bounded_.exchange(0);
    return {};
  }

  // A path ray's next run, or any of a shadow ray's, whose weights may be multiplied in any order. A brick is convex: no
  // other run of the segment is in it, and its fields are this task's alone.
  void track_next(const cache::VolumeBrickView& brick, const Run& run) {
    Waiting& waiting = waiting_[run.segment];
    const SegmentWalk walk(waiting.segment, inputs_.tables.volumes);
    shading::Collisions& head = waiting.head;
    const bool whole =
        waiting.shadow ? walk.pass(run.run, brick, head.weight, head.steps) : walk.track(run.run, brick, head);
    if (!whole) ++bounded_;
    if (!waiting.shadow) ++waiting.head_runs;
  }

  // What is left to path rays, some segments at a time.
  Status track_rest() {
    const size_t count = waiting_.size();
    for (size_t start = 0; start < count; start += kBatchRecords) {
      const size_t in_batch = std::min(kBatchRecords, count - start);
      std::vector<std::vector<Run>> blocks(block_count(in_batch, kBlockRecords));
      parallel_blocks(in_batch, kBlockRecords, [&](size_t b, size_t first, size_t last) {
        for (size_t w = start + first; w < start + last; ++w) list_rest(static_cast<uint32_t>(w), blocks[b]);
      });
      for (size_t b = 0; b < blocks.size(); ++b) {
        runs_.insert(runs_.end(), blocks[b].begin(), blocks[b].end());
        if (runs_.size() >= most_runs_) SPILLWAY_TRY(sweep_rest(start + std::min(in_batch, (b + 1) * kBlockRecords)));
      }
    }
    return sweep_rest(count);
  }

  void list_rest(uint32_t w, std::vector<Run>& runs) {
    Waiting& waiting = waiting_[w];
    if (waiting.shadow || waiting.head.collided()) return;
    const size_t before = runs.size();
    uint32_t passed = 0;
    SegmentWalk(waiting.segment, inputs_.tables.volumes).for_each_run([&](const BrickRun& run) {
      if (passed++ >= waiting.head_runs) runs.push_back({run, w});
      return true;
    });
    waiting.run_count = static_cast<uint32_t>(runs.size() - before);
  }

  // The runs that are listed, of segments before `last`; they are then joined in ray order.
  Status sweep_rest(size_t last) {
    if (runs_.empty()) return {};
    collisions_.assign(runs_.size(), {});
    SPILLWAY_TRY(sweep_runs([&](const cache::VolumeBrickView& brick, uint32_t r) { track(brick, r); }));
    for (size_t r = 0; joined_ < last; ++joined_)
      for (Waiting& waiting = waiting_[joined_]; waiting.run_count > 0; --waiting.run_count)
        waiting.head.append(collisions_[r++]);
    return {};
  }

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

  // In the order of bricks: what lies behind a collision that was found is left out.
  void track(const cache::VolumeBrickView& brick, uint32_t r) {
    const Run& run = runs_[r];
    Waiting& waiting = waiting_[run.segment];
    if (run.run.begin > waiting.nearest) return;
    const SegmentWalk walk(waiting.segment, inputs_.tables.volumes);
    if (!walk.track(run.run, brick, collisions_[r])) ++bounded_;
    waiting.nearest = std::min(waiting.nearest, collisions_[r].distance);
  }

  // What the segments come to, when all of their runs are joined.
  Status end_segments() {
    joined_ = 0;
    std::vector<GlowPlace> places(waiting_.size());
    parallel_blocks(waiting_.size(), kBlockRecords, [&](size_t, size_t first, size_t last) {
      for (size_t w = first; w < last; ++w)
        if (waiting_[w].head.collided())
          places[w] = glow_place(waiting_[w].segment, waiting_[w].head.distance, inputs_.tables);
    });
    std::vector<float> values(waiting_.size(), 0);
    SPILLWAY_TRY(look_up(places, values));
    for (size_t w = 0; w < waiting_.size(); ++w) {
      const Waiting& waiting = waiting_[w];
      const Rgb glow = glow_of_value(*waiting.segment.medium, values[w], inputs_.tables);
      auto& results = waiting.shadow ? scratch_.shadow_results : scratch_.path_results;
      results[waiting.ray] = segment_result(waiting.segment, waiting.head, glow);
      report_.step_count += waiting.head.steps;
    }
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
  const uint64_t most_runs_;
  TrackMediaScratch& scratch_;
  TrackMediaReport& report_;
  std::vector<Run> runs_;
  std::vector<Waiting> waiting_;
  size_t joined_ = 0;  // of the segments: the rest of their runs is tracked
  std::vector<shading::Collisions> collisions_;
  std::vector<cache::KeyIndex<uint32_t>> order_, order_scratch_;
  std::atomic<uint64_t> bounded_ = 0;
};

// ---- the rays of a wave ----

template <class Record>
Status track_kind(const MediaInputs& inputs, const MediaRays<Record>& rays, Rounds& rounds,
                  Buffer<SegmentResult>& results, TrackMediaReport& report) {
  results.renew(MemoryTag::rays, rays.rays.size());
  results.set_size(rays.rays.size());
  const bool resident = inputs.volumes == nullptr || inputs.volumes->parts().all_resident();
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
        else if (Waiting waiting{segment, static_cast<uint32_t>(start + i), is_shadow(Record{})};
                 !track_head(inputs, waiting, blocks[b], result))
          blocks[b].waiting.push_back(waiting);
      }
    });
    for (const BlockWork& block : blocks) {
      report.segment_count += block.segments;
      report.run_count += block.work.runs, report.step_count += block.work.steps;
      report.bounded_count += block.work.bounded;
      for (const uint32_t brick : block.work.bricks) inputs.volumes->parts().note_use(brick);
    }
    for (const BlockWork& block : blocks) SPILLWAY_TRY(rounds.add(block));
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
  Rounds rounds(inputs, options.run_limit_bytes, scratch, report);
  SPILLWAY_TRY(track_kind(inputs, paths, rounds, scratch.path_results, report));
  SPILLWAY_TRY(track_kind(inputs, shadows, rounds, scratch.shadow_results, report));
  SPILLWAY_TRY(rounds.finish());
  for (const SegmentResult& result : scratch.path_results) report.collision_count += result.distance < INFINITY ? 1 : 0;
  return {};
}

SegmentResult track_segment(const MediaInputs& inputs, const MediumSegment& segment, bool shadow) {
  Work work;
  return track_one(inputs, segment, shadow, work);
}

}  // namespace spillway::pipeline
