#include "shading/camera.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/chi_square.h"
#include "tests/support/random.h"

namespace spillway::shading {
namespace {

Camera camera(bool orthographic, float lens_radius) {
  Camera c;
  c.world_from_camera = {{{0, 0, 1, 5}, {0, 1, 0, 6}, {-1, 0, 0, 7}}};  // turned and moved
  c.tan_half_fov_x = 0.8f, c.tan_half_fov_y = 0.4f, c.screen_center_x = 0.1f;
  c.resolution_x_px = 200, c.resolution_y_px = 100;
  c.lens_radius = lens_radius, c.focal_distance = 3;
  c.is_orthographic = orthographic;
  return c;
}

TEST(Camera, corners_of_the_picture_see_corners_of_the_window) {
  for (const bool orthographic : {false, true}) {
    const Camera c = camera(orthographic, 0);
    for (const auto& [raster, x, y] :
         {std::tuple{Float2{0, 0}, -0.7f, 0.4f}, {Float2{200, 100}, 0.9f, -0.4f}, {Float2{100, 50}, 0.1f, 0.0f}}) {
      const CameraRay ray = camera_ray(c, raster, {0.5f, 0.5f});
      const Float3 origin = orthographic ? Float3{x, y, 0} : Float3{0, 0, 0};
      const Float3 direction = orthographic ? Float3{0, 0, 1} : normalize(Float3{x, y, 1});
      EXPECT_LT(length(ray.origin_world - c.world_from_camera.point(origin)), 1e-5f);
      EXPECT_LT(length(ray.direction_world - c.world_from_camera.vector(direction)), 1e-6f);
    }
  }
}

// Whatever the point of the lens, a pixel's rays meet in the plane of focus, and leave from all over the lens.
TEST(Camera, a_lens_is_sharp_at_its_focal_distance_alone) {
  for (const bool orthographic : {false, true}) {
    const Camera c = camera(orthographic, 0.25f);
    const Camera sharp = camera(orthographic, 0);
    test::Random u(11);
    double squares = 0;
    constexpr int kSamples = 20000;
    for (int i = 0; i < kSamples; ++i) {
      const Float2 raster{200 * u(), 100 * u()}, lens{u(), u()};
      const CameraRay ray = camera_ray(c, raster, lens), middle = camera_ray(sharp, raster, lens);
      const auto at_focus = [](const CameraRay& r) {
        return r.origin_world +
               r.direction_world * ((8 - r.origin_world.x) / r.direction_world.x);  // the camera looks along x
      };
      ASSERT_LT(length(at_focus(ray) - at_focus(middle)), 2e-5f);
      const float off = length(ray.origin_world - middle.origin_world);
      ASSERT_LE(off, 0.25f * (1 + 1e-5f));
      squares += off * off;
    }
    EXPECT_NEAR(squares / kSamples, 0.25 * 0.25 / 2,
                0.25 * 0.25 / 2 * 0.02);  // uniform on a disk; four standard errors
  }
}

// Rings of equal area, cut into sectors.
TEST(Camera, points_of_the_lens_are_uniform) {
  constexpr int kRings = 12, kSectors = 16, kSamples = 400000;
  const Camera c = camera(false, 0.25f);
  const Float3 middle = camera_ray(camera(false, 0), {100, 50}, {0.5f, 0.5f}).origin_world;
  std::vector<double> seen(kRings * kSectors);
  test::Random u(11);
  for (int i = 0; i < kSamples; ++i) {
    const float x = u();
    const Float3 off = (camera_ray(c, {100, 50}, {x, u()}).origin_world - middle) * 4;  // on the unit disk
    const double turn = std::atan2(off.y, off.z) / (2 * M_PI) + 0.5;
    const auto ring = std::min(kRings - 1, static_cast<int>(length_squared(off) * kRings));
    ++seen[static_cast<size_t>(ring * kSectors + std::min(kSectors - 1, static_cast<int>(turn * kSectors)))];
  }
  test::ChiSquare chi_square;
  for (const double count : seen) chi_square.add(count, static_cast<double>(kSamples) / (kRings * kSectors));
  EXPECT_LT(chi_square.deviations(), 5);
}

TEST(Camera, a_footprint_is_a_pixel) {
  EXPECT_EQ(camera_ray(camera(false, 0), {3, 3}, {0, 0}).cone_width, 0);
  EXPECT_FLOAT_EQ(camera_ray(camera(false, 0), {3, 3}, {0, 0}).cone_spread, 0.008f);
  EXPECT_FLOAT_EQ(camera_ray(camera(true, 0), {3, 3}, {0, 0}).cone_width, 0.008f);
  EXPECT_EQ(camera_ray(camera(true, 0), {3, 3}, {0, 0}).cone_spread, 0);
}

Filter filter(FilterKind kind, float radius, float a = 0, float b = 0) { return {kind, {radius, radius / 2}, a, b}; }
const Filter kFilters[] = {filter(FilterKind::box, 0.5f), filter(FilterKind::triangle, 2),
                           filter(FilterKind::gaussian, 1.5f, 0.5f),
                           filter(FilterKind::mitchell, 2, 1 / 3.0f, 1 / 3.0f), filter(FilterKind::sinc, 4, 3)};

TEST(Filter, weights_have_mean_one_and_samples_are_centred) {
  for (const Filter& f : kFilters) {
    const FilterSampler sampler(f);
    test::Random u(11);
    double weight = 0, moment[2] = {}, squares = 0;
    constexpr int kSamples = 400000;
    for (int i = 0; i < kSamples; ++i) {
      const FilterSample s = sampler.sample({u(), u()});
      ASSERT_LE(std::fabs(s.offset_px.x), f.radius_px.x);
      ASSERT_LE(std::fabs(s.offset_px.y), f.radius_px.y);
      weight += s.weight, squares += s.weight * s.weight;
      moment[0] += s.weight * s.offset_px.x, moment[1] += s.weight * s.offset_px.y;
    }
    const double mean = weight / kSamples, error = std::sqrt((squares / kSamples - mean * mean) / kSamples);
    EXPECT_NEAR(mean, 1, 4 * error + 1e-6) << static_cast<int>(f.kind);
    for (const double m : moment)  // a weight's size times the radius bounds the deviation
      EXPECT_NEAR(m / kSamples, 0, 4 * std::sqrt(squares / kSamples) * f.radius_px.x / std::sqrt(kSamples));
  }
}

// The share of weight in each part of the diameter is the filter's own integral there.
TEST(Filter, samples_follow_the_filter_with_its_sign) {
  for (const Filter& f : {kFilters[1], kFilters[2], kFilters[3]}) {
    const FilterSampler sampler(f);
    constexpr int kParts = 16, kSamples = 400000;
    double got[kParts] = {}, wanted[kParts] = {}, sum = 0;
    test::Random u(11);
    for (int i = 0; i < kSamples; ++i) {
      const FilterSample s = sampler.sample({u(), u()});
      got[std::min(kParts - 1, static_cast<int>((s.offset_px.x / f.radius_px.x + 1) / 2 * kParts))] +=
          s.weight / kSamples;
    }
    const auto value = [&](double x) {
      x = std::fabs(x);
      if (f.kind == FilterKind::triangle) return std::max(0.0, 2 - x);
      if (f.kind == FilterKind::gaussian) return std::exp(-x * x / 0.5) - std::exp(-1.5 * 1.5 / 0.5);
      const double b = 1 / 3.0, c = 1 / 3.0;  // Mitchell and Netravali 1988, equation 8
      if (x < 1) return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + 6 - 2 * b) / 6;
      return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + 8 * b + 24 * c) / 6;
    };
    constexpr int kFine = 200;
    for (int i = 0; i < kParts * kFine; ++i) {
      const double v = value(((i + 0.5) / (kParts * kFine) * 2 - 1) * f.radius_px.x);
      wanted[i / kFine] += v, sum += v;
    }
    for (int part = 0; part < kParts; ++part)
      EXPECT_NEAR(got[part], wanted[part] / sum, 0.005) << static_cast<int>(f.kind) << ' ' << part;
  }
}

}  // namespace
}  // namespace spillway::shading
