// Pictures of motion whose answer is known: how long what moves covers each pixel.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>

#include "tests/tools/rendered.h"
#include "tools/metrics/statistical_equality.h"

namespace spillway::tools {
namespace {

constexpr int kSize = 16;
// Pixel (x, y) of the picture is the unit square from (x - 8, 7 - y) on, seen against a sky of radiance one.
std::string view(const std::string& camera, const std::string& times = "", const std::string& before_camera = "") {
  return times + "\nScale -1 1 1 LookAt 0 0 5 0 0 0 0 1 0 " + before_camera +
         "\nCamera \"orthographic\" \"float screenwindow\" [-8 8 -8 8] " + camera +
         "\nFilm \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16 PixelFilter \"box\"\nWorldBegin\n";
}
constexpr const char* kSky = "LightSource \"infinite\" \"rgb L\" [1 1 1]\n";
constexpr const char* kBlack = "Material \"diffuse\" \"rgb reflectance\" [0 0 0]\n";
constexpr const char* kFaces = "] \"integer indices\" [0 1 2 0 2 3]\n";

Picture rendered_text(const std::string& text, int samples) {
  const test::TemporaryDirectory directory;
  std::ofstream(directory.path() / "scene.pbrt") << text;
  return rendered(directory.path() / "scene.pbrt", samples);
}

// The mean over each pixel of `brightness`, of 64 x 64 places: off by less than a thousandth where it has no edges.
void expect_picture(const Picture& picture, const std::function<double(double, double)>& brightness, int samples) {
  ASSERT_EQ(picture.pixels.size(), static_cast<size_t>(kSize * kSize));
  constexpr int kPlaces = 64;
  for (int py = 0; py < kSize; ++py)
    for (int px = 0; px < kSize; ++px) {
      double wanted = 0;
      for (int j = 0; j < kPlaces; ++j)
        for (int i = 0; i < kPlaces; ++i)
          wanted += brightness(px - 8 + (i + 0.5) / kPlaces, 8 - py - (j + 0.5) / kPlaces) / (kPlaces * kPlaces);
      // Five standard errors of independent samples, and half float's rounding; ours are better spread.
      const double variance = wanted * (1 - wanted) / samples;
      ASSERT_NEAR(luminance(picture.pixels[static_cast<size_t>(py * kSize + px)]), wanted,
                  5 * std::sqrt(variance) + 2e-3)
          << px << ' ' << py;
    }
}

// How long [left + speed t, left + width + speed t] covers x while t goes from 0 to 1; speed > 0.
double covered(double x, double left, double width, double speed) {
  const double first = (x - left - width) / speed, last = (x - left) / speed;
  return std::max(0.0, std::min(last, 1.0) - std::max(first, 0.0));
}

constexpr int kSamples = 1024;
const std::string kBar =
    std::string(kBlack) + "Shape \"trianglemesh\" \"point3 P\" [-6 -9 0 -4 -9 0 -4 9 0 -6 9 0" + kFaces;

TEST(MotionAnswers, a_bar_that_moves_evenly_covers_each_pixel_as_long_as_it_should) {
  const Picture picture =
      rendered_text(view("") + kSky + "ActiveTransform EndTime Translate 8 0 0 ActiveTransform All\n" + kBar, kSamples);
  expect_picture(
      picture, [](double x, double) { return 1 - covered(x, -6, 2, 8); }, kSamples);
}

// The shutter opens before the motion begins and closes before it ends: a third of the time the bar stands.
TEST(MotionAnswers, a_shutter_may_open_before_the_motion) {
  const Picture picture =
      rendered_text(view("\"float shutteropen\" 1 \"float shutterclose\" 2.5 ", "TransformTimes 1.5 3.5") + kSky +
                        "ActiveTransform EndTime Translate 8 0 0 ActiveTransform All\n" + kBar,
                    kSamples);
  // Its exposure is one and a half.
  const auto brightness = [](double x, double) {
    const double standing = x >= -6 && x < -4 ? 1 : 0;
    return 1 - (standing + 2 * covered(x, -6, 2, 4)) / 3;
  };
  Picture normal = picture;
  for (Rgb& pixel : normal.pixels) pixel = pixel * (1 / 1.5f);
  expect_picture(normal, brightness, kSamples);
}

// A quadrant that turns by a right angle: lengths of time grow with the angle, which no mixture of matrices gives.
TEST(MotionAnswers, a_turning_quadrant_sweeps_angles_evenly) {
  const Picture picture =
      rendered_text(view("") + kSky + "ActiveTransform EndTime Rotate 90 0 0 1 ActiveTransform All\n" + kBlack +
                        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 90 0 0 90 90 0 0 90 0" + kFaces,
                    kSamples);
  const auto brightness = [](double x, double y) {
    const double angle = std::atan2(y, x) / (M_PI / 2);  // in right angles; covered from t to t + 1
    return angle < 0 ? 1 : 1 - std::max(0.0, std::min(angle, 1.0) - std::max(angle - 1, 0.0));
  };
  expect_picture(picture, brightness, kSamples);
}

// Above the camera, out of its sight, and below the sun: its shadow moves over the floor.
TEST(MotionAnswers, a_moving_shadow_is_as_blurred_as_what_casts_it) {
  const std::string floor =
      "Material \"diffuse\" \"rgb reflectance\" [0.5 0.5 0.5]\nShape \"trianglemesh\" \"point3 P\" "
      "[-90 -90 0 90 -90 0 90 90 0 -90 90 0" +
      std::string(kFaces);
  const std::string sun =
      "LightSource \"distant\" \"point3 from\" [0 0 9] \"point3 to\" [0 0 0] \"rgb L\" [6.2831853 6.2831853 "
      "6.2831853]\n";
  const Picture picture = rendered_text(
      view("") + sun + floor + "Translate 0 0 6 ActiveTransform EndTime Translate 8 0 0 ActiveTransform All\n" + kBar,
      kSamples);
  expect_picture(
      picture, [](double x, double) { return 1 - covered(x, -6, 2, 8); }, kSamples);
}

// Veils whose opacity is a half: rays that were let through, of both kinds, go on at the time they had.
TEST(MotionAnswers, what_lies_behind_a_veil_is_seen_at_the_same_time) {
  const std::string veil = std::string(kBlack) + "Shape \"trianglemesh\" \"point3 P\" [-6 -9 1 -4 -9 1 -4 9 1 -6 9 1" +
                           "] \"integer indices\" [0 1 2 0 2 3] \"float alpha\" 0.5\n";
  const Picture picture = rendered_text(
      view("") + kSky + "ActiveTransform EndTime Translate 8 0 0 ActiveTransform All\n" + veil + kBar, kSamples);
  // Veil and bar move together: what the veil lets through ends at the bar.
  expect_picture(
      picture, [](double x, double) { return 1 - covered(x, -6, 2, 8); }, kSamples);
}

// The camera goes one way or all else goes the other; by the same random numbers, up to rounding at edges.
TEST(MotionAnswers, a_moving_camera_sees_what_it_would_see_if_the_world_moved) {
  const auto cube = [](const std::string& move) {
    return std::string("LightSource \"infinite\" \"rgb L\" [0.3 0.4 0.5]\nAttributeBegin ") + move +
           "Material \"diffuse\" \"rgb reflectance\" [0.8 0.6 0.2]\nRotate 30 1 1 0\nShape \"sphere\" \"float radius\" "
           "3\n"
           "Translate 3 2 0\nShape \"trianglemesh\" \"point3 P\" [-3 -3 1 3 -3 1 3 3 -1 -3 3 -1" +
           kFaces + "AttributeEnd\n";
  };
  const std::string there = "ActiveTransform EndTime Translate 3 -2 1 ActiveTransform All ";
  const Picture world = rendered_text(view("") + cube(there), 256);
  const Picture camera = rendered_text(view("", "", there) + cube(""), 256);
  const EqualityReport report = statistical_equality(world, camera, metric_mask(world, camera, {}));
  EXPECT_TRUE(report.equal) << report.failing_pixels << " pixels, " << report.failing_blocks << " blocks";
  const Picture still = rendered_text(view("") + cube(""), 256);
  EXPECT_FALSE(statistical_equality(world, still, metric_mask(world, still, {})).equal);
}

}  // namespace
}  // namespace spillway::tools
