// Pictures of other renderers, and pictures whose answer is known.
//
// Each scene of tests/twins was also written by hand for Mitsuba 3, whose pictures are in tests/images
// (tests/twins/make_twins.py). They must be equal within the noise that both tell of.

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "tests/support/black_body_luminance.h"
#include "tests/support/small_scene.h"
#include "tests/tools/rendered.h"
#include "tools/metrics/statistical_equality.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;

#ifndef __SANITIZE_ADDRESS__  // under which the samples that statistics need would take minutes
constexpr int kSamples = 2048;

class Twins : public testing::TestWithParam<const char*> {};

TEST_P(Twins, are_equal_within_their_noise) {
  const fs::path source = SPILLWAY_SOURCE_DIR;
  const std::string_view name = GetParam();
  const bool is_caustic = name == "glass" || name == "mirror" || name == "cloud_in_glass";
  const int more = name == "fog" ? 4 : is_caustic ? 2 : 1;  // edges of a bright bulb, and caustics, are noisier
  const Picture ours = rendered(source / "tests/twins" / (std::string(GetParam()) + ".pbrt"), more * kSamples);
  const auto theirs = read_picture(source / "tests/images" / (std::string(GetParam()) + ".exr"));
  ASSERT_TRUE(theirs) << theirs.error().message;
  ASSERT_TRUE(ours.has_halves() && theirs->has_halves());
  ASSERT_EQ(ours.pixels.size(), theirs->pixels.size());
  // No pixel and no block of 8 x 8 outside of its interval at 1 %, after Sidak's correction, and no cluster.
  const EqualityReport report = statistical_equality(ours, *theirs, metric_mask(ours, *theirs, {}));
  EXPECT_TRUE(report.equal) << report.failing_pixels << " pixels, " << report.failing_blocks << " blocks, cluster of "
                            << report.largest_cluster;
  const Mean a = mean_of(ours), b = mean_of(*theirs);
  const double four_errors = 4 * std::hypot(a.standard_error, b.standard_error) / b.value;
  EXPECT_LE(std::fabs(a.value / b.value - 1), std::max(0.001, four_errors));
  EXPECT_LE(four_errors, 0.003);
  RecordProperty("four_standard_errors", std::to_string(four_errors));
}

INSTANTIATE_TEST_SUITE_P(Mitsuba, Twins,
                         testing::Values("box", "bulb", "bulb_point", "cloud_in_glass", "colors", "fog", "glass",
                                         "globe", "instances", "lamps", "lens", "many_lamps", "mirror", "motion",
                                         "nested", "orthographic", "patches", "plastic", "projector", "quadrics",
                                         "screen", "sky", "smoke", "spot", "sun", "texture", "thin_glass"),
                         [](const auto& name) { return std::string(name.param); });
#endif

// ---- scenes with an answer ----

constexpr const char* kView =
    "LookAt 0 0 5 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 4\n"
    "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16 PixelFilter \"box\"\n"
    "Integrator \"path\" \"integer maxdepth\" 200\nWorldBegin\n";
constexpr const char* kFloor =
    "Material \"diffuse\" \"rgb reflectance\" [0.5 0.5 0.5]\nShape \"trianglemesh\" \"point3 P\" "
    "[-90 -90 0 90 -90 0 90 90 0 -90 90 0] \"integer indices\" [0 1 2 0 2 3]\n";
constexpr const char* kBlack = "Material \"diffuse\" \"rgb reflectance\" [0 0 0]\n";

// A black sheet of opacity 0.4 across the plane z = `z`, or the plane y = 1.
std::string veil(const std::string& points) {
  return std::string(kBlack) + "Shape \"trianglemesh\" \"point3 P\" [" + points +
         "] \"integer indices\" [0 1 2 0 2 3] \"float alpha\" 0.4\n";
}

Mean mean_of_scene(const std::string& world, int samples = 1024) {
  const test::TemporaryDirectory directory;
  std::ofstream(directory.path() / "scene.pbrt") << kView << world;
  return mean_of(rendered(directory.path() / "scene.pbrt", samples));
}

void expect_mean(const std::string& world, double wanted, double relative_error, int samples = 1024) {
  const Mean mean = mean_of_scene(world, samples);
  EXPECT_NEAR(mean.value, wanted, wanted * relative_error + 4 * mean.standard_error) << world;
  EXPECT_LT(mean.standard_error, 0.003 * wanted);
}

