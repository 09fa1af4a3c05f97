// One vertex of a path against answers known by hand. The streamed stages and the reference integrator share this code:
// where it is wrong, both are, and their images still agree.

#include "pipeline/render/shade_path.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace spillway::pipeline {
namespace {

// A lamp of two triangles over the receiver at the origin, whose normal is z: corners (-1, -1) to (1, 1) at `height`.
struct Lamp {
  std::vector<shading::Emitter> emitters;
  std::vector<shading::Emission> emissions{{{1, 1, 1}, 1}};
  std::vector<float> cdf{0, 0.5f, 1};
  float height;

  explicit Lamp(float at_height) : height(at_height) {
    for (const Float3* edges : {kFirst, kSecond}) emitters.push_back({{{-1, -1, height}, edges[0], edges[1]}, 0});
  }
  [[nodiscard]] PathSettings settings() const {
    PathSettings s;
    s.lights.emitters = emitters, s.lights.emissions = emissions, s.lights.cdf = cdf;
    return s;
  }
  // The triangle that a ray from the origin meets; none: the ray passes.
  [[nodiscard]] uint32_t met(Float3 direction) const {
    if (!(direction.z > 0)) return LightId::kNone;
    const Float3 p = direction * (height / direction.z);
    if (std::fabs(p.x) > 1 || std::fabs(p.y) > 1) return LightId::kNone;
    return p.x > p.y ? 0 : 1;
  }

