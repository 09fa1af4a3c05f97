#include "pipeline/render/replay_paths.h"

#include <algorithm>
#include <iterator>
#include <tuple>

namespace spillway::pipeline {

Result<ReplayPaths> ReplayPaths::of(const AccessLog& log) {
  ReplayPaths paths;
  SPILLWAY_ASSIGN(paths.samples_, log.samples());
  const std::vector<SampleRow> rows = std::exchange(paths.samples_.rays, {});
  paths.order_paths(rows);
  double begun = 0;
  for (const WaveAccess& wave : log.waves) begun += static_cast<double>(wave.facts.generated_count);
  if (paths.path_count() > 0) paths.rays_a_sample_ = std::max(1.0, begun / paths.path_count());
  paths.add_singles(log, rows);
  return paths;
}

void ReplayPaths::order_paths(std::span<const SampleRow> rows) {
  std::vector<std::pair<uint64_t, uint32_t>> numbers;  // of a key, by the order of its camera rays
  const auto is_single = [&](const SampleRow& row) { return samples_.needs_of(row).is_single; };
  for (const SampleRow& row : rows)
    if (samples_.needs_of(row).kind == RayKind::camera && !is_single(row))
      numbers.emplace_back(row.path, static_cast<uint32_t>(numbers.size()));
  const auto path_count = static_cast<uint32_t>(numbers.size());
  std::ranges::sort(numbers);
  for (const SampleRow& row : rows) {
    if (is_single(row)) continue;
    const auto found = std::ranges::lower_bound(numbers, std::pair(row.path, 0u));
    if (found != numbers.end() && found->first == row.path) rays_.push_back({found->second, row.wave, row.needs});
  }
  std::ranges::stable_sort(rays_, {}, [&](const Ray& ray) {
    const RayKind of_ray = samples_.needs[ray.needs].kind;
    return std::tuple(ray.path, of_ray != RayKind::camera, ray.wave, of_ray);
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

std::span<const ReplayPaths::Single> ReplayPaths::beside(uint32_t ray) const {
  if (!has_singles_[ray]) return {};
  const auto of_ray = std::ranges::equal_range(singles_, ray, {}, &Single::beside);
  return {of_ray.begin(), of_ray.end()};
}

// Spread over the rays of their wave and kind.
void ReplayPaths::add_singles(const AccessLog& log, std::span<const SampleRow> rows) {
  has_singles_.assign(rays_.size(), false);
  std::vector<std::vector<uint32_t>> rays(log.waves.size() * kRayKinds);
  std::vector<std::vector<uint32_t>> needs_of_singles(rays.size());
  const auto cell = [](uint32_t wave, RayKind kind) { return wave * kRayKinds + static_cast<size_t>(kind); };
  for (uint32_t r = 0; r < rays_.size(); ++r) rays[cell(rays_[r].wave, kind(r))].push_back(r);
  for (const SampleRow& row : rows)
    if (samples_.needs_of(row).is_single)
      needs_of_singles[cell(row.wave, samples_.needs_of(row).kind)].push_back(row.needs);
  const auto spread = [&](const std::vector<uint32_t>& what, const std::vector<uint32_t>& over, bool is_box) {
    for (size_t i = 0; i < what.size() && !over.empty(); ++i)
      singles_.push_back({over[(2 * i + 1) * over.size() / (2 * what.size())], what[i], is_box});
  };
  for (size_t i = 0; i < rays.size(); ++i) spread(needs_of_singles[i], rays[i], false);
  for (uint32_t w = 0; w < log.waves.size(); ++w) {
    const std::vector<uint32_t>&camera = rays[cell(w, RayKind::camera)], &continued = rays[cell(w, RayKind::continued)],
                               &shadow = rays[cell(w, RayKind::shadow)];
    spread(boxes_of_none(log.waves[w].camera_boxes, {&camera}), camera, true);
    spread(boxes_of_none(log.waves[w].later_boxes, {&continued, &shadow}), continued.empty() ? shadow : continued, true);
  }
  std::ranges::stable_sort(singles_, {}, &Single::beside);
  for (const Single& one : singles_) has_singles_[one.beside] = true;
}

// Those of the pages that none of the rays tells of.
std::vector<uint32_t> ReplayPaths::boxes_of_none(const std::vector<uint32_t>& pages,
                                                 std::initializer_list<const std::vector<uint32_t>*> lists) const {
  std::vector<uint32_t> told;
  for (const auto* const rays : lists) {
    for (const uint32_t r : *rays) {
      const auto tops = samples_.pages(needs(r)), boxes = samples_.boxes(needs(r));
      told.insert(told.end(), tops.begin(), tops.end());
      told.insert(told.end(), boxes.begin(), boxes.end());
    }
  }
  std::ranges::sort(told);
  std::vector<uint32_t> left;
  std::ranges::set_difference(pages, told, std::back_inserter(left));
  return left;
}

}  // namespace spillway::pipeline
