#include "pipeline/pack/pack_page_tree.h"

#include <cmath>

#include "cache/base/check.h"
#include "pipeline/pack/swept_bounds.h"

namespace spillway::pipeline {
namespace {

// A transformed vertex in 32-bit floats is off by at most 4 roundings of the sum of magnitudes, and a ray that is
// transformed instead of the vertex by about as much again; 2^-24 is one rounding.
constexpr double kPadding = 16 * 0x1p-24;

uint32_t rebased(uint32_t reference, uint32_t node_base, uint32_t entry_base) {
  if (reference == cache::kNoChild) return reference;
  return reference + ((reference & cache::kLeafBit) != 0 ? entry_base : node_base);
}

// Adds the tree over `boxes` to the shared arrays; returns its root. Its entries are already there, from entry_base on.
uint32_t add_tree(PackedPageTree& tree, std::span<const Bounds3> boxes, uint32_t entry_base,
                  const BuildOptions& options) {
  if (boxes.empty()) return cache::kNoChild;
  BoxTree built = build_box_tree(boxes, 0, options);
  const auto node_base = static_cast<uint32_t>(tree.nodes.size());
  for (cache::TraceNode& node : built.nodes) {
    for (uint32_t& child : node.child) child = rebased(child, node_base, entry_base);
    tree.nodes.push_back(node);
  }
  return rebased(built.root, node_base, entry_base);
}

struct ObjectBoxes {
  std::vector<Bounds3> boxes;
  std::vector<cache::PageTreeEntry> entries;
};

void add_object(PackedPageTree& tree, uint32_t object, const ObjectBoxes& content, const BuildOptions& options) {
  const auto entry_base = static_cast<uint32_t>(tree.entries.size());
  tree.entries.insert(tree.entries.end(), content.entries.begin(), content.entries.end());
  cache::PageObject& out = tree.objects[object];
  out.reserved = 0;
  for (const Bounds3& box : content.boxes) out.bounds_object.grow(box);
  out.root = add_tree(tree, content.boxes, entry_base, options);
}

}  // namespace

Bounds3 transformed_bounds(const Affine3& transform, const Bounds3& bounds) {
  Bounds3 out;
  for (int i = 0; i < 3; ++i) {
    const float* row = transform.m[i];
    double lower = row[3], upper = row[3], magnitude = std::fabs(static_cast<double>(row[3]));
    for (int a = 0; a < 3; ++a) {
      const double x = static_cast<double>(row[a]) * bounds.lower[a], y = static_cast<double>(row[a]) * bounds.upper[a];
      lower += std::min(x, y), upper += std::max(x, y);
      magnitude += std::max(std::fabs(x), std::fabs(y));
    }
    out.lower[i] = std::nextafter(static_cast<float>(lower - kPadding * magnitude), -INFINITY);
    out.upper[i] = std::nextafter(static_cast<float>(upper + kPadding * magnitude), INFINITY);
  }
  return out;
}

PackedPageTree pack_page_tree(std::span<const Bounds3> page_bounds, std::span<const cache::PageLocation> pages,
                              std::span<const cache::Instance> instances, uint32_t object_count,
                              const BuildOptions& options, const MovingInstances& moving) {
  SPILLWAY_CHECK(page_bounds.size(), ==, pages.size());
  std::vector<ObjectBoxes> objects(object_count);
  for (uint32_t p = 0; p < pages.size(); ++p) {
    objects[pages[p].object].boxes.push_back(page_bounds[p]);
    objects[pages[p].object].entries.push_back({0, p});
  }
  PackedPageTree tree;
  tree.objects.resize(object_count);
  for (uint32_t o = 1; o < object_count; ++o) add_object(tree, o, objects[o], options);
  for (uint32_t i = 1; i < instances.size(); ++i) {
    const Bounds3& prototype = tree.objects[instances[i].object].bounds_object;
    const uint32_t motion = instances[i].motion;
    objects[0].boxes.push_back(motion == 0 ? transformed_bounds(instances[i].world_from_object, prototype)
                                           : swept_bounds(moving.motions[motion - 1], moving.first_time,
                                                          moving.last_time, prototype));
    objects[0].entries.push_back({1, i});
  }
  add_object(tree, 0, objects[0], options);
  tree.bounds_world = tree.objects[0].bounds_object;
  return tree;
}

}  // namespace spillway::pipeline
