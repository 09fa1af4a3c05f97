#include "pipeline/render/replay_access.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "cache/residency.h"
#include "pipeline/records.h"
#include "pipeline/render/epochs.h"

namespace spillway::pipeline {
namespace {

constexpr double kMostWaves = 1 << 22;  // 2^38 paths in small waves: more is no frame

using List = std::vector<uint32_t>;

// Camera paths [first, last) in the order in which they begin.
struct PathRange {
  double first = 0, last = 0;
};

// A wave of the plan.
struct PlannedWave {
  double paths = 0;
  PathRange begun;
  std::vector<PathRange> going_on;  // those of before that are still on their way
};

// What is known of the log as a whole.
struct LogTotals {
  double steps = 0, begun = 0, rays = 0;
  double other_seconds = 0, trace_seconds = 0, shade_seconds = 0;
  double continuing = 0;  // of a wave's paths, those that go on
};

// The share c of paths that go on at each of max_depth bounces when a path has so many vertices: 1 + c + ... +
// c^max_depth.
double continuing(double vertices, uint32_t max_depth) {
  double low = 0, high = 1;
  for (int i = 0; i < 50; ++i) {
    const double c = 0.5 * (low + high);
    double sum = 1, term = 1;
    for (uint32_t d = 0; d < max_depth; ++d) sum += term *= c;
    (sum < vertices ? low : high) = c;
  }
  return low;
}

LogTotals totals(const AccessLog& log) {
  LogTotals t;
  for (const WaveAccess& w : log.waves) {
    const WaveFacts& f = w.facts;
    t.steps += static_cast<double>(f.path_count), t.begun += static_cast<double>(f.generated_count);
    t.rays += static_cast<double>(f.path_count + f.shadow_count);
    t.other_seconds += f.generate_seconds + f.sort_seconds + f.route_seconds;
    t.trace_seconds += std::max(0.0, f.trace_seconds - f.page_wait_seconds);
    t.shade_seconds += std::max(0.0, f.shade_seconds - f.attribute_wait_seconds);
  }
  t.continuing = continuing(t.begun > 0 ? t.steps / t.begun : 1, log.facts.scene.max_depth);
  return t;
}

// Paths that began together.
struct PathGroup {
  PathRange range;
  double live = 0;
  uint32_t age = 0;  // waves
  uint32_t half = 0;
};

// The loop of the renderer with counts for rays: topped up from open epochs, which close when their last path ends.
class WavePlanner {
 public:
  WavePlanner(const AccessLog& log, const LogTotals& t, const Plan& plan)
      : t_(t),
        wave_paths_(static_cast<double>(plan.wave_paths)),
        pixels_(static_cast<double>(log.facts.scene.pixel_count)),
        max_depth_(log.facts.scene.max_depth),
        schedule_({log.facts.scene.samples_per_pixel, plan.epoch_samples, plan.first_epoch_samples}) {}

  std::vector<PlannedWave> run() {
    std::vector<PlannedWave> waves;
    while (true) {
      PlannedWave wave;
      // The log's lists of what goes on hold all ages at once: those of the youngest stand for the older ones.
      const auto youngest = std::ranges::min_element(groups_, {}, &PathGroup::age);
      for (const PathGroup& group : groups_) {
        wave.paths += group.live;
        if (group.age == youngest->age) wave.going_on.push_back(group.range);
      }
      top_up(wave);
      if (wave.paths < 0.5) return waves;
      waves.push_back(std::move(wave));
      advance();
    }
  }

 private:
  void top_up(PlannedWave& wave) {
    wave.begun = {begun_, begun_};
    while (wave_paths_ - wave.paths >= 0.5) {
      if (left_ < 0.5) {
        const auto epoch = schedule_.open_next();
        if (!epoch) break;
        left_ = epoch->sample_count * pixels_, half_ = epoch->half;
      }
      const double fresh = std::min(wave_paths_ - wave.paths, left_);
      groups_.push_back({{begun_, begun_ + fresh}, fresh, 0, half_});
      begun_ += fresh, left_ -= fresh, wave.paths += fresh;
    }
    wave.begun.last = begun_;
  }

