// Matrix conventions: columns as pbrt writes them, left-handed views, right-hand rotations.

#include "tools/import/transform.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace spillway::tools {
namespace {

void expect_near(Vec3 got, Vec3 want, double tolerance) {
  EXPECT_NEAR(got.x, want.x, tolerance);
  EXPECT_NEAR(got.y, want.y, tolerance);
  EXPECT_NEAR(got.z, want.z, tolerance);
}
constexpr double kRounding = 1e-14;  // a few operations on numbers near one

TEST(transform, look_at_puts_the_target_on_z_and_right_to_the_right) {
  // From +z looking at the origin, y up: right is up x view = -x of the world, since pbrt is left-handed.
  const Transform camera_from_world = *look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0});
  expect_near(camera_from_world.point({0, 0, 5}), {0, 0, 0}, kRounding);
  expect_near(camera_from_world.point({0, 0, 0}), {0, 0, 5}, kRounding);
  expect_near(camera_from_world.vector({0, 1, 0}), {0, 1, 0}, kRounding);
  expect_near(camera_from_world.vector({-1, 0, 0}), {1, 0, 0}, kRounding);
  EXPECT_NEAR(camera_from_world.determinant(), 1, kRounding);  // no mirroring between world and camera
}

TEST(transform, look_at_needs_no_perpendicular_up) {
  const Transform t = *look_at({1, 2, 3}, {4, 1, 0}, {0, 7, 1});
  const double distance = std::sqrt(9.0 + 1 + 9);
  expect_near(t.point({4, 1, 0}), {0, 0, distance}, 1e-13);
  EXPECT_NEAR(t.vector({0, 7, 1}).x, 0, 1e-13);
  EXPECT_GT(t.vector({0, 7, 1}).y, 0);
  EXPECT_TRUE(t.keeps_angles());
}

TEST(transform, rotations_follow_the_right_hand) {
  expect_near(rotation(90, {0, 0, 2})->vector({1, 0, 0}), {0, 1, 0}, kRounding);
  expect_near(rotation(90, {1, 0, 0})->vector({0, 1, 0}), {0, 0, 1}, kRounding);
  expect_near(rotation(90, {0, 1, 0})->vector({0, 0, 1}), {1, 0, 0}, kRounding);
  expect_near(rotation(120, {1, 1, 1})->vector({1, 0, 0}), {0, 1, 0}, kRounding);
}

TEST(transform, sixteen_numbers_are_columns) {
  const double numbers[16] = {1, 2, 3, 0, 4, 5, 6, 0, 7, 8, 10, 0, 11, 12, 13, 1};
  const Transform t = *from_columns(numbers);
  expect_near(t.point({0, 0, 0}), {11, 12, 13}, 0);
  expect_near(t.vector({1, 0, 0}), {1, 2, 3}, 0);
  expect_near(t.vector({0, 0, 1}), {7, 8, 10}, 0);
  const double doubled[16] = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 2, 4, 6, 2};  // homogeneous: w = 2
  expect_near(from_columns(doubled)->point({1, 1, 1}), {2, 3, 4}, 0);
}

TEST(transform, products_apply_the_right_one_first) {
  const Transform t = translation({1, 0, 0}) * scaling({2, 2, 2});
  expect_near(t.point({1, 1, 1}), {3, 2, 2}, 0);
}

TEST(transform, inverse_undoes_and_its_transpose_keeps_normals_perpendicular) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-2, 2);
  for (int i = 0; i < 100; ++i) {
    Transform t;
    for (auto& row : t.m) {
      for (double& x : row) x = uniform(random);
    }
    if (std::fabs(t.determinant()) < 0.1) continue;  // badly conditioned: rounding would need its own tolerance
    const Transform inverse = t.inverse();
    expect_near(inverse.point(t.point({1, 2, 3})), {1, 2, 3}, 1e-12);  // condition numbers up to about 1e3
    const Vec3 edge = t.vector({1, 1, 0}), normal = inverse.transposed_vector({1, -1, 5});
    EXPECT_NEAR(edge.x * normal.x + edge.y * normal.y + edge.z * normal.z, 0, 1e-12);
  }
}

TEST(transform, thin_scales_are_invertible_and_flat_ones_are_not) {
  EXPECT_TRUE(scaling({1, 1, 1e-9}).is_invertible());
  EXPECT_TRUE(scaling({1e-9, 1e-9, 1e-9}).is_invertible());
  EXPECT_TRUE(scaling({-1, 1, 1}).is_invertible());
  EXPECT_FALSE(scaling({0, 1, 1}).is_invertible());
  Transform flat;
  flat.m[2][0] = 1, flat.m[2][1] = 1, flat.m[2][2] = 0;  // rows 0 and 1 add up to row 2
  EXPECT_FALSE(flat.is_invertible());
  Transform infinite;
  infinite.m[0][3] = INFINITY;
  EXPECT_FALSE(infinite.is_invertible());
}

TEST(transform, angles_survive_rotation_mirroring_and_one_scale) {
  EXPECT_TRUE((scaling({-3, 3, 3}) * *rotation(33, {1, 2, 3})).keeps_angles());
  EXPECT_FALSE(scaling({1, 1, 1.01}).keeps_angles());
  Transform shear;
  shear.m[0][1] = 0.01;
  EXPECT_FALSE(shear.keeps_angles());
}

}  // namespace
}  // namespace spillway::tools
