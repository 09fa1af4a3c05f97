// Surfaces so smooth that only one of the two strategies finds their light, or none. docs/failures.md has the table.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/closed_forms.h"

namespace spillway::test {
namespace {

constexpr double kBig = 20;
const std::string kFloor = sheet({-kBig, -kBig, 0}, {2 * kBig, 0, 0}, {0, 2 * kBig, 0});

// Light of intensity one from (0, 0, height), seen from above on metal: f cos / d^2.
double metal_below_a_point(double alpha, double height, double x, double y) {
  const Vec to_light{-x, -y, height};
  const double squared = dot(to_light, to_light), cosine = height / std::sqrt(squared);
  return metal({0, 0, 1}, unit(to_light), alpha, kMetalIndex) * cosine / squared;
}

// Hard: all light is in a lobe of a few thousandths, and BSDF sampling never meets a point.
TEST(Failures, polished_metal_under_a_point_light) {
  for (const double alpha : {0.005, 0.05}) {
    const FailureScene scene(view_down(1.5, 0.2, 1, 16) + metal_words(alpha) + kFloor +
                             "LightSource \"point\" \"point3 from\" [0 0 2] \"rgb I\" [10 10 10]\n");
    scene.expect_same_bits();
    const auto value = [&](double x, double y) { return 10 * metal_below_a_point(alpha, 2, x, y); };
    expect_unbiased(scene, mean_over_square(0.2, 120, value));
  }
}

// Hard: the lamp and the lobe are both tiny; whichever strategy is sampled alone meets the other one rarely.
TEST(Failures, polished_metal_under_a_tiny_lamp) {
  constexpr double kSide = 0.02, kRadiance = 1000;
  const std::string lamp = emitter(kRadiance, sheet({-kSide / 2, -kSide / 2, 2}, {0, kSide, 0}, {kSide, 0, 0}));
  for (const double alpha : {0.002, 0.01, 0.1}) {
    const FailureScene scene(view_down(1.5, 0.2, 1, 16) + metal_words(alpha) + kFloor + lamp);
    scene.expect_same_bits();
    const auto from_place = [&](double x, double y) {
      const double cosine_at_lamp = 2 / std::sqrt(4 + x * x + y * y);
      return kRadiance * kSide * kSide * cosine_at_lamp * metal_below_a_point(alpha, 2, x, y);
    };
    // Where the lobe ends inside of the picture the lamp's points all bring as much, wherever they are.
    const bool ends_inside = alpha < 0.005;
    const auto value = [&](double x, double y) {
      if (ends_inside) return from_place(x, y);
      return mean_over_square(kSide / 2, 1, [&](double u, double v) { return from_place(x - u, y - v); });
    };
    expect_unbiased(scene,
                    mean_over_square(0.2,
                                     ends_inside    ? 200
                                     : alpha < 0.05 ? 60
                                                    : 10,
                                     value),
                    {.rounding = 2e-4, .largest_error = 0.02});
  }
}

// Hard: nothing but the mirrored direction itself finds the lamp, one path in four hundred.
TEST(Failures, a_mirror_under_a_tiny_lamp) {
  constexpr double kSide = 0.02, kHalf = 0.2;
  const FailureScene scene(view_down(1.5, kHalf, 1, 16) + metal_words(0) + kFloor +
                           emitter(1000, sheet({-kSide / 2, -kSide / 2, 2}, {0, kSide, 0}, {kSide, 0, 0})));
  scene.expect_same_bits();
  const double share = kSide * kSide / (4 * kHalf * kHalf);
  expect_unbiased(scene, 1000 * reflectance(1, kMetalIndex) * share, {.largest_error = 0.03});
}

// What cannot be found: no sampled direction meets a point, and no point is asked for by a mirror. It is black.
TEST(Failures, a_mirror_does_not_show_a_point_light) {
  const FailureScene scene(view_down(1.5, 0.2, 5) + metal_words(0) + kFloor +
                           "LightSource \"point\" \"point3 from\" [0 0 2] \"rgb I\" [10 10 10]\n");
  scene.expect_same_bits();
  EXPECT_EQ(scene.render(1, 16).mean, 0);
}

// Veach's plates: four metals, four lamps of equal power and unlike sizes. Hard: for smooth metal and a large lamp
// light sampling fails, for rough metal and a small lamp BSDF sampling does, and one estimator has to be good at all
// sixteen.
class VeachPlates : public testing::TestWithParam<double> {};

TEST_P(VeachPlates, are_lit_by_lamps_of_all_sizes) {
  const double alpha = GetParam();
  constexpr double kSides[4] = {0.02, 0.1, 0.3, 0.8}, kPlaces[4] = {-0.8, -0.5, -0.1, 0.55}, kHeight = 2, kHalf = 0.8;
  std::string lamps;
  for (int j = 0; j < 4; ++j) {
    const double s = kSides[j], y = kPlaces[j];
    lamps += emitter(0.1 / (s * s), sheet({kHeight - s / 2, y - s / 2, kHeight}, {0, s, 0}, {s, 0, 0}));
  }
  // Seen at 45 degrees from the other side: the lamps' images lie around the origin.
  const FailureScene scene(view_along({-1.5, 0, 1.5}, {0, 0, 0}, {0, 0, 1}, kHalf, 1, 16) + metal_words(alpha) +
                           kFloor + lamps);
  scene.expect_same_bits();
  const Vec seen = unit({-1, 0, 1});
  const auto value = [&](double across, double along) {
    const Vec place{along * std::sqrt(2.0), across, 0};
    double sum = 0;
    for (int j = 0; j < 4; ++j) {
      const double s = kSides[j], y = kPlaces[j];
      const int cells = alpha < 0.05 ? std::max(1, static_cast<int>(s / 0.1)) : 1;
      sum += 0.1 * mean_over_square(s / 2, cells, [&](double u, double v) {
               const Vec to = Vec{kHeight + u, y + v, kHeight} - place;
               const double squared = dot(to, to), cosine = to.z / std::sqrt(squared);
               return metal(seen, unit(to), alpha, kMetalIndex) * cosine * cosine / squared;
             });
    }
    return sum;
  };
  expect_unbiased(scene, mean_over_square(kHalf, alpha < 0.05 ? 30 : 8, value),
                  {.rounding = 2e-4, .largest_error = 0.01});
}

INSTANTIATE_TEST_SUITE_P(Roughness, VeachPlates, testing::Values(0.02, 0.05, 0.1, 0.3),
                         [](const auto& alpha) { return fmt::format("alpha_{:.0f}_hundredths", 100 * alpha.param); });

// Hard: at a degree above the horizon the cosine is small, the lobe lies half below the surface, and masking decides.
TEST(Failures, grazing_light_on_rough_metal) {
  for (const double degrees : {1.0, 5.0}) {
    const double height = std::tan(degrees * M_PI / 180);
    const Vec to_sun = unit({1, 0, height});
    for (const double alpha : {0.1, 0.5}) {
      const FailureScene scene(
          view_down(1, 0.1, 1) + metal_words(alpha) + kFloor +
          fmt::format("LightSource \"distant\" \"point3 from\" [1 0 {:.17g}] \"point3 to\" [0 0 0] \"rgb L\" [9 9 9]\n",
                      height));
      scene.expect_same_bits();
      expect_unbiased(scene, 9 * to_sun.z * metal({0, 0, 1}, to_sun, alpha, kMetalIndex));
    }
  }
}

// The same from the other end: a white sky on metal seen at grazing angles, which is its directional albedo.
TEST(Failures, rough_metal_seen_at_grazing_angles) {
  for (const double degrees : {1.0, 5.0}) {
    const double height = std::tan(degrees * M_PI / 180);
    const Vec seen = unit({-1, 0, height});
    for (const double alpha : {0.1, 0.5}) {
      const FailureScene scene(view_along({-1, 0, height}, {0, 0, 0}, {0, 0, 1}, 0.005, 1) + metal_words(alpha) +
                               kFloor + sky(1));
      scene.expect_same_bits();
      // Elevation as t^2: finer steps where the lobe meets the horizon.
      const auto ring = [&](double t) {
        const double z = t * t, r = std::sqrt(1 - z * z);
        const auto f = [&](double phi) {
          return metal(seen, {r * std::cos(phi), r * std::sin(phi), z}, alpha, kMetalIndex);
        };
        return 2 * integral(0, M_PI, 120, f) * z * 2 * t;
      };
      expect_unbiased(scene, integral(0, 1, 200, ring), {.rounding = 1e-4});
    }
  }
}

}  // namespace
}  // namespace spillway::test
