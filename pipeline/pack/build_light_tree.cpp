#include "pipeline/pack/build_light_tree.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace spillway::pipeline {
namespace {

using shading::kLightNodeWidth;
using shading::kNoLightNode;
using shading::LightChild;
using shading::LightNode;

constexpr int kBins = 16;
constexpr uint32_t kNoChild = 0xffffffffu;  // of an item that is none
// Below this many nodes, cuts go by cost; deeper ones halve, so that no scene makes a tree of more than some thirty.
constexpr uint32_t kDeepestCostCut = 16;
constexpr uint32_t kMortonBits = 21;

double cost_of(double energy, Float3 extent, double cos_spread) {
  const double diagonal_squared = static_cast<double>(extent.x) * extent.x + static_cast<double>(extent.y) * extent.y +
                                  static_cast<double>(extent.z) * extent.z;
  return energy * diagonal_squared * (2 - cos_spread);
}

// ---- along the curve ----

uint64_t spread_bits(uint64_t v) {  // two zeros between each two bits of 21
  v = (v | v << 32) & 0x001f00000000ffffull;
  v = (v | v << 16) & 0x001f0000ff0000ffull;
  v = (v | v << 8) & 0x100f00f00f00f00full;
  v = (v | v << 4) & 0x10c30c30c30c30c3ull;
  return (v | v << 2) & 0x1249249249249249ull;
}

uint64_t morton_code(const LightItem& item, const Bounds3& box) {
  const Float3 center = item.box.center();
  uint64_t code = 0;
  for (int a = 0; a < 3; ++a) {
    const float extent = box.upper[a] - box.lower[a];
    const float place = extent > 0 ? (center[a] - box.lower[a]) / extent : 0;
    const float cells = static_cast<float>(1u << kMortonBits);
    const auto cell = static_cast<uint64_t>(std::clamp(place * cells, 0.0f, cells - 1));
    code |= spread_bits(cell) << a;
  }
  return code;
}

// Where a chunk of at least half of the items ends: at the largest step of the curve.
size_t chunk_end(std::span<const LightItem> items, const Bounds3& box) {
  size_t best = items.size();
  uint64_t largest = 0;
  for (size_t i = items.size() / 2 + 1; i < items.size(); ++i) {
    const uint64_t step = morton_code(items[i - 1], box) ^ morton_code(items[i], box);
    if (step > largest) largest = step, best = i;
  }
  return best;
}

// ---- one tree ----

struct Cluster {
  std::span<LightItem> items;
  LightItem bounds;
  double cost = 0;
};

Cluster cluster_of(std::span<LightItem> items) {
  Cluster c{items, items.size() == 1 ? items[0] : bounds_of(items), 0};
  c.cost = cost_of(c.bounds.energy, c.bounds.box.extent(), c.bounds.cos_cone);
  return c;
}

struct Bin {
  Bounds3 box;
  Float3 normals{0, 0, 0};  // weighed by energy
  double energy = 0;
  size_t count = 0;