TEST(KnownAnswers, a_sun_and_a_point_on_a_floor) {
  // Irradiance 2 across the beam, 60 degrees off: 2 cos 60 rho / pi.
  expect_mean("LightSource \"distant\" \"point3 from\" [0 1.7320508 1] \"point3 to\" [0 0 0] \"rgb L\" [2 2 2]\n" +
                  std::string(kFloor),
              2 * 0.5 * 0.5 / M_PI, 1e-5);
  // I cos / d^2 rho / pi, over a picture 0.35 wide: off by less than a thousandth.
  expect_mean("LightSource \"point\" \"point3 from\" [0 3 4] \"rgb I\" [100 100 100]\n" + std::string(kFloor),
              100 * 0.8 / 25 * 0.5 / M_PI, 1e-3);
}

TEST(KnownAnswers, a_veil_lets_through_what_it_does_not_stop) {
  expect_mean("LightSource \"infinite\" \"rgb L\" [1 1 1]\n" + veil("-9 -9 1 9 -9 1 9 9 1 -9 9 1"), 0.6, 0.002);
  // Shadow rays: of a point, then of a sky.
  expect_mean("LightSource \"point\" \"point3 from\" [0 3 4] \"rgb I\" [100 100 100]\n" + std::string(kFloor) +
                  veil("-9 1 0.1 9 1 0.1 9 1 9 -9 1 9"),
              0.6 * 100 * 0.8 / 25 * 0.5 / M_PI, 0.003);
  expect_mean("LightSource \"infinite\" \"rgb L\" [1 1 1]\n" + std::string(kFloor) +
                  veil("-90 -90 5.5 90 -90 5.5 90 90 5.5 -90 90 5.5"),
              0.6 * 0.5, 0.003);
}

// Emission 1 and albedo one half on every side: 1 + 1/2 + 1/4 and so on, whichever way one looks.
TEST(KnownAnswers, a_closed_furnace_of_albedo_one_half_is_twice_as_bright) {
  expect_mean(
      "AreaLightSource \"diffuse\" \"rgb L\" [1 1 1] \"bool twosided\" true\nMaterial \"diffuse\" \"rgb reflectance\" "
      "[0.5 0.5 0.5]\n"
      "Shape \"sphere\" \"float radius\" 8\n",
      2, 0.001);
}

// A box of the medium "gas", from z = -1 to 1, in front of a white sky.
std::string gas_box(const std::string& medium) {
  return "LightSource \"infinite\" \"rgb L\" [1 1 1]\nMakeNamedMedium \"gas\" " + medium +
         "\nMediumInterface \"gas\" \"\" Material \"interface\"\nShape \"trianglemesh\" \"point3 P\" "
         "[-9 -9 -1 9 -9 -1 9 9 -1 -9 9 -1 -9 -9 1 9 -9 1 9 9 1 -9 9 1] \"integer indices\" "
         "[0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7]\n";
}

// Beer's law, and what glows along the way; the rays are up to a thousandth longer than the box is deep.
TEST(KnownAnswers, gas_that_absorbs_lets_through_what_beers_law_says) {
  expect_mean(gas_box("\"string type\" \"homogeneous\" \"rgb sigma_a\" [0.4 0.4 0.4] \"rgb sigma_s\" [0 0 0]"),
              std::exp(-0.8), 0.003);
  // A grid whose density is 2 everywhere inside, fading over its outermost half cells: 40 cells over 4 units.
  std::string density;
  for (int i = 0; i < 40; ++i) density += "2 ";
  expect_mean(gas_box("\"string type\" \"uniformgrid\" \"integer nz\" 40 \"point3 p0\" [-99 -99 -2] \"point3 p1\" "
                      "[99 99 2] \"rgb sigma_a\" [0.3 0.3 0.3] \"rgb sigma_s\" [0 0 0] \"float density\" [" +
                      density + "]"),
              std::exp(-0.3 * 2 * 2), 0.004, 2048);
  // The same as colours, and as one that glows.
  std::string colors, zeros, glow;
  for (int i = 0; i < 40; ++i) colors += "0.6 0.6 0.6 ", zeros += "0 0 0 ", glow += "3 3 3 ";
  const std::string grid =
      "\"string type\" \"rgbgrid\" \"integer nz\" 40 \"point3 p0\" [-99 -99 -2] \"point3 p1\" [99 99 2] "
      "\"rgb sigma_a\" [" +
      colors + "] \"rgb sigma_s\" [" + zeros + "]";
  expect_mean(gas_box(grid), std::exp(-0.3 * 2 * 2), 0.004, 2048);
  expect_mean(gas_box(grid + " \"rgb Le\" [" + glow + "]"), std::exp(-1.2) + 3 * (1 - std::exp(-1.2)), 0.004, 2048);
  expect_mean(gas_box("\"string type\" \"homogeneous\" \"rgb sigma_a\" [0.4 0.4 0.4] \"rgb sigma_s\" [0 0 0] "
                      "\"rgb Le\" [3 3 3]"),
              std::exp(-0.8) + 3 * (1 - std::exp(-0.8)), 0.003);
  // One that glows by a number a sample, and one by its heat: a black body's radiance over that where it is brightest.
  std::string shine, heat;
  for (int i = 0; i < 40; ++i) shine += "1.5 ", heat += "2700 ";
  const std::string hot =
      "\"string type\" \"uniformgrid\" \"integer nz\" 40 \"point3 p0\" [-99 -99 -2] \"point3 p1\" [99 99 2] "
      "\"rgb sigma_a\" [0.3 0.3 0.3] \"rgb sigma_s\" [0 0 0] \"float density\" [" +
      density + "]";
  expect_mean(gas_box(hot + " \"rgb Le\" [2 2 2] \"float Lescale\" [" + shine + "]"),
              std::exp(-1.2) + 3 * (1 - std::exp(-1.2)), 0.004, 2048);
  expect_mean(gas_box(hot + " \"float Lescale\" 5 \"float temperature\" [" + heat + "]"),
              std::exp(-1.2) + 5 * test::luminance_of_a_body(2700) * (1 - std::exp(-1.2)), 0.006, 2048);
}

