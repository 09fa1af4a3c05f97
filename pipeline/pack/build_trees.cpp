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

namespace spillway::pipeline {
namespace {

using cache::kLeafBit;
using cache::kNoChild;
using cache::TraceLeaf;
using cache::TraceNode;

// Embree splits what it finds too deep at the middle, which adds at most log2(65536) levels to this.
constexpr unsigned kBuilderDepth = 30;
constexpr unsigned kMaxBranching = 8;

// What Embree's callbacks build; lives in Embree's own arena until it is flattened. Most are leaves, which are small.
struct BuildItem {
  unsigned child_count = 0;  // 0: a leaf
};
struct BuildLeaf : BuildItem {
  unsigned prim_count = 0;
  unsigned prim[4] = {};
};
struct BuildNode : BuildItem {
  Bounds3 bounds[kMaxBranching];
  BuildItem* child[kMaxBranching] = {};
};

Bounds3 to_bounds(const RTCBounds& b) {
  return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
}

void* make_node(RTCThreadLocalAllocator allocator, unsigned, void*) {
  return new (rtcThreadLocalAlloc(allocator, sizeof(BuildNode), 16)) BuildNode;
}

void set_children(void* node, void** children, unsigned count, void*) {
  auto* n = static_cast<BuildNode*>(node);
  n->child_count = count;
  for (unsigned i = 0; i < count; ++i) n->child[i] = static_cast<BuildItem*>(children[i]);
}

void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  auto* n = static_cast<BuildNode*>(node);
  for (unsigned i = 0; i < count; ++i) n->bounds[i] = to_bounds(*bounds[i]);
}

void* make_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* prims, size_t count, void*) {
  SPILLWAY_CHECK(count, <=, size_t{4});
  auto* leaf = new (rtcThreadLocalAlloc(allocator, sizeof(BuildLeaf), 16)) BuildLeaf;
  leaf->prim_count = static_cast<unsigned>(count);
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

EmbreeTree build(std::vector<RTCBuildPrimitive>& prims, unsigned branching, unsigned leaf_size) {
  EmbreeTree tree{Bvh(rtcNewBVH(device())), nullptr};
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.byteSize = sizeof arguments;
  arguments.buildQuality = RTC_BUILD_QUALITY_MEDIUM;
  arguments.maxBranchingFactor = branching;
  arguments.maxDepth = kBuilderDepth;
  arguments.sahBlockSize = leaf_size;
  arguments.minLeafSize = leaf_size;
  arguments.maxLeafSize = leaf_size;
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

RTCBuildPrimitive build_primitive(const Bounds3& b, unsigned id) {
  return {b.lower.x, b.lower.y, b.lower.z, 0, b.upper.x, b.upper.y, b.upper.z, id};
}

// Eight-bit boxes around the children, rounded outwards; against the rounding of its own arithmetic the kernel pads.
void quantise(const BuildNode& from, TraceNode& to) {
  Bounds3 all;
  for (unsigned c = 0; c < from.child_count; ++c) all.grow(from.bounds[c]);
  for (int a = 0; a < 3; ++a) {
    const float largest = std::max(std::fabs(all.lower[a]), std::fabs(all.upper[a]));
    // Flat boxes keep a thickness that survives the addition of origin and quantum.
    const float scale = std::max({(all.upper[a] - all.lower[a]) / 252, largest * 0x1p-22f, 1e-30f});
    to.scale[a] = scale;
    to.origin[a] = all.lower[a] - scale;
    for (unsigned c = 0; c < from.child_count; ++c) {
      const double lower = (static_cast<double>(from.bounds[c].lower[a]) - to.origin[a]) / scale;
      const double upper = (static_cast<double>(from.bounds[c].upper[a]) - to.origin[a]) / scale;
      to.lower[a][c] = static_cast<uint8_t>(std::clamp(std::floor(lower), 0.0, 255.0));
      to.upper[a][c] = static_cast<uint8_t>(std::clamp(std::ceil(upper), 0.0, 255.0));
    }
  }
}

// Large children first: what a shadow ray meets in them is most likely to stop it, and any hit will do.
void put_largest_first(BuildNode& node) {
  unsigned order[kMaxBranching];
  std::iota(order, order + node.child_count, 0u);
  std::stable_sort(order, order + node.child_count,
                   [&](unsigned a, unsigned b) { return node.bounds[a].half_area() > node.bounds[b].half_area(); });
  const BuildNode unsorted = node;
  for (unsigned c = 0; c < node.child_count; ++c)
    node.bounds[c] = unsorted.bounds[order[c]], node.child[c] = unsorted.child[order[c]];
}

// Parents before children, in depth-first order; leaves in the order they are met. on_leaf returns a leaf reference.
template <class OnLeaf>
uint32_t flatten(BuildItem* item, uint32_t node_base, std::vector<TraceNode>& nodes, const OnLeaf& on_leaf) {
  if (item->child_count == 0) return on_leaf(*static_cast<const BuildLeaf*>(item));
  auto* const from = static_cast<BuildNode*>(item);
  put_largest_first(*from);
  const size_t at = nodes.size();
  nodes.emplace_back();
  std::memset(static_cast<void*>(&nodes[at]), 0, sizeof(TraceNode));
  quantise(*from, nodes[at]);
  nodes[at].child_count = from->child_count;
  std::fill(std::begin(nodes[at].child), std::end(nodes[at].child), kNoChild);
  for (unsigned c = 0; c < from->child_count; ++c) {
    const uint32_t reference = flatten(from->child[c], node_base, nodes, on_leaf);
    nodes[at].child[c] = reference;
  }
  return node_base + static_cast<uint32_t>(at);
}

Bounds3 bounds_of(const PackTriangle& triangle) {
  Bounds3 b;
  for (const Float3& v : triangle.vertex) b.grow(v);
  return b;
}

struct PageParts {
  std::vector<TraceNode> nodes;
  std::vector<TraceLeaf> leaves;
  std::vector<uint32_t> slot_triangle;  // which input triangle each leaf slot holds; kNoChild: none
  uint32_t root = kNoChild;
};

uint32_t add_leaf(const BuildLeaf& from, std::span<const PackTriangle> triangles, PageParts& page) {
  TraceLeaf leaf{};
  for (unsigned i = 0; i < 4; ++i) {
    leaf.prim[i] = PrimId::kNone;
    page.slot_triangle.push_back(i < from.prim_count ? from.prim[i] : kNoChild);
    if (i >= from.prim_count) continue;
    const PackTriangle& triangle = triangles[from.prim[i]];
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
  std::vector<RTCBuildPrimitive> prims;
  prims.reserve(triangles.size());
  page.leaves.reserve(triangles.size() / 3), page.nodes.reserve(triangles.size() / 16);
  page.slot_triangle.reserve(4 * (triangles.size() / 3));
  for (size_t i = 0; i < triangles.size(); ++i)
    prims.push_back(build_primitive(bounds_of(triangles[i]), static_cast<unsigned>(i)));
  const EmbreeTree tree = build(prims, options.branching, options.leaf_fill);
  page.root = flatten(tree.root, 0, page.nodes, [&](const BuildLeaf& leaf) { return add_leaf(leaf, triangles, page); });
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
  const uint64_t leaves_at = nodes_at + page.nodes.size() * sizeof(TraceNode);
  const uint64_t maps_at = leaves_at + page.leaves.size() * sizeof(TraceLeaf);
  const std::vector<std::byte> maps = micromap_section(page, micromaps, maps_at);
  const uint64_t size = aligned(maps_at + maps.size(), 4096);
  Buffer<std::byte> bytes(MemoryTag::pack, size);
  cache::TracePageHeader header{};
  header.magic = cache::kTracePageMagic, header.version = cache::kTracePageVersion;
  header.size_bytes = size;
  header.triangle_count = static_cast<uint32_t>(triangles.size());
  header.node_count = static_cast<uint32_t>(page.nodes.size());
  header.leaf_count = static_cast<uint32_t>(page.leaves.size());
  header.root = page.root;
  header.flags = maps.empty() ? 0u : static_cast<uint32_t>(cache::kPageHasAlpha);
  Bounds3 bounds;
  for (const PackTriangle& triangle : triangles) bounds.grow(bounds_of(triangle));
  header.lower = bounds.lower, header.upper = bounds.upper;
  if (!page.nodes.empty()) std::memcpy(bytes.data() + nodes_at, page.nodes.data(), page.nodes.size() * sizeof(TraceNode));
  std::memcpy(bytes.data() + leaves_at, page.leaves.data(), page.leaves.size() * sizeof(TraceLeaf));
  if (!maps.empty()) std::memcpy(bytes.data() + maps_at, maps.data(), maps.size());
  std::memcpy(bytes.data(), &header, sizeof header);
  constexpr size_t kCovered = offsetof(cache::TracePageHeader, size_bytes);
  header.checksum = checksum(bytes.data() + kCovered, size - kCovered);
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

BoxTree build_box_tree(std::span<const Bounds3> boxes, uint32_t node_base, const BuildOptions& options) {
  BoxTree tree;
  if (boxes.empty()) return tree;
  std::vector<RTCBuildPrimitive> prims;
  prims.reserve(boxes.size());
  for (size_t i = 0; i < boxes.size(); ++i) prims.push_back(build_primitive(boxes[i], static_cast<unsigned>(i)));
  const EmbreeTree built = build(prims, options.branching, 1);
  prims = {};  // with a million instances these are what memory is needed for next
  tree.nodes.reserve(boxes.size() / 4);
  tree.root = flatten(built.root, node_base, tree.nodes,
                      [](const BuildLeaf& leaf) { return leaf.prim[0] | kLeafBit; });
  return tree;
}

}  // namespace spillway::pipeline
