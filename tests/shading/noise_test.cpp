#include "shading/noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

// Roundings of some products of 32-bit floats.
constexpr float kRounding = 2e-5f;

// The numbers below were computed in double precision from the definition in pbrt-v4 (util/noise.cpp, textures.cpp).
TEST(Noise, has_the_values_of_its_definition) {
  EXPECT_NEAR(gradient_noise({0.5f, 0.25f, 0.75f}), -0.375079f, kRounding);
  EXPECT_NEAR(gradient_noise({3.3f, -1.7f, 12.9f}), 0.169584f, kRounding);
  EXPECT_NEAR(gradient_noise({-200.1f, 17.6f, 255.7f}), 0.240089f, 1e-4f);  // 200.1 has four digits behind its point
  EXPECT_NEAR(gradient_noise({0.1f, 0.9f, -0.4f}), 0.059665f, kRounding);
}

TEST(Noise, sums_of_octaves_have_the_values_of_their_definition) {
  struct {
    Float3 p;
    float width, fbm, turbulence, windy;
    Rgb marble;
  } cases[] = {
      {{1.2f, 3.4f, 5.6f}, 0, -0.460009f, 0.729004f, -0.011735f, {0.868631f, 0.868631f, 0.898289f}},
      {{1.2f, 3.4f, 5.6f}, 0.05f, -0.438931f, 0.790971f, -0.011199f, {0.868216f, 0.868216f, 0.897770f}},
      {{-0.3f, 0.7f, 2.2f}, 0.2f, 0.001301f, 0.412126f, 0.000632f, {0.647383f, 0.647383f, 0.741824f}},
      {{-0.3f, 0.7f, 2.2f}, 3, 0, 0.691602f, 0, {0.623301f, 0.623301f, 0.724714f}},
  };
  constexpr float kFineRounding = 2e-4f;  // 1.99^7 times that of a place
  for (const auto& c : cases) {
    EXPECT_NEAR(fractal_noise(c.p, c.width, 0.5f, 8), c.fbm, kFineRounding) << c.width;
    EXPECT_NEAR(turbulence(c.p, c.width, 0.6f, 8), c.turbulence, kFineRounding) << c.width;
    EXPECT_NEAR(windy_waves(c.p, c.width), c.windy, kFineRounding) << c.width;
    const Rgb marble = marble_color(c.p, c.width, {0.5f, 1.5f, 0.4f, 8});
    EXPECT_NEAR(marble.r, c.marble.r, kFineRounding) << c.width;
    EXPECT_NEAR(marble.b, c.marble.b, kFineRounding) << c.width;
  }
}

TEST(Noise, clouds_have_the_values_of_their_definition) {
  struct {
    Float3 p;
    CloudParams cloud;
    float density;
  } cases[] = {
      {{0.31f, 0.62f, 0.17f}, {1, 1, 5}, 0.50801f},
      {{0.31f, 0.62f, 0.17f}, {0.5f, 2, 4}, 0.14416f},
      {{0.2f, 0.45f, 0.7f}, {1, 1, 5}, 0.2787f},
      {{0.2f, 0.45f, 0.7f}, {2, 0, 3}, 0.1f},
      {{0.8f, 0.7f, 0.3f}, {2, 0, 3}, 0.59023f},
      {{0.37f, 0.58f, 0.83f}, {1, 1, 5}, 0},
      {{0.12f, 0.66f, 0.44f}, {0.5f, 2, 4}, 0.0383f},
      {{0.12f, 0.25f, 0.44f}, {1, 0, 0}, 0.5f},
      {{0.12f, -3, 0.44f}, {1, 1, 5}, 1},
      {{0.12f, 1, 0.44f}, {9, 1, 5}, 0},
  };
  // Differences over a hundredth multiply what is rounded off a place by a hundred.
  for (const auto& c : cases)
    EXPECT_NEAR(cloud_density(c.p, c.cloud), c.density, 2e-3f) << c.p.x << ' ' << c.cloud.wispiness;
}

