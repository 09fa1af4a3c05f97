#include "pipeline/render/pair_pool.h"

#include <gtest/gtest.h>

#include <vector>

namespace spillway::pipeline {
namespace {

std::vector<uint32_t> rays_of(const PairPool& pool, const Cell& cell) {
  std::vector<uint32_t> rays;
  pool.for_each_piece(cell, [&](std::span<const Pair> pairs) {
    for (const Pair& pair : pairs) rays.push_back(pair.ray);
  });
  return rays;
}

TEST(PairPool, each_list_gives_back_its_own_pairs_in_order) {
  std::vector<Cell> cells(5, Cell{});
  PairMemory memory;
  PairPool pool(memory, 1 << 14, cells.size());
  std::vector<std::vector<uint32_t>> expected(cells.size());
  for (uint32_t i = 0; i < 9000; ++i) {
    const size_t c = i % 7 % cells.size();
    ASSERT_TRUE(pool.add(cells[c], {i, c == 0 ? 3u : 0u}));
    expected[c].push_back(i);
  }
  for (size_t c = 0; c < cells.size(); ++c) {
    EXPECT_EQ(cells[c].count, expected[c].size());
    EXPECT_EQ(rays_of(pool, cells[c]), expected[c]);
  }
  EXPECT_TRUE(rays_of(pool, Cell{}).empty());
}

TEST(PairPool, what_is_used_up_says_so_and_holds_what_it_took) {
  PairMemory memory;
  PairPool pool(memory, 64, 1);
  Cell cell{};
  uint32_t taken = 0;
  while (pool.add(cell, {taken, 0})) ++taken;
  EXPECT_EQ(taken, 64u);
  EXPECT_EQ(rays_of(pool, cell).size(), 64u);
  EXPECT_FALSE(pool.add(cell, {taken, 0}));
  EXPECT_EQ(cell.count, 64u);
  PairMemory nothing;
  PairPool none(nothing, 0, 10);
  Cell empty{};
  EXPECT_FALSE(none.add(empty, {0, 0}));
}

}  // namespace
}  // namespace spillway::pipeline