  void advance() {
    for (PathGroup& group : groups_) group.live *= t_.continuing, ++group.age;
    std::erase_if(groups_, [&](const PathGroup& group) { return group.age > max_depth_ || group.live < 0.5; });
    for (const uint32_t half : {0u, 1u}) {
      const bool under_way = std::ranges::any_of(groups_, [&](const PathGroup& group) { return group.half == half; });
      if (schedule_.is_open(half) && !under_way && (left_ < 0.5 || half_ != half)) schedule_.close(half);
    }
  }

  const LogTotals& t_;
  const double wave_paths_, pixels_;
  const uint32_t max_depth_;
  EpochSchedule schedule_;
  std::vector<PathGroup> groups_;
  double begun_ = 0, left_ = 0;  // of the epoch whose paths begin
  uint32_t half_ = 0;
};

// Unions of lists of the log over ranges of paths.
class LogSets {
 public:
  explicit LogSets(const AccessLog& log) : log_(log) {
    double end = 0;
    for (const WaveAccess& w : log.waves) {
      begins_.push_back(end);
      end += static_cast<double>(w.facts.generated_count);
    }
    begins_.push_back(end);
  }

  // Waves count whose middle lies in the range, so that neighbouring ranges share none; or the one around its middle.
  void add(PathRange range, List WaveAccess::*list, std::vector<bool>& to) const {
    if (range.last <= range.first) return;
    const size_t first = wave_at(range.first);
    bool any = false;
    for (size_t wave = first; wave < log_.waves.size() && begins_[wave] <= range.last; ++wave) {
      const double middle = 0.5 * (begins_[wave] + begins_[wave + 1]);
      if (middle < range.first || middle > range.last) continue;
      add_wave(wave, list, to);
      any = true;
    }
    if (!any) add_wave(wave_at(0.5 * (range.first + range.last)), list, to);
  }

 private:
  [[nodiscard]] size_t wave_at(double path) const {
    const auto after = std::upper_bound(begins_.begin(), begins_.end() - 1, path);
    return after == begins_.begin() ? 0 : static_cast<size_t>(after - begins_.begin()) - 1;
  }
  void add_wave(size_t wave, List WaveAccess::*list, std::vector<bool>& to) const {
    for (const uint32_t item : log_.waves[wave].*list) to[item] = true;
  }

