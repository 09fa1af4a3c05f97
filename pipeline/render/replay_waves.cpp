#include "pipeline/render/replay_waves.h"

#include <algorithm>
#include <cmath>

#include "pipeline/render/park_rays.h"

namespace spillway::pipeline {

ReplayWaves::ReplayWaves(const ReplayPaths& paths, const SceneFacts& scene, const Plan& plan)
    : paths_(paths),
      rays_a_sample_(paths.rays_a_sample()),
      park_limit_(static_cast<double>(plan.parked_rays)),
      frame_paths_(static_cast<double>(scene.pixel_count) * scene.samples_per_pixel),
      pixel_count_(scene.pixel_count),
      wave_paths_(static_cast<size_t>(std::max(1.0, std::round(static_cast<double>(plan.wave_paths) / rays_a_sample_)))),
      schedule_({scene.samples_per_pixel, plan.epoch_samples, plan.first_epoch_samples}),
      half_(paths.path_count()) {}

bool ReplayWaves::next(ReplayWave& wave) {
  wave = {};
  wave.paths.swap(next_paths_), wave.shadows.swap(next_shadows_);
  const bool has_traced = parked_.traced_count() + parked_shadows_.traced_count() > 0;
  if (!has_traced && are_nearly_full(rays_of(parked_.size()), rays_of(parked_shadows_.size()), park_limit_))
    sweep_lot(wave);
  top_up(wave);
  const auto is_empty = [&] {
    return wave.paths.empty() && wave.back.empty() && wave.shadows.empty() && wave.back_shadows == 0;
  };
  if (is_empty() && parked_.size() + parked_shadows_.size() > 0) {
    sweep_lot(wave);
    top_up(wave);
  }
  return !is_empty();
}

void ReplayWaves::sweep_lot(ReplayWave& wave) {
  wave.swept_rays = rays_of(parked_.waiting.size() + parked_shadows_.waiting.size());
  for (Parked* const parked : {&parked_, &parked_shadows_}) {
    parked->traced = std::exchange(parked->waiting, {});
    parked->given = 0;
  }
  // By what they hit, of which the page is known.
  std::ranges::stable_sort(parked_.traced, {}, [&](uint32_t ray) {
    const auto stops = paths_.samples().stops(paths_.needs(ray));
    return stops.empty() ? UINT32_MAX : stops.front();
  });
}

void ReplayWaves::give_back(Parked& parked, size_t count, Rays& to) {
  const auto first = parked.traced.begin() + static_cast<ptrdiff_t>(parked.given);
  to.insert(to.end(), first, first + static_cast<ptrdiff_t>(count));
  parked.given += count;
}

bool ReplayWaves::open_epoch() {
  const auto epoch = schedule_.open_next();
  if (!epoch) return false;
  opened_paths_ += static_cast<double>(epoch->sample_count) * static_cast<double>(pixel_count_);
  epoch_end_ = static_cast<uint32_t>(std::lround(std::min(1.0, opened_paths_ / frame_paths_) * paths_.path_count()));
  epoch_half_ = epoch->half;
  return true;
}

void ReplayWaves::top_up(ReplayWave& wave) {
  const auto room = [&](size_t held) { return wave_paths_ - std::min(wave_paths_, held); };
  give_back(parked_, std::min(parked_.traced_count(), room(wave.paths.size())), wave.back);
  wave.back_shadows = std::min(parked_shadows_.traced_count(), room(wave.shadows.size()));
  for (size_t i = 0; i < wave.back_shadows; ++i) --live_[half_of(parked_shadows_.traced[parked_shadows_.given++])];
  while (wave.paths.size() + wave.back.size() < wave_paths_) {
    if (begun_ == epoch_end_) {
      if (!open_epoch()) return;
      continue;
    }
    half_[begun_] = static_cast<uint8_t>(epoch_half_);
    ++live_[epoch_half_];
    wave.paths.push_back(paths_.camera_ray(begun_++));
  }
}

bool ReplayWaves::has_room(double paths, double shadows) const {
  return paths <= park_limit_ - rays_of(parked_.size()) && shadows <= park_limit_ - rays_of(parked_shadows_.size());
}

void ReplayWaves::park(ReplayWave& wave, const std::vector<bool>& is_parked) {
  size_t at = 0;
  const auto park = [&](Rays& rays, Parked& parked) {
    Rays stay;
    for (const uint32_t ray : rays) (is_parked[at++] ? parked.waiting : stay).push_back(ray);
    rays = std::move(stay);
  };
  park(wave.paths, parked_), park(wave.shadows, parked_shadows_);
}

void ReplayWaves::send(uint32_t ray) {
  ++live_[half_of(ray)];
  (paths_.kind(ray) == RayKind::shadow ? next_shadows_ : next_paths_).push_back(ray);
}

void ReplayWaves::advance(const ReplayWave& wave) {
  for (const Rays* const rays : {&wave.paths, &wave.back}) {
    for (const uint32_t ray : *rays) {
      const auto [first, last] = paths_.sent_by(ray);
      for (uint32_t sent = first; sent < last; ++sent) send(sent);
      --live_[half_of(ray)];
    }
  }
  for (const uint32_t ray : wave.shadows) --live_[half_of(ray)];
  close_epochs();
}

void ReplayWaves::close_epochs() {
  for (const uint32_t half : {0u, 1u})
    if (schedule_.is_open(half) && live_[half] == 0 && (begun_ == epoch_end_ || epoch_half_ != half))
      schedule_.close(half);
}

}  // namespace spillway::pipeline
