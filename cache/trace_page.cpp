#include "cache/trace_page.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "cache/base/all_finite.h"
#include "cache/base/hash.h"

namespace spillway::cache {
namespace {

constexpr uint64_t kNodesOffset = (sizeof(TracePageHeader) + 63) / 64 * 64;
constexpr uint64_t kPageAlignment = 4096;

uint64_t leaves_offset(const TracePageHeader& h) { return kNodesOffset + uint64_t{h.node_count} * sizeof(TraceNode); }
uint64_t micromaps_offset(const TracePageHeader& h) {
  return leaves_offset(h) + uint64_t{h.leaf_count} * sizeof(TraceLeaf);
}

// Checks a tree whose references are below the given counts: every node and leaf is reached exactly once, children come
// after parents, and no leaf is deeper than the kernel's stack allows.
class TreeCheck {
 public:
  TreeCheck(std::span<const TraceNode> nodes, size_t leaf_count, std::string_view where)
      : nodes_(nodes), where_(where), depth_(nodes.size(), 0), leaf_seen_(leaf_count, false) {}

  Status check_root(uint32_t root) {
    if (root == kNoChild) return {};
    SPILLWAY_TRY(reach(root, 1, 0));
    return {};
  }
  // In order: a node's depth is known before its children are looked at.
  Status check_nodes() {
    for (size_t i = 0; i < nodes_.size(); ++i) {
      if (depth_[i] == 0) return error("{}: node {} is not part of the tree; the file is damaged", where_, i);
      SPILLWAY_TRY(check_node(nodes_[i], i));
    }
    return {};
  }
  Status check_all_leaves_reached() const {
    const auto missing = std::find(leaf_seen_.begin(), leaf_seen_.end(), false);
    if (missing == leaf_seen_.end()) return {};
    return error("{}: leaf {} is not part of the tree; the file is damaged", where_, missing - leaf_seen_.begin());
  }

 private:
  Status check_node(const TraceNode& node, size_t index) {
    for (int axis = 0; axis < 3; ++axis)
      if (!std::isfinite(node.origin[axis]) || !std::isfinite(node.scale[axis]) || node.scale[axis] < 0)
        return error("{}: node {} has a box that is not finite; the file is damaged", where_, index);
    if (node.child_count < 1 || node.child_count > 8)
      return error("{}: node {} has {} children; the file is damaged", where_, index, node.child_count);
    for (uint32_t c = 0; c < node.child_count; ++c) SPILLWAY_TRY(reach(node.child[c], depth_[index] + 1, index + 1));
    return {};
  }

  Status reach(uint32_t reference, int depth, size_t first_allowed) {
    if (depth > kMaxTreeDepth) return error("{}: the tree is deeper than {}; the file is damaged", where_, kMaxTreeDepth);
    const uint32_t index = reference & ~kLeafBit;
    const bool is_leaf = (reference & kLeafBit) != 0;
    const bool in_range = is_leaf ? index < leaf_seen_.size() : index < nodes_.size() && index >= first_allowed;
    if (!in_range) return error("{}: a child reference {:#x} leads nowhere; the file is damaged", where_, reference);
    if (is_leaf ? leaf_seen_[index] : depth_[index] != 0)
      return error("{}: a child reference {:#x} is there twice; the file is damaged", where_, reference);
    if (is_leaf)
      leaf_seen_[index] = true;
    else
      depth_[index] = depth;
    return {};
  }

