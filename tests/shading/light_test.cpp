#include "shading/light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "shading/frame.h"
#include "tests/support/random.h"

namespace spillway::shading {
namespace {

struct Triangle {
  TriangleShape shape;
  Emission emission;
};

Triangle triangle(Float3 position, Float3 edge1, Float3 edge2, Rgb radiance) { return {{position, edge1, edge2}, {radiance, 1}}; }

// Chosen by the numbers of the distribution: triangles, then lights.
struct Lights {
  std::vector<Emitter> emitters;
  std::vector<Emission> emissions;
  std::vector<Light> lights;
  std::vector<float> cdf;

  Lights(const std::vector<Triangle>& triangles, std::vector<float> distribution) : cdf(std::move(distribution)) {
    for (const Triangle& t : triangles) {
      emitters.push_back({t.shape, static_cast<uint32_t>(emissions.size())});
      emissions.push_back(t.emission);
    }
  }
  explicit Lights(const Light& light) : lights{light}, cdf{0, 1} {}

  [[nodiscard]] LightTable table() const {
    LightTable t;
    t.emitters = emitters, t.emissions = emissions, t.lights = lights, t.cdf = cdf;
    t.first_infinite = static_cast<uint32_t>(lights.size());
    while (t.first_infinite > 0 && lights[t.first_infinite - 1].kind == LightKind::infinite) --t.first_infinite;
    return t;
  }
};

LightSample sample(const Lights& lights, Float3 receiver, float u_select, Float2 u) {
  return sample_light(lights.table(), {receiver}, {u_select, 0}, u);
}

Lights three_triangles() {
  return {{triangle({0, 0, 5}, {2, 0, 0}, {0, 2, 0}, {1, 1, 1}), triangle({4, 0, 3}, {0, 1, 0}, {0, 0, 1}, {2, 2, 2}),
           triangle({-3, 1, 2}, {1, 1, 0}, {0, 0, 2}, {3, 0, 0})},
          {0, 0.5f, 0.6f, 1}};
}

TEST(Light, the_density_of_a_chance_hit_is_that_of_sampling_bit_for_bit) {
  const Lights lights = three_triangles();
  LightTable table = lights.table();
  test::Random u(3);
  for (const bool by_area : {false, true}) {
    table.emitters_by_area = by_area;
    int compared = 0;
    for (int i = 0; i < 20000; ++i) {
      const Float3 receiver = u.point(4);
      const float select = u(), x = u(), y = u();
      const LightSample got = sample_light(table, {receiver}, {select, 0}, {x, y});
      if (!(got.pdf_solid_angle > 0)) continue;
      const uint32_t index = select < 0.5f ? 0 : select < 0.6f ? 1 : 2;
      const TriangleShape shape = emitter_in_world(table, 0, index);
      ASSERT_EQ(emitter_pdf_solid_angle(table, {receiver}, 0, index, shape, got.point_world), got.pdf_solid_angle) << i;
      ++compared;
    }
    EXPECT_GT(compared, 19000) << by_area;
  }
}

TEST(Light, lights_are_chosen_as_often_as_their_pmf_says) {
  const Lights lights = three_triangles();
  test::Random u(3);
  int seen[3] = {};
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const float select = u(), x = u();
    const LightSample got = sample(lights, {0, 0, 0}, select, {x, u()});
    ++seen[got.point_world.z == 5 ? 0 : got.point_world.x == 4 ? 1 : 2];
  }
  const double pmf[3] = {0.5, 0.1, 0.4};
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(seen[i] / static_cast<double>(kSamples), pmf[i], 4 * std::sqrt(pmf[i] * (1 - pmf[i]) / kSamples));
}

// The mean of f / pdf is the integral of f: irradiance of a parallel square above the receiver, known in closed form.
TEST(Light, the_irradiance_of_a_square_lamp_is_the_published_one) {
  const Lights lamp{{triangle({-1, -1, 2}, {2, 0, 0}, {2, 2, 0}, {1, 1, 1}), triangle({-1, -1, 2}, {2, 2, 0}, {0, 2, 0}, {1, 1, 1})},
                    {0, 0.5f, 1}};
  test::Random u(3);
  double sum = 0, squares = 0;
  constexpr int kSamples = 400000;
  for (int i = 0; i < kSamples; ++i) {
    const float select = u(), x = u();
    const LightSample got = sample(lamp, {0, 0, 0}, select, {x, u()});
    const double value = got.radiance.g * std::max(0.0f, got.w_next_world.z) / got.pdf_solid_angle;
    sum += value, squares += value * value;
  }
  const double mean = sum / kSamples, error = std::sqrt((squares / kSamples - mean * mean) / kSamples);
  // Four times the form factor of a rectangle at its corner (Howell, configuration B-3), sides 1 by 1 at distance 2.
  const double a = 0.5, root = std::sqrt(1 + a * a);
  const double corner = 2 * a / root * std::atan(a / root) / (2 * M_PI);
  EXPECT_NEAR(mean, M_PI * 4 * corner, 4 * error);
  EXPECT_LT(error, 0.003);
}

TEST(Light, a_sky_is_seen_alike_from_everywhere) {
  Light sky{};
  sky.kind = LightKind::infinite, sky.radiance = {2, 2, 2};
  const Lights lights(sky);
  test::Random u(3);
  double up = 0;
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const float x = u();
    const LightSample got = sample(lights, {1, 2, 3}, u(), {x, u()});
    ASSERT_NEAR(length(got.w_next_world), 1, 1e-5);
    ASSERT_TRUE(std::isinf(got.distance));
    ASSERT_EQ(got.pdf_solid_angle, infinite_value(lights.table(), {0, 0, 0}, got.w_next_world).pdf_solid_angle);
    up += got.radiance.g * std::max(0.0f, got.w_next_world.z) / got.pdf_solid_angle;
  }
  EXPECT_NEAR(up / kSamples, 2 * M_PI, 0.06);  // irradiance; four deviations
}