  const AccessLog& log_;
  std::vector<double> begins_;  // of each wave's paths, and the end
};

struct Needs {
  std::vector<bool> pages, blocks;
};

Needs needs_of(const AccessLog& log, const LogSets& sets, const PlannedWave& wave) {
  Needs n{std::vector<bool>(log.page_bytes.size()), std::vector<bool>(log.attribute_bytes.size())};
  sets.add(wave.begun, &WaveAccess::camera_pages, n.pages);
  sets.add(wave.begun, &WaveAccess::attribute_blocks, n.blocks);
  for (const PathRange& range : wave.going_on) {
    sets.add(range, &WaveAccess::continued_pages, n.pages);
    sets.add(range, &WaveAccess::shadow_pages, n.pages);
    sets.add(range, &WaveAccess::attribute_blocks, n.blocks);
  }
  return n;
}

// One sweep over what is needed and not resident. Returns the bytes read.
uint64_t sweep(cache::Residency& residency, const std::vector<uint64_t>& bytes, const std::vector<bool>& needed) {
  uint64_t read = 0;
  for (uint32_t part = 0; part < bytes.size(); ++part) {
    if (!needed[part]) continue;
    residency.ask(part);
    if (residency.is_resident(part)) continue;
    read += bytes[part];
    if (residency.take_room(part)) residency.set_resident(part);
  }
  residency.rebalance([](uint32_t) {});
  return read;
}

uint64_t bytes_of(const std::vector<uint64_t>& bytes, const std::vector<bool>& set) {
  uint64_t sum = 0;
  for (size_t i = 0; i < bytes.size(); ++i)
    if (set[i]) sum += bytes[i];
  return sum;
}

// Computing and reading overlap inside the tracing of what is swept, and inside shading.
void add_times(const LogTotals& t, const PlannedWave& wave, double swept_share, uint64_t page_bytes,
               uint64_t block_bytes, const ReplayRates& rates, Replay& replay) {
  const bool is_large = replay.plan.wave_paths > kInCoreWavePaths;
  const double share = t.steps > 0 ? wave.paths / t.steps : 0, rays = t.rays * share;
  const double other = t.other_seconds * share + (is_large ? wave.paths * rates.large_wave_seconds_per_step : 0);
  const double trace = t.trace_seconds * share, shade = t.shade_seconds * share;
  const double swept = swept_share * (trace + rays * rates.wait_seconds_per_ray) +
                       static_cast<double>(page_bytes) / rates.check_bytes_per_second;
  const double page_io = static_cast<double>(page_bytes) / rates.disk_bytes_per_second;
  const double block_io = static_cast<double>(block_bytes) / rates.disk_bytes_per_second;
  replay.compute_seconds += other + (1 - swept_share) * trace + swept + shade;
  replay.io_seconds += page_io + block_io;
  replay.seconds += other + (1 - swept_share) * trace + std::max(swept, page_io) + std::max(shade, block_io);
}

}  // namespace

Result<Replay> replay_access(const AccessLog& log, PlanOptions options, const ReplayRates& rates) {
  if (log.waves.empty()) return error("the log has no waves");
  Replay replay;
  SPILLWAY_ASSIGN(replay.plan, plan_render(log.facts.scene, options));
  if (log.facts.scene.max_depth > kMostBounces) return error("the log is of {} bounces: it is damaged", log.facts.scene.max_depth);
  const double wave_count = static_cast<double>(log.facts.scene.pixel_count) * log.facts.scene.samples_per_pixel /
                            static_cast<double>(replay.plan.wave_paths);
  if (!(wave_count < kMostWaves)) return error("the log is of a frame of {:.0f} waves: it is damaged", wave_count);
  const LogTotals t = totals(log);
  const LogSets sets(log);
  cache::Residency pages(log.page_bytes, replay.plan.page_bytes, replay.plan.read_ahead_bytes);
  cache::Residency blocks(log.attribute_bytes, replay.plan.attribute_bytes, replay.plan.read_ahead_bytes);
  const std::vector<PlannedWave> waves = WavePlanner(log, t, replay.plan).run();
  for (const PlannedWave& wave : waves) {
    const Needs needs = needs_of(log, sets, wave);
    uint64_t swept_bytes = 0;
    for (uint32_t p = 0; p < needs.pages.size(); ++p)
      if (needs.pages[p] && !pages.is_resident(p)) swept_bytes += log.page_bytes[p];
    const uint64_t needed_bytes = bytes_of(log.page_bytes, needs.pages);
    const uint64_t page_bytes = sweep(pages, log.page_bytes, needs.pages);
    const uint64_t block_bytes = sweep(blocks, log.attribute_bytes, needs.blocks);
    replay.page_bytes += page_bytes, replay.attribute_bytes += block_bytes;
    replay.page_sweeps += page_bytes > 0 ? 1 : 0;
    const double swept_share =
        needed_bytes > 0 ? static_cast<double>(swept_bytes) / static_cast<double>(needed_bytes) : 0;
    add_times(t, wave, swept_share, page_bytes, block_bytes, rates, replay);
  }
  replay.wave_count = waves.size();
  replay.finer_than_log = replay.plan.wave_paths < log.facts.wave_paths;
  if (replay.plan.spills) {
    // What the planner takes a step to spill, for the steps that there were.
    const double planned =
        static_cast<double>(replay.plan.predicted_spill_bytes) / std::max(1.0, replay.plan.predicted_steps);
    replay.spill_bytes = static_cast<uint64_t>(planned * t.steps);
    const double io = static_cast<double>(replay.spill_bytes) / rates.disk_bytes_per_second;
    replay.io_seconds += io, replay.seconds += 0.5 * io;
  }
  return replay;
}

}  // namespace spillway::pipeline
