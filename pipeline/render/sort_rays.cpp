#include "pipeline/render/sort_rays.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cache/base/check.h"
#include "cache/base/parallel.h"

namespace spillway::pipeline {
namespace {

using cache::KeyIndex;
using cache::TraceRay;

constexpr int kCellBits = 28;  // with the octant and the kind 32: four passes of the radix sort at most
// Octants come below the first 16 of them. Bounce rays in a city of 9 M triangles, time of tracing against unsorted,
// for 0, 8, 14, 20 bits above the octant: 0.78, 0.67, 0.59, 0.57 (waves of 65536), 0.53, 0.49, 0.44, 0.44 (2^20).
constexpr int kCoarseBits = 16;
constexpr int kMaxAxisBits = 15;
constexpr size_t kBlock = 4096;  // rays a task: about 20 us

// Where each bit of a quantised coordinate goes in the key.
struct CellCode {
  uint32_t mask[3] = {};
  float lower[3] = {}, scale[3] = {}, last[3] = {};

  // Cells are halved along their longest side, so that they end nearly cubic whatever the shape of the scene.
  explicit CellCode(const Bounds3& bounds) {
    float side[3];
    int bits[3] = {};
    for (int a = 0; a < 3; ++a) {
      const float extent = bounds.upper[a] - bounds.lower[a];
      side[a] = std::isfinite(extent) && extent > 0 ? extent : 0;
      lower[a] = side[a] > 0 ? bounds.lower[a] : 0;
      scale[a] = side[a] > 0 ? 1 / side[a] : 0;
    }
    for (int bit = kCellBits - 1; bit >= 0; --bit) {
      const int a = longest(side);
      if (!(side[a] > 0) || bits[a] == kMaxAxisBits) break;
      mask[a] |= 1u << bit;
      ++bits[a];
      side[a] /= 2;
    }
    for (int a = 0; a < 3; ++a) {
      scale[a] *= static_cast<float>(1 << bits[a]);
      last[a] = static_cast<float>((1 << bits[a]) - 1);
    }
  }

  static int longest(const float (&side)[3]) {
    const int a = side[1] > side[0] ? 1 : 0;
    return side[2] > side[a] ? 2 : a;
  }
  [[nodiscard]] uint32_t along(float x, int a) const {
    // In this order a NaN becomes 0.
    const float cell = std::max(0.0f, std::min((x - lower[a]) * scale[a], last[a]));
    return _pdep_u32(static_cast<uint32_t>(cell), mask[a]);
  }
  [[nodiscard]] uint32_t operator()(Float3 p) const { return along(p.x, 0) | along(p.y, 1) | along(p.z, 2); }
};

uint32_t octant(Float3 d) {
  return static_cast<uint32_t>(std::signbit(d.x)) << 2 | static_cast<uint32_t>(std::signbit(d.y)) << 1 |
         static_cast<uint32_t>(std::signbit(d.z));
}

// Kinds apart: each is walked by code of its own, whose branches the other would make the processor forget.
uint32_t sort_key(uint32_t kind, uint32_t cell, uint32_t direction) {
  constexpr int kFineBits = kCellBits - kCoarseBits;
  const uint32_t fine = cell & ((1u << kFineBits) - 1);
  return kind << (kCellBits + 3) | (cell >> kFineBits) << (kFineBits + 3) | direction << kFineBits | fine;
}

void write_keys(std::span<const TraceRay> rays, uint32_t kind, uint32_t first_index, const CellCode& cell,
                std::span<KeyIndex<uint32_t>> items) {
  parallel_blocks(rays.size(), kBlock, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i)
      items[i] = {sort_key(kind, cell(rays[i].origin_world), octant(rays[i].direction_world)),
                  first_index + static_cast<uint32_t>(i)};
  });
}

}  // namespace

void sort_rays(std::span<const TraceRay> path_rays, std::span<const TraceRay> shadow_rays,
               const Bounds3& scene_bounds_world, std::span<uint32_t> order, const SortRaysOptions& options,
               SortRaysScratch& scratch) {
  SPILLWAY_CHECK(order.size(), ==, path_rays.size() + shadow_rays.size());
  SPILLWAY_CHECK(order.size(), <, size_t{UINT32_MAX});
  if (!options.enabled) return std::iota(order.begin(), order.end(), 0u);
  scratch.grow(order.size());
  const std::span items(scratch.items.data(), order.size());
  const CellCode cell(scene_bounds_world);
  write_keys(path_rays, 0, 0, cell, items.first(path_rays.size()));
  write_keys(shadow_rays, 1, static_cast<uint32_t>(path_rays.size()), cell, items.subspan(path_rays.size()));
  cache::radix_sort(items, {scratch.other.data(), order.size()});
  parallel_blocks(order.size(), kBlock, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) order[i] = items[i].index;
  });
}

}  // namespace spillway::pipeline
