#pragma once

// Cuts the triangles of one object into spatial clusters, one a page.
//
// In:     one ClusterItem a triangle, any order.
// Out:    the items permuted so that a page's triangles are neighbours in the array, pages in the depth-first order of
//         the tree of cuts (pages that follow each other are neighbours in space); inside a page by ascending triangle.
// Memory: the items, in place: 28 bytes a triangle, owned by the caller (tag pack). Nothing spills.
// Order:  a cut depends on the set of items alone: counts and bounds of bins are exact in any order of adding, and
//         ties go to the first axis and bin. So neither threads nor the input's order reach the output.
// Based on: binned surface-area cuts (Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies"). Here
//         the price of a side is its area times (triangles + triangles that its pages could hold), which favours cuts
//         that leave full pages.

#include <cstdint>
#include <span>
#include <vector>

#include "cache/base/vec.h"

namespace spillway::pipeline {

struct ClusterItem {
  Bounds3 bounds;
  uint32_t triangle;
};
static_assert(sizeof(ClusterItem) == 28);

struct ClusterPagesOptions {
  uint32_t max_triangles_per_page = 65536;
};

// Where each page begins in the permuted items; empty without items.
std::vector<uint32_t> cluster_pages(std::span<ClusterItem> items, const ClusterPagesOptions& options);

}  // namespace spillway::pipeline
