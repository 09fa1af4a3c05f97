#include "shading/portal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "shading/light.h"
#include "tests/support/chi_square.h"
#include "tests/support/random.h"

namespace spillway::shading {
namespace {

// A skylight of two by two, two above the origin: it looks up.
const Portal kSkylight{{-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, 0};

TEST(Portal, is_looked_through_from_below_and_inside_its_edges_alone) {
  EXPECT_TRUE(looks_through(kSkylight, {0, 0, 0}, {0, 0, 1}));
  EXPECT_TRUE(looks_through(kSkylight, {0.9f, -0.9f, -7}, {0, 0, 1}));
  EXPECT_TRUE(looks_through(kSkylight, {0, 0, 0}, normalize(Float3{0.99f, 0, 2})));
  EXPECT_FALSE(looks_through(kSkylight, {0, 0, 0}, normalize(Float3{1.01f, 0, 2})));
  EXPECT_FALSE(looks_through(kSkylight, {0, 0, 0}, normalize(Float3{0, -1.01f, 2})));
  EXPECT_FALSE(looks_through(kSkylight, {0, 0, 0}, {0, 0, -1}));
  EXPECT_FALSE(looks_through(kSkylight, {0, 0, 3}, {0, 0, 1}));   // beyond it
  EXPECT_FALSE(looks_through(kSkylight, {0, 0, 3}, {0, 0, -1}));  // from outside
  EXPECT_FALSE(looks_through(kSkylight, {0, 0, 2}, {1, 0, 0}));
}

// Cells of its area: each is a share of the samples, and of the density over its solid angle.
TEST(Portal, points_are_uniform_and_have_the_density_that_is_said) {
  constexpr int kCells = 12, kSamples = 200000;
  const Float3 from{0.4f, -0.2f, 0.5f};
  std::vector<double> seen(kCells * kCells);
  test::Random u(17);
  double solid_angle = 0;
  for (int i = 0; i < kSamples; ++i) {
    const float x = u();
    const Float3 w = sample_portal(kSkylight, from, {x, u()});
    const float pdf = portal_pdf_solid_angle(kSkylight, from, w);
    if (pdf == 0) continue;  // on the very edge
    solid_angle += 1 / pdf;
    const Float3 at = from + w * ((2 - from.z) / w.z);
    const auto cell = [](float c) { return std::min(kCells - 1, static_cast<int>((c + 1) / 2 * kCells)); };
    ++seen[static_cast<size_t>(cell(at.x) * kCells + cell(at.y))];
  }
  test::ChiSquare chi_square;
  for (const double count : seen) chi_square.add(count, static_cast<double>(kSamples) / (kCells * kCells));
  EXPECT_LT(chi_square.deviations(), 5);
  double wanted = 0;  // the rectangle's solid angle on a grid
  constexpr int kGrid = 400;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const double x = -1 + 2 * (i % kGrid + 0.5) / kGrid - 0.4, y = -1 + 2 * (i / kGrid + 0.5) / kGrid + 0.2, z = 1.5;
    wanted += z / std::pow(x * x + y * y + z * z, 1.5) * 4 / (kGrid * kGrid);
  }
  EXPECT_NEAR(solid_angle / kSamples, wanted, 0.003 * wanted);  // four standard errors
  EXPECT_EQ(portal_pdf_solid_angle(kSkylight, from, {0, 0, -1}), 0);
}

struct Skies {
  std::vector<Light> lights;
  std::vector<float> cdf{0, 0.25f, 1};
  std::vector<Portal> portals{kSkylight};
  // Two even skies; the second is seen through the portal.
  Skies() : lights(2) {
    for (Light& light : lights) light = Light{}, light.kind = LightKind::infinite;
    lights[0].radiance = {0.1f, 0.1f, 0.1f}, lights[1].radiance = {2, 2, 2};
    portals[0].light = 1;
  }
  [[nodiscard]] LightTable table() const {
    LightTable t;
    t.lights = lights, t.cdf = cdf, t.portals = portals;
    return t;
  }
};

TEST(Portal, hides_its_light_beside_it_and_no_other) {
  const Skies skies;
  EXPECT_FLOAT_EQ(infinite_value(skies.table(), {0, 0, 0}, {0, 0, 1}).radiance.g, 2.1f);
  EXPECT_FLOAT_EQ(infinite_value(skies.table(), {0, 0, 0}, {1, 0, 0}).radiance.g, 0.1f);
  EXPECT_FLOAT_EQ(infinite_value(skies.table(), {9, 0, 0}, {0, 0, 1}).radiance.g, 0.1f);
}

// Sampling by itself, chance by itself, and both together: the irradiance that is known in closed form.
TEST(Portal, every_strategy_brings_the_same_light) {
  const Skies skies;
  test::Random u(17);
  constexpr int kSamples = 400000;
  double sampled = 0, met = 0, both = 0;
  for (int i = 0; i < kSamples; ++i) {
    const float select = u(), x = u();
    const LightSample s = sample_light(skies.table(), {{0, 0, 0}, 0}, {select, 0.5f}, {x, u()});
    ASSERT_EQ(s.pdf_solid_angle, infinite_value(skies.table(), {0, 0, 0}, s.w_next_world).pdf_solid_angle);
    ASSERT_EQ(s.radiance.g, infinite_value(skies.table(), {0, 0, 0}, s.w_next_world).radiance.g);
    const auto cosine_pdf = [](Float3 w) { return std::max(0.0f, w.z) / static_cast<float>(M_PI); };
    const double direct = s.radiance.g * std::max(0.0f, s.w_next_world.z) / s.pdf_solid_angle;
    sampled += direct, both += direct * power_heuristic(s.pdf_solid_angle, cosine_pdf(s.w_next_world));
    const float z = std::sqrt(u()), phi = static_cast<float>(2 * M_PI) * u(), r = std::sqrt(1 - z * z);
    const Float3 w{r * std::cos(phi), r * std::sin(phi), z};
    const double chance = M_PI * infinite_value(skies.table(), {0, 0, 0}, w).radiance.g;
    met += chance;
    both += chance * power_heuristic(cosine_pdf(w), infinite_value(skies.table(), {0, 0, 0}, w).pdf_solid_angle);
  }
  // Four times the form factor of a rectangle at its corner (Howell, configuration B-3), sides 1 by 1 at distance 2.
  const double a = 0.5, root = std::sqrt(1 + a * a), corner = 2 * a / root * std::atan(a / root) / (2 * M_PI);
  const double wanted = M_PI * (0.1 + 2 * 4 * corner);
  EXPECT_NEAR(sampled / kSamples, wanted, 0.01 * wanted);  // four standard errors of the noisiest
  EXPECT_NEAR(met / kSamples, wanted, 0.01 * wanted);
  EXPECT_NEAR(both / kSamples, wanted, 0.01 * wanted);
}

// ---- and of an even sky without one ----

TEST(InfiniteLight, directions_of_an_even_sky_are_uniform) {
  Skies skies;
  skies.portals.clear();
  constexpr int kRows = 12, kColumns = 16, kSamples = 400000;
  std::vector<double> seen(kRows * kColumns);
  test::Random u(17);
  for (int i = 0; i < kSamples; ++i) {
    const float select = u(), x = u();
    const Float3 w = sample_light(skies.table(), {{0, 0, 0}, 0}, {select, 0.5f}, {x, u()}).w_next_world;
    const auto row = std::min(kRows - 1, static_cast<int>((1 - w.z) / 2 * kRows));
    const double turn = std::atan2(w.y, w.x) / (2 * M_PI) + 0.5;
    ++seen[static_cast<size_t>(row * kColumns + std::min(kColumns - 1, static_cast<int>(turn * kColumns)))];
  }
  test::ChiSquare chi_square;
  for (const double count : seen) chi_square.add(count, static_cast<double>(kSamples) / (kRows * kColumns));
  EXPECT_LT(chi_square.deviations(), 5);
}

}  // namespace
}  // namespace spillway::shading
