// Texture graphs without images, and what materials make of them.

#include "pipeline/evaluate_texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "pipeline/render/resolve_material.h"
#include "shading/noise.h"

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

// ---- textures by place ----

ShadingPoint at_place(Float3 position, float width = 0) {
  ShadingPoint point{};
  point.position = position, point.normal_geometric = point.normal_shading = {0, 0, 1};
  point.dpdu = {2, 0, 0}, point.dpdv = {0, 3, 0};
  point.width_world = point.width_uv = width;
  return point;
}

cache::Texel evaluate_at(std::span<const TextureNode> nodes, const ShadingPoint& point, Float2 uv = {0, 0}) {
  const TextureEvaluator evaluator(nodes, nullptr);
  const TextureQuery query{static_cast<uint32_t>(nodes.size() - 1), uv, point.width_uv, &point};
  cache::Texel value{};
  TextureEvaluator::Scratch scratch;
  EXPECT_TRUE(evaluator.evaluate({&query, 1}, {&value, 1}, scratch));
  return value;
}

// s + 10 t: bilinear interpolation without bounds says where st is.
std::vector<TextureNode> coordinates(TextureMapping mapping, const Affine3& texture_from_world) {
  std::vector<TextureNode> nodes{constant(0, 0, 0), constant(10, 0, 0), constant(1, 0, 0), constant(11, 0, 0),
                                 node_of(TextureKind::bilerp, {0, 1, 2, 3})};
  nodes.back().mapping = mapping, nodes.back().texture_from_world = texture_from_world;
  return nodes;
}

TEST(EvaluateTexture, mappings_take_the_place_in_the_textures_own_space) {
  const Affine3 moved{{{0, 1, 0, -2}, {-1, 0, 0, 0}, {0, 0, 0.5f, 1}}};  // turned about z, moved, z halved
  for (const Float3 p : {Float3{1, 2, 3}, {-0.5f, 4, -6}, {2, 1.5f, 0.25f}}) {
    const Float3 t = moved.point(p);
    const double r = length(t), phi = std::atan2(t.y, t.x);
    const double turn = phi < 0 ? phi / (2 * M_PI) + 1 : phi / (2 * M_PI);
    const auto value = [&](TextureMapping mapping) {
      return evaluate_at(coordinates(mapping, moved), at_place(p)).value[0];
    };
    EXPECT_NEAR(value(TextureMapping::planar), t.x + 10 * t.y, 1e-5);
    EXPECT_NEAR(value(TextureMapping::cylindrical), (phi + M_PI) / (2 * M_PI) + 10 * t.z, 1e-5);
    EXPECT_NEAR(value(TextureMapping::spherical), std::acos(t.z / r) / M_PI + 10 * turn, 1e-5);
  }
}

// Where a solid checkerboard is unlike at two places a footprint apart, it is grey in between.
TEST(EvaluateTexture, a_solid_checkerboard_has_cells_in_three_dimensions) {
  TextureNode board = node_of(TextureKind::checkerboard, {0, 1});
  board.mapping = TextureMapping::solid;
  board.texture_from_world = {{{2, 0, 0, 0}, {0, 4, 0, 0}, {0, 0, 1, 0}}};
  const TextureNode nodes[] = {constant(1, 1, 1), constant(0, 0, 0), board};
  for (int x = -3; x < 3; ++x)
    for (int y = -3; y < 3; ++y)
      for (int z = -3; z < 3; ++z) {
        const Float3 p{(static_cast<float>(x) + 0.4f) / 2, (static_cast<float>(y) + 0.5f) / 4,
                       static_cast<float>(z) + 0.6f};
        EXPECT_EQ(evaluate_at(nodes, at_place(p)).value[0], (x + y + z) % 2 == 0 ? 1 : 0);
      }
  EXPECT_NEAR(evaluate_at(nodes, at_place({0, 0.125f, 0.5f}, 0.1f)).value[0], 0.5f, 1e-5);  // on a wall between two
  // The filter is three footprints wide, 0.6 units here where a cell is a quarter: nothing but grey is left.
  EXPECT_NEAR(evaluate_at(nodes, at_place({0.2f, 0.1f, 0.5f}, 1)).value[0], 0.5f, 0.03f);
}