  static constexpr Float3 kFirst[2] = {{2, 0, 0}, {2, 2, 0}}, kSecond[2] = {{2, 2, 0}, {0, 2, 0}};
};

ShadingPoint point_at(Float3 position) {
  ShadingPoint point{};
  point.position = position;
  point.normal_geometric = point.normal_shading = {0, 0, 1};
  return point;
}

// A path that comes straight down.
HitRecord hit_from_above(uint32_t sample, uint32_t bounce = 0) {
  HitRecord hit{};
  hit.direction_world = {0, 0, -1};
  hit.path.sink = 9, hit.path.sample = sample, hit.path.bounce = static_cast<uint16_t>(bounce);
  hit.path.throughput = {1, 1, 1}, hit.path.eta_scale = 1;
  return hit;
}

SurfaceValues diffuse(float albedo) {
  SurfaceValues surface{};
  surface.bsdf.kind = shading::BsdfKind::diffuse;
  surface.bsdf.reflectance = {albedo, albedo, albedo};
  surface.normal_shading = {0, 0, 1};
  return surface;
}

// The mean of many samples, and its deviation.
struct Mean {
  double sum = 0, squares = 0;
  int count = 0;
  void add(double value) { sum += value, squares += value * value, ++count; }
  [[nodiscard]] double mean() const { return sum / count; }
  [[nodiscard]] double deviation() const { return std::sqrt(std::max(0.0, squares / count - mean() * mean()) / count); }
};

// What the path's next ray brings from the lamp.
double found_by_chance(const Lamp& lamp, const ShadedVertex& vertex, const PathSettings& settings) {
  const Float3 direction = vertex.path_ray.direction_world;
  const uint32_t light = lamp.met(direction);
  if (light == LightId::kNone) return 0;
  HitRecord hit{};
  hit.direction_world = direction, hit.path = vertex.path;
  SurfaceValues emitter{};
  emitter.light = light, emitter.normal_shading = {0, 0, 1};
  const ShadedVertex found = shade_vertex(settings, hit, point_at(direction * (lamp.height / direction.z)), emitter);
  return found.has_splat ? found.splat.value.g : 0;
}

double found_by_chance(const Lamp& lamp, const ShadedVertex& vertex) {
  return found_by_chance(lamp, vertex, lamp.settings());
}

// Four times the form factor of a rectangle at its corner (Howell, configuration B-3), sides 1 by 1.
double form_factor_of_lamp(double height) {
  const double a = 1 / height, root = std::sqrt(1 + a * a);
  return 4 * 2 * a / root * std::atan(a / root) / (2 * M_PI);
}

TEST(ShadePath, every_estimator_brings_the_light_of_a_square_lamp_once) {
  for (const float height : {0.5f, 2.0f})
    for (const Estimator estimator : {Estimator::mis_power, Estimator::mis_balance, Estimator::light,
                                      Estimator::light_by_area, Estimator::bsdf, Estimator::hemisphere}) {
      const Lamp lamp(height);
      PathSettings settings = lamp.settings();
      settings.estimator = estimator, settings.sampler = shading::SamplerKind::independent;
      settings.lights.emitters_by_area = estimator == Estimator::light_by_area;
      Mean sampled, by_chance, both;
      for (uint32_t sample = 0; sample < 100000; ++sample) {
        const ShadedVertex vertex = shade_vertex(settings, hit_from_above(sample), point_at({0, 0, 0}), diffuse(0.6f));
        const double a = vertex.has_shadow ? vertex.shadow.contribution.g : 0;
        const double b = vertex.has_path ? found_by_chance(lamp, vertex, settings) : 0;
        sampled.add(a), by_chance.add(b), both.add(a + b);
      }
      const double expected = 0.6 * form_factor_of_lamp(height);
      EXPECT_NEAR(both.mean(), expected, 4 * both.deviation()) << height << " " << static_cast<int>(estimator);
      EXPECT_LT(both.deviation(), 0.01 * expected) << height << " " << static_cast<int>(estimator);
      const bool has_light = estimator <= Estimator::light_by_area;
      const bool has_chance = estimator != Estimator::light && estimator != Estimator::light_by_area;
      EXPECT_EQ(sampled.mean() > 0, has_light) << static_cast<int>(estimator);
      EXPECT_EQ(by_chance.mean() > 0, has_chance) << static_cast<int>(estimator);
    }
}

TEST(ShadePath, without_roulette_paths_go_on_as_they_are) {
  const Lamp lamp(1);
  PathSettings settings = lamp.settings();
  settings.max_depth = 100, settings.roulette = false;
  for (uint32_t sample = 0; sample < 1000; ++sample) {
    HitRecord hit = hit_from_above(sample, 40);
    hit.path.throughput = {0.01f, 0.01f, 0.01f};
    const ShadedVertex vertex = shade_vertex(settings, hit, point_at({0, 0, 0}), diffuse(0.5f));
    ASSERT_TRUE(vertex.has_path);
    ASSERT_FLOAT_EQ(vertex.path.throughput.g, 0.005f);
  }
}

TEST(ShadePath, both_strategies_together_bring_the_light_of_a_square_lamp_once) {
  // Near enough that both strategies matter.
  for (const float height : {0.5f, 2.0f}) {
    const Lamp lamp(height);
    Mean sampled, by_chance, both;
    for (uint32_t sample = 0; sample < 100000; ++sample) {
      const ShadedVertex vertex = shade_vertex(lamp.settings(), hit_from_above(sample), point_at({0, 0, 0}), diffuse(0.6f));
      const double a = vertex.has_shadow ? vertex.shadow.contribution.g : 0;
      const double b = vertex.has_path ? found_by_chance(lamp, vertex) : 0;
      sampled.add(a), by_chance.add(b), both.add(a + b);
    }
    EXPECT_NEAR(both.mean(), 0.6 * form_factor_of_lamp(height), 4 * both.deviation()) << height;
    EXPECT_LT(both.deviation(), 0.001) << height;
    EXPECT_GT(sampled.mean(), 0) << height;
    EXPECT_GT(by_chance.mean(), 0) << height;
  }
}

// The balance of the two shows in the noise: each direction is left to the strategy that is more likely to find it.
TEST(ShadePath, the_more_likely_strategy_has_the_larger_weight) {
  const Lamp lamp(0.5f);
  // Of a square of half sides 1 above its centre.
  const double square_solid_angle = 4 * std::asin(1 / (1 + 0.5 * 0.5));
  int compared = 0;
  for (uint32_t sample = 0; sample < 1000; ++sample) {
    const ShadedVertex vertex = shade_vertex(lamp.settings(), hit_from_above(sample), point_at({0, 0, 0}), diffuse(1));
    if (!vertex.has_shadow) continue;
    const Float3 w = normalize(vertex.shadow_ray.direction_world);
    // Half of the samples go to each triangle, evenly over its solid angle: a quarter of the square's, twice.
    const double pdf_light = 0.5 / (square_solid_angle / 2), pdf_bsdf = w.z / M_PI;
    // f cos / pdf without the weight
    const double weight = vertex.shadow.contribution.g / (pdf_bsdf / pdf_light);
    EXPECT_NEAR(weight, pdf_light * pdf_light / (pdf_light * pdf_light + pdf_bsdf * pdf_bsdf), 1e-3);
    ++compared;
  }
  EXPECT_GT(compared, 900);
}

TEST(ShadePath, shadow_rays_end_just_before_their_light) {
  for (const float height : {0.01f, 1.0f, 1000.0f}) {
    const Lamp lamp(height);
    int compared = 0;
    for (uint32_t sample = 0; sample < 1000; ++sample) {
      const ShadedVertex vertex = shade_vertex(lamp.settings(), hit_from_above(sample), point_at({0, 0, 0}), diffuse(1));
      if (!vertex.has_shadow) continue;
      const cache::TraceRay& ray = vertex.shadow_ray;
      const double end = static_cast<double>(ray.origin_world.z) + static_cast<double>(ray.t_max) * ray.direction_world.z;
      ASSERT_LT(end, height);
      // The margin is 64 roundings of the largest coordinate, which here is at most a hundred times the distance.
      ASSERT_GT(end, height * (1 - 1e-3));
      ++compared;
    }
    EXPECT_GT(compared, 900) << height;
  }
}

TEST(ShadePath, roulette_changes_no_mean) {
  const Lamp lamp(1);
  PathSettings settings = lamp.settings();
  settings.max_depth = 100;
  for (const uint32_t bounce : {0u, 1u, 5u, 40u}) {
    Mean carried;
    uint32_t ended = 0;
    for (uint32_t sample = 0; sample < 50000; ++sample) {
      HitRecord hit = hit_from_above(sample, bounce);
      hit.path.throughput = {0.5f, 0.25f, 0.125f};
      const ShadedVertex vertex = shade_vertex(settings, hit, point_at({0, 0, 0}), diffuse(0.8f));
      carried.add(vertex.has_path ? vertex.path.throughput.g : 0);
      ended += vertex.has_path ? 0 : 1;
    }
    EXPECT_NEAR(carried.mean(), 0.8 * 0.25, 4 * carried.deviation() + 1e-6) << bounce;
    EXPECT_EQ(ended > 0, bounce > 0) << bounce;
  }
}

TEST(ShadePath, normals_of_an_instance_stay_upright_on_its_surface) {
  Affine3 world_from_object, object_from_world;
  const float scale[3] = {3, 0.5f, 1}, move[3] = {5, -2, 1};
  for (int a = 0; a < 3; ++a) {
    world_from_object.m[a][a] = scale[a], world_from_object.m[a][3] = move[a];
    object_from_world.m[a][a] = 1 / scale[a], object_from_world.m[a][3] = -move[a] / scale[a];
  }
  cache::TriangleAttributes triangle;
  const Float3 corners[3] = {{1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  for (int i = 0; i < 3; ++i) {
    triangle.position_object[i] = corners[i];
    triangle.normal_object[i] = normalize(cross(corners[1] - corners[0], corners[2] - corners[0]));
  }
  triangle.has_normals = true;
  HitRecord hit = hit_from_above(0);
  hit.hit.u = 0.25f, hit.hit.v = 0.5f, hit.hit.instance = 1;
  const ShadingPoint point = shading_point(triangle, hit, {&world_from_object, &object_from_world}, false);
  for (int a = 0; a < 3; ++a) EXPECT_NEAR(point.normal_shading[a], point.normal_geometric[a], 1e-6);
  EXPECT_NEAR(point.position.x, 0.25f * 3 + 5, 1e-6);
  EXPECT_NEAR(point.position.y, 0.25f * 2 * 0.5f - 2, 1e-6);
  EXPECT_NEAR(point.position.z, 0.5f * 3 + 1, 1e-6);
}

TEST(ShadePath, alpha_stops_its_share_independently_of_all_else_that_is_sampled) {
  constexpr uint32_t kSamples = 20000;
  constexpr float kAlpha = 0.3f;
  std::vector<HitRecord> hits;
  for (uint32_t sample = 0; sample < kSamples; ++sample) {
    hits.push_back(hit_from_above(sample, 1));
    hits.back().hit.prim = 77;
  }
  const auto share = [&](const auto& value) {  // the mean of value x stopped
    double sum = 0;
    for (const HitRecord& hit : hits)
      if (stopped_by_alpha(hit, 0, kAlpha)) sum += value(hit);
    return sum / kSamples;
  };
  // Four deviations of a mean of values of at most one.
  constexpr double kTolerance = 4 * 0.46 / 141;
  EXPECT_NEAR(share([](const HitRecord&) { return 1; }), 0.3, kTolerance);
  for (uint32_t slot = 0; slot < shading::kSlotFirstBounce + 4 * shading::kSlotsPerBounce; ++slot) {
    const auto sampled = [&](const HitRecord& hit) { return sample_2d(sample_key(hit.path, 0), slot); };
    EXPECT_NEAR(share([&](const HitRecord& hit) { return sampled(hit).x; }), 0.15, kTolerance) << slot;
    EXPECT_NEAR(share([&](const HitRecord& hit) { return sampled(hit).y; }), 0.15, kTolerance) << slot;
  }
  // A shadow ray through the same triangle, the next bounce, and the same triangle of another instance ask again.
  const auto again = [&](const auto& change) {
    return share([&](HitRecord hit) {
      change(hit);
      return stopped_by_alpha(hit, 0, kAlpha) ? 1 : 0;
    });
  };
  EXPECT_NEAR(again([](HitRecord& hit) { hit.is_shadow = 1; }), 0.09, kTolerance);
  EXPECT_NEAR(again([](HitRecord& hit) { hit.path.bounce = 2; }), 0.09, kTolerance);
  EXPECT_NEAR(again([](HitRecord& hit) { hit.hit.instance = 3; }), 0.09, kTolerance);
  EXPECT_NEAR(again([](HitRecord& hit) { hit.hit.prim = 78; }), 0.09, kTolerance);
}

TEST(ShadePath, full_and_empty_alpha_are_certain) {
  for (uint32_t sample = 0; sample < 100; ++sample) {
    EXPECT_TRUE(stopped_by_alpha(hit_from_above(sample), 0, 1));
    EXPECT_FALSE(stopped_by_alpha(hit_from_above(sample), 0, 0));
  }
}

}  // namespace
}  // namespace spillway::pipeline
