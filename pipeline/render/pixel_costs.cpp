#include "pipeline/render/pixel_costs.h"

#include <atomic>
#include <iterator>

#include "cache/base/check.h"

namespace spillway::pipeline {
namespace {

void add_relaxed(uint64_t& sum, uint64_t value) {
  std::atomic_ref<uint64_t>(sum).fetch_add(value, std::memory_order_relaxed);
}

}  // namespace

const char* name(Cost cost) {
  static constexpr const char* kNames[] = {"tree_steps", "pages_waited", "texture_lookups", "scatterings", "rays"};
  static_assert(std::size(kNames) == kCostCount);
  return kNames[static_cast<size_t>(cost)];
}

PixelCosts::PixelCosts(const FilmShape& shape, size_t mesh_count)
    : shape_(shape),
      counts_(MemoryTag::film, shape.pixel_count() * kCostCount),
      by_mesh_(MemoryTag::film, mesh_count) {}

uint64_t PixelCosts::bytes(const FilmShape& shape, size_t mesh_count) {
  return (shape.pixel_count() * kCostCount + mesh_count) * sizeof(uint64_t);
}

size_t PixelCosts::index(uint32_t x, uint32_t y) const {
  const FilmWindow& w = shape_.window;
  SPILLWAY_CHECK(x >= w.x0 && x < w.x1 && y >= w.y0 && y < w.y1, ==, true);
  return kCostCount * (size_t{y - w.y0} * w.width() + (x - w.x0));
}

void PixelCosts::add(uint32_t sink, Cost cost, uint64_t count) {
  if (count == 0) return;
  add_relaxed(counts_[index(sink % shape_.full_width, sink / shape_.full_width) + static_cast<size_t>(cost)], count);
}

void PixelCosts::add_ray(uint32_t sink, const RayCost& ray) {
  add(sink, Cost::rays, 1);
  add(sink, Cost::tree_steps, ray.tree_steps);
  add(sink, Cost::pages_waited, ray.pages_waited);
}

void PixelCosts::add_mesh(uint32_t mesh, uint64_t scatterings) { add_relaxed(by_mesh_[mesh], scatterings); }

uint64_t PixelCosts::at(uint32_t x, uint32_t y, Cost cost) const {
  return counts_[index(x, y) + static_cast<size_t>(cost)];
}

uint64_t PixelCosts::total(Cost cost) const {
  uint64_t sum = 0;
  for (size_t i = static_cast<size_t>(cost); i < counts_.size(); i += kCostCount) sum += counts_[i];
  return sum;
}

}  // namespace spillway::pipeline
