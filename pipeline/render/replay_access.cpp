#include "pipeline/render/replay_access.h"

#include <algorithm>

#include "cache/residency.h"
#include "pipeline/records.h"
#include "pipeline/render/replay_pages.h"
#include "pipeline/render/replay_paths.h"
#include "pipeline/render/replay_waves.h"

namespace spillway::pipeline {
namespace {

constexpr double kMostWaves = 1 << 22;  // 2^38 paths in small waves: more is no frame
// Of a wave's rays, those that are like one of the log, at least, of the most that are: blocks are known of whole waves.
// Chosen, not measured: what it says of blocks is up to 3.5 times too much (bench/RESULTS.md).
constexpr double kManyOfMost = 0.25;
constexpr double kUnprobedBytesPerSecond = 2.8e9;  // as the planner's

using List = std::vector<uint32_t>;
using Set = std::vector<bool>;

void add(const List& items, Set& to) {
  for (const uint32_t item : items) to[item] = true;
}

// Attribute blocks: one sweep a wave.
class ReplayBlocks {
 public:
  ReplayBlocks(const AccessLog& log, const Plan& plan)
      : log_(log),
        residency_(log.attribute_bytes, plan.attribute_bytes, plan.read_ahead_bytes),
        was_read_(log.attribute_bytes.size()) {}

  ReplayRead sweep(const List& waves) {
    Set needed(log_.attribute_bytes.size());
    for (const uint32_t w : waves) add(log_.waves[w].attribute_blocks, needed);
    ReplayRead read;
    for (uint32_t block = 0; block < needed.size(); ++block) {
      if (!needed[block]) continue;
      residency_.ask(block);
      if (residency_.is_resident(block)) continue;
      (was_read_[block] ? read.again_bytes : read.first_bytes) += log_.attribute_bytes[block];
      was_read_[block] = true;
      if (residency_.take_room(block)) residency_.set_resident(block);
    }
    residency_.rebalance([](uint32_t) {});
    return read;
  }

 private:
  const AccessLog& log_;
  cache::Residency residency_;
  Set was_read_;
};

// Seconds that reading a byte makes a render wait.
struct ReadCosts {
  double first = 0, again = 0;
  double compute = 0;  // what it takes of the tracing threads, who share the processors with those that read
};

uint64_t unique_bytes(const AccessLog& log) {
  uint64_t unique = 0;
  Set seen(log.page_bytes.size());
  for (const WaveAccess& w : log.waves)
    for (const uint32_t page : w.read_pages) unique += seen[page] ? 0 : log.page_bytes[page], seen[page] = true;
  return unique;
}

// A page that was read before is known by its checksum, which the log's probe measured; of those that are new the log's
// own waits tell, when it read no others.
ReadCosts read_costs(const AccessLog& log, const ReplayRates& rates) {
  const AccessFacts& f = log.facts;
  ReadCosts costs;
  costs.again = f.probe_bytes > 0 ? f.probe_seconds / static_cast<double>(f.probe_bytes) : 1 / kUnprobedBytesPerSecond;
  costs.first = costs.again;
  if (f.probe_bytes > 0 && f.threads > 0)
    costs.compute = f.probe_cpu_seconds / static_cast<double>(f.threads) / static_cast<double>(f.probe_bytes);
  const uint64_t unique = unique_bytes(log);
  if (unique > 0 && unique == f.page_bytes_read) costs.first = f.page_wait_seconds / static_cast<double>(unique);
  if (rates.disk_bytes_per_second > 0) costs.first = costs.again = 1 / rates.disk_bytes_per_second;
  return costs;
}

double spilled_bytes(const AccessLog& log, const Plan& plan) {
  // What the planner takes a step to spill, for the steps that there were.
  if (!plan.spills) return 0;
  double steps = 0;
  for (const WaveAccess& w : log.waves) steps += static_cast<double>(w.facts.path_count);
  return static_cast<double>(plan.predicted_spill_bytes) / std::max(1.0, plan.predicted_steps) * steps;
}

Status check(const AccessLog& log, const Plan& plan) {
  const SceneFacts& scene = log.facts.scene;
  if (log.facts.rays_are_parked != 0)
    return error("the log is of a run that parked rays: what its waves need is not in it; make it without --log-parked");
  if (scene.max_depth > kMostBounces) return error("the log is of {} bounces: it is damaged", scene.max_depth);
  const double wave_count =
      static_cast<double>(scene.pixel_count) * scene.samples_per_pixel / static_cast<double>(plan.wave_paths);
  if (!(wave_count < kMostWaves)) return error("the log is of a frame of {:.0f} waves: it is damaged", wave_count);
  return {};
}

// Goes through the waves of a plan.
class Replayer {
 public:
  Replayer(const AccessLog& log, const ReplayPaths& paths, const Plan& plan, const ReadCosts& costs)
      : log_(log),
        paths_(paths),
        costs_(costs),
        pages_(log, paths, plan),
        blocks_(log, plan),
        waves_(paths, log.facts.scene, plan) {
    replay_.plan = plan;
  }

