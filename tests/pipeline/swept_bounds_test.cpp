#include "pipeline/pack/swept_bounds.h"

#include <gtest/gtest.h>

#include "pipeline/pack/make_motion.h"
#include "tests/support/random_motion.h"

namespace spillway::pipeline {
namespace {

using test::Random;
using test::random_affine;
using test::rotation_about;

bool contains(const Bounds3& box, Float3 p) {
  for (int a = 0; a < 3; ++a)
    if (p[a] < box.lower[a] || p[a] > box.upper[a]) return false;
  return true;
}

Float3 point_in(const Bounds3& box, Random& random) {
  Float3 p{};
  for (int a = 0; a < 3; ++a)  // a corner as often as not: those are what sticks out
    p[a] = random.below(2) != 0 ? (random.below(2) != 0 ? box.lower[a] : box.upper[a])
                                : random.in(box.lower[a], box.upper[a]);
  return p;
}

TEST(SweptBounds, hold_every_point_at_every_time) {
  Random random(1);
  for (int i = 0; i < 400; ++i) {
    const bool mirrored = random.below(2) != 0;
    const Result<Motion> motion = make_motion(random_affine(random, mirrored), random_affine(random, mirrored));
    ASSERT_TRUE(motion) << motion.error().message;
    Bounds3 box;
    box.grow(random.point(3)), box.grow(random.point(3));
    float times[2] = {random.in(0, 1), random.in(0, 1)};
    if (i % 4 == 0) times[0] = 0, times[1] = 1;
    if (times[0] > times[1]) std::swap(times[0], times[1]);
    const Bounds3 swept = swept_bounds(*motion, times[0], times[1], box);
    for (int k = 0; k < 500; ++k) {
      const float time = std::min(times[1], times[0] + (times[1] - times[0]) * random.in(0, 1));
      const Float3 p = transform_at(*motion, time).point(point_in(box, random));
      ASSERT_TRUE(contains(swept, p)) << i << ' ' << time << ": " << p.x << ' ' << p.y << ' ' << p.z;
    }
  }
}

// A point on a rim reaches its highest place between two samples in time, wherever those are.
TEST(SweptBounds, hold_the_top_of_a_turning_wheel) {
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const double start_rad = random.in(-1.5f, 0), turn_rad = random.in(1.6f, 3.1f);
    const Result<Motion> motion =
        make_motion(rotation_about({0, 0, 1}, start_rad), rotation_about({0, 0, 1}, start_rad + turn_rad));
    ASSERT_TRUE(motion) << motion.error().message;
    Bounds3 point;
    point.grow(Float3{1, 0, 0});
    const auto top = static_cast<float>((M_PI / 2 - start_rad) / turn_rad);  // the time, when there is one
    if (top > 1) continue;
    const Float3 p = transform_at(*motion, top).point({1, 0, 0});
    ASSERT_GE(swept_bounds(*motion, 0, 1, point).upper.y, p.y) << i;
  }
}

TEST(SweptBounds, are_not_much_larger_than_what_they_hold) {
  Bounds3 box;
  box.grow(Float3{-1, -1, -1}), box.grow(Float3{1, 1, 1});
  Affine3 end;
  end.m[0][3] = 10;
  const Result<Motion> straight = make_motion(Affine3{}, end);
  ASSERT_TRUE(straight);
  const Bounds3 line = swept_bounds(*straight, 0.25f, 0.5f, box);
  EXPECT_NEAR(line.lower.x, 1.5f, 1e-4f);
  EXPECT_NEAR(line.upper.x, 6, 1e-4f);
  EXPECT_NEAR(line.upper.y, 1, 1e-4f);
  const Result<Motion> turning = make_motion(Affine3{}, rotation_about({0, 0, 1}, 3));
  ASSERT_TRUE(turning);
  const Bounds3 wheel = swept_bounds(*turning, 0, 1, box);
  EXPECT_NEAR(wheel.upper.x, std::sqrt(2.0f),
              2e-3f);  // h^2/8 (3 rad)^2 sqrt(3) = 5e-4, and a corner's dip between samples
  EXPECT_NEAR(wheel.upper.z, 1, 2e-3f);
}

}  // namespace
}  // namespace spillway::pipeline