  std::span<const TraceNode> nodes_;
  std::string_view where_;
  std::vector<int> depth_;
  std::vector<bool> leaf_seen_;
};

Status check_header(std::span<const std::byte> page, std::string_view where) {
  if (page.size() < sizeof(TracePageHeader)) return error("{}: has {} bytes, less than a page header", where, page.size());
  TracePageHeader h;
  std::memcpy(&h, page.data(), sizeof h);
  if (h.magic != kTracePageMagic) return error("{}: byte 0: is no trace page", where);
  if (h.version != kTracePageVersion)
    return error("{}: byte 4: is of version {}, this program reads {}; pack the scene again", where, h.version, kTracePageVersion);
  if (h.size_bytes != page.size() || page.size() % kPageAlignment != 0)
    return error("{}: byte 16: says {} bytes where {} are; the file is damaged", where, h.size_bytes, page.size());
  constexpr size_t kCovered = offsetof(TracePageHeader, size_bytes);
  if (checksum(page.data() + kCovered, page.size() - kCovered) != h.checksum)
    return error("{}: byte 8: the checksum does not match; the file is damaged", where);
  if (h.triangle_count > kMaxTrianglesPerPage || h.leaf_count > kMaxTrianglesPerPage ||
      h.node_count > kMaxTrianglesPerPage || micromaps_offset(h) > page.size())
    return error("{}: byte 24: claims {} nodes and {} leaves, more than the page holds", where, h.node_count, h.leaf_count);
  if ((h.flags & ~uint32_t{kPageHasAlpha}) != 0) return error("{}: byte 40: has unknown flags {:#x}", where, h.flags);
  return {};
}

Status check_leaves(const TracePageView& page, std::string_view where) {
  for (uint32_t i = 0; i < page.header->leaf_count; ++i) {
    if (!all_finite(&page.leaves[i].vertex[0][0][0], 36))
      return error("{}: leaf {} has a vertex that is not finite; the file is damaged", where, i);
  }
  return {};
}

Status check_micromaps(const TracePageView& page, std::string_view where) {
  if (page.micromap_offsets == nullptr) return {};
  const uint64_t size = page.header->size_bytes;
  const uint64_t table = micromaps_offset(*page.header);
  const uint64_t slots = uint64_t{page.header->leaf_count} * 4;
  if (table + slots * sizeof(uint32_t) > size) return error("{}: the micromap table is cut short", where);
  for (uint64_t i = 0; i < slots; ++i) {
    const uint64_t offset = page.micromap_offsets[i];
    if (offset == 0) continue;
    if (offset % 4 != 0 || offset < table || offset + sizeof(OpacityMicromap) > size)
      return error("{}: micromap {} lies outside the page; the file is damaged", where, i);
    OpacityMicromap map;
    std::memcpy(&map, page.bytes + offset, sizeof map);
    if (map.level > kMaxMicromapLevel || offset + sizeof map + std::max(1u, (1u << (2 * map.level)) / 4) > size)
      return error("{}: micromap {} of level {} does not fit the page; the file is damaged", where, i, map.level);
  }
  return {};
}

}  // namespace

uint32_t micro_triangle_index(float u, float v, uint32_t level) {
  const int32_t n = 1 << level;
  const float b = v * static_cast<float>(n);
  const int32_t row = std::clamp(static_cast<int32_t>(b), 0, n - 1);
  const float a = u * static_cast<float>(n);
  const int32_t column = std::clamp(static_cast<int32_t>(a), 0, n - 1 - row);
  const bool inverted = (a - static_cast<float>(column)) + (b - static_cast<float>(row)) > 1 && column < n - 1 - row;
  return static_cast<uint32_t>(row * (2 * n - row) + 2 * column + (inverted ? 1 : 0));
}

Status validate_trace_page(std::span<const std::byte> page, std::string_view where) {
  SPILLWAY_TRY(check_header(page, where));
  const TracePageView view = trace_page_view(page);
  TreeCheck check({view.nodes, view.header->node_count}, view.header->leaf_count, where);
  SPILLWAY_TRY(check.check_root(view.header->root));
  SPILLWAY_TRY(check.check_nodes());
  SPILLWAY_TRY(check.check_all_leaves_reached());
  SPILLWAY_TRY(check_leaves(view, where));
  return check_micromaps(view, where);
}

TracePageView trace_page_view(std::span<const std::byte> page) {
  TracePageView view;
  view.bytes = page.data();
  view.header = reinterpret_cast<const TracePageHeader*>(page.data());
  view.nodes = reinterpret_cast<const TraceNode*>(page.data() + kNodesOffset);
  view.leaves = reinterpret_cast<const TraceLeaf*>(page.data() + leaves_offset(*view.header));
  if (view.header->flags & kPageHasAlpha)
    view.micromap_offsets = reinterpret_cast<const uint32_t*>(page.data() + micromaps_offset(*view.header));
  return view;
}

Status validate_page_tree(const PageTree& tree, size_t page_count, std::string_view where) {
  if (tree.objects.empty() || tree.instances.empty()) return error("{}: has no world; the file is damaged", where);
  TreeCheck check(tree.nodes, tree.entries.size(), where);
  for (const PageObject& object : tree.objects) SPILLWAY_TRY(check.check_root(object.root));
  SPILLWAY_TRY(check.check_nodes());
  for (size_t i = 0; i < tree.entries.size(); ++i) {
    const PageTreeEntry& entry = tree.entries[i];
    const size_t limit = entry.kind == 0 ? page_count : tree.instances.size();
    if (entry.kind > 1 || entry.index >= limit || (entry.kind == 1 && entry.index == 0))
      return error("{}: entry {} leads nowhere; the file is damaged", where, i);
  }
  for (size_t i = 1; i < tree.instances.size(); ++i)
    if (tree.instances[i].object == 0 || tree.instances[i].object >= tree.objects.size())
      return error("{}: instance {} is of object {}, which does not exist", where, i, tree.instances[i].object);
  for (size_t i = 0; i < tree.instances.size(); ++i)
    if (tree.instances[i].motion > (i == 0 ? 0 : tree.motions.size()))
      return error("{}: instance {} moves by motion {} of {}", where, i, tree.instances[i].motion, tree.motions.size());
  return {};
}

}  // namespace spillway::cache
