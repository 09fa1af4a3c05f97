#pragma once

// Makes nodes of up to eight children of a binary tree: which of its nodes stay, and which are left out.
//
// Of all ways to leave out nodes the one is taken in which rays enter the fewest nodes (the sum of the surfaces of
// those that stay), each of which has a price besides, for the room that it takes.
//
// Based on: Ylitalo, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
//           section 3: the same dynamic programme; leaves are not made here, and nodes have a price.

#include <array>
#include <cstdint>
#include <vector>

#include "pipeline/pack/binary_tree.h"

namespace spillway::pipeline {

inline constexpr uint32_t kMaxBranching = 8;
// What a node costs beside the chance that a ray enters it, in parts of the surface of the whole tree over the number
// of its leaves. On a city 0 left 5.5 children a node, this 6.0.
inline constexpr float kNodePrice = 0.5f;

class TreeCollapse {
 public:
  // `branching`: 2 to kMaxBranching.
  TreeCollapse(const BinaryTree& tree, uint32_t branching);

  // The children of a node that stays: nodes that stay, and leaves.
  struct Children {
    uint32_t count = 0;
    uint32_t node[kMaxBranching] = {};
  };
  [[nodiscard]] Children children(uint32_t node) const;

 private:
  // How a subtree is said by at most so many nodes side by side: as many of its left child and of its right one; 0: by
  // itself.
  struct Split {
    uint8_t left = 0, right = 0;
  };
  // By [how many - 1]; the last is that of its children, when the node stays.
  struct Choice {
    Split split[kMaxBranching];
  };

  // By [how many - 1], of at most so many nodes side by side.
  using Costs = std::array<float, kMaxBranching - 1>;

  void add_roots(uint32_t node, Split split, Children& children) const;
  void choose(uint32_t node, float price, std::vector<Costs>& costs);

  const BinaryTree& tree_;
  uint32_t branching_;
  std::vector<Choice> choices_;
};

}  // namespace spillway::pipeline
