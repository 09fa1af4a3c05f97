#include "tests/support/kernel_scene.h"

#include <algorithm>

#include "cache/base/check.h"

namespace spillway::test {

void KernelScene::add_page(std::span<const PackTriangle> triangles, uint32_t object,
                           std::span<const std::vector<std::byte>> micromaps) {
  pages_.push_back(pipeline::build_trace_page(triangles, micromaps, options_));
  const Status valid = cache::validate_trace_page(pages_.back(), "page");
  SPILLWAY_CHECK(valid ? std::string() : valid.error().message, ==, std::string());
  views_.push_back(cache::trace_page_view(pages_.back()));
  const cache::TracePageHeader& header = *views_.back().header;
  locations_.push_back({0, pages_.back().size(), header.triangle_count, object});
  bounds_.push_back({header.lower, header.upper});
  object_count_ = std::max(object_count_, object + 1);
}

void KernelScene::add_instance(uint32_t object, const Affine3& world_from_object) {
  cache::Instance instance{world_from_object, {}, object, 0, {}};
  SPILLWAY_CHECK(pipeline::invert(world_from_object, instance.object_from_world), ==, true);
  instances_.push_back(instance);
  object_count_ = std::max(object_count_, object + 1);
}

void KernelScene::add_moving_instance(uint32_t object, const Motion& motion) {
  add_instance(object, motion.key[0]);
  motions_.push_back(motion);
  instances_.back().motion = static_cast<uint32_t>(motions_.size());
}

void KernelScene::finish() {
  packed_ = pipeline::pack_page_tree(bounds_, locations_, instances_, object_count_, options_, {motions_, 0, 1});
  tree_ = {packed_.nodes, packed_.entries, packed_.objects, instances_,
           std::max(max_abs(packed_.bounds_world.lower), max_abs(packed_.bounds_world.upper)), motions_};
}

Walls::Walls(uint32_t cell_count, float wall_distance, float wall_size)
    : cells(cell_count), distance(wall_distance), size(wall_size) {
  uint32_t prim = 0;
  const auto at = [&](int axis, uint32_t i, uint32_t j) {
    return on_wall(axis, static_cast<float>(i) / static_cast<float>(cells), static_cast<float>(j) / static_cast<float>(cells));
  };
  for (int axis = 0; axis < 3; ++axis)
    for (uint32_t i = 0; i < cells; ++i) {
      std::vector<PackTriangle> row;
      for (uint32_t j = 0; j < cells; ++j) {
        const Float3 a = at(axis, i, j), b = at(axis, i + 1, j), c = at(axis, i + 1, j + 1), d = at(axis, i, j + 1);
        row.push_back({{a, b, c}, prim++});
        row.push_back({{a, c, d}, prim++});
      }
      scene.add_page(row);
    }
  scene.finish();
}

Float3 Walls::on_wall(int axis, float u, float v) const {
  const float along[2] = {distance - u * size, distance - v * size};
  Float3 p{distance, distance, distance};
  p[(axis + 1) % 3] = along[0], p[(axis + 2) % 3] = along[1];
  return p;
}

cache::TraceRay Walls::ray_to_an_edge(Random& random) const {
  const int axis = static_cast<int>(random.below(3));
  const auto grid = [&] { return static_cast<float>(1 + random.below(cells - 1)) / static_cast<float>(cells); };
  float u = grid(), v = grid();
  switch (random.below(4)) {
    case 0: u = random.in(0.01f, 0.99f); break;
    case 1: v = random.in(0.01f, 0.99f); break;
    case 2: {  // on a diagonal
      const float s = random.in(0, 1) / static_cast<float>(cells);
      u = std::min(u + s, 0.999f), v = std::min(v + s, 0.999f);
      break;
    }
    default: break;  // a vertex
  }
  return ray_from_to(random.point(10), on_wall(axis, u, v));
}

}  // namespace spillway::test
