#include "pipeline/pack/build_trees.h"

#if SPILLWAY_EMBREE_MAJOR == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <tbb/task_arena.h>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <numeric>

#include "cache/base/alignment.h"
#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "pipeline/pack/binary_tree.h"
#include "pipeline/pack/collapse_tree.h"

namespace spillway::pipeline {
namespace {

using cache::kLeafBit;
using cache::kNoChild;
using cache::TraceLeaf;
using cache::TraceNode;

// Of Embree's tree; where its cuts would lead further it fails.
constexpr unsigned kBuilderDepth = 60;

// What Embree's callbacks build; lives in Embree's own arena until cut_few() has its leaves.
struct BuildItem {
  unsigned count;  // of a leaf; 0: a node
};
struct BuildLeaf : BuildItem {
  unsigned prim[kFewItems];  // as many as there are
};
struct BuildNode : BuildItem {
  Bounds3 bounds[2];
  BuildItem* child[2];
};

Bounds3 to_bounds(const RTCBounds& b) { return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}}; }

void* make_node(RTCThreadLocalAllocator allocator, unsigned, void*) {
  return new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), 16)) BuildNode{};
}

void set_children(void* node, void** children, unsigned count, void*) {
  SPILLWAY_CHECK(count, ==, 2u);
  for (unsigned i = 0; i < 2; ++i) static_cast<BuildNode*>(node)->child[i] = static_cast<BuildItem*>(children[i]);
}

void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  SPILLWAY_CHECK(count, ==, 2u);
  for (unsigned i = 0; i < 2; ++i) static_cast<BuildNode*>(node)->bounds[i] = to_bounds(*bounds[i]);
}

void* make_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* prims, size_t count, void*) {
  SPILLWAY_CHECK(count, <=, kFewItems);
  const size_t size = sizeof(BuildItem) + count * sizeof(unsigned);
  auto* const leaf = static_cast<BuildLeaf*>(rtcThreadLocalAlloc(allocator, size, 16));
  leaf->count = static_cast<unsigned>(count);
  for (size_t i = 0; i < count; ++i) leaf->prim[i] = prims[i].primID;
  return leaf;
}

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct BvhRelease {
  void operator()(RTCBVH bvh) const { rtcReleaseBVH(bvh); }
};
using Device = std::unique_ptr<RTCDeviceTy, DeviceRelease>;
using Bvh = std::unique_ptr<RTCBVHTy, BvhRelease>;

// One tree a thread: a build that is parallel inside would not give the same tree every time.
RTCDevice device() {
  static const Device shared(rtcNewDevice(nullptr));
  return shared.get();
}

struct EmbreeTree {
  Bvh bvh;
  BuildItem* root = nullptr;
};

RTCBuildPrimitive build_primitive(const Bounds3& b, unsigned id) {
  return {b.lower.x, b.lower.y, b.lower.z, 0, b.upper.x, b.upper.y, b.upper.z, id};
}

EmbreeTree build(std::span<const Bounds3> boxes, unsigned leaf_items, unsigned max_depth) {
  std::vector<RTCBuildPrimitive> prims;
  prims.reserve(boxes.size());
  for (size_t i = 0; i < boxes.size(); ++i) prims.push_back(build_primitive(boxes[i], static_cast<unsigned>(i)));
  EmbreeTree tree{Bvh(rtcNewBVH(device())), nullptr};
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.byteSize = sizeof arguments;
  arguments.buildQuality = RTC_BUILD_QUALITY_MEDIUM;
  arguments.maxBranchingFactor = 2;
  arguments.maxDepth = max_depth;
  arguments.sahBlockSize = leaf_items;
  arguments.minLeafSize = kFewItems;
  arguments.maxLeafSize = kFewItems;
  arguments.traversalCost = 1.0f;
  arguments.intersectionCost = 1.0f;
  arguments.bvh = tree.bvh.get();
  arguments.primitives = prims.data();
  arguments.primitiveCount = arguments.primitiveArrayCapacity = prims.size();
  arguments.createNode = make_node;
  arguments.setNodeChildren = set_children;
  arguments.setNodeBounds = set_bounds;
  arguments.createLeaf = make_leaf;
  thread_local tbb::task_arena alone(1);
  alone.execute([&] { tree.root = static_cast<BuildItem*>(rtcBuildBVH(&arguments)); });
  return tree;
}

