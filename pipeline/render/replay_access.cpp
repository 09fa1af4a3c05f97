#include "pipeline/render/replay_access.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "cache/file.h"
#include "cache/residency.h"

namespace spillway::pipeline {
namespace {

constexpr uint64_t kInCoreWavePaths = 64 << 10;  // beyond, a wave leaves the processor's caches

using List = std::vector<uint32_t>;

// Camera paths [first, last) in the order in which they begin.
struct PathRange {
  double first = 0, last = 0;
};

// A wave of the plan.
struct PlannedWave {
  double paths = 0;
  PathRange begun;
  std::vector<PathRange> going_on;  // whose paths are still on their way, the latest first
};

// What is known of the log as a whole.
struct LogTotals {
  double steps = 0, begun = 0, rays = 0;
  double other_seconds = 0, trace_seconds = 0, shade_seconds = 0;
  double continuing = 0;  // of a wave's paths, those that go on
};

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
  t.continuing = t.steps > 0 ? 1 - t.begun / t.steps : 0;
  return t;
}

// Waves are topped up until no path is left to begin; then what goes on gets less by the share that ends.
std::vector<PlannedWave> plan_waves(const LogTotals& t, uint64_t wave_paths, uint32_t max_depth) {
  std::vector<PlannedWave> waves;
  double begun = 0, live = 0;
  std::vector<PathRange> going_on;
  for (uint32_t tail = 0; tail <= max_depth && (begun < t.begun || live >= 1);) {
    const double fresh = std::min(std::max(0.0, static_cast<double>(wave_paths) - live), t.begun - begun);
    if (begun >= t.begun) ++tail;
    PlannedWave wave{live + fresh, {begun, begun + fresh}, going_on};
    begun += fresh;
    live = wave.paths * t.continuing;
    if (fresh > 0) going_on.insert(going_on.begin(), wave.begun);
    // Those that began `depth` waves ago have ended.
    if (going_on.size() > max_depth) going_on.resize(max_depth);
    if (fresh == 0 && !going_on.empty() && going_on.size() > max_depth + 1 - tail) going_on.pop_back();
    waves.push_back(std::move(wave));
  }
  return waves;
}

// Unions of lists of the log over ranges of paths.
class LogSets {
 public:
  explicit LogSets(const AccessLog& log) : log_(log) {
    double end = 0;
    for (const WaveAccess& w : log.waves) ends_.push_back(end += static_cast<double>(w.facts.generated_count));
  }

  void add(PathRange range, List WaveAccess::*list, std::vector<bool>& to) const {
    if (range.last <= range.first) return;
    // From the wave that holds the first path, through the waves after the last in which its paths go on.
    auto wave = static_cast<size_t>(std::upper_bound(ends_.begin(), ends_.end(), range.first) - ends_.begin());
    for (; wave < log_.waves.size(); ++wave) {
      for (const uint32_t item : log_.waves[wave].*list) to[item] = true;
      if (ends_[wave] >= range.last) break;
    }
  }

 private:
  const AccessLog& log_;
  std::vector<double> ends_;
};

struct Needs {
  std::vector<bool> pages, sampled, blocks;
};

Needs needs_of(const AccessLog& log, const LogSets& sets, const PlannedWave& wave) {
  Needs n{std::vector<bool>(log.page_bytes.size()), std::vector<bool>(log.page_bytes.size()),
          std::vector<bool>(log.attribute_bytes.size())};
  sets.add(wave.begun, &WaveAccess::camera_pages, n.pages);
  sets.add(wave.begun, &WaveAccess::sampled_pages, n.sampled);
  sets.add(wave.begun, &WaveAccess::attribute_blocks, n.blocks);
  for (const PathRange& range : wave.going_on) {
    sets.add(range, &WaveAccess::continued_pages, n.pages);
    sets.add(range, &WaveAccess::shadow_pages, n.pages);
    sets.add(range, &WaveAccess::sampled_pages, n.sampled);
    sets.add(range, &WaveAccess::attribute_blocks, n.blocks);
  }
  return n;
}

std::vector<uint64_t> held(const std::vector<uint64_t>& bytes) {
  std::vector<uint64_t> out;
  for (const uint64_t b : bytes)
    out.push_back((b + cache::kDirectAlignment - 1) / cache::kDirectAlignment * cache::kDirectAlignment);
  return out;
}

// One sweep over what is needed and not resident. Returns the bytes read. `asked`: residents that count as wanted.
uint64_t sweep(cache::Residency& residency, const std::vector<uint64_t>& bytes, const std::vector<bool>& needed,
               const std::vector<bool>& asked) {
  uint64_t read = 0;
  for (uint32_t part = 0; part < bytes.size(); ++part) {
    if (residency.is_resident(part)) {
      if (asked[part]) residency.ask(part);
      continue;
    }
    if (!needed[part]) continue;
    residency.ask(part);
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
  const LogTotals t = totals(log);
  const LogSets sets(log);
  cache::Residency pages(held(log.page_bytes), replay.plan.page_bytes, replay.plan.read_ahead_bytes);
  cache::Residency blocks(held(log.attribute_bytes), replay.plan.attribute_bytes, replay.plan.read_ahead_bytes);
  const std::vector<PlannedWave> waves = plan_waves(t, replay.plan.wave_paths, log.facts.scene.max_depth);
  for (const PlannedWave& wave : waves) {
    const Needs needs = needs_of(log, sets, wave);
    uint64_t swept_bytes = 0;
    for (uint32_t p = 0; p < needs.pages.size(); ++p)
      if (needs.pages[p] && !pages.is_resident(p)) swept_bytes += log.page_bytes[p];
    const uint64_t needed_bytes = bytes_of(log.page_bytes, needs.pages);
    const uint64_t page_bytes = sweep(pages, log.page_bytes, needs.pages, needs.sampled);
    const uint64_t block_bytes = sweep(blocks, log.attribute_bytes, needs.blocks, needs.blocks);
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
