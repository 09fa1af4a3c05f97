#pragma once

// The loop of the renderer with counts for rays: which paths of a frame make which wave, given a plan.
//
// Owns: groups of paths that began together. Order: serial. Based on: render_image.cpp, whose rules these are: waves
// are topped up from open epochs, which close when their last path ends; rays that wait for pages are parked, and come
// back when many are, when a wave was not full, or when nothing else is left.

#include <array>
#include <vector>

#include "pipeline/render/access_log.h"
#include "pipeline/render/epochs.h"

namespace spillway::pipeline {

// Camera paths [first, last) in the order in which they begin.
struct PathRange {
  double first = 0, last = 0;
};

struct ReplayWave {
  PathRange begun;
  std::vector<PathRange> going_on;  // of those that are still on their way: the youngest, which stand for all
  double camera_paths = 0, later_paths = 0, shadows = 0;  // without what was parked before
  double unparked = 0;                                    // rays that were
  bool sweeps = false;                                    // it does not park
  [[nodiscard]] double paths() const { return camera_paths + later_paths; }
};

// What is known of a log as a whole.
struct PathRates {
  explicit PathRates(const AccessLog& log);
  double steps = 0, begun = 0;
  double continuing = 0;  // of a wave's paths, those that go on
  double shadows_a_later_path = 0;
};

class ReplayWaves {
 public:
  ReplayWaves(const AccessLog& log, const Plan& plan);

  // The next wave; false when all paths have ended.
  bool next(ReplayWave& wave);
  // Whether so many rays of this wave may leave it.
  [[nodiscard]] bool may_park(const ReplayWave& wave, double paths, double shadows) const;
  // These shares of it wait for pages, and leave it.
  void park(const ReplayWave& wave, double camera_share, double later_share, double shadow_share);
  // The wave was traced and shaded.
  void advance();

 private:
  // Paths that began together.
  struct PathGroup {
    PathRange range;
    double live = 0;
    uint32_t age = 0;  // bounces
    uint32_t half = 0;
  };
  void unpark(ReplayWave& wave);
  void top_up(ReplayWave& wave);
  void close_epochs();
  [[nodiscard]] double live() const;

  const PathRates rates_;
  const double wave_paths_, park_limit_, pixels_;
  const uint32_t max_depth_;
  EpochSchedule schedule_;
  std::vector<PathGroup> groups_, parked_;
  double parked_paths_ = 0, parked_shadows_ = 0;
  double next_shadows_ = 0;
  double begun_ = 0, left_ = 0;  // of the epoch whose paths begin
  uint32_t half_ = 0;
  bool starves_ = false;
};

}  // namespace spillway::pipeline
