#include "pipeline/render/replay_waves.h"

#include <algorithm>
#include <tuple>

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
constexpr double kManyOfMost = 0.25;

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

double ReplayWaves::sum(const Groups& groups) {
  double all = 0;
  for (const PathGroup& group : groups) all += group.live;
  return all;
}

bool ReplayWaves::has_traced() const { return sum(traced_) + sum(traced_shadows_) >= kFewest; }

bool ReplayWaves::is_empty() const {
  return sum(groups_) + sum(back_) < kFewest && sum(shadows_) + sum(back_shadows_) < kFewest;
}

// The log's lists of what goes on hold all ages at once: those of the youngest stand for the older ones. Of them those
// that are many: what a portion of the lot brought back is a few of each range, and the lists are of all of it.
std::vector<PathRange> ReplayWaves::youngest_ranges() const {
  const auto youngest = std::ranges::min_element(groups_, {}, &PathGroup::age);
  double most = 0;
  for (const PathGroup& group : groups_)
    if (group.age == youngest->age) most = std::max(most, group.live);
  std::vector<PathRange> ranges;
  for (const PathGroup& group : groups_)
    if (group.age == youngest->age && group.live >= kManyOfMost * most) ranges.push_back(group.range);
  return ranges;
}

bool ReplayWaves::next(ReplayWave& wave) {
  wave = {};
  wave.going_on = youngest_ranges();
  wave.later_paths = sum(groups_), wave.shadows = sum(shadows_);
  if (!has_traced() && are_nearly_full(sum(parked_), sum(parked_shadows_), park_limit_)) sweep_lot(wave);
  top_up(wave);
  if (is_empty() && sum(parked_) + sum(parked_shadows_) >= kFewest) {
    sweep_lot(wave);
    top_up(wave);
  }
  return !is_empty();
}

void ReplayWaves::sweep_lot(ReplayWave& wave) {
  wave.swept_rays = sum(parked_) + sum(parked_shadows_);
  traced_.insert(traced_.end(), parked_.begin(), parked_.end());
  for (const int half : {0, 1}) traced_shadows_[half] += parked_shadows_[half];
  parked_.clear(), parked_shadows_ = {};
}

// A portion of the lot, of all that it holds the same.
void ReplayWaves::take_back() {
  const auto share = [](double room, double all) { return room < all ? std::max(room, 0.0) / all : 1.0; };
  const double paths = share(wave_paths_ - sum(groups_), sum(traced_));
  for (PathGroup& group : traced_) {
    back_.push_back(group), back_.back().live *= paths;
    group.live *= 1 - paths;
  }
  if (paths == 1) traced_.clear();
  const double shadows = share(wave_paths_ - sum(shadows_), sum(traced_shadows_));
  for (const int half : {0, 1}) {
    back_shadows_[half] += shadows * traced_shadows_[half];
    traced_shadows_[half] *= 1 - shadows;
  }
}

void ReplayWaves::top_up(ReplayWave& wave) {
  take_back();
  wave.begun = {begun_, begun_};
  double room = wave_paths_ - sum(groups_) - sum(back_);
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

bool ReplayWaves::has_room(double paths, double shadows) const {
  return paths <= park_limit_ - sum(parked_) - sum(traced_) &&
         shadows <= park_limit_ - sum(parked_shadows_) - sum(traced_shadows_);
}

void ReplayWaves::park(double camera_share, double later_share, double shadow_share) {
  for (PathGroup& group : groups_) {
    PathGroup waits = group;
    waits.live *= group.age == 0 ? camera_share : later_share;
    if (waits.live <= 0) continue;
    group.live -= waits.live;
    parked_.push_back(waits);
  }
  for (const int half : {0, 1}) parked_shadows_[half] += shadows_[half] * shadow_share;
}

void ReplayWaves::merge(Groups& groups) {
  const auto key = [](const PathGroup& g) { return std::tuple(g.range.first, g.range.last, g.age, g.half); };
  std::ranges::sort(groups, {}, key);
  Groups merged;
  for (const PathGroup& group : groups) {
    if (!merged.empty() && key(merged.back()) == key(group))
      merged.back().live += group.live;
    else
      merged.push_back(group);
  }
  groups = std::move(merged);
}

void ReplayWaves::advance() {
  groups_.insert(groups_.end(), back_.begin(), back_.end());
  back_.clear(), back_shadows_ = {};
  merge(groups_);
  for (PathGroup& group : groups_) group.live *= rates_.continuing, ++group.age;
  std::erase_if(groups_, [&](const PathGroup& group) { return group.age > max_depth_ || group.live < kFewest; });
  shadows_ = {};
  for (const PathGroup& group : groups_) shadows_[group.half] += group.live * rates_.shadows_a_later_path;
  close_epochs();
}

void ReplayWaves::close_epochs() {
  for (const uint32_t half : {0u, 1u}) {
    const auto is_of_half = [&](const PathGroup& group) { return group.half == half && group.live >= kFewest; };
    const auto any = [&](const Groups& groups) { return std::ranges::any_of(groups, is_of_half); };
    const double shadows = shadows_[half] + parked_shadows_[half] + traced_shadows_[half];
    const bool under_way = any(groups_) || any(parked_) || any(traced_) || shadows >= kFewest;
    if (schedule_.is_open(half) && !under_way && (left_ < kFewest || half_ != half)) schedule_.close(half);
  }
}

}  // namespace spillway::pipeline
