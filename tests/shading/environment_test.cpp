#include "shading/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "shading/light.h"
#include "shading/trigonometry.h"
#include "tests/support/random.h"

namespace spillway::shading {
namespace {

// A map with dark and bright texels, an empty row, and one very bright texel.
struct TestMap {
  explicit TestMap(uint32_t size) : texels(size * size), rows(size + 1), cells(size * (size + 1)) {
    for (uint32_t i = 0; i < size * size; ++i) {
      const float value = i / size == 2 ? 0 : static_cast<float>((i * 2654435761u) >> 24) / 255;
      texels[i] = {value, value / 2, value / 4};
    }
    texels[size * size / 2 + 3] = {300, 200, 100};
    build_environment_cdfs(size, texels, rows, cells);
    map = {size, texels, rows, cells};
  }
  std::vector<Rgb> texels;
  std::vector<float> rows, cells;
  EnvironmentMap map;
};

TEST(Environment, the_arc_tangent_is_one) {
  for (int i = 0; i <= 1000; ++i) {
    const float y = static_cast<float>(i) / 1000;
    EXPECT_NEAR(atan_of_ratio(y, 1), std::atan(static_cast<double>(y)), 6e-8);
  }
}

TEST(Environment, square_and_sphere_are_inverse_to_each_other) {
  test::Random u(5);
  for (int i = 0; i < 20000; ++i) {
    const Float2 square{u(), u()};
    const Float3 w = equal_area_direction(square);
    ASSERT_NEAR(length(w), 1, 1e-6);
    const Float2 back = equal_area_square(w);
    ASSERT_NEAR(back.x, square.x, 2e-6) << square.x << ' ' << square.y;
    ASSERT_NEAR(back.y, square.y, 2e-6) << square.x << ' ' << square.y;
  }
  // pbrt-v4, section 3.8.3: +z in the middle, -z in the corners, +x to the right, +y at larger y.
  EXPECT_LT(length(equal_area_direction({0.5f, 0.5f}) - Float3{0, 0, 1}), 1e-6);
  EXPECT_LT(length(equal_area_direction({0, 0}) - Float3{0, 0, -1}), 1e-6);
  EXPECT_LT(length(equal_area_direction({1, 0.5f}) - Float3{1, 0, 0}), 1e-6);
  EXPECT_LT(length(equal_area_direction({0.5f, 1}) - Float3{0, 1, 0}), 1e-6);
  for (const Float3 w : {Float3{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}}) {
    const Float2 square = equal_area_square(w);
    EXPECT_TRUE(square.x >= 0 && square.x <= 1 && square.y >= 0 && square.y <= 1);
  }
}

// The mean over the square of a function of the direction is its mean over the sphere.
TEST(Environment, the_map_keeps_areas) {
  constexpr int kSteps = 256;
  double z = 0, zz = 0, xy = 0, cap = 0;
  for (int i = 0; i < kSteps * kSteps; ++i) {
    const Float3 w = equal_area_direction(
        {(static_cast<float>(i % kSteps) + 0.5f) / kSteps, (static_cast<float>(i / kSteps) + 0.5f) / kSteps});
    z += w.z, zz += w.z * w.z, xy += w.x * w.y, cap += w.x > 0.6f;
  }
  EXPECT_NEAR(z / (kSteps * kSteps), 0, 1e-4);
  EXPECT_NEAR(zz / (kSteps * kSteps), 1.0 / 3, 1e-4);
  EXPECT_NEAR(xy / (kSteps * kSteps), 0, 1e-4);
  EXPECT_NEAR(cap / (kSteps * kSteps), 0.2, 2e-3);
}

TEST(Environment, texels_are_sampled_as_their_pdf_says_and_by_their_light) {
  const TestMap test(16);
  std::vector<double> seen(256);
  test::Random u(5);
  constexpr int kSamples = 1000000;
  double energy = 0;
  for (int i = 0; i < kSamples; ++i) {
    const Float3 w = sample_environment(test.map, {u(), u()});
    const float pdf = environment_value(test.map, w).pdf_solid_angle;
    ASSERT_GT(pdf, 0);
    energy += environment_value(test.map, w).radiance.r / pdf;
    const Float2 square = equal_area_square(w);
    ++seen[static_cast<size_t>(static_cast<int>(square.y * 16) * 16 + static_cast<int>(square.x * 16))];
  }
  double chi_square = 0, sum = 0, total = 0;
  for (const Rgb t : test.texels) sum += luminance(t), total += t.r;
  int bins = 0;
  for (size_t i = 0; i < 256; ++i) {
    const double wanted = luminance(test.texels[i]) / sum * kSamples;
    if (wanted == 0) {
      EXPECT_EQ(seen[i], 0);
    }
    if (wanted < 20) continue;
    chi_square += (seen[i] - wanted) * (seen[i] - wanted) / wanted, ++bins;
  }
  EXPECT_GT(bins, 150);
  EXPECT_LT((chi_square - bins) / std::sqrt(2.0 * bins),
            5);  // normal approximation, five deviations; the seed is fixed
  EXPECT_NEAR(energy / kSamples, total * 4 * M_PI / 256, total * 4 * M_PI / 256 * 1e-3);
}

TEST(Environment, a_dark_map_is_sampled_evenly) {
  const std::vector<Rgb> texels(16, {0, 0, 0});
  std::vector<float> rows(5), cells(20);
  build_environment_cdfs(4, texels, rows, cells);
  const EnvironmentMap map{4, texels, rows, cells};
  EXPECT_NEAR(environment_value(map, {0, 0, 1}).pdf_solid_angle, 1 / (4 * M_PI), 1e-6);
  EXPECT_EQ(rows[4], 1);
}

// Image and constant light together: the density of a sample is that of a chance hit, bit for bit, and estimates agree
// with the sum of both.
TEST(Environment, an_image_in_the_light_table_is_turned_and_weighed) {
  const TestMap test(16);
  Light image{}, constant{};
  image.kind = constant.kind = LightKind::infinite;
  image.radiance = {2, 2, 2}, constant.radiance = {0.1f, 0.2f, 0.3f};
  image.image = 1;
  image.position = {0, 1, 0}, image.edge1 = {0, 0, 1}, image.edge2 = {1, 0, 0};
  const std::vector<Light> lights{constant, image};
  const std::vector<float> cdf{0, 0.25f, 1};
  LightTable table;
  table.lights = lights, table.cdf = cdf, table.first_infinite = 0, table.environment = test.map;
  EXPECT_EQ(infinite_value(table, {0, 0, 0}, {1, 0, 0}).radiance.r,
            0.1f + 2 * environment_value(test.map, {0, 0, 1}).radiance.r);
  test::Random u(5);
  double sum = 0;
  constexpr int kSamples = 400000;
  for (int i = 0; i < kSamples; ++i) {
    const float select = u();
    const LightSample s = sample_light(table, {{0, 0, 0}}, {select, 0}, {u(), u()});
    ASSERT_EQ(s.pdf_solid_angle, infinite_value(table, {0, 0, 0}, s.w_next_world).pdf_solid_angle);
    ASSERT_EQ(s.radiance.g, infinite_value(table, {0, 0, 0}, s.w_next_world).radiance.g);
    ASSERT_NEAR(length(s.w_next_world), 1, 1e-5);
    sum += s.radiance.g / s.pdf_solid_angle;
  }
  double total = 0;
  for (const Rgb t : test.texels) total += t.g;
  const double wanted = 2 * total * 4 * M_PI / 256 + 0.2 * 4 * M_PI;
  EXPECT_NEAR(sum / kSamples, wanted, wanted * 0.01);
}

}  // namespace
}  // namespace spillway::shading
