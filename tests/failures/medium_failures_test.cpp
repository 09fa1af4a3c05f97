// Light in gas. docs/failures.md has the table.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/closed_forms.h"

namespace spillway::test {
namespace {

// Gas everywhere: the camera is in it, and nothing ends it.
std::string in_gas(double absorbed, double scattered, double g, const std::string& view) {
  return fmt::format(
             "MakeNamedMedium \"gas\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [{0} {0} {0}] \"rgb sigma_s\" "
             "[{1} {1} {1}] \"float g\" {2}\nMediumInterface \"\" \"gas\"\n",
             absorbed, scattered, g) +
         view;
}
const std::string kFloor = diffuse(0.5) + sheet({-20, -20, 0}, {40, 0, 0}, {0, 40, 0});

// A point in gas that absorbs: I cos / d^2 exp(-sigma (d + what lies before the camera)).
TEST(Failures, a_point_light_in_absorbing_gas) {
  const FailureScene scene(in_gas(0.4, 0, 0, view_down(1.5, 0.3, 1)) + kFloor +
                           "LightSource \"point\" \"point3 from\" [0.5 0 2] \"rgb I\" [9 9 9]\n");
  scene.expect_same_bits();
  const auto value = [](double x, double y) {
    const double d = std::sqrt((x - 0.5) * (x - 0.5) + y * y + 4);
    return 0.5 / M_PI * 9 * 2 / (d * d * d) * std::exp(-0.4 * (d + 1.5));
  };
  expect_unbiased(scene, mean_over_square(0.3, 4, value), {.largest_error = 0.01});
}

// Hard: a lamp inside of the gas is met from near and from far, by both strategies, each through gas.
TEST(Failures, a_lamp_in_absorbing_gas) {
  const FailureScene scene(in_gas(0.7, 0, 0, view_down(0.4, 0.2, 1)) + kFloor +
                           emitter(5, sheet({-0.3, -0.3, 0.5}, {0, 0.6, 0}, {0.6, 0, 0})));
  scene.expect_same_bits();
  const auto value = [](double x, double y) {
    return 0.36 * mean_over_square(0.3, 3, [&](double u, double v) {
             const double squared = (u - x) * (u - x) + (v - y) * (v - y) + 0.25;
             return 0.5 / M_PI * 5 * 0.25 / (squared * squared) * std::exp(-0.7 * (std::sqrt(squared) + 0.4));
           });
  };
  expect_unbiased(scene, mean_over_square(0.2, 2, value), {.largest_error = 0.01});
}

// A point in gas that scatters, seen past it: along the ray at distance b,
// the integral of sigma_s / (4 pi) I exp(-sigma_t (t + d)) / d^2. Bounded as long as the ray keeps away from the point;
// without that the variance has no bound (charted).
TEST(Failures, a_point_light_in_scattering_gas_seen_beside_it) {
  constexpr double kScattered = 0.3, kAll = 0.4;
  const FailureScene scene(
      in_gas(kAll - kScattered, kScattered, 0, view_along({0, 0, 4}, {0, 0, 0}, {0, 1, 0}, 0.2, 1)) +
      "LightSource \"point\" \"point3 from\" [1 0 0] \"rgb I\" [9 9 9]\n");
  scene.expect_same_bits();
  const auto value = [&](double x, double y) {
    return integral(0, 60, 200, [&](double t) {
      const double squared = (x - 1) * (x - 1) + y * y + (t - 4) * (t - 4);
      return kScattered / (4 * M_PI) * 9 * std::exp(-kAll * (t + std::sqrt(squared))) / squared;
    });
  };
  expect_unbiased(scene, mean_over_square(0.2, 2, value), {.largest_error = 0.01});
}

// A small lamp in gas that scatters once: the same integral over the lamp, with its cosine. Both strategies find it.
TEST(Failures, a_lamp_in_scattering_gas_seen_beside_it) {
  constexpr double kScattered = 0.8, kAll = 1;
  const FailureScene scene(
      in_gas(kAll - kScattered, kScattered, 0, view_along({0, 0, 1}, {0, 0, 0}, {0, 1, 0}, 0.2, 1)) +
      emitter(200, sheet({-0.05, 0.8, -0.05}, {0.1, 0, 0}, {0, 0, 0.1})));
  scene.expect_same_bits();
  const auto value = [&](double x, double y) {
    return integral(0, 30, 60, [&](double t) {
      return kScattered / (4 * M_PI) * std::exp(-kAll * t) * 0.01 * mean_over_square(0.05, 1, [&](double u, double v) {
               const double squared = (x - u) * (x - u) + (y - 0.8) * (y - 0.8) + (1 - t - v) * (1 - t - v);
               const double d = std::sqrt(squared);
               return 200 * (0.8 - y) / d / squared * std::exp(-kAll * d);
             });
    });
  };
  expect_unbiased(scene, mean_over_square(0.2, 2, value), {.samples = 256, .largest_error = 0.01});
}

// Hard: of a hundred paths one collides at all, and of those few inside of the beam.
TEST(Failures, a_spot_light_in_thin_fog) {
  constexpr double kScattered = 0.01, kDistance = 3;
  const FailureScene scene(
      in_gas(0, kScattered, 0, view_along({0, 0, kDistance}, {0, 0, 0}, {0, 1, 0}, 0.3, 1, 16)) +
      "LightSource \"spot\" \"point3 from\" [-2 0 0] \"point3 to\" [0 0 0] \"rgb I\" [500 500 500] "
      "\"float coneangle\" 10 \"float conedeltaangle\" 4\n");
  scene.expect_same_bits();
  const double full = std::cos(6 * M_PI / 180), none = std::cos(10 * M_PI / 180);
  const auto value = [&](double x, double y) {
    return integral(kDistance - 0.6, kDistance + 0.6, 60, [&](double t) {
      const Vec from_spot{x + 2, y, kDistance - t};
      const double squared = dot(from_spot, from_spot), d = std::sqrt(squared);
      const double s = std::min(1.0, std::max(0.0, (from_spot.x / d - none) / (full - none)));
      return kScattered / (4 * M_PI) * 500 * s * s * (3 - 2 * s) * std::exp(-kScattered * (t + d)) / squared;
    });
  };
  expect_unbiased(scene, mean_over_square(0.3, 20, value), {.samples = 256, .rounding = 1e-3, .largest_error = 0.05});
}

// Hard: nothing ends a path but leaving. Gas that loses nothing cannot be seen in a white sky.
TEST(Failures, gas_of_albedo_one_in_a_white_sky) {
  for (const auto& [scattered, g] : {std::pair(2.0, 0.9), std::pair(10.0, -0.5), std::pair(10.0, 0.0)}) {
    const FailureScene scene(
        view_from({0, 0, 9}, {0, 0, 0}, {0, 1, 0}, 5, 30000) + sky(1) +
        fmt::format(
            "MakeNamedMedium \"gas\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] \"rgb sigma_s\" "
            "[{0} {0} {0}] \"float g\" {1}\nMediumInterface \"gas\" \"\" Material \"interface\" ReverseOrientation\n",
            scattered, g) +
        room({-1, -1, -1}, {1, 1, 1}));
    scene.expect_same_bits();
    expect_unbiased(scene, 1, {.seeds = 12, .samples = 16});
  }
}

// The same in a grid of bricks of unlike density: every other cell is empty.
TEST(Failures, a_checkered_cloud_of_albedo_one_in_a_white_sky) {
  std::string density;
  for (int i = 0; i < 16 * 16 * 16; ++i) density += (i + i / 16 + i / 256) % 2 == 0 ? "8 " : "0 ";
  const FailureScene scene(
      view_from({0, 0, 9}, {0, 0, 0}, {0, 1, 0}, 5, 30000) + sky(1) +
      "MakeNamedMedium \"gas\" \"string type\" \"uniformgrid\" \"integer nx\" 16 \"integer ny\" 16 "
      "\"integer nz\" 16 \"point3 p0\" [-1 -1 -1] \"point3 p1\" [1 1 1] \"rgb sigma_a\" [0 0 0] "
      "\"rgb sigma_s\" [1 1 1] \"float density\" [" +
      density + "]\nMediumInterface \"gas\" \"\" Material \"interface\" ReverseOrientation\n" +
      room({-1, -1, -1}, {1, 1, 1}));
  scene.expect_same_bits();
  expect_unbiased(scene, 1, {.seeds = 12, .samples = 16});
}

// A cage may divide media as any shape may: a cube of sharp edges, which is its own limit surface.
TEST(Failures, absorbing_gas_in_a_subdivided_cage) {
  const FailureScene scene(
      view_along({0, 0, 4}, {0, 0, 0}, {0, 1, 0}, 0.2, 100) + sky(1) +
      "MakeNamedMedium \"gas\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0.5 0.5 0.5] \"rgb sigma_s\" [0 0 0]\n"
      "MediumInterface \"gas\" \"\" Material \"interface\"\n"
      "Shape \"subdivmesh\" \"point3 P\" [-1 -1 -1  1 -1 -1  1 1 -1  -1 1 -1  -1 -1 1  1 -1 1  1 1 1  -1 1 1]\n"
      "\"integer indices\" [0 3 2 1  4 5 6 7  0 1 5 4  1 2 6 5  2 3 7 6  3 0 4 7]\n"
      "\"integer creaseindices\" [0 1 1 2 2 3 3 0  4 5 5 6 6 7 7 4  0 4 1 5 2 6 3 7]\n"
      "\"float creasesharpness\" [10 10 10 10 10 10 10 10 10 10 10 10]\n");
  scene.expect_same_bits();
  const auto value = [](double x, double y) { return std::exp(-0.5 * 2 * std::sqrt(1 + (x * x + y * y) / 16)); };
  expect_unbiased(scene, mean_over_square(0.2, 4, value), {.largest_error = 0.01});
}

}  // namespace
}  // namespace spillway::test
