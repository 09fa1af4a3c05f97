// Runs of hits, up and down: what is in media, which blocks are needed, what lies in each.

#include "pipeline/render/hit_runs.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace spillway::test {
namespace {

using namespace pipeline;

// Hits whose records lie the other way round.
struct Hits {
  std::vector<HitRecord> records;
  std::vector<cache::KeyIndex<uint64_t>> order;

  explicit Hits(const std::vector<uint32_t>& prims) : records(prims.size()) {
    for (const uint32_t prim : prims) {
      order.push_back({0, static_cast<uint32_t>(prims.size() - 1 - order.size())});
      records[order.back().index].hit.prim = prim;
    }
  }
  [[nodiscard]] SortedHits sorted() const { return {order, records.data()}; }
};

size_t run_length_of(const std::vector<uint32_t>& prims, bool descends) {
  return run_length(Hits(prims).sorted(), descends);
}

class HitRuns : public testing::Test {
 protected:
  static std::vector<AttributeLocation> four_blocks() {
    std::vector<AttributeLocation> blocks;
    for (const auto& [first, count] : {std::pair{0u, 10u}, {10u, 5u}, {15u, 1u}, {16u, 100u}}) {
      AttributeLocation& block = blocks.emplace_back();
      block.first_prim = first, block.prim_count = count;
    }
    return blocks;
  }
  const std::vector<AttributeLocation> locations_ = four_blocks();
  AttributeStore attributes_{nullptr, locations_};
};

TEST_F(HitRuns, end_where_the_order_does) {
  EXPECT_EQ(run_length_of({3, 3, 5, 9, 4}, false), 4u);
  EXPECT_EQ(run_length_of({9, 5, 5, 3, 4}, true), 4u);
  EXPECT_EQ(run_length_of({9, 5}, false), 1u);
  EXPECT_EQ(run_length_of({}, true), 0u);
}

TEST_F(HitRuns, have_their_media_at_the_end_that_was_sorted_last) {
  std::vector<uint32_t> prims{3, 7, kMediumPrim, kMediumPrim, kMediumPrim};
  const Hits ascending(prims);
  const SurfacesAndMedia up = surfaces_and_media(ascending.sorted(), false);
  EXPECT_EQ(up.surfaces.size(), 2u);
  EXPECT_EQ(up.media.size(), 3u);
  EXPECT_EQ(up.surfaces.front().hit.prim, 3u);
  std::ranges::reverse(prims);
  const Hits descending(prims);
  const SurfacesAndMedia down = surfaces_and_media(descending.sorted(), true);
  EXPECT_EQ(down.surfaces.size(), 2u);
  EXPECT_EQ(down.media.size(), 3u);
  EXPECT_EQ(down.surfaces.front().hit.prim, 7u);
  EXPECT_EQ(down.media.front().hit.prim, kMediumPrim);
  EXPECT_EQ(surfaces_and_media(Hits({8, 2}).sorted(), true).surfaces.size(), 2u);
}

TEST_F(HitRuns, need_the_same_blocks_forwards_and_backwards_each_with_its_own_hits) {
  std::vector<uint32_t> prims{0, 0, 9, 15, 16, 16, 80};
  for (const bool descends : {false, true}) {
    const Hits hits(prims);
    const std::vector<uint32_t> blocks = blocks_touched(hits.sorted(), attributes_, descends);
    EXPECT_EQ(blocks, descends ? (std::vector<uint32_t>{3, 2, 0}) : (std::vector<uint32_t>{0, 2, 3}));
    SortedHits rest = hits.sorted();
    for (const uint32_t block : blocks) {
      const auto in_block = rest.first(hits_in_block(rest, attributes_, block, descends));
      EXPECT_FALSE(in_block.empty());
      for (size_t i = 0; i < in_block.size(); ++i) EXPECT_EQ(attributes_.block_of(in_block[i].hit.prim), block);
      rest = rest.subspan(in_block.size());
    }
    EXPECT_TRUE(rest.empty());
    std::ranges::reverse(prims);
  }
}

}  // namespace
}  // namespace spillway::test