// Shadow rays go on behind what lets them through, and end before the lamp as they would have ended without it.
TEST(KnownAnswers, a_lamp_shines_through_what_is_not_there) {
  const std::string lamp = std::string(kFloor) +
                           "AttributeBegin Translate 0 0 8 AreaLightSource \"diffuse\" \"rgb L\" [9 9 9] Shape "
                           "\"trianglemesh\" \"point3 P\" [-1 -1 0 1 1 0 1 -1 0] AttributeEnd\n";
  const std::string medium = "\"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] \"rgb sigma_s\" [0 0 0]";
  const std::string gas = gas_box(medium), box = gas.substr(gas.find("MakeNamedMedium"));
  const Mean open = mean_of_scene(lamp);
  EXPECT_GT(open.value, 0.04);
  expect_mean(lamp + "Translate 0 0 2\n" + box, open.value, 0.003);
}

// Sheets a kilometre from the origin let a ray go on a little further than it came; the lamp's place is known better.
TEST(KnownAnswers, a_lamp_shines_through_sheets_that_are_known_worse_than_it) {
  const auto mean = [](int sheets) {
    std::string text =
        "LookAt 0 0 -995 0 0 -1000 0 1 0 Camera \"perspective\" \"float fov\" 4\n"
        "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16 PixelFilter \"box\"\n"
        "Integrator \"path\" \"integer maxdepth\" 1\nWorldBegin\n"
        "AttributeBegin AreaLightSource \"diffuse\" \"rgb L\" [900 900 900] Shape \"trianglemesh\" \"point3 P\" "
        "[-99 -99 0 99 99 0 99 -99 0] AttributeEnd\nAttributeBegin Translate 0 0 -1000\n" +
        std::string(kFloor) +
        "AttributeEnd\nMakeNamedMedium \"nothing\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] \"rgb "
        "sigma_s\" [0 0 0]\nMediumInterface \"nothing\" \"\" Material \"interface\" Translate 0 0 -900\n";
    for (int i = 0; i < sheets; ++i)
      text +=
          "Translate 0 0 -4 Shape \"trianglemesh\" \"point3 P\" [-999 -999 0 999 -999 0 999 999 0 -999 999 0] "
          "\"integer indices\" [0 1 2 0 2 3]\n";
    const test::TemporaryDirectory directory;
    std::ofstream(directory.path() / "scene.pbrt") << text;
    return mean_of(rendered(directory.path() / "scene.pbrt", 64)).value;
  };
  const double open = mean(0);
  EXPECT_GT(open, 0.5);
  EXPECT_NEAR(mean(20), open, 1e-3 * open);
}

// Gas that loses nothing cannot be seen in a white sky, however thick it is: an optical depth of 50.
TEST(KnownAnswers, a_furnace_of_gas_returns_everything) {
  const test::TemporaryDirectory directory;
  std::ofstream(directory.path() / "scene.pbrt")
      << "LookAt 0 0 9 0 0 0 0 1 0 Camera \"perspective\" \"float fov\" 4\n"
         "Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8 PixelFilter \"box\"\n"
         "Integrator \"volpath\" \"integer maxdepth\" 30000\nWorldBegin\nLightSource \"infinite\" \"rgb L\" [1 1 1]\n"
         "MakeNamedMedium \"gas\" \"string type\" \"homogeneous\" \"rgb sigma_a\" [0 0 0] \"rgb sigma_s\" [25 25 25] "
         "\"float g\" 0.3\nMediumInterface \"gas\" \"\" Material \"interface\" Shape \"sphere\"\n";
  const Mean mean = mean_of(rendered(directory.path() / "scene.pbrt", 256));
  EXPECT_NEAR(mean.value, 1, 4 * mean.standard_error);
  EXPECT_LT(mean.standard_error, 0.02);
}

