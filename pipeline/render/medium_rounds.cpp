#include "pipeline/render/medium_rounds.h"

#include <algorithm>
#include <array>

#include "cache/base/parallel.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBlockSegments = 256;
constexpr size_t kBlockRuns = 128;
// Points listed of a segment and round at most; a block of rays must not take much memory.
constexpr uint32_t kMostListed = 64;
// A path ray whose densities are anything from none to their majorant gets behind its points in so many cases. Fewer
// list more points for nothing; more need more sweeps for the few that go on.
constexpr float kUnlikely = 1.0f / 1024;

void list_known(PointList& list, const shading::CellStep& step, Rgb value) {
  list.points.push_back({{}, step});
  list.points.back().set_value(value);
}

void list_unknown(PointList& list, uint32_t brick, uint32_t first_run, const DensityPoint& point) {
  const auto at = static_cast<uint32_t>(list.points.size());
  list.points.push_back({point.lattice, point.step});
  if (list.runs.size() > first_run && list.runs.back().brick == brick &&
      list.runs.back().first + list.runs.back().count == at)
    ++list.runs.back().count;
  else
    list.runs.push_back({brick, at, 1});
}

void note(MediumBlock& block, uint32_t brick) {
  if (block.bricks.empty() || block.bricks.back() != brick) block.bricks.push_back(brick);
}

// What is known of a segment's points, while it is walked.
class Lister {
 public:
  Lister(const MediaInputs& inputs, WaitingSegment& waiting, MediumBlock& block)
      : inputs_(inputs),
        waiting_(waiting),
        block_(block),
        walk_(waiting.segment, inputs.tables.volumes),
        first_run_(static_cast<uint32_t>(block.list.runs.size())) {}

  void walk() {
    const bool passes = waiting_.waiting == Waiting::to_pass;
    block_.bounded += walk_.for_each_point(waiting_.place, [&](uint32_t brick, const DensityPoint& point) {
      return passes ? pass(brick, point) : meet(brick, point);
    });
  }
  [[nodiscard]] bool knows_all() const { return listed_ == 0; }

 private:
  bool pass(uint32_t brick, const DensityPoint& point) {
    if (const cache::VolumeBrickView view = inputs_.volumes->resident(brick)) {
      note(block_, brick);
      walk_.rule().pass(point.step, look(view, point.lattice), waiting_.so_far);
      return true;
    }
    list_unknown(block_.list, brick, first_run_, point);
    waiting_.is_open = ++listed_ == kMostListed;
    return !waiting_.is_open;
  }

  bool meet(uint32_t brick, const DensityPoint& point) {
    if (const cache::VolumeBrickView view = inputs_.volumes->resident(brick)) {
      note(block_, brick);
      const Rgb density = look(view, point.lattice);
      if (knows_all()) return !walk_.rule().track(point.step, density, waiting_.so_far);
      list_known(block_.list, point.step, density);
      if (walk_.rule().is_real(point.step, density)) return false;  // nothing gets behind it
      waiting_.is_open = ++listed_ == kMostListed;
      return !waiting_.is_open;
    }
    list_unknown(block_.list, brick, first_run_, point);
    behind_ *= point.step.decision;
    waiting_.is_open = ++listed_ == kMostListed || behind_ < kUnlikely;
    return !waiting_.is_open;
  }

  const MediaInputs& inputs_;
  WaitingSegment& waiting_;
  MediumBlock& block_;
  SegmentWalk walk_;
  uint32_t first_run_, listed_ = 0;
  float behind_ = 1;
};

Rgb value_at(const MediaInputs& inputs, const VolumePlace& place) {
  return place.brick == cache::kNoBrick ? Rgb{0, 0, 0} : look(inputs.volumes->resident(place.brick), place.lattice);
}

