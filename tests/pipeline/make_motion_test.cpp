#include "pipeline/pack/make_motion.h"

#include <gtest/gtest.h>

#include <cstring>

#include "pipeline/check_motion.h"
#include "tests/support/random_motion.h"

namespace spillway::pipeline {
namespace {

using test::Random;
using test::random_affine;
using test::rotation_about;

bool same_bits(const Affine3& a, const Affine3& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

float largest_difference(const Affine3& a, const Affine3& b) {
  float largest = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) largest = std::max(largest, std::fabs(a.m[i][j] - b.m[i][j]));
  return largest;
}

float determinant(const Affine3& a) {
  return dot(cross({a.m[0][0], a.m[0][1], a.m[0][2]}, {a.m[1][0], a.m[1][1], a.m[1][2]}),
             {a.m[2][0], a.m[2][1], a.m[2][2]});
}

Affine3 scaled(float x, float y, float z) {
  Affine3 a;
  a.m[0][0] = x, a.m[1][1] = y, a.m[2][2] = z;
  return a;
}

TEST(Motion, meets_both_keys_exactly_and_stays_there_outside) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Affine3 start = random_affine(random, i % 2 != 0), end = random_affine(random, i % 2 != 0);
    const Result<Motion> motion = make_motion(start, end);
    ASSERT_TRUE(motion) << i << ": " << motion.error().message;
    for (const float time : {0.0f, -1.0f}) ASSERT_TRUE(same_bits(transform_at(*motion, time), start)) << i;
    for (const float time : {1.0f, 7.0f}) ASSERT_TRUE(same_bits(transform_at(*motion, time), end)) << i;
  }
}

// Numbers are up to about 5; parts are rounded to 2^-24 of that, and sines are off by 1e-7.
TEST(Motion, does_not_jump_beside_its_keys) {
  Random random(2);
  for (int i = 0; i < 500; ++i) {
    const Result<Motion> motion = make_motion(random_affine(random, i % 2 != 0), random_affine(random, i % 2 != 0));
    ASSERT_TRUE(motion) << i << ": " << motion.error().message;
    ASSERT_LT(largest_difference(transform_at(*motion, 1e-7f), motion->key[0]), 1e-5f) << i;
    ASSERT_LT(largest_difference(transform_at(*motion, 1 - 1e-7f), motion->key[1]), 1e-5f) << i;
  }
}

TEST(Motion, turns_a_wheel_evenly_and_keeps_it_round) {
  Random random(3);
  for (const double angle_rad : {1e-4, 0.3, 1.0, 2.0, 3.0, 3.14}) {
    const Float3 axis = normalize(random.point(1));
    const Affine3 start = rotation_about(axis, 0.7);
    Affine3 end = rotation_about(axis, 0.7 + angle_rad);
    end.m[0][3] = 5;
    const Result<Motion> motion = make_motion(start, end);
    ASSERT_TRUE(motion) << motion.error().message;
    EXPECT_NEAR(motion->turns * 2 * M_PI, angle_rad, 1e-6);
    for (const float time : {0.1f, 0.25f, 0.5f, 0.8f, 0.99f}) {
      Affine3 wanted = rotation_about(axis, 0.7 + angle_rad * time);
      wanted.m[0][3] = 5 * time;
      EXPECT_LT(largest_difference(transform_at(*motion, time), wanted), 1e-6f) << angle_rad << ' ' << time;
    }
  }
}

TEST(Motion, goes_the_shorter_way_round) {
  const Float3 up{0, 1, 0};
  const Result<Motion> motion = make_motion(Affine3{}, rotation_about(up, 1.5 * M_PI));
  ASSERT_TRUE(motion) << motion.error().message;
  EXPECT_NEAR(motion->turns, 0.25f, 1e-6f);
  EXPECT_LT(largest_difference(transform_at(*motion, 0.5f), rotation_about(up, -0.25 * M_PI)), 1e-6f);
}

