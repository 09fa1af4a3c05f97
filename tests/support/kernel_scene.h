#pragma once

// Triangles in pages and a tree over them, all in memory, for tests and benchmarks of the kernel alone.

#include <vector>

#include "cache/trace_kernel.h"
#include "pipeline/pack/build_trees.h"
#include "pipeline/pack/pack_page_tree.h"
#include "tests/support/random.h"

namespace spillway::test {

using pipeline::BuildOptions;
using pipeline::PackTriangle;

class KernelScene {
 public:
  explicit KernelScene(BuildOptions options = {}) : options_(options), instances_(1) {
    instances_[0] = cache::Instance{Affine3{}, Affine3{}, 0, 0, {}};
  }

  // A page of object 0 (the world) or of a prototype. `micromaps` as build_trace_page() takes them.
  void add_page(std::span<const PackTriangle> triangles, uint32_t object = 0,
                std::span<const std::vector<std::byte>> micromaps = {});
  void add_instance(uint32_t object, const Affine3& world_from_object);
  void add_moving_instance(uint32_t object, const Motion& motion);
  // After the last page and instance.
  void finish();

  template <cache::TraceMode mode = cache::TraceMode::nearest>
  [[nodiscard]] cache::TraceHit trace(const cache::TraceRay& ray) const {
    cache::TraceHit hit = cache::no_hit(ray);
    cache::TraceCounters work;
    cache::DueVisits none;
    cache::trace_resident<mode>(tree_, {views_.data()}, ray, hit, work, none);
    return hit;
  }
  [[nodiscard]] const cache::PageTree& tree() const { return tree_; }
  [[nodiscard]] const cache::TracePageView& page(size_t i) const { return views_[i]; }

 private:
  BuildOptions options_;
  uint32_t object_count_ = 1;
  std::vector<Buffer<std::byte>> pages_;
  std::vector<cache::TracePageView> views_;
  std::vector<cache::PageLocation> locations_;
  std::vector<Bounds3> bounds_;
  std::vector<cache::Instance> instances_;
  std::vector<Motion> motions_;
  pipeline::PackedPageTree packed_;
  cache::PageTree tree_;
};

inline cache::TraceRay ray_from_to(Float3 from, Float3 to) { return {from, INFINITY, to - from, 0}; }

// Three walls of cells x cells quads, two triangles each, that meet in a corner: axis-aligned, so that their boxes have
// no thickness, `distance` away from where the rays start. Cut into pages by rows.
struct Walls {
  Walls(uint32_t cells, float distance, float size);
  KernelScene scene;
  uint32_t cells;
  float distance, size;

  // A ray towards a vertex or an inner point of an edge that triangles share.
  [[nodiscard]] cache::TraceRay ray_to_an_edge(Random& random) const;

 private:
  [[nodiscard]] Float3 on_wall(int axis, float u, float v) const;
};

}  // namespace spillway::test
