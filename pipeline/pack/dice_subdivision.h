#pragma once

// Dices the cages of a scene for its cameras.
//
// In:     cages, in the order in which they were said; instances.
// Out:    meshes behind those that are there, one a cage and detail, in the order of cages; the spool holds their
//         triangles. An object with cages whose instances need different details becomes several objects: instances move
//         to the one of their detail, and stay with the object's own triangles by a second instance.
// Memory: cages of 8 MiB (128 small ones) at a time with the points of their edges, and two pieces a thread.
// Order:  that of cages, then of details, then of faces; threads only make pieces earlier.
// Fails:  more triangles than DiceOptions::most_triangles; images of displacements that cannot be read; the cache.
// Based on: DeRose et al. 1998 for the surface; the rates are of Reyes (Cook et al. 1987), powers of two, an edge at a time.

#include <span>
#include <string>
#include <vector>

#include "cache/base/motion.h"
#include "cache/trace_page.h"
#include "pipeline/pack/cage_spool.h"
#include "pipeline/pack/dice_rates.h"
#include "pipeline/pack/displacement.h"
#include "pipeline/pack/mesh_spool.h"

namespace spillway::pipeline {

// What dicing reads of a scene that is being packed, and what it adds to it.
struct DicedScene {
  const CageSpool& cages;
  std::vector<cache::Instance>& instances;  // 0 is the world's
  std::span<const Motion> motions;          // of instances that move
  std::vector<std::string>& object_names;   // of object 1, 2, ...
  SpooledScene& scene;
  MeshSpool& spool;
  uint64_t& degenerate_count;
  const Displacement& displacement;
};

struct DiceReport {
  uint64_t cage_count = 0, triangle_count = 0;                // a cage once for each of its details
  uint64_t cached_cage_count = 0, cached_triangle_count = 0;  // of these, found in the cache
};

// Options have cameras.
Result<DiceReport> dice_subdivision(const DicedScene& diced, const DiceOptions& options, uint32_t max_faces_per_chunk);

}  // namespace spillway::pipeline
