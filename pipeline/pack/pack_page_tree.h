#pragma once

// Builds the resident tree over pages and instances.
//
// In:     the bounds of each page in its object's space, which object it is of, the instances ([0]: the world).
// Out:    the sections tree_nodes, tree_entries, tree_objects; the bounds of the world with all instances.
// Memory: tables of the size of their sections.
// Order:  serial.

#include <span>
#include <vector>

#include "cache/trace_page.h"
#include "pipeline/pack/build_trees.h"

namespace spillway::pipeline {

struct PackedPageTree {
  std::vector<cache::TraceNode> nodes;
  std::vector<cache::PageTreeEntry> entries;
  std::vector<cache::PageObject> objects;
  Bounds3 bounds_world;
};

// Where instances that move are, and when: bounds hold all of [first_time, last_time].
struct MovingInstances {
  std::span<const Motion> motions;
  float first_time = 0, last_time = 1;
};

// page_object: ascending. Instances of objects without pages must have been left out.
PackedPageTree pack_page_tree(std::span<const Bounds3> page_bounds, std::span<const cache::PageLocation> pages,
                              std::span<const cache::Instance> instances, uint32_t object_count,
                              const BuildOptions& options, const MovingInstances& moving = {});

// The bounds of what `transform` makes of everything in `bounds`, rounded outwards.
[[nodiscard]] Bounds3 transformed_bounds(const Affine3& transform, const Bounds3& bounds);

using spillway::invert;

}  // namespace spillway::pipeline
