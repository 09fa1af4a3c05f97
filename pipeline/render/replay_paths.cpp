#include "pipeline/render/replay_paths.h"

#include <algorithm>
#include <tuple>

namespace spillway::pipeline {

Result<ReplayPaths> ReplayPaths::of(const AccessLog& log) {
  ReplayPaths paths;
  SPILLWAY_ASSIGN(paths.samples_, log.samples());
  paths.order_paths();
  double begun = 0;
  for (const WaveAccess& wave : log.waves) begun += static_cast<double>(wave.facts.generated_count);
  if (paths.path_count() > 0) paths.rays_a_sample_ = std::max(1.0, begun / paths.path_count());
  paths.add_seldom(log);
  return paths;
}

void ReplayPaths::order_paths() {
  std::vector<std::pair<uint64_t, uint32_t>> numbers;  // of a key, by the order of its camera rays
  for (const SampleRow& row : samples_.rays)
    if (samples_.needs_of(row).kind == RayKind::camera)
      numbers.emplace_back(row.path, static_cast<uint32_t>(numbers.size()));
  const auto path_count = static_cast<uint32_t>(numbers.size());
  std::ranges::sort(numbers);
  for (const SampleRow& row : samples_.rays) {
    const auto found = std::ranges::lower_bound(numbers, std::pair(row.path, 0u));
    if (found != numbers.end() && found->first == row.path) rays_.push_back({found->second, row.wave, row.needs});
  }
  samples_.rays = {};
  std::ranges::stable_sort(rays_, {}, [&](const Ray& ray) {
    return std::tuple(ray.path, samples_.needs[ray.needs].kind != RayKind::camera, ray.wave, samples_.needs[ray.needs].kind);
  });
  first_.assign(path_count + 1, 0);
  for (const Ray& ray : rays_) ++first_[ray.path + 1];
  for (uint32_t path = 0; path < path_count; ++path) first_[path + 1] += first_[path];
}

std::pair<uint32_t, uint32_t> ReplayPaths::sent_by(uint32_t ray) const {
  const uint32_t end = first_[rays_[ray].path + 1], wave = rays_[ray].wave;
  uint32_t first = ray + 1;
  while (first < end && rays_[first].wave <= wave) ++first;
  const bool goes_on = first < end && rays_[first].wave == wave + 1 && kind(first) == RayKind::continued;
  uint32_t last = first;
  while (last < end && (!goes_on || rays_[last].wave == wave + 1)) ++last;
  return {first, last};
}

std::span<const ReplayPaths::Seldom> ReplayPaths::seldom(uint32_t ray) const {
  if (!has_seldom_[ray]) return {};
  const auto of_ray = std::ranges::equal_range(seldom_, ray, {}, &Seldom::ray);
  return {of_ray.begin(), of_ray.end()};
}

// Spread over the rays of their wave and kind.
void ReplayPaths::add_seldom(const AccessLog& log) {
  has_seldom_.assign(rays_.size(), false);
  if (log.facts.sampled_of == 1) return;
  std::vector<std::vector<uint32_t>> of_wave(log.waves.size() * kRayKinds);
  for (uint32_t r = 0; r < rays_.size(); ++r)
    of_wave[rays_[r].wave * kRayKinds + static_cast<size_t>(kind(r))].push_back(r);
  std::vector<uint8_t> sampled(log.page_bytes.size());
  const auto add = [&](const std::vector<uint32_t>& pages, uint8_t flag, const std::vector<uint32_t>& rays) {
    uint64_t count = 0;
    for (const uint32_t page : pages) count += (sampled[page] & flag) == 0 ? 1 : 0;
    uint64_t i = 0;
    for (const uint32_t page : pages)
      if ((sampled[page] & flag) == 0 && !rays.empty())
        seldom_.push_back({rays[(2 * i++ + 1) * rays.size() / (2 * count)], page, flag == 2});
  };
  for (size_t w = 0; w < log.waves.size(); ++w) {
    const WaveAccess& wave = log.waves[w];
    const auto lists = {&wave.camera_pages, &wave.continued_pages, &wave.shadow_pages};
    size_t kind_index = 0;
    bool later_boxes = false;
    for (const auto* const list : lists) {
      const std::vector<uint32_t>& rays = of_wave[w * kRayKinds + kind_index];
      if (kind_index != static_cast<size_t>(RayKind::shadow)) std::ranges::fill(sampled, uint8_t{0});
      if (kind_index == static_cast<size_t>(RayKind::shadow)) for (uint8_t& flags : sampled) flags &= 2;
      for (const uint32_t r : rays) {
        const NeedsRow& n = needs(r);
        for (const uint32_t page : samples_.pages(n)) sampled[page] |= 3;
        for (const uint32_t page : samples_.boxes(n)) sampled[page] |= 2;
      }
      add(*list, 1, rays);
      if (kind_index == 0) add(wave.camera_boxes, 2, rays);
      later_boxes = kind_index == 2;
      if (later_boxes) add(wave.later_boxes, 2, rays.empty() ? of_wave[w * kRayKinds + 1] : rays);
      ++kind_index;
    }
  }
  std::ranges::stable_sort(seldom_, {}, &Seldom::ray);
  for (const Seldom& one : seldom_) has_seldom_[one.ray] = true;
}

}  // namespace spillway::pipeline
