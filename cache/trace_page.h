#pragma once

// The trace part of a page: an 8-wide tree with 8-bit boxes over leaves of four triangles, used as it lies on disk.
//
// Format, little endian, at a 4096-aligned offset of pages.trace, size_bytes a multiple of 4096:
//   TracePageHeader, TraceNode[node_count] (64-aligned), TraceLeaf[leaf_count] (64-aligned),
//   with kPageHasAlpha: uint32 micromap_offset[4 * leaf_count] (0 = opaque triangle, else bytes from the page's start),
//   then the opacity micromaps.
// Position independent: references are indices; vertices are the mesh's own 32-bit floats, in the mesh's vertex order.
// The page tree (over pages and instances) uses the same nodes, its leaf references index PageTreeEntry.

#include <cstdint>
#include <span>
#include <string_view>

#include "cache/base/ids.h"
#include "cache/base/motion.h"
#include "cache/base/result.h"
#include "cache/base/vec.h"

namespace spillway::cache {

inline constexpr uint32_t kTracePageMagic = 0x50545053;  // "SPTP"
inline constexpr uint32_t kTracePageVersion = 1;
inline constexpr uint32_t kMaxTrianglesPerPage = 65536;
inline constexpr int kMaxTreeDepth = 48;  // of a page, and of the page tree; checked on load, sizes the kernel's stack

enum TracePageFlag : uint32_t { kPageHasAlpha = 1, kPageHasMotion = 2 /* reserved */ };

struct TracePageHeader {
  uint32_t magic;
  uint32_t version;
  uint64_t checksum;  // XXH3 of everything after this field, to size_bytes
  uint64_t size_bytes;
  uint32_t triangle_count;
  uint32_t node_count;
  uint32_t leaf_count;
  uint32_t root;   // a child reference
  uint32_t flags;  // TracePageFlag
  uint32_t reserved[3];
  Float3 lower, upper;  // exact bounds of the triangles
};

// A child reference: kNoChild, or leaf index with the top bit set, or node index. Children come after their parent.
inline constexpr uint32_t kNoChild = 0xffffffffu;
inline constexpr uint32_t kLeafBit = 0x80000000u;

// Child box in axis a: origin[a] + scale[a] * lower[a][i] .. origin[a] + scale[a] * upper[a][i], rounded outwards.
// Slots in use are the first child_count; the others hold kNoChild.
struct alignas(64) TraceNode {
  float origin[3];
  float scale[3];
  uint8_t lower[3][8];
  uint8_t upper[3][8];
  uint32_t child[8];
  uint32_t child_count;
  uint32_t reserved[5];
};
static_assert(sizeof(TraceNode) == 128);

// Four triangles; unused lanes have prim kNone and all vertices NaN-free zero (they never hit: zero area).
struct alignas(32) TraceLeaf {
  float vertex[3][3][4];  // [vertex][axis][lane]
  uint32_t prim[4];
};
static_assert(sizeof(TraceLeaf) == 160);

// Opacity of 4^level micro-triangles, two bits each, first in the lowest bits. Micro-triangles are
// numbered row by row (rows of equal v), see micro_triangle_index().
enum class Opacity : uint8_t { opaque = 0, clear = 1, unknown = 2 };
struct OpacityMicromap {
  uint32_t level;
  // uint8 states[4^level / 4, at least 1]
};
inline constexpr uint32_t kMaxMicromapLevel = 8;
// n = 2^level; row = floor(v n), row r starts at r (2 n - r) and holds 2 (n - r) - 1 micro-triangles, alternately
// upright and inverted from u = 0 on.
[[nodiscard]] uint32_t micro_triangle_index(float u, float v, uint32_t level);

// Checks everything the kernel will follow: checksum, sizes, children after parents, depth, indices, finite vertices.
Status validate_trace_page(std::span<const std::byte> page, std::string_view where);

// A validated page, ready to trace. Pointers into the caller's bytes.
struct TracePageView {
  const TracePageHeader* header = nullptr;
  const TraceNode* nodes = nullptr;
  const TraceLeaf* leaves = nullptr;
  const uint32_t* micromap_offsets = nullptr;  // null without alpha
  const std::byte* bytes = nullptr;
};
[[nodiscard]] TracePageView trace_page_view(std::span<const std::byte> page);

// ---- the page tree ----

// What a leaf of a page tree stands for: a page of the tree's own object, or an instance of another object.
struct PageTreeEntry {
  uint32_t kind;   // 0: page, 1: instance
  uint32_t index;  // PageId, or InstanceId
};

// Trees over entries, one an object (object 0 is the world); node and entry arrays are shared by all.
struct PageObject {
  uint32_t root;  // child reference into the shared nodes; leaf references index entries; kNoChild: empty
  uint32_t reserved;
  Bounds3 bounds_object;
};

struct Instance {
  Affine3 world_from_object;  // of one that moves: its first key
  Affine3 object_from_world;
  uint32_t object;  // >= 1; prototypes hold pages only (two levels)
  uint32_t motion;  // 0: stands still; else one more than its place among the motions
  uint32_t reserved[2];
};

// One line a page of pages.trace.
struct PageLocation {
  uint64_t offset_bytes;
  uint64_t size_bytes;
  uint32_t triangle_count;
  uint32_t object;
};

struct PageTree {
  std::span<const TraceNode> nodes;
  std::span<const PageTreeEntry> entries;
  std::span<const PageObject> objects;
  std::span<const Instance> instances;  // [0] is the world: identity, object 0
  float scene_extent_world = 0;         // largest |coordinate| of the world bounds, for the kernel's box padding
  std::span<const Motion> motions = {};  // of the instances that move, and of the camera
};
Status validate_page_tree(const PageTree& tree, size_t page_count, std::string_view where);

}  // namespace spillway::cache