TEST(EvaluateTexture, noise_is_solid_and_blurred_by_the_footprint) {
  TextureNode noise;
  noise.kind = TextureKind::fbm, noise.mapping = TextureMapping::solid;
  noise.value[0] = 0.5f, noise.value[1] = 8;
  noise.texture_from_world = {{{3, 0, 0, 0}, {0, 3, 0, 0}, {0, 0, 3, 1}}};
  const Float3 p{0.3f, -0.2f, 0.8f};
  const TextureNode nodes[] = {noise};
  const Float3 there = noise.texture_from_world.point(p);
  EXPECT_EQ(evaluate_at(nodes, at_place(p)).value[0], shading::fractal_noise(there, 0, 0.5f, 8));
  EXPECT_EQ(evaluate_at(nodes, at_place(p, 0.01f)).value[0], shading::fractal_noise(there, 3 * 0.01f, 0.5f, 8));
  EXPECT_EQ(evaluate_at(nodes, at_place(p, 100)).value[0], 0);
}

TEST(EvaluateTexture, a_direction_mix_takes_its_first_texture_along_the_direction) {
  TextureNode mix = node_of(TextureKind::direction_mix, {0, 1});
  mix.value[0] = 0.6f, mix.value[1] = 0, mix.value[2] = 0.8f;
  const TextureNode nodes[] = {constant(1, 0, 0), constant(0, 0, 0), mix};
  ShadingPoint point = at_place({0, 0, 0});
  EXPECT_FLOAT_EQ(evaluate_at(nodes, point).value[0], 0.8f);
  point.normal_geometric = {-0.6f, 0, -0.8f};
  EXPECT_FLOAT_EQ(evaluate_at(nodes, point).value[0], 1);
  point.normal_geometric = {0.8f, 0, -0.6f};
  EXPECT_FLOAT_EQ(evaluate_at(nodes, point).value[0], 0);
}

TEST(EvaluateTexture, dots_choose_one_of_two_textures) {
  const TextureNode nodes[] = {constant(3, 0, 0), constant(7, 0, 0), node_of(TextureKind::dots, {0, 1}, {2, 1})};
  EXPECT_EQ(evaluate(nodes, {1.05f, 1.9f}).value[0], 3);  // st (2.1, 1.9)
  EXPECT_EQ(evaluate(nodes, {1.25f, 2.5f}).value[0], 7);
}

TEST(EvaluateTexture, what_is_not_finite_is_looked_up_at_the_origin) {
  const TextureNode board[] = {constant(1, 1, 1), constant(0, 0, 0),
                               node_of(TextureKind::checkerboard, {0, 1}, {3e38f, 1})};
  EXPECT_EQ(evaluate(board, {10, 0.5f}).value[0], 1);
  TextureNode noise;
  noise.kind = TextureKind::marble, noise.mapping = TextureMapping::solid;
  noise.value[2] = 1, noise.texture_from_world.m[0][0] = 3e38f;
  EXPECT_TRUE(std::isfinite(evaluate_at({&noise, 1}, at_place({1e5f, 0, 0})).value[0]));
}

// A bump by a texture that knows nothing of uv: looked up where the surface would be a step along u, and along v.
TEST(ResolveMaterial, a_solid_bump_tilts_the_normal_by_its_slope) {
  const Affine3 slope{{{0.25f, -0.5f, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}}};  // s = x / 4 - y / 2 is the height
  const std::vector<TextureNode> nodes{constant(0, 0, 0), constant(0, 0, 0), constant(1, 0, 0), constant(1, 0, 0), [&] {
                                         TextureNode n = node_of(TextureKind::bilerp, {0, 1, 2, 3});
                                         n.mapping = TextureMapping::planar, n.texture_from_world = slope;
                                         return n;
                                       }()};
  const TextureEvaluator textures(nodes, nullptr);
  Material material;
  material.displacement = 4;
  Mesh mesh{};
  const MaterialResolver resolver({{&mesh, 1}, {&material, 1}, &textures}, 0);
  HitRecord hit{};
  const ShadingPoint point = at_place({5, 6, 7}, 0.01f);
  SurfaceQuery query;
  query.hit = &hit, query.point = &point;
  MaterialResolver::Scratch scratch;
  ASSERT_TRUE(resolver.resolve({&query, 1}, scratch));
  EXPECT_LT(length(query.values.normal_shading - normalize(Float3{-0.25f, 0.5f, 1})), 1e-3f);
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
