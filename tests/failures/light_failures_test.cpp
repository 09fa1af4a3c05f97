// Light that arrives by ways that are hard to find. docs/failures.md has the table.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/closed_forms.h"

namespace spillway::test {
namespace {

constexpr double kBig = 20;
const std::string kFloor = diffuse(0.5) + sheet({-kBig, -kBig, 0}, {2 * kBig, 0, 0}, {0, 2 * kBig, 0});

// Hard: next-event estimation finds the lamp from one half of the room alone, and that half is not seen.
// In a sphere what is thrown back lights every place alike: E = rho flux / (4 pi r^2 (1 - rho)).
TEST(Failures, a_lamp_that_faces_the_ceiling) {
  constexpr double kSide = 0.02, kRadiance = 5000, kAlbedo = 0.5;
  const FailureScene scene(view_from({0, 0, -0.2}, {0, 0, -1}, {0, 1, 0}, 40, 60, 16) + diffuse(kAlbedo) +
                           "Shape \"sphere\" \"float radius\" 1\n" +
                           emitter(kRadiance, sheet({-kSide / 2, -kSide / 2, 0.3}, {kSide, 0, 0}, {0, kSide, 0})));
  scene.expect_same_bits();
  const double flux = M_PI * kRadiance * kSide * kSide;
  const double irradiance = kAlbedo * flux / (4 * M_PI * (1 - kAlbedo));
  // The sphere is diced: off by at most 1/4096 of its radius.
  expect_unbiased(scene, kAlbedo * irradiance / M_PI, {.rounding = 1e-3, .largest_error = 0.01});
}

// Irradiance at (x, y) below a slit in a black plate at height one, of a white sky beyond.
constexpr double kSlitX = 0.025, kSlitY = 1;
double below_the_slit(double x, double y) {
  const auto row = [&](double v) {
    return integral(-kSlitX, kSlitX, 1, [&](double u) {
      const double squared = (u - x) * (u - x) + (v - y) * (v - y) + 1;
      return 1 / (squared * squared);
    });
  };
  return integral(-kSlitY, kSlitY, 8, row);
}

std::string dark_chamber() {
  const double far = kBig - kSlitX, end = kBig - kSlitY;
  return diffuse(0) + sheet({-kBig, -kBig, 1}, {far, 0, 0}, {0, 2 * kBig, 0}) +
         sheet({kSlitX, -kBig, 1}, {far, 0, 0}, {0, 2 * kBig, 0}) +
         sheet({-kSlitX, kSlitY, 1}, {2 * kSlitX, 0, 0}, {0, end, 0}) +
         sheet({-kSlitX, -kBig, 1}, {2 * kSlitX, 0, 0}, {0, end, 0}) +
         sheet({-kBig, -kBig, 0}, {2 * kBig, 0, 0}, {0, 0, 1}) + sheet({-kBig, kBig, 0}, {2 * kBig, 0, 0}, {0, 0, 1}) +
         sheet({-kBig, -kBig, 0}, {0, 2 * kBig, 0}, {0, 0, 1}) + sheet({kBig, -kBig, 0}, {0, 2 * kBig, 0}, {0, 0, 1});
}

// Hard: of the directions that a sky is sampled in, three in a thousand pass; a portal says which.
TEST(Failures, light_through_a_slit) {
  const std::string view = view_down(0.9, 0.1, 1, 16);
  const double answer = 0.5 / M_PI * mean_over_square(0.1, 1, below_the_slit);
  const FailureScene plain(view + sky(1) + kFloor + dark_chamber());
  plain.expect_same_bits();
  expect_unbiased(plain, answer, {.samples = 128, .largest_error = 0.05});
  // Seen along cross(edge1, edge2) of its first corner.
  const FailureScene portal(
      view +
      fmt::format("LightSource \"infinite\" \"rgb L\" [1 1 1] \"point3 portal\" [-{0} -{1} 1 -{0} {1} "
                  "1 {0} {1} 1 {0} -{1} 1]\n",
                  kSlitX, kSlitY) +
      kFloor + dark_chamber());
  portal.expect_same_bits();
  expect_unbiased(portal, answer, {.largest_error = 0.005});
}

// Hard: glass between floor and lamp stops every shadow ray, so that the lamp is met by chance alone. A pane of
// index 1.5 with its reflections left out by the depth of paths: from the floor at angle a the lamp's plane is met at a
// distance r = gap tan a + pane tan b, sin b = sin a / 1.5, through (1 - F)^2.
TEST(Failures, a_lamp_behind_a_pane_of_glass) {
  constexpr double kPane = 0.2, kGap = 1, kSide = 1;
  const FailureScene scene(view_down(0.4, 0.1, 3, 16) + kFloor + "Material \"dielectric\" \"float eta\" 1.5\n" +
                           sheet({-kBig, -kBig, 0.7}, {2 * kBig, 0, 0}, {0, 2 * kBig, 0}) +
                           sheet({-kBig, -kBig, 0.5}, {0, 2 * kBig, 0}, {2 * kBig, 0, 0}) +
                           emitter(10, sheet({-kSide / 2, -kSide / 2, 1.2}, {0, kSide, 0}, {kSide, 0, 0})));
  scene.expect_same_bits();
  const auto distance = [&](double sine) {
    const double inside = sine / 1.5;
    return kGap * sine / std::sqrt(1 - sine * sine) + kPane * inside / std::sqrt(1 - inside * inside);
  };
  const auto value = [&](double x, double y) {
    return mean_over_square(kSide / 2, 6, [&](double u, double v) {
      const double r = std::hypot(u - x, v - y);
      double low = 0, high = 0.999;
      for (int i = 0; i < 50; ++i) (distance((low + high) / 2) < r ? low : high) = (low + high) / 2;
      const double sine = (low + high) / 2, cosine = std::sqrt(1 - sine * sine), inside = sine / 1.5;
      const double per_sine = kGap / std::pow(cosine, 3) + kPane / 1.5 / std::pow(1 - inside * inside, 1.5);
      // d(solid angle) = sine d(sine) / cosine d(phi); d(area) = r dr d(phi).
      const double passed = 1 - reflectance(cosine, 1.5);
      const double ratio = r > 1e-9 ? sine / r : 1 / (kGap + kPane / 1.5);
      return 10 * kSide * kSide * passed * passed * ratio / per_sine;
    });
  };
  expect_unbiased(scene, 0.5 / M_PI * mean_over_square(0.1, 1, value), {.rounding = 1e-4});
}

// What cannot be found: no path leads through glass to a point. The floor below the pane is black.
TEST(Failures, a_point_light_behind_glass_is_lost) {
  const FailureScene scene(view_down(0.4, 0.1, 10) + kFloor + "Material \"dielectric\" \"float eta\" 1.5\n" +
                           sheet({-kBig, -kBig, 0.7}, {2 * kBig, 0, 0}, {0, 2 * kBig, 0}) +
                           sheet({-kBig, -kBig, 0.5}, {0, 2 * kBig, 0}, {2 * kBig, 0, 0}) +
                           "LightSource \"point\" \"point3 from\" [0 0 1.2] \"rgb I\" [10 10 10]\n");
  scene.expect_same_bits();
  EXPECT_EQ(scene.render(1, 16).mean, 0);
}

// A caustic: a ball of glass between a square lamp and the floor. Every path is found by chance; what each brings is at
// most the lamp's radiance, so that the picture converges, the slower the smaller the lamp (charted).
TEST(Failures, a_caustic_of_a_glass_ball) {
  const FailureScene scene(view_down(0.4, 0.5, 12, 16) + kFloor +
                           "AttributeBegin Material \"dielectric\" Translate 0 0 1.5 " +
                           "Shape \"sphere\" \"float radius\" 0.8 AttributeEnd\n" +
                           emitter(10, sheet({-0.5, -0.5, 4}, {0, 1, 0}, {1, 0, 0})));
  scene.expect_same_bits();
  // No closed form, but two bounds: what the floor would get without the ball, and all that the lamp sends.
  const double mean = scene.render(1, 256).mean;
  const double plain = 10 * 1.0 / (4 * 4) * 0.5 / M_PI;
  EXPECT_GT(mean, plain);
  EXPECT_LT(mean, 10.0 * 0.5);
}

// Hard: forty reflections before there is light, and roulette on the way: (reflectance at 45 degrees)^40.
TEST(Failures, a_corridor_of_mirrors) {
  const FailureScene scene(view_along({0, 0, 0}, {1, 0, -1}, {0, 1, 0}, 0.05, 60, 16) + metal_words(0) +
                           sheet({-0.5, -5, -40}, {0, 10, 0}, {0, 0, 45}) +
                           sheet({0.5, -5, -40}, {0, 10, 0}, {0, 0, 45}) +
                           emitter(7, sheet({-0.5, -5, -40}, {1, 0, 0}, {0, 10, 0})));
  scene.expect_same_bits();
  expect_unbiased(scene, 7 * std::pow(reflectance(std::sqrt(0.5), kMetalIndex), 40), {.largest_error = 0.02});
}

constexpr uint32_t kTrianglesPerPage = 256;  // eight pages and more; thousands of bounces read what is not in memory

// Hard: what a thousand panes let through is met by those paths alone that survive a walk of a thousand steps.
// A pane returns s = 2 r / (1 + r); n of them n s / (1 + (n - 1) s), r at normal incidence.
TEST(Failures, a_thousand_panes_of_glass) {
  constexpr int kCount = 1000;
  std::string panes = "Material \"thindielectric\" \"float eta\" 1.05\n";
  for (int i = 0; i < kCount; ++i) panes += sheet({-1, -1, -0.01 * i}, {2, 0, 0}, {0, 2, 0});
  const double r = reflectance(1, 1.05), s = 2 * r / (1 + r), returned = kCount * s / (1 + (kCount - 1) * s);
  const FailureScene behind(
      view_down(0.5, 0.05, 30000, 4) + panes + emitter(1, sheet({-1, -1, -20}, {2, 0, 0}, {0, 2, 0})), {},
      kTrianglesPerPage);
  behind.expect_same_bits();
  expect_unbiased(behind, 1 - returned, {.seeds = 8, .samples = 16, .largest_error = 0.05});
}

// Five hundred slabs whose faces are all there: refraction in and out, radiance times the index squared and back.
TEST(Failures, a_thousand_faces_of_glass) {
  constexpr int kFaces = 1000;
  std::string slabs = "Material \"dielectric\" \"float eta\" 1.1\n";
  for (int i = 0; i < kFaces; i += 2)
    slabs +=
        sheet({-1, -1, -0.01 * i}, {2, 0, 0}, {0, 2, 0}) + sheet({-1, -1, -0.01 * i - 0.005}, {0, 2, 0}, {2, 0, 0});
  const double r = reflectance(1, 1.1), returned = kFaces * r / (1 + (kFaces - 1) * r);
  const FailureScene scene(
      view_down(0.5, 0.05, 30000, 4) + slabs + emitter(1, sheet({-1, -1, -20}, {2, 0, 0}, {0, 2, 0})), {},
      kTrianglesPerPage);
  scene.expect_same_bits();
  expect_unbiased(scene, 1 - returned, {.seeds = 8, .samples = 16, .largest_error = 0.05});
}

}  // namespace
}  // namespace spillway::test