  void add(const LightItem& item) {
    box.grow(item.box);
    normals += item.axis * item.energy;
    energy += item.energy;
    ++count;
  }
  void add(const Bin& other) {
    box.grow(other.box);
    normals += other.normals;
    energy += other.energy;
    count += other.count;
  }
  // Normals spread evenly over a cone of angle a have a mean of length (1 + cos a) / 2.
  [[nodiscard]] double cost() const {
    if (count == 0) return 0;
    const double mean = energy > 0 ? std::min(1.0, length(normals) / energy) : 1;
    return cost_of(energy, box.extent(), 2 * mean - 1);
  }
};

struct Cut {
  int axis = 0;
  size_t left_count = 0;
  double cost = INFINITY;
};

void try_axis(std::span<const LightItem> items, const Bounds3& centers, int axis, Cut& best) {
  const float extent = centers.upper[axis] - centers.lower[axis];
  if (!(extent > 0)) return;
  std::array<Bin, kBins> bins;
  for (const LightItem& item : items) {
    const float place = (item.box.center()[axis] - centers.lower[axis]) / extent;
    bins[std::min(static_cast<size_t>(place * kBins), size_t{kBins - 1})].add(item);
  }
  std::array<double, kBins> right_cost{};
  Bin right;
  for (int i = kBins - 1; i > 0; --i) right.add(bins[i]), right_cost[i] = right.cost();
  Bin left;
  for (int i = 1; i < kBins; ++i) {
    left.add(bins[i - 1]);
    const double cost = left.cost() + right_cost[i];
    if (left.count > 0 && left.count < items.size() && cost < best.cost) best = {axis, left.count, cost};
  }
}

// Left counts are multiples of a node's width: nodes at the bottom are full.
size_t rounded_left(size_t wanted, size_t count) {
  const size_t most = (count - 1) / kLightNodeWidth * kLightNodeWidth;
  return std::clamp((wanted + kLightNodeWidth / 2) / kLightNodeWidth * kLightNodeWidth, size_t{kLightNodeWidth}, most);
}

// Orders the items so that the first ones, whose number is returned, are one side.
size_t cut(std::span<LightItem> items, bool by_cost) {
  Bounds3 centers;
  for (const LightItem& item : items) centers.grow(item.box.center());
  Cut best;
  for (int axis = 0; axis < 3; ++axis) {
    if (by_cost) try_axis(items, centers, axis, best);
  }
  if (best.left_count == 0) {
    const Float3 e = centers.extent();
    best = {e.x >= e.y && e.x >= e.z ? 0 : e.y >= e.z ? 1 : 2, items.size() / 2, 0};
  }
  const size_t left = rounded_left(best.left_count, items.size());
  const int axis = best.axis;
  std::nth_element(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(left), items.end(),
                   [axis](const LightItem& a, const LightItem& b) {
                     const float ca = a.box.center()[axis], cb = b.box.center()[axis];
                     return ca != cb ? ca < cb : a.child < b.child;
                   });
  return left;
}

// At most eight clusters: the costliest is cut as long as there is room for one more.
std::vector<Cluster> children_of(std::span<LightItem> items, bool by_cost) {
  std::vector<Cluster> clusters;
  if (items.size() > kLightNodeWidth) {
    clusters.push_back(cluster_of(items));
    while (clusters.size() < kLightNodeWidth) {
      const auto rank = [](const Cluster& c) { return std::pair(c.cost, c.items.size()); };
      Cluster* worst = nullptr;
      for (Cluster& c : clusters)
        if (c.items.size() > kLightNodeWidth && (worst == nullptr || rank(c) > rank(*worst))) worst = &c;
      if (worst == nullptr) break;
      const std::span<LightItem> all = worst->items;
      const size_t left = cut(all, by_cost);
      *worst = cluster_of(all.first(left));
      clusters.push_back(cluster_of(all.subspan(left)));
    }
  }
  const auto spread_out = [&](std::span<LightItem> few) {
    for (size_t i = 0; i < few.size(); ++i) clusters.push_back(cluster_of(few.subspan(i, 1)));
  };
  if (clusters.empty()) spread_out(items);
  // Small clusters need no node of their own while there is room.
  for (size_t i = 0; i < clusters.size();) {
    const std::span<LightItem> few = clusters[i].items;
    if (few.size() == 1 || clusters.size() - 1 + few.size() > kLightNodeWidth) {
      ++i;
      continue;
    }
    clusters.erase(clusters.begin() + static_cast<std::ptrdiff_t>(i));
    spread_out(few);
  }
  return clusters;
}

// ---- one node ----

void quantise_boxes(std::span<const Cluster> children, LightNode& node) {
  Bounds3 box;
  for (const Cluster& c : children) box.grow(c.bounds.box);
  for (int a = 0; a < 3; ++a) {
    const float origin = box.lower[a];
    float scale = (box.upper[a] - origin) / 255;
    while (origin + scale * 255 < box.upper[a]) scale = std::nextafter(scale, INFINITY);
    node.origin[a] = origin, node.scale[a] = scale;
    for (size_t i = 0; i < children.size(); ++i) {
      const Bounds3& b = children[i].bounds.box;
      const auto at = [&](int q) { return origin + scale * static_cast<float>(q); };
      const auto steps = [&](float x) { return scale > 0 ? std::clamp((x - origin) / scale, 0.0f, 255.0f) : 0.0f; };
      int lower = static_cast<int>(steps(b.lower[a])), upper = static_cast<int>(std::ceil(steps(b.upper[a])));
      while (lower > 0 && at(lower) > b.lower[a]) --lower;
      while (upper < 255 && at(upper) < b.upper[a]) ++upper;
      node.lower[a][i] = static_cast<uint8_t>(lower), node.upper[a][i] = static_cast<uint8_t>(upper);
    }
  }
}

// The cone grows by what its axis is turned.
void quantise_cone(const LightItem& item, size_t slot, LightNode& node) {
  double squared = 0, along = 0, size_squared = 0;
  for (int a = 0; a < 3; ++a) {
    const auto q = static_cast<int8_t>(std::lround(item.axis[a] * 127));
    node.axis[a][slot] = q;
    squared += static_cast<double>(q) * q;
    along += static_cast<double>(q) * item.axis[a];
    size_squared += static_cast<double>(item.axis[a]) * item.axis[a];
  }
  const double turned = std::clamp(along / std::sqrt(squared * size_squared), -1.0, 1.0);
  constexpr double kRoundings = 1e-6;  // of what decodes it, in 32 bits
  const double c = cosine_of_sum(turned, item.cos_cone) - kRoundings;
  node.cone[slot] = static_cast<uint16_t>(std::clamp(std::floor((c + 1) * 32767), 0.0, 65534.0));
}

// Recursive: a node, then what is below its children. `energy` is the whole tree's.
class NodeMaker {
 public:
  NodeMaker(LightTrees& trees, double energy) : trees_(trees), energy_(energy) {}

