#pragma once

// The one owner of Embree: builds the trees that the kernel traces, at pack time. Deterministic: the same input gives
// the same bytes (one tree a thread, never a parallel build inside a tree).

#include <cstdint>
#include <span>
#include <vector>

#include "cache/base/memory.h"
#include "cache/trace_page.h"

namespace spillway::pipeline {

struct PackTriangle {
  Float3 vertex[3];
  uint32_t prim;
};
static_assert(sizeof(PackTriangle) == 40);

struct BuildOptions {            // all performance: no setting may change a bit of any image
  uint32_t branching = 8;        // 2..8; fewer: other trees, for the layout tests
  uint32_t leaf_fill = 4;        // 1..4 triangles a leaf; less: larger pages
};

// A whole trace page, header and checksum included. `micromaps[i]` is empty for an opaque triangle, else the bytes of an
// OpacityMicromap; the span itself is empty when no triangle has alpha. At most kMaxTrianglesPerPage triangles.
Buffer<std::byte> build_trace_page(std::span<const PackTriangle> triangles,
                                   std::span<const std::vector<std::byte>> micromaps, const BuildOptions& options);

// A tree over boxes; leaf reference i stands for boxes[i]. References are relative to node_base.
struct BoxTree {
  uint32_t root = cache::kNoChild;
  std::vector<cache::TraceNode> nodes;
};
BoxTree build_box_tree(std::span<const Bounds3> boxes, uint32_t node_base, const BuildOptions& options);

}  // namespace spillway::pipeline
