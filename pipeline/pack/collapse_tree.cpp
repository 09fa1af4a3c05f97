#include "pipeline/pack/collapse_tree.h"

#include <cmath>

namespace spillway::pipeline {

TreeCollapse::TreeCollapse(const BinaryTree& tree, uint32_t branching)
    : tree_(tree), branching_(branching), choices_(tree.inner_count) {
  const float price = kNodePrice * tree.nodes[0].bounds.half_area() / static_cast<float>(tree.inner_count + 1);
  std::vector<Costs> costs(tree.inner_count);
  for (size_t node = tree.nodes.size(); node-- > 0;)
    if (tree.nodes[node].count == 0) choose(static_cast<uint32_t>(node), price, costs);
}

// Children come after their node: their costs are known.
void TreeCollapse::choose(uint32_t node, float price, std::vector<Costs>& costs) {
  static constexpr Costs kOfLeaf = {};  // it is there in any case
  const auto costs_of = [&](uint32_t child) -> const Costs& {
    return tree_.nodes[child].count != 0 ? kOfLeaf : costs[tree_.nodes[child].first];
  };
  const Costs& left = costs_of(node + 1);
  const Costs& right = costs_of(tree_.nodes[node].right);
  Costs& cost = costs[tree_.nodes[node].first];
  float split_cost[kMaxBranching];
  Choice& choice = choices_[tree_.nodes[node].first];
  for (uint32_t roots = 2; roots <= branching_; ++roots) {
    float best = INFINITY;
    for (uint32_t l = 1; l < roots; ++l) {
      const float sum = left[l - 1] + right[roots - l - 1];
      if (sum >= best) continue;
      best = sum;
      choice.split[roots - 1] = {static_cast<uint8_t>(l), static_cast<uint8_t>(roots - l)};
    }
    split_cost[roots - 1] = best;
  }
  cost[0] = tree_.nodes[node].bounds.half_area() + price + split_cost[branching_ - 1];
  for (uint32_t roots = 2; roots < branching_; ++roots) {
    cost[roots - 1] = split_cost[roots - 1];
    if (cost[roots - 2] > cost[roots - 1]) continue;
    cost[roots - 1] = cost[roots - 2];
    choice.split[roots - 1] = choice.split[roots - 2];
  }
}

void TreeCollapse::add_roots(uint32_t node, Split split, Children& children) const {
  const auto add = [&](uint32_t child, uint32_t roots) {
    const BinaryNode& item = tree_.nodes[child];
    const Split of_child = item.count != 0 ? Split{} : choices_[item.first].split[roots - 1];
    if (of_child.left == 0)
      children.node[children.count++] = child;
    else
      add_roots(child, of_child, children);
  };
  add(node + 1, split.left);
  add(tree_.nodes[node].right, split.right);
}

TreeCollapse::Children TreeCollapse::children(uint32_t node) const {
  Children children;
  add_roots(node, choices_[tree_.nodes[node].first].split[branching_ - 1], children);
  return children;
}

}  // namespace spillway::pipeline