TEST(Motion, stretches_and_moves_evenly) {
  Affine3 end = scaled(3, 1, 2);
  end.m[1][3] = -8;
  const Result<Motion> motion = make_motion(scaled(1, 1, 4), end);
  ASSERT_TRUE(motion) << motion.error().message;
  Affine3 wanted = scaled(1.5f, 1, 3.5f);
  wanted.m[1][3] = -2;
  EXPECT_LT(largest_difference(transform_at(*motion, 0.25f), wanted), 1e-6f);
}

TEST(Motion, keeps_the_rotation_proper_when_it_mirrors) {
  Random random(4);
  for (int i = 0; i < 200; ++i) {
    const Result<Motion> motion = make_motion(random_affine(random, true), random_affine(random, true));
    ASSERT_TRUE(motion) << i << ": " << motion.error().message;
    for (const float time : {0.01f, 0.3f, 0.5f, 0.9f}) ASSERT_LT(determinant(transform_at(*motion, time)), 0) << i;
  }
  // A mirror that turns by a right angle turns, as what is not mirrored does.
  const Result<Motion> mirror = make_motion(scaled(-1, -1, -1), [] {
    Affine3 end = rotation_about({0, 0, 1}, M_PI / 2);
    for (auto& row : end.m)
      for (float& x : row) x = -x;
    return end;
  }());
  ASSERT_TRUE(mirror) << mirror.error().message;
  EXPECT_NEAR(mirror->turns, 0.25f, 1e-6f);
}

TEST(Motion, has_an_inverse_at_every_time) {
  Random random(5);
  for (int i = 0; i < 500; ++i) {
    const Result<Motion> motion = make_motion(random_affine(random, i % 2 != 0), random_affine(random, i % 2 != 0));
    ASSERT_TRUE(motion) << i << ": " << motion.error().message;
    const Pose pose = pose_at(*motion, random.in(0, 1));
    const Float3 p = random.point(3);
    // Thirty roundings of coordinates of up to 30, by an inverse of up to about 30.
    ASSERT_LT(length(pose.inverse.point(pose.transform.point(p)) - p), 2e-3f) << i;
  }
}

TEST(Motion, between_keys_that_do_not_allow_it_is_refused) {
  struct Case {
    Affine3 start, end;
    const char* message;
  };
  Affine3 not_finite;
  not_finite.m[1][3] = NAN;
  Affine3 far;
  far.m[0][3] = 1e31f;
  const Case cases[] = {{Affine3{}, scaled(-1, 1, 1), "mirrors at one end"},
                        {Affine3{}, scaled(1, 0, 1), "no finite inverse"},
                        {scaled(1, 1, 1e-7f), Affine3{}, "thin"},
                        {not_finite, Affine3{}, "not finite"},
                        {Affine3{}, far, "too large"}};
  for (const Case& c : cases) {
    const Result<Motion> motion = make_motion(c.start, c.end);
    ASSERT_FALSE(motion) << c.message;
    EXPECT_NE(motion.error().message.find(c.message), std::string::npos) << motion.error().message;
  }
}

TEST(Motion, with_any_number_damaged_is_valid_or_refused) {
  Random random(6);
  const Result<Motion> whole = make_motion(random_affine(random, false), random_affine(random, false));
  ASSERT_TRUE(whole);
  ASSERT_TRUE(check_motion(*whole));
  int refused = 0;
  for (size_t number = 0; number < sizeof(Motion) / sizeof(float); ++number)
    for (const float value : {NAN, INFINITY, -1e30f, 0.0f, 1e-30f, -2.0f}) {
      Motion damaged = *whole;
      std::memcpy(reinterpret_cast<char*>(&damaged) + number * sizeof(float), &value, sizeof value);
      if (!check_motion(damaged)) {
        ++refused;
        continue;
      }
      for (const float time : {0.0f, 0.3f, 0.7f, 1.0f}) {
        Affine3 inverse;
        ASSERT_TRUE(invert(transform_at(damaged, time), inverse)) << number << " = " << value;
      }
    }
  EXPECT_GT(refused, 49 * 4);  // translations may be anything finite that is not too far
}

}  // namespace
}  // namespace spillway::pipeline