TEST(Light, one_sided_triangles_shine_to_their_side_alone) {
  const TriangleShape up{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}, down{{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
  const Emission one{{1, 1, 1}, 0}, both{{1, 1, 1}, 1};
  EXPECT_EQ(emitter_radiance(up, one, {0, 0, -1}).g, 1);  // seen from above
  EXPECT_EQ(emitter_radiance(up, one, {0, 0, 1}).g, 0);
  EXPECT_EQ(emitter_radiance(down, one, {0, 0, -1}).g, 0);
  EXPECT_EQ(emitter_radiance(down, one, {0, 0, 1}).g, 1);
  EXPECT_EQ(emitter_radiance(down, both, {0, 0, -1}).g, 1);
}

TEST(Light, a_spot_fades_as_a_smoothstep_of_the_cosine) {
  Light spot{};
  spot.kind = LightKind::spot, spot.radiance = {8, 8, 8}, spot.edge1 = {0, 0, -1};
  spot.cos_total = 0.5f, spot.cos_falloff = 0.9f;
  const Lights lights(spot);
  const auto seen = [&](float cosine) {
    const float sine = std::sqrt(1 - cosine * cosine);
    return sample(lights, {2 * sine, 0, -2 * cosine}, 0.5f, {0.5f, 0.5f}).radiance.g;
  };
  EXPECT_NEAR(seen(0.95f), 2, 1e-5);  // 8 over the squared distance
  EXPECT_NEAR(seen(0.7f), 1, 1e-4);   // halfway
  EXPECT_NEAR(seen(0.6f), 2 * 0.15625, 1e-4);  // a quarter: 3/16 - 2/64
  EXPECT_EQ(seen(0.4f), 0);
}

TEST(Light, without_lights_nothing_is_sampled) {
  const Lights no_lights({}, {0});
  const LightTable none = no_lights.table();
  EXPECT_EQ(sample(no_lights, {0, 0, 0}, 0.5f, {0.5f, 0.5f}).pdf_solid_angle, 0);
  EXPECT_FALSE(has_infinite_light(none));
  EXPECT_EQ(infinite_value(none, {0, 0, 0}, {0, 0, 1}).pdf_solid_angle, 0);
}

TEST(Light, weights_of_two_strategies_sum_to_one) {
  test::Random u(3);
  for (int i = 0; i < 1000; ++i) {
    const float a = u() * 10, b = u() * 10;
    EXPECT_NEAR(power_heuristic(a, b) + power_heuristic(b, a), 1, 1e-6);
  }
  EXPECT_EQ(power_heuristic(0, 1), 0);
}

TEST(Light, scaling_the_scene_scales_densities_alone) {
  for (const float scale : {1e-6f, 1e4f}) {
    Lights small = three_triangles(), large = three_triangles();
    for (Emitter& e : large.emitters)
      e.shape = {e.shape.position * scale, e.shape.edge1 * scale, e.shape.edge2 * scale};
    test::Random u(3);
    for (int i = 0; i < 1000; ++i) {
      const Float3 receiver = u.point(2);
      const float select = u(), x = u(), y = u();
      const LightSample a = sample(small, receiver, select, {x, y}), b = sample(large, receiver * scale, select, {x, y});
      if (a.pdf_solid_angle == 0) continue;
      ASSERT_NEAR(b.pdf_solid_angle / a.pdf_solid_angle, 1, 2e-3) << scale;  // solid angles do not change
      ASSERT_EQ(a.radiance.g, b.radiance.g);
    }
  }
}

}  // namespace
}  // namespace spillway::shading