  uint32_t make(std::span<LightItem> items, uint32_t parent, uint32_t depth) {
    const auto index = static_cast<uint32_t>(trees_.nodes.size());
    trees_.nodes.push_back(LightNode{});
    std::vector<Cluster> children = children_of(items, depth < kDeepestCostCut);
    fill(index, parent, children);
    for (uint32_t slot = 0; slot < children.size(); ++slot) {
      const uint32_t place = shading::light_place(index, slot);
      uint32_t child = children[slot].bounds.child;
      if (children[slot].items.size() > 1)
        child = shading::light_child(LightChild::node, make(children[slot].items, place, depth + 1));
      else
        put(child, place);
      trees_.nodes[index].child[slot] = child;
    }
    return index;
  }

 private:
  void fill(uint32_t index, uint32_t parent, std::span<const Cluster> children) {
    LightNode& node = trees_.nodes[index];
    node.parent = parent;
    node.child_count = static_cast<uint8_t>(children.size());
    std::fill(std::begin(node.child), std::end(node.child), kNoChild);
    for (auto& axis : node.axis) std::fill(std::begin(axis), std::end(axis), int8_t{1});
    quantise_boxes(children, node);
    for (size_t i = 0; i < children.size(); ++i) {
      const LightItem& item = children[i].bounds;
      quantise_cone(item, i, node);
      node.energy[i] = std::max(static_cast<float>(item.energy / energy_), 1e-30f);
      node.two_sided = static_cast<uint8_t>(node.two_sided | (item.two_sided != 0 ? 1u << i : 0u));
    }
  }

  void put(uint32_t child, uint32_t place) {
    const uint32_t index = shading::light_child_index(child);
    switch (shading::light_child_kind(child)) {
      case LightChild::node:
        trees_.nodes[index].parent = place;
        break;
      case LightChild::emitter:
        trees_.emitter_leaves[index] = place;
        break;
      case LightChild::instance:
        trees_.instance_leaves[index] = place;
        break;
      case LightChild::light:
        break;
    }
  }

  LightTrees& trees_;
  double energy_;
};

}  // namespace

LightTreeBuilder::LightTreeBuilder(uint32_t object_count, size_t emitter_count, size_t instance_count,
                                   BuildLightTreeOptions options)
    : options_(options),
      sort_({.what = "lights",
             .tag = MemoryTag::pack,
             .purpose = cache::IoPurpose::pack,
             .memory_limit_bytes = options.memory_limit_bytes,
             .scratch = options.scratch}) {
  trees_.roots.resize(object_count, kNoLightNode);
  trees_.emitter_leaves.resize(emitter_count, kNoLightNode);
  trees_.instance_leaves.resize(instance_count + 1, kNoLightNode);
}

void LightTreeBuilder::begin(uint32_t object, const Bounds3& box) {
  sort_.clear();
  object_ = object, box_ = box;
  added_ = 0, energy_ = 0, moments_ = {};
}

Status LightTreeBuilder::add(const LightItem& item) {
  if (!(item.energy > 0)) return {};
  const cache::SortKey key{morton_code(item, box_), added_++};
  energy_ += item.energy;
  moments_.add(item);
  return sort_.append({&key, 1}, {&item, 1});
}

LightItem LightTreeBuilder::build(std::vector<LightItem>& items) {
  LightItem all = bounds_of(items);
  all.child = shading::light_child(LightChild::node, NodeMaker(trees_, energy_).make(items, kNoLightNode, 0));
  return all;
}

Result<LightTreeBuilder::Object> LightTreeBuilder::end() {
  SPILLWAY_TRY(sort_.finish());
  Object object{{}, moments_};
  if (added_ == 0) return object;
  std::vector<LightItem> pending, chunks;
  uint32_t taken = 0;
  for (size_t p = 0; p < sort_.partition_count(); ++p) {
    SPILLWAY_ASSIGN(const cache::SortedRecords<LightItem> sorted, sort_.partition(p));
    for (size_t i = 0; i < sorted.size(); ++i) {
      pending.push_back(sorted[i]), ++taken;
      if (pending.size() < options_.chunk_lights || taken == added_) continue;
      const auto end = pending.begin() + static_cast<std::ptrdiff_t>(chunk_end(pending, box_));
      std::vector<LightItem> rest(end, pending.end());
      pending.erase(end, pending.end());
      chunks.push_back(build(pending));
      pending = std::move(rest);
    }
  }
  chunks.push_back(build(pending));
  object.bounds = chunks.size() == 1 ? chunks[0] : build(chunks);
  trees_.roots[object_] = shading::light_child_index(object.bounds.child);
  if (trees_.nodes.size() > shading::kMaxLightNodes)
    return error("{} nodes of light trees; {} are possible: make instances of what emits", trees_.nodes.size(),
                 shading::kMaxLightNodes);
  return object;
}

}  // namespace spillway::pipeline