TEST(Noise, dots_lie_where_their_definition_puts_them) {
  const std::pair<Float2, bool> cases[] = {{{0.1f, 0.1f}, false}, {{1, 0}, false},        {{2.1f, 1.9f}, true},
                                           {{3, 5}, true},        {{-1.05f, 2.1f}, true}, {{-4, -4}, true},
                                           {{7.2f, 3.1f}, true}};
  for (const auto& [st, inside] : cases) EXPECT_EQ(is_inside_dot(st), inside) << st.x << ' ' << st.y;
  int count = 0;
  for (int i = 0; i < 256; ++i) count += is_inside_dot({static_cast<float>(i / 16), static_cast<float>(i % 16)});
  EXPECT_EQ(count, 108);
  EXPECT_FALSE(is_inside_dot({2.5f, 2.5f}));  // where four cells meet: out of every dot's reach
}

TEST(Noise, is_zero_at_whole_numbers_smooth_and_repeats) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> place(-50, 50);
  constexpr float kStep = 1.0f / 1024;
  double sum = 0, most = 0;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    const Float3 p{place(engine), place(engine), place(engine)};
    EXPECT_EQ(gradient_noise({std::floor(p.x), std::floor(p.y), std::floor(p.z)}), 0);
    const float value = gradient_noise(p);
    // Gradients are at most root 2 long, and the fade at most 15/8 steep over differences of at most 2.
    EXPECT_LT(std::fabs(gradient_noise(p + Float3{kStep, 0, 0}) - value), 6 * kStep);
    EXPECT_NEAR(gradient_noise(p + Float3{256, -512, 1024}), value, 2e-3f);  // places round to 2^-14 there
    sum += value, most = std::max<double>(most, std::fabs(value));
  }
  EXPECT_NEAR(sum / kSamples, 0, 0.01);  // deviation 0.27, independent at this spacing: five standard errors
  EXPECT_LT(most, 1.05);
  EXPECT_GT(most, 0.7);
}

TEST(Noise, is_finite_anywhere) {
  for (const float far : {1e7f, 1e20f, 3e38f, INFINITY, NAN})
    for (const Float3 p : {Float3{far, 0.3f, 0.3f}, {0.3f, -far, 0.3f}, {far, far, far}}) {
      EXPECT_TRUE(std::isfinite(gradient_noise(p)));
      EXPECT_TRUE(std::isfinite(fractal_noise(p, 0.1f, 0.5f, kMaxOctaves)));
      EXPECT_TRUE(std::isfinite(turbulence(p, INFINITY, 0.5f, kMaxOctaves)));
      EXPECT_TRUE(is_finite(marble_color(p, 0, {})));
      EXPECT_FALSE(is_inside_dot({far, far}) && far > 1e8f);
    }
}

// What a footprint hides does not shift the mean: fading octaves of signed noise leaves it, turbulence keeps its level.
TEST(Noise, octaves_out_of_sight_keep_the_mean) {
  std::mt19937 engine(8);
  std::uniform_real_distribution<float> place(0, 100);
  double fine = 0, coarse = 0, fine_turbulence = 0, coarse_turbulence = 0;
  constexpr int kSamples = 40000;
  for (int i = 0; i < kSamples; ++i) {
    const Float3 p{place(engine), place(engine), place(engine)};
    fine += fractal_noise(p, 0, 0.5f, 6), coarse += fractal_noise(p, 0.2f, 0.5f, 6);
    fine_turbulence += turbulence(p, 0, 0.5f, 6), coarse_turbulence += turbulence(p, 0.2f, 0.5f, 6);
  }
  EXPECT_NEAR(fine / kSamples, 0, 0.01);
  EXPECT_NEAR(coarse / kSamples, 0, 0.01);
  // Six octaves of |noise|, whose mean is 0.2 to within a tenth, and the last counted twice where it fades.
  EXPECT_NEAR(coarse_turbulence / fine_turbulence, 1, 0.2);
}

TEST(Trigonometry, turns_go_round) {
  for (int i = 0; i < 64; ++i) {
    const double turn = i / 64.0;
    for (const double radius : {1e-6, 1.0, 1e6}) {
      const auto x = static_cast<float>(radius * std::cos(2 * M_PI * turn)),
                 y = static_cast<float>(radius * std::sin(2 * M_PI * turn));
      const double off = std::fabs(turn_of(y, x) - turn);
      EXPECT_LT(std::min(off, 1 - off), 1e-6) << i;
    }
  }
  EXPECT_EQ(turn_of(0, 0), 0);
  EXPECT_EQ(turn_of(0, INFINITY), 0);
}

}  // namespace
}  // namespace spillway::shading