// A sky seen through a skylight of twenty by twenty, twenty above the floor, and nowhere else.
TEST(KnownAnswers, a_portal_lets_in_what_is_seen_through_it) {
  const std::string sky =
      "LightSource \"infinite\" \"rgb L\" [1 1 1] \"point3 portal\" [-10 -10 20 -10 10 20 10 10 20 10 -10 20]\n";
  const double a = 0.5, root = std::sqrt(1 + a * a), corner = 2 * a / root * std::atan(a / root) / (2 * M_PI);
  expect_mean(sky + kFloor, 0.5 * 4 * corner, 0.002);  // a floor of one half; Howell, configuration B-3, at its corner
  EXPECT_EQ(mean_of_scene(sky, 16).value, 0);          // looking down, away from it
}

// A mix is one of its parts, as often as it says, whatever they are.
TEST(KnownAnswers, a_mix_returns_the_mean_of_its_parts) {
  expect_mean(
      "LightSource \"infinite\" \"rgb L\" [1 1 1]\nMakeNamedMaterial \"a\" \"string type\" \"diffuse\" \"rgb "
      "reflectance\" "
      "[0.8 0.8 0.8]\nMakeNamedMaterial \"b\" \"string type\" \"diffusetransmission\" \"rgb reflectance\" [0.1 0.1 "
      "0.1] "
      "\"rgb transmittance\" [0.3 0.3 0.3]\nMaterial \"mix\" \"string materials\" [\"a\" \"b\"] \"float amount\" 0.25\n"
      "Shape \"trianglemesh\" \"point3 P\" [-9 -9 0 9 -9 0 9 9 0 -9 9 0] \"integer indices\" [0 1 2 0 2 3]\n",
      0.75 * 0.8 + 0.25 * 0.4, 0.002);
}

// A sheet that sends each share to its side: a point before it, then the same point behind it.
TEST(KnownAnswers, a_translucent_sheet_is_lit_from_both_sides) {
  const std::string sheet =
      "Material \"diffusetransmission\" \"rgb reflectance\" [0.3 0.3 0.3] \"rgb transmittance\" [0.6 0.6 0.6] \"float "
      "scale\" 0.5\nShape \"trianglemesh\" \"point3 P\" [-9 -9 0 9 -9 0 9 9 0 -9 9 0] \"integer indices\" [0 1 2 0 2 "
      "3]\n";
  for (const auto& [z, share] : {std::pair(4, 0.15), std::pair(-4, 0.3)})
    expect_mean(fmt::format("LightSource \"point\" \"point3 from\" [0 3 {}] \"rgb I\" [100 100 100]\n", z) + sheet,
                100 * 0.8 / 25 * share / M_PI, 1e-3);
}

// A map of one texel tilts the whole floor.
TEST(KnownAnswers, a_normal_map_tilts_the_light_on_a_floor) {
  const test::TemporaryDirectory directory;
  std::ofstream(directory.path() / "tilt.ppm", std::ios::binary) << "P6\n1 1\n255\n" << '\xb0' << '\x70' << '\xe0';
  std::ofstream(directory.path() / "scene.pbrt")
      << kView << "LightSource \"distant\" \"point3 from\" [1 2 3] \"point3 to\" [0 0 0] \"rgb L\" [2 2 2]\n"
      << "Material \"diffuse\" \"rgb reflectance\" [0.5 0.5 0.5] \"string normalmap\" \"tilt.ppm\"\n"
      << "Shape \"trianglemesh\" \"point3 P\" [-9 -9 0 9 -9 0 9 9 0 -9 9 0] \"point2 uv\" [0 0 1 0 1 1 0 1] "
         "\"integer indices\" [0 1 2 0 2 3]\n";
  const double n[3] = {2 * 0xb0 / 255.0 - 1, 2 * 0x70 / 255.0 - 1, 2 * 0xe0 / 255.0 - 1};
  const double cosine = (n[0] + 2 * n[1] + 3 * n[2]) / std::sqrt(14 * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]));
  const Mean mean = mean_of(rendered(directory.path() / "scene.pbrt", 64));
  EXPECT_NEAR(mean.value, 2 * cosine * 0.5 / M_PI, 1e-4);
}

// Clear glass in a white sky cannot be seen, through however many faces.
TEST(KnownAnswers, glass_in_a_white_sky_is_not_there) {
  expect_mean(
      "LightSource \"infinite\" \"rgb L\" [1 1 1]\nMaterial \"dielectric\"\nShape \"sphere\" \"float radius\" 0.1\n"
      "Material \"thindielectric\"\nShape \"bilinearmesh\" \"point3 P\" [-1 -1 1 1 -1 1 -1 1 1 1 1 1]\n",
      1, 0.002);
}

}  // namespace
}  // namespace spillway::tools
