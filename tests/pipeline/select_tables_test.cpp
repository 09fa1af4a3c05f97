// Tables that settings change, against those of the store.

#include "pipeline/render/select_tables.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

class SelectTables : public testing::Test {
 protected:
  void SetUp() override {
    test::SmallSceneOptions scene;
    scene.has_media = true;
    scene.volume_brick_voxels = 16;  // of eight cells
    auto store = test::pack_small_scene(directory_.path(), "scene", scene);
    ASSERT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
  }

  test::TemporaryDirectory directory_;
  std::unique_ptr<Store> store_;
};

TEST_F(SelectTables, looser_bounds_of_media_are_the_largest_of_their_brick_or_grid) {
  const cache::VolumeTables own = store_->medium_tables().volumes;
  const SelectedMedia same(*store_, MajorantExtent::cell), brick(*store_, MajorantExtent::brick),
      grid(*store_, MajorantExtent::grid);
  EXPECT_EQ(same.tables().volumes.cell_max.data(), own.cell_max.data());
  ASSERT_EQ(brick.tables().volumes.cell_max.size(), own.cell_max.size());
  ASSERT_EQ(grid.tables().volumes.cell_max.size(), own.cell_max.size());
  ASSERT_FALSE(own.grids.empty());
  size_t last_is_largest = 0;
  for (const cache::VolumeGrid& g : own.grids) {
    const size_t cells = cache::brick_cell_count(g.brick_voxels);
    ASSERT_GT(cells, 1u);
    for (size_t b = 0; b < g.brick_total; ++b) {
      const auto bounds = own.cell_max.subspan(g.first_cell + b * cells, cells);
      const float largest = std::ranges::max(bounds);
      last_is_largest += largest > 0 && std::ranges::max(bounds.first(cells - 1)) < largest;
      for (size_t c = 0; c < cells; ++c) {
        EXPECT_EQ(brick.tables().volumes.cell_max[g.first_cell + b * cells + c], largest);
        EXPECT_EQ(grid.tables().volumes.cell_max[g.first_cell + b * cells + c], g.value_max);
      }
    }
  }
  EXPECT_GT(last_is_largest, 0u);  // so that no cell can be left out unseen
}

TEST_F(SelectTables, one_filter_is_that_of_all_textures_and_changes_nothing_else) {
  const SelectedTextures own(*store_, TextureFilter::of_texture), point(*store_, TextureFilter::point),
      bilinear(*store_, TextureFilter::bilinear), trilinear(*store_, TextureFilter::trilinear);
  EXPECT_EQ(own.nodes().data(), store_->textures().data());
  ASSERT_FALSE(own.nodes().empty());
  for (size_t i = 0; i < own.nodes().size(); ++i) {
    EXPECT_EQ(point.nodes()[i].filter, cache::TexelFilter::point);
    EXPECT_EQ(bilinear.nodes()[i].filter, cache::TexelFilter::bilinear);
    EXPECT_EQ(trilinear.nodes()[i].filter, cache::TexelFilter::trilinear);
    EXPECT_EQ(point.nodes()[i].kind, own.nodes()[i].kind);
    EXPECT_EQ(point.nodes()[i].image, own.nodes()[i].image);
  }
}

}  // namespace
}  // namespace spillway::pipeline