  Replay run() {
    for (ReplayWave wave; waves_.next(wave); waves_.advance(wave)) {
      if (wave.swept_rays > 0) count(pages_.sweep_lot(), wave.swept_rays);
      trace(wave);
      const ReplayRead read = blocks_.sweep(shaded_like(wave));
      replay_.attribute_bytes += read.bytes();
      // Blocks are not gone through when they are new, as pages are.
      replay_.io_seconds += static_cast<double>(read.bytes()) * costs_.again;
      replay_.compute_seconds += static_cast<double>(read.again_bytes) * costs_.compute;
      ++replay_.wave_count;
    }
    count(pages_.sweep_lot(), 0);  // of rays that are no samples, if such alone are left
    return replay_;
  }

 private:
  // Blocks are known of whole waves of the log, of all their rays.
  [[nodiscard]] List shaded_like(const ReplayWave& wave) const {
    std::vector<size_t> counts(log_.waves.size());
    for (const List* const rays : {&wave.paths, &wave.back})
      for (const uint32_t ray : *rays) ++counts[paths_.ray(ray).wave];
    const auto most = static_cast<double>(std::ranges::max(counts));
    List waves;
    for (uint32_t w = 0; w < counts.size(); ++w)
      if (counts[w] > 0 && static_cast<double>(counts[w]) >= kManyOfMost * most) waves.push_back(w);
    return waves;
  }

  void trace(ReplayWave& wave) {
    pages_.begin(wave.paths, wave.shadows);
    const bool parks = replay_.plan.parked_rays > 0;
    const double parked = parks ? park(wave) : 0;
    count(pages_.sweep(), pages_.waiting() - parked);
    // As the renderer does: else all that is wanted is asked for when the lot is swept.
    if (!parks) pages_.rebalance();
  }

  // How many rays leave the wave.
  double park(ReplayWave& wave) {
    const ReplayRays late = pages_.choose_late();
    if (late.sum() == 0 || !waves_.has_room(late.paths, late.shadows)) return 0;  // all is read in the wave
    const std::vector<bool> is_parked = pages_.park();
    waves_.park(wave, is_parked);
    const double parked = paths_.rays_a_sample() * static_cast<double>(std::ranges::count(is_parked, true));
    replay_.parked_rays += parked;
    return parked;
  }

  void count(const ReplayRead& read, double rays) {
    replay_.page_bytes += read.bytes(), replay_.page_sweeps += read.bytes() > 0 ? 1 : 0;
    replay_.waiting_rays += rays;
    const auto first = static_cast<double>(read.first_bytes), again = static_cast<double>(read.again_bytes);
    replay_.io_seconds += first * costs_.first + again * costs_.again;
    replay_.compute_seconds += again * costs_.compute;
  }

  const AccessLog& log_;
  const ReplayPaths& paths_;
  const ReadCosts costs_;
  ReplayPages pages_;
  ReplayBlocks blocks_;
  ReplayWaves waves_;
  Replay replay_;
};

// What the logged run computed, logging and what it read again itself left out.
double computed_seconds(const AccessLog& log, const ReadCosts& costs) {
  const AccessFacts& f = log.facts;
  const uint64_t unique = unique_bytes(log), again = f.page_bytes_read > unique ? f.page_bytes_read - unique : 0;
  const double seconds = f.seconds - f.log_seconds - f.page_wait_seconds - f.attribute_wait_seconds;
  return std::max(0.0, seconds - static_cast<double>(again) * costs.compute);
}

}  // namespace

Result<Replay> replay_access(const AccessLog& log, PlanOptions options, const ReplayRates& rates) {
  if (log.waves.empty()) return error("the log has no waves");
  SPILLWAY_ASSIGN(const Plan plan, plan_render(log.facts.scene, options));
  SPILLWAY_TRY(check(log, plan));
  SPILLWAY_ASSIGN(const ReplayPaths paths, ReplayPaths::of(log));
  const ReadCosts costs = read_costs(log, rates);
  Replay replay = Replayer(log, paths, plan, costs).run();
  replay.finer_than_log = plan.wave_paths < log.facts.wave_paths;
  replay.spill_bytes = static_cast<uint64_t>(spilled_bytes(log, plan));
  replay.io_seconds += static_cast<double>(replay.spill_bytes) / rates.spill_bytes_per_second;
  replay.compute_seconds += computed_seconds(log, costs);
  replay.seconds = replay.compute_seconds + replay.io_seconds;
  return replay;
}

}  // namespace spillway::pipeline