// Embree's tree with its leaves cut. Nodes get their bounds from their parents.
class TreeCopy {
 public:
  TreeCopy(std::span<const Bounds3> boxes, unsigned leaf_items, BinaryTree& tree)
      : boxes_(boxes), leaf_items_(leaf_items), tree_(tree) {}

  void add(const BuildItem& item, const Bounds3& bounds) {
    if (item.count != 0)
      return cut_few(boxes_, {static_cast<const BuildLeaf&>(item).prim, item.count}, leaf_items_, false, tree_);
    const auto& node = static_cast<const BuildNode&>(item);
    const size_t at = tree_.add_node(bounds);
    add(*node.child[0], node.bounds[0]);
    tree_.nodes[at].right = static_cast<uint32_t>(tree_.nodes.size());
    add(*node.child[1], node.bounds[1]);
  }

 private:
  std::span<const Bounds3> boxes_;
  unsigned leaf_items_;
  BinaryTree& tree_;
};

// Empty where Embree fails.
BinaryTree cut_by_surface(std::span<const Bounds3> boxes, unsigned leaf_items) {
  BinaryTree tree;
  tree.items.reserve(boxes.size());
  tree.nodes.reserve(2 * boxes.size() / leaf_items + 1);
  const EmbreeTree built = build(boxes, leaf_items, kBuilderDepth);
  if (built.root == nullptr) return {};
  Bounds3 bounds;
  for (const Bounds3& box : boxes) bounds.grow(box);
  TreeCopy(boxes, leaf_items, tree).add(*built.root, bounds);
  return tree;
}

// Children of a node of the finished tree.
struct WideNode {
  uint32_t count = 0;
  Bounds3 bounds[kMaxBranching];
  uint32_t node[kMaxBranching] = {};  // of the binary tree
};

// Eight-bit boxes around the children, rounded outwards; against the rounding of its own arithmetic the kernel pads.
void quantise(const WideNode& from, TraceNode& to) {
  Bounds3 all;
  for (unsigned c = 0; c < from.count; ++c) all.grow(from.bounds[c]);
  for (int a = 0; a < 3; ++a) {
    const float largest = std::max(std::fabs(all.lower[a]), std::fabs(all.upper[a]));
    // Flat boxes keep a thickness that survives the addition of origin and quantum.
    const float scale = std::max({(all.upper[a] - all.lower[a]) / 252, largest * 0x1p-22f, 1e-30f});
    to.scale[a] = scale;
    to.origin[a] = all.lower[a] - scale;
    for (unsigned c = 0; c < from.count; ++c) {
      const double lower = (static_cast<double>(from.bounds[c].lower[a]) - to.origin[a]) / scale;
      const double upper = (static_cast<double>(from.bounds[c].upper[a]) - to.origin[a]) / scale;
      to.lower[a][c] = static_cast<uint8_t>(std::clamp(std::floor(lower), 0.0, 255.0));
      to.upper[a][c] = static_cast<uint8_t>(std::clamp(std::ceil(upper), 0.0, 255.0));
    }
  }
}

// Large children first: what a shadow ray meets in them is most likely to stop it, and any hit will do.
WideNode largest_first(const BinaryTree& tree, const TreeCollapse::Children& children) {
  const auto area = [&](uint32_t node) { return tree.nodes[node].bounds.half_area(); };
  TreeCollapse::Children order = children;
  std::stable_sort(order.node, order.node + order.count, [&](uint32_t a, uint32_t b) { return area(a) > area(b); });
  WideNode node;
  node.count = order.count;
  for (unsigned c = 0; c < order.count; ++c)
    node.node[c] = order.node[c], node.bounds[c] = tree.nodes[order.node[c]].bounds;
  return node;
}

