#pragma once

// Cuts the triangles of one object into spatial clusters, one a page.
//
// In:     the triangles, any order.
// Out:    the triangles permuted so that a page's are neighbours in the array, pages in the depth-first order of the
//         tree of cuts (pages that follow each other are neighbours in space); inside a page by ascending prim.
// Memory: the triangles, in place: 40 bytes each, owned by the caller (tag pack). A set that is larger than what may be
//         held is cut by StreamedCuts first, which holds none: some kilobytes a cut, and a pass over the set a level.
// Order:  a cut depends on the set of triangles alone: counts and bounds of bins are exact in any order of adding, and
//         ties go to the first axis and bin. So neither threads, nor the input's order, nor what may be held at a time
//         reach the output.
// Based on: binned surface-area cuts (Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies"). Here
//         the price of a side is its area times (triangles + triangles that its pages could hold), which favours cuts
//         that leave full pages.

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "cache/base/result.h"
#include "pipeline/pack/build_trees.h"

namespace spillway::pipeline {

struct ClusterPagesOptions {
  uint32_t max_triangles_per_page = 65536;
};

// Where each page begins in the permuted triangles; empty without any. `depth`: cuts that led to this set.
std::vector<uint32_t> cluster_pages(std::span<PackTriangle> triangles, const ClusterPagesOptions& options,
                                    int depth = 0);

// The first cuts of a set that is too large to hold, down to sets that are not: cluster_pages of one set after the
// other, each with its depth, gives the pages that cluster_pages of the whole would have given.
class StreamedCuts {
 public:
  // Calls visit() with blocks that together are the whole set, each triangle once; from several threads at once if it
  // likes.
  using Visit = std::function<void(std::span<const PackTriangle>)>;
  using Pass = std::function<Status(const Visit&)>;

  // Fails as `pass` does, and when more than max_set triangles lie in one place, where no cut parts them.
  static Result<StreamedCuts> make(const Pass& pass, uint64_t count, uint64_t max_set,
                                   const ClusterPagesOptions& options);
  StreamedCuts(StreamedCuts&&) noexcept;
  StreamedCuts& operator=(StreamedCuts&&) noexcept;
  ~StreamedCuts();

  [[nodiscard]] size_t size() const;  // sets, in depth-first order
  [[nodiscard]] uint64_t count(size_t set) const;
  [[nodiscard]] int depth(size_t set) const;
  [[nodiscard]] uint32_t set_of(const PackTriangle& triangle) const;

 private:
  struct State;
  explicit StreamedCuts(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace spillway::pipeline