// All of the segment's points are decided. False: what it collided with is listed.
bool end_segment(const MediaInputs& inputs, WaitingSegment& waiting, MediumBlock& block, SegmentResult& result) {
  EndPlaces places;
  if (waiting.so_far.collided()) places = end_places(waiting.segment, waiting.so_far.distance, inputs.tables);
  const std::span at(places.at.data(), places.count);
  const auto is_known = [&](const VolumePlace& place) {
    return place.brick == cache::kNoBrick || inputs.volumes->resident(place.brick);
  };
  if (std::ranges::all_of(at, is_known)) {
    std::array<Rgb, 3> values;
    for (size_t i = 0; i < at.size(); ++i) values[i] = value_at(inputs, at[i]);
    block.steps += waiting.so_far.steps;
    result = segment_result(waiting.segment, waiting.so_far, std::span(values).first(at.size()), inputs.tables);
    return true;
  }
  waiting.waiting = Waiting::at_end, waiting.point_count = places.count;
  waiting.first_point = static_cast<uint32_t>(block.list.points.size());
  for (const VolumePlace& place : at) {
    if (is_known(place))
      list_known(block.list, {}, value_at(inputs, place));
    else
      list_unknown(block.list, place.brick, static_cast<uint32_t>(block.list.runs.size()), {place.lattice, {}});
  }
  block.list.segments.push_back(waiting);
  return false;
}

}  // namespace

SegmentResult track_resident(const MediaInputs& inputs, const MediumSegment& segment, bool is_shadow,
                             MediumBlock& block) {
  WaitingSegment whole;
  whole.segment = segment;
  const SegmentWalk walk(segment, inputs.tables.volumes);
  block.bounded += walk.for_each_point(whole.place, [&](uint32_t brick, const DensityPoint& point) {
    const Rgb density = look(inputs.volumes->resident(brick), point.lattice);
    if (!is_shadow) return !walk.rule().track(point.step, density, whole.so_far);
    walk.rule().pass(point.step, density, whole.so_far);
    return true;
  });
  SegmentResult result;
  end_segment(inputs, whole, block, result);
  return result;
}

uint64_t PointList::size_bytes() const {
  return segments.size() * sizeof(WaitingSegment) + points.size() * sizeof(ListedPoint) +
         runs.size() * (sizeof(BrickPoints) + 2 * sizeof(cache::KeyIndex<uint32_t>));
}

void PointList::reserve(uint64_t limit_bytes) {
  if (segments.capacity() > 0) return;
  segments.reserve(limit_bytes / sizeof(WaitingSegment));
  points.reserve(limit_bytes / sizeof(ListedPoint)), runs.reserve(limit_bytes / sizeof(BrickPoints));
}

void PointList::append(const PointList& other) {
  const auto base = static_cast<uint32_t>(points.size());
  for (const WaitingSegment& segment : other.segments) {
    segments.push_back(segment);
    segments.back().first_point += base;
  }
  points.insert(points.end(), other.points.begin(), other.points.end());
  for (const BrickPoints& run : other.runs) runs.push_back({run.brick, run.first + base, run.count});
}

bool MediumRounds::advance(const MediaInputs& inputs, WaitingSegment& waiting, MediumBlock& block,
                           SegmentResult& result) {
  const size_t first = block.list.points.size();
  waiting.is_open = false;
  Lister lister(inputs, waiting, block);
  lister.walk();
  if (lister.knows_all()) return end_segment(inputs, waiting, block, result);
  waiting.first_point = static_cast<uint32_t>(first);
  waiting.point_count = static_cast<uint32_t>(block.list.points.size() - first);
  block.list.segments.push_back(waiting);
  return false;
}

void MediumRounds::count(const MediumBlock& block) {
  report_.segment_count += block.segments, report_.step_count += block.steps, report_.bounded_count += block.bounded;
  for (const uint32_t brick : block.bricks) inputs_.volumes->parts().note_use(brick);
}

