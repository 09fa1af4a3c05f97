#pragma once

// Stage sort_rays: the order in which trace_rays takes the rays of a wave, neighbours in it walking the same nodes.
//
// In: hot columns of path and shadow rays, any order.
// Out: a permutation of all of them (paths first, then shadow rays, one index space), each kind by the cell of the origin
//      along a Morton curve of nearly cubic cells; inside a coarse cell by octant of direction, then by fine cell.
// Memory: tag rays: 16 bytes a ray in SortRaysScratch, kept by the caller between waves.
// Order: total: equal keys keep the order of their indices. It changes no bit of any image, only the time.
// Based on: the ray sorting of Moon et al. 2010 and Eisenacher et al. 2013 (Hyperion: direction, then origin); here
//           coarse position comes before direction (measured: see the .cpp), and the bits of the code go to the axis
//           whose cells are longest, because cities are flat.

#include <cstdint>
#include <span>

#include "cache/base/memory.h"
#include "cache/base/vec.h"
#include "cache/radix_sort.h"
#include "cache/ray.h"

namespace spillway::pipeline {

struct SortRaysOptions {
  bool enabled = true;  // performance; off: the order is the identity
};

// Grows to the largest wave. What a planner must set aside for it: sort_rays_scratch_bytes().
struct SortRaysScratch {
  Buffer<cache::KeyIndex<uint32_t>> items, other;

  void grow(size_t count) { items.grow(MemoryTag::rays, count), other.grow(MemoryTag::rays, count); }
};
[[nodiscard]] constexpr uint64_t sort_rays_scratch_bytes(uint64_t ray_count) {
  return 2 * sizeof(cache::KeyIndex<uint32_t>) * ray_count;
}

// `order` is as long as both kinds of rays together. `scene_bounds_world` bounds the cells; origins outside lie in the
// cells at the border. At most 2^32 - 1 rays.
void sort_rays(std::span<const cache::TraceRay> path_rays, std::span<const cache::TraceRay> shadow_rays,
               const Bounds3& scene_bounds_world, std::span<uint32_t> order, const SortRaysOptions& options,
               SortRaysScratch& scratch);

}  // namespace spillway::pipeline
