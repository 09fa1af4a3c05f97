// Runs of hits, up and down: what is in media, which blocks are needed, what lies in each.

#include "pipeline/render/hit_runs.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace spillway::test {
namespace {

using namespace pipeline;

std::vector<HitRecord> hits_of(const std::vector<uint32_t>& prims) {
  std::vector<HitRecord> hits(prims.size());
  for (size_t i = 0; i < prims.size(); ++i) hits[i].hit.prim = prims[i];
  return hits;
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
  EXPECT_EQ(run_length(hits_of({3, 3, 5, 9, 4}), false), 4u);
  EXPECT_EQ(run_length(hits_of({9, 5, 5, 3, 4}), true), 4u);
  EXPECT_EQ(run_length(hits_of({9, 5}), false), 1u);
  EXPECT_EQ(run_length({}, true), 0u);
}

TEST_F(HitRuns, have_their_media_at_the_end_that_was_sorted_last) {
  std::vector<HitRecord> hits = hits_of({3, 7, kMediumPrim, kMediumPrim, kMediumPrim});
  const SurfacesAndMedia up = surfaces_and_media(hits, false);
  EXPECT_EQ(up.surfaces.size(), 2u);
  EXPECT_EQ(up.media.size(), 3u);
  EXPECT_EQ(up.surfaces.data(), hits.data());
  std::ranges::reverse(hits);
  const SurfacesAndMedia down = surfaces_and_media(hits, true);
  EXPECT_EQ(down.surfaces.size(), 2u);
  EXPECT_EQ(down.media.size(), 3u);
  EXPECT_EQ(down.media.data(), hits.data());
  EXPECT_EQ(surfaces_and_media(hits_of({8, 2}), true).surfaces.size(), 2u);
}

TEST_F(HitRuns, need_the_same_blocks_forwards_and_backwards_each_with_its_own_hits) {
  std::vector<uint32_t> prims{0, 0, 9, 15, 16, 16, 80};
  for (const bool descends : {false, true}) {
    const std::vector<HitRecord> hits = hits_of(prims);
    const std::vector<uint32_t> blocks = blocks_touched(hits, attributes_, descends);
    EXPECT_EQ(blocks, descends ? (std::vector<uint32_t>{3, 2, 0}) : (std::vector<uint32_t>{0, 2, 3}));
    std::span<const HitRecord> rest = hits;
    for (const uint32_t block : blocks) {
      const auto in_block = rest.first(hits_in_block(rest, attributes_, block, descends));
      EXPECT_FALSE(in_block.empty());
      for (const HitRecord& hit : in_block) EXPECT_EQ(attributes_.block_of(hit.hit.prim), block);
      rest = rest.subspan(in_block.size());
    }
    EXPECT_TRUE(rest.empty());
    std::ranges::reverse(prims);
  }
}

}  // namespace
}  // namespace spillway::test