Status MediumRounds::add(const MediumBlock& block) {
  count(block);
  if (block.list.segments.empty()) return {};
  list().reserve(options_.run_limit_bytes);
  if (!list().segments.empty() && list().size_bytes() + block.list.size_bytes() > options_.run_limit_bytes)
    SPILLWAY_TRY(round());
  list().append(block.list);
  return {};
}

Status MediumRounds::finish() {
  while (!list().segments.empty()) SPILLWAY_TRY(round());
  return {};
}

Status MediumRounds::round() {
  if (const uint64_t bytes = list().size_bytes(); bytes > scratch_.claimed_bytes) {
    scratch_.claim = {};
    scratch_.claim = MemoryClaim(MemoryTag::volumes, bytes), scratch_.claimed_bytes = bytes;
  }
  SPILLWAY_TRY(look_up());
  return settle();
}

// One sweep over the bricks of the list.
Status MediumRounds::look_up() {
  PointList& all = list();
  auto& order = scratch_.order;
  order.resize(all.runs.size()), scratch_.order_scratch.resize(all.runs.size());
  for (uint32_t r = 0; r < all.runs.size(); ++r) order[r] = {all.runs[r].brick, r};
  cache::radix_sort(std::span(order), std::span(scratch_.order_scratch));
  std::vector<uint32_t> bricks;
  for (const auto& item : order)
    if (bricks.empty() || bricks.back() != item.key) bricks.push_back(item.key);
  ++report_.round_count, report_.run_count += order.size(), report_.bricks_touched += bricks.size();
  size_t first = 0;
  return inputs_.volumes->parts().sweep(bricks, [&](uint32_t part, std::span<const std::byte> bytes) -> Status {
    const cache::VolumeBrickView brick(bytes);
    size_t last = first;
    while (last < order.size() && order[last].key == part) ++last;
    parallel_blocks(last - first, kBlockRuns, [&](size_t, size_t from, size_t to) {
      for (size_t i = first + from; i < first + to; ++i) {
        const BrickPoints& run = all.runs[order[i].index];
        for (ListedPoint& point : std::span(all.points).subspan(run.first, run.count))
          point.set_value(look(brick, point.lattice));
      }
    });
    first = last;
    return {};
  });
}

// Decides what was looked up; what goes on is the next list.
Status MediumRounds::settle() {
  std::vector<WaitingSegment>& segments = list().segments;
  std::vector<MediumBlock> blocks(block_count(segments.size(), kBlockSegments));
  parallel_blocks(segments.size(), kBlockSegments, [&](size_t b, size_t first, size_t last) {
    for (size_t s = first; s < last; ++s) settle_segment(segments[s], blocks[b]);
  });
  list().clear();
  for (const MediumBlock& block : blocks) {
    count(block);
    if (!block.list.segments.empty()) list().append(block.list);
  }
  return {};
}

void MediumRounds::settle_segment(WaitingSegment& waiting, MediumBlock& block) const {
  const std::span<const ListedPoint> points =
      std::span(scratch_.list.points).subspan(waiting.first_point, waiting.point_count);
  SegmentResult& result =
      (waiting.waiting == Waiting::to_pass ? scratch_.shadow_results : scratch_.path_results)[waiting.ray];
  if (waiting.waiting == Waiting::at_end) {
    std::array<Rgb, 3> values;
    for (size_t i = 0; i < points.size(); ++i) values[i] = points[i].value();
    block.steps += waiting.so_far.steps;
    result = segment_result(waiting.segment, waiting.so_far, std::span(values).first(points.size()), inputs_.tables);
    return;
  }
  const shading::StepRule rule = rule_of(waiting.segment);
  for (const ListedPoint& listed : points) {
    if (waiting.waiting == Waiting::to_pass)
      rule.pass(listed.step, listed.value(), waiting.so_far);
    else if (rule.track(listed.step, listed.value(), waiting.so_far))
      break;
  }
  if (waiting.is_open && !waiting.so_far.collided())
    advance(inputs_, waiting, block, result);
  else
    end_segment(inputs_, waiting, block, result);
}

}  // namespace spillway::pipeline
