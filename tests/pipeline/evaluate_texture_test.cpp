// Texture graphs without images, and what materials make of them.

#include "pipeline/evaluate_texture.h"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/render/resolve_material.h"

namespace spillway::pipeline {
namespace {

TextureNode constant(float r, float g, float b) {
  TextureNode node;
  node.value[0] = r, node.value[1] = g, node.value[2] = b;
  return node;
}

TextureNode node_of(TextureKind kind, std::initializer_list<uint32_t> children, Float2 scale = {1, 1}) {
  TextureNode node;
  node.kind = kind;
  std::copy(children.begin(), children.end(), node.child);
  node.uv_scale[0] = scale.x, node.uv_scale[1] = scale.y;
  return node;
}

cache::Texel evaluate(std::span<const TextureNode> nodes, Float2 uv, float width = 0) {
  const TextureEvaluator evaluator(nodes, nullptr);
  const TextureQuery query{static_cast<uint32_t>(nodes.size() - 1), uv, width};
  cache::Texel value{};
  TextureEvaluator::Scratch scratch;
  EXPECT_TRUE(evaluator.evaluate({&query, 1}, {&value, 1}, scratch));
  return value;
}

TEST(EvaluateTexture, scale_mix_and_bilerp_do_their_arithmetic) {
  const TextureNode a = constant(0.5f, 2, 3), b = constant(4, 0.25f, 1), half = constant(0.75f, 0, 0);
  const TextureNode product[] = {a, b, node_of(TextureKind::scale, {0, 1})};
  EXPECT_EQ(evaluate(product, {0, 0}).value[0], 2);
  EXPECT_EQ(evaluate(product, {0, 0}).value[1], 0.5f);
  const TextureNode mix[] = {a, b, half, node_of(TextureKind::mix, {0, 1, 2})};
  EXPECT_EQ(evaluate(mix, {0, 0}).value[0], 0.5f * 0.25f + 4 * 0.75f);
  const TextureNode corners[] = {constant(1, 0, 0), constant(2, 0, 0), constant(4, 0, 0), constant(8, 0, 0),
                                 node_of(TextureKind::bilerp, {0, 1, 2, 3})};
  EXPECT_EQ(evaluate(corners, {0, 0}).value[0], 1);
  EXPECT_EQ(evaluate(corners, {0, 1}).value[0], 2);
  EXPECT_EQ(evaluate(corners, {1, 0}).value[0], 4);
  EXPECT_EQ(evaluate(corners, {1, 1}).value[0], 8);
  EXPECT_EQ(evaluate(corners, {0.5f, 0.5f}).value[0], 15 / 4.0f);
}

TEST(EvaluateTexture, a_checkerboard_alternates_on_both_sides_of_zero) {
  const TextureNode board[] = {constant(1, 1, 1), constant(0, 0, 0),
                               node_of(TextureKind::checkerboard, {0, 1}, {2, 4})};
  for (int x = -5; x < 5; ++x)
    for (int y = -5; y < 5; ++y) {
      const Float2 uv{(static_cast<float>(x) + 0.3f) / 2, (static_cast<float>(y) + 0.6f) / 4};
      EXPECT_EQ(evaluate(board, uv).value[0], (x + y) % 2 == 0 ? 1 : 0) << x << ' ' << y;
    }
}

// Against the triangle filter by brute force.
TEST(EvaluateTexture, a_footprint_blurs_a_checkerboard) {
  const TextureNode board[] = {constant(1, 1, 1), constant(0, 0, 0), node_of(TextureKind::checkerboard, {0, 1})};
  for (const float width : {0.05f, 0.2f, 0.5f, 1.3f})
    for (const Float2 uv : {Float2{0.1f, 0.2f}, {-0.45f, 1.05f}, {2.97f, -3.6f}}) {
      const double radius = 1.5 * width;
      constexpr int kSteps = 400;
      double sum = 0, weights = 0;
      for (int i = 0; i < kSteps; ++i)
        for (int j = 0; j < kSteps; ++j) {
          const double dx = (2 * (i + 0.5) / kSteps - 1) * radius, dy = (2 * (j + 0.5) / kSteps - 1) * radius;
          const double weight = (radius - std::fabs(dx)) * (radius - std::fabs(dy));
          const auto cell = static_cast<int>(std::floor(uv.x + dx)) + static_cast<int>(std::floor(uv.y + dy));
          sum += (cell % 2 == 0) * weight, weights += weight;
        }
      EXPECT_NEAR(evaluate(board, uv, width).value[0], sum / weights, 0.005) << width << ' ' << uv.x;
    }
}

TEST(ResolveMaterial, a_normal_map_tilts_the_normal_in_the_frame_of_dpdu) {
  const Float3 n = normalize(Float3{0.2f, -0.3f, 1});
  for (const auto& [texel, tilt] : {std::pair{Float3{0.5f, 0.5f, 1}, Float3{0, 0, 1}},
                                    {Float3{1, 0.5f, 1}, Float3{1, 0, 1}},
                                    {Float3{0.5f, 0.25f, 0.75f}, Float3{0, -0.5f, 0.5f}}}) {
    const TextureNode map = constant(texel.x, texel.y, texel.z);
    const TextureEvaluator textures({&map, 1}, nullptr);
    Material material;
    material.normal_map = 0;
    Mesh mesh{};
    const MaterialResolver resolver({{&mesh, 1}, {&material, 1}, &textures}, 0);
    HitRecord hit{};
    ShadingPoint point{};
    point.normal_geometric = point.normal_shading = n, point.dpdu = {3, 0, 0};
    SurfaceQuery query;
    query.hit = &hit, query.point = &point;
    MaterialResolver::Scratch scratch;
    ASSERT_TRUE(resolver.resolve({&query, 1}, scratch));
    const Float3 x = normalize(point.dpdu - n * dot(n, point.dpdu)), y = cross(n, x);
    const Float3 wanted = normalize(x * tilt.x + y * tilt.y + n * tilt.z);
    EXPECT_LT(length(query.values.normal_shading - wanted), 1e-5f) << tilt.x << ' ' << tilt.y;
  }
}

}  // namespace
}  // namespace spillway::pipeline