struct WideTree {
  uint32_t root = kNoChild;
  std::vector<TraceNode> nodes;
  int depth = 0;
};

// Parents before children, in depth-first order; leaves in the order they are met. on_leaf returns a leaf reference.
template <class OnLeaf>
uint32_t flatten(const BinaryTree& tree, const TreeCollapse& collapse, uint32_t at, uint32_t node_base, int depth,
                 WideTree& wide, const OnLeaf& on_leaf) {
  wide.depth = std::max(wide.depth, depth);
  const BinaryNode& item = tree.nodes[at];
  if (item.count != 0) return on_leaf(std::span(tree.items).subspan(item.first, item.count));
  const WideNode from = largest_first(tree, collapse.children(at));
  const size_t place = wide.nodes.size();
  wide.nodes.emplace_back();
  std::memset(static_cast<void*>(&wide.nodes[place]), 0, sizeof(TraceNode));
  quantise(from, wide.nodes[place]);
  wide.nodes[place].child_count = from.count;
  std::fill(std::begin(wide.nodes[place].child), std::end(wide.nodes[place].child), kNoChild);
  for (unsigned c = 0; c < from.count; ++c) {
    const uint32_t reference = flatten(tree, collapse, from.node[c], node_base, depth + 1, wide, on_leaf);
    wide.nodes[place].child[c] = reference;
  }
  return node_base + static_cast<uint32_t>(place);
}

// start(): before the first leaf; a tree that is too deep is built again, in halves.
template <class Start, class OnLeaf>
WideTree wide_tree(std::span<const Bounds3> boxes, uint32_t leaf_items, uint32_t branching, uint32_t node_base,
                   const Start& start, const OnLeaf& on_leaf) {
  for (const bool in_halves : {false, true}) {
    const BinaryTree tree = in_halves ? cut_all_in_halves(boxes, leaf_items) : cut_by_surface(boxes, leaf_items);
    if (tree.nodes.empty()) continue;
    const TreeCollapse collapse(tree, branching);
    WideTree wide;
    wide.nodes.reserve(tree.nodes.size() / 8);
    start();
    wide.root = flatten(tree, collapse, 0, node_base, 1, wide, on_leaf);
    if (wide.depth <= cache::kMaxTreeDepth) return wide;
  }
  SPILLWAY_CHECK(boxes.size(), ==, size_t{0});  // 2^32 boxes in halves are less deep
  return {};
}

Bounds3 bounds_of(const PackTriangle& triangle) {
  Bounds3 b;
  for (const Float3& v : triangle.vertex) b.grow(v);
  return b;
}

struct PageParts {
  WideTree tree;
  std::vector<TraceLeaf> leaves;
  std::vector<uint32_t> slot_triangle;  // which input triangle each leaf slot holds; kNoChild: none
};

uint32_t add_leaf(std::span<const uint32_t> from, std::span<const PackTriangle> triangles, PageParts& page) {
  TraceLeaf leaf{};
  for (unsigned i = 0; i < 4; ++i) {
    leaf.prim[i] = PrimId::kNone;
    page.slot_triangle.push_back(i < from.size() ? from[i] : kNoChild);
    if (i >= from.size()) continue;
    const PackTriangle& triangle = triangles[from[i]];
    leaf.prim[i] = triangle.prim;
    for (int v = 0; v < 3; ++v)
      for (int a = 0; a < 3; ++a) leaf.vertex[v][a][i] = triangle.vertex[v][a];
  }
  page.leaves.push_back(leaf);
  return static_cast<uint32_t>(page.leaves.size() - 1) | kLeafBit;
}

