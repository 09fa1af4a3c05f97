#include "pipeline/pack/collapse_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <numeric>
#include <random>

namespace spillway::pipeline {
namespace {

std::vector<Bounds3> random_boxes(size_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-10, 10), size(0, 2);
  std::vector<Bounds3> boxes(count);
  for (Bounds3& box : boxes) {
    box.lower = {place(random), place(random), place(random)};
    box.upper = box.lower + Float3{size(random), size(random), size(random)};
  }
  return boxes;
}

BinaryTree tree_of(const std::vector<Bounds3>& boxes, uint32_t leaf_items, bool in_halves = false) {
  std::vector<uint32_t> items(boxes.size());
  std::iota(items.begin(), items.end(), 0u);
  BinaryTree tree;
  cut_few(boxes, items, leaf_items, in_halves, tree);
  return tree;
}

// Surfaces of the nodes that stay, and how many these are.
struct Cost {
  double surface = 0;
  size_t nodes = 0;
};

Cost cost_of(const BinaryTree& tree, const TreeCollapse& collapse, uint32_t node) {
  if (tree.nodes[node].count != 0) return {};
  Cost cost{tree.nodes[node].bounds.half_area(), 1};
  const TreeCollapse::Children children = collapse.children(node);
  for (uint32_t c = 0; c < children.count; ++c) {
    const Cost below = cost_of(tree, collapse, children.node[c]);
    cost.surface += below.surface, cost.nodes += below.nodes;
  }
  return cost;
}

// The least that any choice costs, by trying all: what each node that could stay costs, in order from the last.
double least_cost(const BinaryTree& tree, uint32_t branching, double price) {
  std::vector<double> stays(tree.nodes.size(), 0);
  const std::function<double(uint32_t, uint32_t)> roots = [&](uint32_t node, uint32_t most) -> double {
    double best = stays[node];  // by itself
    if (tree.nodes[node].count != 0) return best;
    for (uint32_t left = 1; left < most; ++left)
      best = std::min(best, roots(node + 1, left) + roots(tree.nodes[node].right, most - left));
    return best;
  };
  for (auto node = static_cast<uint32_t>(tree.nodes.size()); node-- > 0;) {
    if (tree.nodes[node].count != 0) continue;
    double best = INFINITY;
    for (uint32_t left = 1; left < branching; ++left)
      best = std::min(best, roots(node + 1, left) + roots(tree.nodes[node].right, branching - left));
    stays[node] = tree.nodes[node].bounds.half_area() + price + best;
  }
  return stays[0];
}

TEST(cut_few, every_box_is_in_one_leaf_and_every_node_around_its_own) {
  for (const uint32_t leaf_items : {1u, 3u, 4u}) {
    for (const size_t count : {size_t{1}, size_t{5}, size_t{31}, kFewItems}) {
      const std::vector<Bounds3> boxes = random_boxes(count, static_cast<uint32_t>(count));
      const BinaryTree tree = tree_of(boxes, leaf_items);
      std::vector<uint32_t> items = tree.items;
      std::sort(items.begin(), items.end());
      for (uint32_t i = 0; i < count; ++i) ASSERT_EQ(items[i], i);
      ASSERT_EQ(items.size(), count);
      for (size_t n = 0; n < tree.nodes.size(); ++n) {
        const BinaryNode& node = tree.nodes[n];
        EXPECT_LE(node.count, leaf_items);
        Bounds3 around;
        for (uint32_t i = 0; i < node.count; ++i) around.grow(boxes[tree.items[node.first + i]]);
        if (node.count == 0) around = tree.nodes[n + 1].bounds, around.grow(tree.nodes[node.right].bounds);
        EXPECT_EQ(around.lower, node.bounds.lower);
        EXPECT_EQ(around.upper, node.bounds.upper);
      }
    }
  }
}

TEST(cut_few, leaves_are_full_where_no_cut_is_better_than_another) {
  std::vector<Bounds3> row(kFewItems - 1);
  for (size_t i = 0; i < row.size(); ++i) {
    const auto x = static_cast<float>(i);
    row[i] = {{x, 0, 0}, {x + 1, 1, 1}};
  }
  const BinaryTree tree = tree_of(row, 4);
  EXPECT_EQ(tree.nodes.size(), 2 * (kFewItems / 4) - 1);
}

TEST(cut_few, boxes_that_shrink_by_halves_make_a_deep_tree_unless_cut_in_halves) {
  std::vector<Bounds3> boxes;
  for (int i = 0; i < 60; ++i)
    boxes.push_back({{0, 0, 0}, {std::ldexp(1.0f, -i), std::ldexp(1.0f, -i), std::ldexp(1.0f, -i)}});
  const std::function<int(const BinaryTree&, uint32_t)> depth = [&](const BinaryTree& tree, uint32_t node) -> int {
    if (tree.nodes[node].count != 0) return 1;
    return 1 + std::max(depth(tree, node + 1), depth(tree, tree.nodes[node].right));
  };
  EXPECT_GT(depth(tree_of(boxes, 1), 0), 20);  // balanced it would be 7
  EXPECT_LE(depth(tree_of(boxes, 1, true), 0), 7);
}

TEST(cut_few, many_in_halves_are_logarithmically_deep) {
  const std::vector<Bounds3> boxes = random_boxes(5000, 3);
  const BinaryTree tree = cut_all_in_halves(boxes, 4);
  std::vector<uint32_t> items = tree.items;
  std::sort(items.begin(), items.end());
  ASSERT_EQ(items.size(), boxes.size());
  for (uint32_t i = 0; i < items.size(); ++i) ASSERT_EQ(items[i], i);
  const std::function<int(uint32_t)> depth = [&](uint32_t node) -> int {
    if (tree.nodes[node].count != 0) return 1;
    return 1 + std::max(depth(node + 1), depth(tree.nodes[node].right));
  };
  EXPECT_LE(depth(0), 14);
}

TEST(collapse_tree, no_choice_of_nodes_costs_less) {
  for (uint32_t seed = 0; seed < 20; ++seed) {
    const std::vector<Bounds3> boxes = random_boxes(12 + seed % 5, seed);
    const BinaryTree tree = tree_of(boxes, 1);
    const double price = kNodePrice * tree.nodes[0].bounds.half_area() / static_cast<double>(tree.inner_count + 1);
    for (const uint32_t branching : {2u, 3u, 5u, 8u}) {
      const TreeCollapse collapse(tree, branching);
      const Cost cost = cost_of(tree, collapse, 0);
      const double least = least_cost(tree, branching, price);
      // Sums of some twenty floats.
      EXPECT_NEAR(cost.surface + price * static_cast<double>(cost.nodes), least, 1e-5 * least)
          << seed << " " << branching;
    }
  }
}

TEST(collapse_tree, every_leaf_stays_once) {
  for (uint32_t seed = 0; seed < 5; ++seed) {
    const BinaryTree tree = tree_of(random_boxes(kFewItems, seed), 1);
    for (const uint32_t branching : {2u, 4u, 8u}) {
      const TreeCollapse collapse(tree, branching);
      std::vector<int> seen(tree.nodes.size(), 0);
      const std::function<void(uint32_t)> visit = [&](uint32_t node) {
        ++seen[node];
        if (tree.nodes[node].count != 0) return;
        const TreeCollapse::Children children = collapse.children(node);
        EXPECT_GE(children.count, 2u);
        EXPECT_LE(children.count, branching);
        for (uint32_t c = 0; c < children.count; ++c) visit(children.node[c]);
      };
      visit(0);
      for (size_t n = 0; n < tree.nodes.size(); ++n)
        EXPECT_TRUE(tree.nodes[n].count != 0 ? seen[n] == 1 : seen[n] <= 1) << n;
    }
  }
}

}  // namespace
}  // namespace spillway::pipeline
