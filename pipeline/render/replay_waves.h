#pragma once

// The loop of the renderer with counts for rays: which paths of a frame make which wave, given a plan.
//
// Owns: groups of paths that began together. Order: serial. Based on: render_image.cpp, whose rules these are: waves
// take back rays of the lot that were traced, then camera paths of open epochs, which close when their last ray ends;
// the lot is swept when it is nearly full, or when nothing else is left.

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
  double camera_paths = 0, later_paths = 0, shadows = 0;  // to be traced: without those that came back
  double swept_rays = 0;                                  // of the lot, before this wave
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
  // Whether the lot takes so many rays.
  [[nodiscard]] bool has_room(double paths, double shadows) const;
  // These shares of the wave go there.
  void park(double camera_share, double later_share, double shadow_share);
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
  using Groups = std::vector<PathGroup>;
  using OfHalf = std::array<double, 2>;
  static double sum(const Groups& groups);
  static double sum(const OfHalf& counts) { return counts[0] + counts[1]; }
  static void merge(Groups& groups);
  [[nodiscard]] std::vector<PathRange> youngest_ranges() const;
  void sweep_lot(ReplayWave& wave);
  void take_back();
  void top_up(ReplayWave& wave);
  void close_epochs();
  [[nodiscard]] bool has_traced() const;
  [[nodiscard]] bool is_empty() const;

  const PathRates rates_;
  const double wave_paths_, park_limit_, pixels_;
  const uint32_t max_depth_;
  EpochSchedule schedule_;
  // Of the wave, to be traced and traced before; of the lot, the same.
  Groups groups_, back_, parked_, traced_;
  OfHalf shadows_ = {}, back_shadows_ = {}, parked_shadows_ = {}, traced_shadows_ = {};
  double begun_ = 0, left_ = 0;  // of the epoch whose paths begin
  uint32_t half_ = 0;
};

}  // namespace spillway::pipeline