PageParts build_parts(std::span<const PackTriangle> triangles, const BuildOptions& options) {
  PageParts page;
  if (triangles.empty()) return page;
  std::vector<Bounds3> boxes;
  boxes.reserve(triangles.size());
  for (const PackTriangle& triangle : triangles) boxes.push_back(bounds_of(triangle));
  page.tree = wide_tree(
      boxes, options.leaf_fill, options.branching, 0, [&] { page.leaves.clear(), page.slot_triangle.clear(); },
      [&](std::span<const uint32_t> leaf) { return add_leaf(leaf, triangles, page); });
  return page;
}

// The micromap table and the maps behind it, at `offset` in the page; empty when no triangle has one.
std::vector<std::byte> micromap_section(const PageParts& page, std::span<const std::vector<std::byte>> micromaps,
                                        uint64_t offset) {
  if (micromaps.empty()) return {};
  std::vector<std::byte> section(page.slot_triangle.size() * sizeof(uint32_t));
  for (size_t slot = 0; slot < page.slot_triangle.size(); ++slot) {
    const uint32_t triangle = page.slot_triangle[slot];
    if (triangle == kNoChild || micromaps[triangle].empty()) continue;
    const auto at = static_cast<uint32_t>(offset + section.size());
    std::memcpy(section.data() + slot * sizeof at, &at, sizeof at);
    section.insert(section.end(), micromaps[triangle].begin(), micromaps[triangle].end());
    section.resize(aligned(section.size(), 4));
  }
  return section;
}

}  // namespace

Buffer<std::byte> build_trace_page(std::span<const PackTriangle> triangles,
                                   std::span<const std::vector<std::byte>> micromaps, const BuildOptions& options) {
  SPILLWAY_CHECK(triangles.size(), <=, size_t{cache::kMaxTrianglesPerPage});
  const PageParts page = build_parts(triangles, options);
  const uint64_t nodes_at = aligned(sizeof(cache::TracePageHeader), 64);
  const uint64_t leaves_at = nodes_at + page.tree.nodes.size() * sizeof(TraceNode);
  const uint64_t maps_at = leaves_at + page.leaves.size() * sizeof(TraceLeaf);
  const std::vector<std::byte> maps = micromap_section(page, micromaps, maps_at);
  const uint64_t size = aligned(maps_at + maps.size(), 4096);
  Buffer<std::byte> bytes(MemoryTag::pack, size);
  cache::TracePageHeader header{};
  header.magic = cache::kTracePageMagic, header.version = cache::kTracePageVersion;
  header.size_bytes = size;
  header.triangle_count = static_cast<uint32_t>(triangles.size());
  header.node_count = static_cast<uint32_t>(page.tree.nodes.size());
  header.leaf_count = static_cast<uint32_t>(page.leaves.size());
  header.root = page.tree.root;
  header.flags = maps.empty() ? 0u : static_cast<uint32_t>(cache::kPageHasAlpha);
  Bounds3 bounds;
  for (const PackTriangle& triangle : triangles) bounds.grow(bounds_of(triangle));
  header.lower = bounds.lower, header.upper = bounds.upper;
  if (!page.tree.nodes.empty())
    std::memcpy(bytes.data() + nodes_at, page.tree.nodes.data(), page.tree.nodes.size() * sizeof(TraceNode));
  std::memcpy(bytes.data() + leaves_at, page.leaves.data(), page.leaves.size() * sizeof(TraceLeaf));
  if (!maps.empty()) std::memcpy(bytes.data() + maps_at, maps.data(), maps.size());
  std::memcpy(bytes.data(), &header, sizeof header);
  constexpr size_t kCovered = offsetof(cache::TracePageHeader, size_bytes);
  header.checksum = checksum(bytes.data() + kCovered, size - kCovered);
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

BoxTree build_box_tree(std::span<const Bounds3> boxes, uint32_t node_base, const BuildOptions& options) {
  if (boxes.empty()) return {};
  WideTree tree = wide_tree(
      boxes, 1, options.branching, node_base, [] {}, [](std::span<const uint32_t> leaf) { return leaf[0] | kLeafBit; });
  return {tree.root, std::move(tree.nodes)};
}

}  // namespace spillway::pipeline
