#include "pipeline/pack/bake_micromap.h"

#include <gtest/gtest.h>

#include <array>

namespace spillway::pipeline {
namespace {

constexpr Float2 kUv[3] = {{0, 0}, {1, 0}, {0, 1}};

// What is baked is baked over uv: an image by place has no uv, and no image is opened for it.
TEST(BakeMicromap, what_uv_does_not_tell_is_left_to_the_shader) {
  TextureNode constant, graph, image;
  graph.kind = TextureKind::scale;
  graph.child[0] = graph.child[1] = 0;
  image.kind = TextureKind::image, image.image = 0;
  const auto unknown = bake_micromap(kUv, 1, std::array{constant, graph}, {}, nullptr);
  ASSERT_TRUE(unknown && !unknown->empty());
  for (const TextureMapping mapping : {TextureMapping::spherical, TextureMapping::cylindrical, TextureMapping::planar}) {
    image.mapping = mapping;
    const auto map = bake_micromap(kUv, 0, {&image, 1}, {}, nullptr);
    ASSERT_TRUE(map);
    EXPECT_EQ(*map, *unknown);
  }
}

TEST(BakeMicromap, a_constant_is_known_all_over) {
  TextureNode node;
  node.value[0] = 1;
  EXPECT_TRUE(bake_micromap(kUv, 0, {&node, 1}, {}, nullptr)->empty());  // opaque: no map
  const auto clear = bake_micromap(kUv, 0, std::array{TextureNode{}}, {}, nullptr);
  node.value[0] = 0.5f;
  const auto half = bake_micromap(kUv, 0, {&node, 1}, {}, nullptr);
  EXPECT_FALSE(clear->empty());
  EXPECT_NE(*clear, *half);
}

}  // namespace
}  // namespace spillway::pipeline
