#pragma once

// A binary tree over boxes, as it is while the tree of a page is built, and its last cuts.

#include <cstdint>
#include <span>
#include <vector>

#include "cache/base/vec.h"

namespace spillway::pipeline {

struct BinaryNode {
  Bounds3 bounds;
  uint32_t first = 0;  // of a leaf: where its items begin; of a node: its number among those
  uint32_t count = 0;  // of a leaf, at least 1; 0: a node
  uint32_t right = 0;  // of a node: its right child; the left one follows it
};

struct BinaryTree {
  std::vector<BinaryNode> nodes;  // the root first
  std::vector<uint32_t> items;    // which box
  uint32_t inner_count = 0;       // nodes that are no leaves

  // Appends a node, whose left child is appended next and whose `right` is set then.
  size_t add_node(const Bounds3& bounds) {
    nodes.push_back({bounds, inner_count++, 0, 0});
    return nodes.size() - 1;
  }
};

inline constexpr size_t kFewItems = 64;

// Appends the tree over a few boxes (1 to kFewItems), in leaves of at most leaf_items. Every cut is looked at, and
// leaves that are not full have a price. `in_halves`: cuts go through the middle, so that depth is logarithmic.
// Deterministic: ties go to the first axis and the first cut, equal centres keep the order of `items`.
void cut_few(std::span<const Bounds3> boxes, std::span<const uint32_t> items, uint32_t leaf_items, bool in_halves,
             BinaryTree& tree);

// A tree of the same leaf size over any number of boxes (at least one), cut through the middle of the longest axis all the
// way: its depth is the logarithm of their number.
BinaryTree cut_all_in_halves(std::span<const Bounds3> boxes, uint32_t leaf_items);

}  // namespace spillway::pipeline
