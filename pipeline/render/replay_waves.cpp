#include "pipeline/render/replay_waves.h"

#include <algorithm>

#include "pipeline/render/park_rays.h"

namespace spillway::pipeline {
namespace {

// The share c of paths that go on at each of max_depth bounces when a path has so many vertices: 1 + c + ... +
// c^max_depth.
double continuing_share(double vertices, uint32_t max_depth) {
  double low = 0, high = 1;
  for (int i = 0; i < 50; ++i) {
    const double c = 0.5 * (low + high);
    double sum = 1, term = 1;
    for (uint32_t d = 0; d < max_depth; ++d) sum += term *= c;
    (sum < vertices ? low : high) = c;
  }
  return low;
}

constexpr double kFewest = 0.5;  // less is no path

}  // namespace

PathRates::PathRates(const AccessLog& log) {
  double shadows = 0;
  for (const WaveAccess& w : log.waves) {
    steps += static_cast<double>(w.facts.path_count), begun += static_cast<double>(w.facts.generated_count);
    shadows += static_cast<double>(w.facts.shadow_count);
  }
  continuing = continuing_share(begun > 0 ? steps / begun : 1, log.facts.scene.max_depth);
  // Of each vertex that is not the last of its path, and of the last ones too.
  shadows_a_later_path = steps > begun ? shadows / (steps - begun) : 0;
}

ReplayWaves::ReplayWaves(const AccessLog& log, const Plan& plan)
    : rates_(log),
      wave_paths_(static_cast<double>(plan.wave_paths)),
      park_limit_(static_cast<double>(plan.parked_rays)),
      pixels_(static_cast<double>(log.facts.scene.pixel_count)),
      max_depth_(log.facts.scene.max_depth),
      schedule_({log.facts.scene.samples_per_pixel, plan.epoch_samples, plan.first_epoch_samples}) {}

double ReplayWaves::live() const {
  double sum = 0;
  for (const PathGroup& group : groups_) sum += group.live;
  return sum;
}

bool ReplayWaves::next(ReplayWave& wave) {
  wave = {};
  // The log's lists of what goes on hold all ages at once: those of the youngest stand for the older ones.
  const auto youngest = std::ranges::min_element(groups_, {}, &PathGroup::age);
  for (const PathGroup& group : groups_) {
    wave.later_paths += group.live;
    if (group.age == youngest->age) wave.going_on.push_back(group.range);
  }
  wave.shadows = next_shadows_;
  wave.sweeps = starves_ || are_nearly_full(parked_paths_, parked_shadows_, park_limit_);
  if (wave.sweeps) unpark(wave);
  top_up(wave);
  starves_ = wave_paths_ - live() >= kFewest;
  const bool has_parked = parked_paths_ + parked_shadows_ >= kFewest;
  if (live() < kFewest && wave.shadows < kFewest && has_parked) {
    wave.sweeps = true;
    unpark(wave);
  }
  return live() >= kFewest || wave.shadows >= kFewest || wave.unparked >= kFewest;
}

void ReplayWaves::unpark(ReplayWave& wave) {
  groups_.insert(groups_.end(), parked_.begin(), parked_.end());
  wave.unparked = parked_paths_ + parked_shadows_;
  parked_.clear();
  parked_paths_ = parked_shadows_ = 0;
}

void ReplayWaves::top_up(ReplayWave& wave) {
  wave.begun = {begun_, begun_};
  double room = wave_paths_ - live();
  while (room >= kFewest) {
    if (left_ < kFewest) {
      const auto epoch = schedule_.open_next();
      if (!epoch) break;
      left_ = epoch->sample_count * pixels_, half_ = epoch->half;
    }
    const double fresh = std::min(room, left_);
    groups_.push_back({{begun_, begun_ + fresh}, fresh, 0, half_});
    begun_ += fresh, left_ -= fresh, room -= fresh, wave.camera_paths += fresh;
  }
  wave.begun.last = begun_;
}

bool ReplayWaves::may_park(const ReplayWave& wave, double paths, double shadows) const {
  if (wave.sweeps || park_limit_ == 0) return false;
  return paths <= park_limit_ - parked_paths_ && shadows <= park_limit_ - parked_shadows_;
}

void ReplayWaves::park(const ReplayWave& wave, double camera_share, double later_share, double shadow_share) {
  for (PathGroup& group : groups_) {
    PathGroup waits = group;
    waits.live *= group.age == 0 ? camera_share : later_share;
    if (waits.live <= 0) continue;
    group.live -= waits.live, parked_paths_ += waits.live;
    parked_.push_back(waits);
  }
  parked_shadows_ += wave.shadows * shadow_share;
}

void ReplayWaves::advance() {
  for (PathGroup& group : groups_) group.live *= rates_.continuing, ++group.age;
  std::erase_if(groups_, [&](const PathGroup& group) { return group.age > max_depth_ || group.live < kFewest; });
  next_shadows_ = live() * rates_.shadows_a_later_path;
  close_epochs();
}

void ReplayWaves::close_epochs() {
  for (const uint32_t half : {0u, 1u}) {
    const auto is_of_half = [&](const PathGroup& group) { return group.half == half && group.live >= kFewest; };
    const bool under_way = std::ranges::any_of(groups_, is_of_half) || std::ranges::any_of(parked_, is_of_half);
    if (schedule_.is_open(half) && !under_way && (left_ < kFewest || half_ != half)) schedule_.close(half);
  }
}

}  // namespace spillway::pipeline
