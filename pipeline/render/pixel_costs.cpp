#include "pipeline/render/pixel_costs.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <iterator>
#include <utility>

#include "cache/base/check.h"

namespace spillway::pipeline {
namespace {

void add_relaxed(uint64_t& sum, uint64_t value) {
  std::atomic_ref<uint64_t>(sum).fetch_add(value, std::memory_order_relaxed);
}

}  // namespace

const char* name(Cost cost) {
  static constexpr const char* kNames[] = {"tree_steps", "pages_waited", "texture_lookups", "scatterings",
                                           "rays",       "tiles_missed"};
  static_assert(std::size(kNames) == kCostCount);
  return kNames[static_cast<size_t>(cost)];
}

PixelCosts::PixelCosts(const FilmShape& shape, size_t mesh_count, size_t tile_count)
    : shape_(shape),
      counts_(MemoryTag::film, shape.pixel_count() * kCostCount),
      by_mesh_(MemoryTag::film, mesh_count),
      first_users_(MemoryTag::film, tile_count) {
  std::ranges::fill(first_users_, kNobody);
}

uint64_t PixelCosts::bytes(const FilmShape& shape, size_t mesh_count, size_t tile_count) {
  return (shape.pixel_count() * kCostCount + mesh_count + tile_count) * sizeof(uint64_t);
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

void PixelCosts::add_tiles_missed(std::span<const uint64_t> touched_bits) {
  for (size_t word = 0; word < touched_bits.size(); ++word)
    for (uint64_t rest = touched_bits[word]; rest != 0; rest &= rest - 1) {
      const size_t tile = word * 64 + static_cast<size_t>(std::countr_zero(rest));
      const uint64_t user = std::exchange(first_users_[tile], kNobody);
      SPILLWAY_CHECK(user, !=, kNobody);
      add(static_cast<uint32_t>(user), Cost::tiles_missed, 1);
    }
}

uint64_t PixelCosts::at(uint32_t x, uint32_t y, Cost cost) const {
  return counts_[index(x, y) + static_cast<size_t>(cost)];
}

uint64_t PixelCosts::total(Cost cost) const {
  uint64_t sum = 0;
  for (size_t i = static_cast<size_t>(cost); i < counts_.size(); i += kCostCount) sum += counts_[i];
  return sum;
}

}  // namespace spillway::pipeline
