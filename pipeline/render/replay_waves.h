#pragma once

// The loop of the renderer with a log's sampled paths for all: which of their rays are traced in which wave, given a plan.
//
// Owns: rays on their way. Order: serial. Based on: render_image.cpp, whose rules these are: waves take back rays of the
// lot that were traced, by what they hit, then camera paths of open epochs, which close when their last ray ends; the lot
// is swept when it is nearly full, or when nothing else is left.

#include <array>
#include <span>
#include <vector>

#include "pipeline/render/epochs.h"
#include "pipeline/render/plan.h"
#include "pipeline/render/replay_paths.h"

namespace spillway::pipeline {

// Rays by their numbers.
struct ReplayWave {
  std::vector<uint32_t> paths, shadows;  // to be traced
  std::vector<uint32_t> back;            // paths that came back, with their hits
  size_t back_shadows = 0;
  double swept_rays = 0;                 // of the lot, before this wave
};

class ReplayWaves {
 public:
  ReplayWaves(const ReplayPaths& paths, const SceneFacts& scene, const Plan& plan);

  // The next wave; false when all paths have ended.
  bool next(ReplayWave& wave);
  // Whether the lot takes so many rays.
  [[nodiscard]] bool has_room(double paths, double shadows) const;
  // Those of the wave go there: of its paths, then of its shadow rays.
  void park(ReplayWave& wave, const std::vector<bool>& is_parked);
  // The wave was traced and shaded.
  void advance(const ReplayWave& wave);

 private:
  using Rays = std::vector<uint32_t>;
  // The lot's, of one kind.
  struct Parked {
    Rays waiting, traced;
    size_t given = 0;  // of those that were traced
    [[nodiscard]] size_t traced_count() const { return traced.size() - given; }
    [[nodiscard]] size_t size() const { return waiting.size() + traced_count(); }
  };
  [[nodiscard]] double rays_of(size_t samples) const { return rays_a_sample_ * static_cast<double>(samples); }
  [[nodiscard]] uint32_t half_of(uint32_t ray) const { return half_[paths_.ray(ray).path]; }
  void sweep_lot(ReplayWave& wave);
  static void give_back(Parked& parked, size_t count, Rays& to);
  void top_up(ReplayWave& wave);
  bool open_epoch();
  void send(uint32_t ray);
  void close_epochs();

  const ReplayPaths& paths_;
  const double rays_a_sample_, park_limit_, frame_paths_;
  const uint64_t pixel_count_;
  const size_t wave_paths_;  // samples
  EpochSchedule schedule_;
  Rays next_paths_, next_shadows_;
  Parked parked_, parked_shadows_;
  std::vector<uint8_t> half_;  // of each path that has begun
  std::array<uint64_t, 2> live_ = {0, 0};
  double opened_paths_ = 0;  // of the frame, in epochs so far
  uint32_t begun_ = 0, epoch_end_ = 0, epoch_half_ = 0;
};

}  // namespace spillway::pipeline
