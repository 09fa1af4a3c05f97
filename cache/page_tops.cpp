#include "cache/page_tops.h"

#include <queue>

namespace spillway::cache {
namespace {

// Where a top ends: the kernel only learns that something is there.
constexpr uint32_t kEnd = kLeafBit;

// A node of the page that may still join its top, and the child of a node there that leads to it.
struct Candidate {
  float area;
  uint32_t node, parent, child;
  bool operator<(const Candidate& other) const { return area < other.area; }
};

// In proportion to the surface of the node's box: its quanta are that box divided by a constant.
float area_of(const TraceNode& node) {
  return node.scale[0] * node.scale[1] + node.scale[1] * node.scale[2] + node.scale[2] * node.scale[0];
}

}  // namespace

PageTops::PageTops(size_t page_count, uint32_t nodes_a_page)
    : nodes_a_page_(nodes_a_page),
      known_(nodes_a_page > 0 ? page_count : 0),
      nodes_(MemoryTag::page_tree, page_count * nodes_a_page) {}

void PageTops::note(uint32_t page, const TracePageView& view) {
  if (nodes_.empty() || known_[page] || (view.header->root & kLeafBit) != 0) return;
  TraceNode* const top = nodes_.data() + size_t{page} * nodes_a_page_;
  std::priority_queue<Candidate> candidates;
  candidates.push({0, view.header->root, 0, 0});
  for (uint32_t count = 0; count < nodes_a_page_ && !candidates.empty(); ++count) {
    const Candidate next = candidates.top();
    candidates.pop();
    if (count > 0) top[next.parent].child[next.child] = count;
    TraceNode& node = top[count] = view.nodes[next.node];
    for (uint32_t c = 0; c < node.child_count; ++c) {
      const uint32_t child = std::exchange(node.child[c], kEnd);
      if ((child & kLeafBit) == 0) candidates.push({area_of(view.nodes[child]), child, count, c});
    }
  }
  known_[page] = true;
}

TracePageView PageTops::view(uint32_t page) const {
  if (nodes_.empty() || !known_[page]) return {};
  const TraceNode* const top = nodes_.data() + size_t{page} * nodes_a_page_;
  // Leaves are not looked at, but asked for.
  return {.nodes = top, .leaves = reinterpret_cast<const TraceLeaf*>(top)};
}

}  // namespace spillway::cache
