// Colours of black bodies against published chromaticities; metals against published reflectances.

#include "tools/import/spectra.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tools/import/color_space.h"

namespace spillway::tools {
namespace {

struct Chromaticity {
  double x, y;
};

// IEC 61966-2-1, inverse.
Chromaticity chromaticity(Rgb c) {
  const double x = 0.4124 * c.r + 0.3576 * c.g + 0.1805 * c.b, y = 0.2126 * c.r + 0.7152 * c.g + 0.0722 * c.b,
               z = 0.0193 * c.r + 0.1192 * c.g + 0.9505 * c.b;
  return {x / (x + y + z), y / (x + y + z)};
}

TEST(spectra, black_bodies_have_the_chromaticities_of_the_planckian_locus) {
  // CIE 1931: 2856 K is illuminant A; the others from Wyszecki and Stiles 1982, Color Science, table of the locus.
  struct {
    float kelvin;
    Chromaticity want;
  } cases[] = {{2000, {0.5267, 0.4133}},
               {2856, {0.4476, 0.4074}},
               {4000, {0.3805, 0.3768}},
               {6500, {0.3135, 0.3237}},
               {10000, {0.2807, 0.2884}}};
  for (const auto& c : cases) {
    const Chromaticity got = chromaticity(blackbody_rgb(c.kelvin));
    // The analytic matching functions are within 1 % of the tables.
    EXPECT_NEAR(got.x, c.want.x, 0.004) << c.kelvin;
    EXPECT_NEAR(got.y, c.want.y, 0.004) << c.kelvin;
  }
}

TEST(spectra, black_bodies_have_luminance_one_and_no_negative_component) {
  for (const float kelvin : {500.0f, 1000.0f, 1500.0f, 3000.0f, 6500.0f, 20000.0f, 1e6f}) {
    const Rgb rgb = blackbody_rgb(kelvin);
    EXPECT_NEAR(luminance(rgb), 1, 1e-6f) << kelvin;  // a few roundings of 32-bit floats
    EXPECT_GE(rgb.r, 0) << kelvin;
    EXPECT_GE(rgb.g, 0) << kelvin;
    EXPECT_GE(rgb.b, 0) << kelvin;
  }
  EXPECT_GT(blackbody_rgb(2000).r, 20 * blackbody_rgb(2000).b);
  EXPECT_LT(blackbody_rgb(20000).r, blackbody_rgb(20000).b);
}

TEST(spectra, piecewise_linear_spectra_are_zero_outside) {
  const float pairs[] = {400, 1, 500, 3, 600, 0};
  EXPECT_EQ(spectrum_at(pairs, 399), 0);
  EXPECT_EQ(spectrum_at(pairs, 400), 1);
  EXPECT_EQ(spectrum_at(pairs, 450), 2);
  EXPECT_EQ(spectrum_at(pairs, 500), 3);
  EXPECT_EQ(spectrum_at(pairs, 575), 0.75f);
  EXPECT_EQ(spectrum_at(pairs, 601), 0);
  EXPECT_EQ(spectrum_at(std::span(pairs).first(2), 400), 0);
  constexpr float kWide[] = {400, -3e38f, 600, 3e38f};
  EXPECT_EQ(spectrum_at(kWide, 500), 0);  // the difference of the two is no float
}

TEST(spectra, light_spectra_are_integrated) {
  const float flat[] = {300, 5, 900, 5};  // equal energy: x = y = 1/3
  const auto rgb = light_rgb(flat);
  ASSERT_TRUE(rgb.has_value());
  EXPECT_NEAR(chromaticity(*rgb).x, 1.0 / 3, 0.004);  // the fit, as above
  EXPECT_NEAR(chromaticity(*rgb).y, 1.0 / 3, 0.004);
  EXPECT_NEAR(luminance(*rgb), 1, 1e-6f);
  const float infrared[] = {900, 1, 1000, 1};
  EXPECT_FALSE(light_rgb(infrared).has_value());
}

TEST(spectra, standard_illuminants_have_their_chromaticities) {
  struct {
    const char* name;
    Chromaticity want;
  } cases[] = {{"stdillum-A", {0.4476, 0.4074}},   {"stdillum-D50", {0.3457, 0.3585}},
               {"stdillum-D65", {0.3127, 0.3290}}, {"stdillum-F2", {0.3721, 0.3751}},
               {"stdillum-F11", {0.3805, 0.3769}}, {"illum-acesD60", {0.3217, 0.3377}}};
  for (const auto& c : cases) {
    const auto rgb = illuminant_rgb(c.name);
    ASSERT_TRUE(rgb.has_value()) << c.name;
    EXPECT_NEAR(chromaticity(*rgb).x, c.want.x, 3e-4) << c.name;  // four digits of the published matrix and values
    EXPECT_NEAR(chromaticity(*rgb).y, c.want.y, 3e-4) << c.name;
    EXPECT_NEAR(luminance(*rgb), 1, 1e-4f) << c.name;
  }
  for (int i = 1; i <= 12; ++i) EXPECT_TRUE(illuminant_rgb("stdillum-F" + std::to_string(i)).has_value()) << i;
  EXPECT_FALSE(illuminant_rgb("stdillum-F13").has_value());
}

TEST(spectra, color_spaces_are_converted_by_the_published_matrices) {
  const auto expect_column = [](Rgb got, double r, double g, double b) {
    EXPECT_NEAR(got.r, r, 6e-4);
    EXPECT_NEAR(got.g, g, 6e-4);
    EXPECT_NEAR(got.b, b, 6e-4);
  };
  // ITU-R BT.2407, annex 2: BT.2020 to BT.709.
  expect_column(surface_rec709(ColorSpace::rec2020, {1, 0, 0}), 1.6605, -0.1246, -0.0182);
  expect_column(light_rec709(ColorSpace::rec2020, {0, 1, 0}), -0.5876, 1.1329, -0.1006);
  expect_column(light_rec709(ColorSpace::rec2020, {0, 0, 1}), -0.0728, -0.0083, 1.1187);
  expect_column(light_rec709(ColorSpace::dci_p3, {1, 0, 0}), 1.2249, -0.0420, -0.0197);
  // AMPAS, ACES to linear Rec. 709 with Bradford's adaptation of D60 to D65.
  expect_column(surface_rec709(ColorSpace::aces2065_1, {1, 0, 0}), 2.5217, -0.2765, -0.0154);
  expect_column(surface_rec709(ColorSpace::aces2065_1, {0, 1, 0}), -1.1341, 1.3727, -0.1530);
  expect_column(surface_rec709(ColorSpace::aces2065_1, {0, 0, 1}), -0.3876, -0.0962, 1.1684);
  expect_column(surface_rec709(ColorSpace::aces2065_1, {1, 1, 1}), 1, 1, 1);
  EXPECT_FALSE(color_space("adobe").has_value());
}

double normal_reflectance(float eta, float k) {
  return ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k);
}

TEST(spectra, metals_have_their_colours) {
  const auto reflectance = [](const std::string& metal) {
    const Rgb eta = *metal_rgb("metal-" + metal + "-eta"), k = *metal_rgb("metal-" + metal + "-k");
    return Rgb{static_cast<float>(normal_reflectance(eta.r, k.r)), static_cast<float>(normal_reflectance(eta.g, k.g)),
               static_cast<float>(normal_reflectance(eta.b, k.b))};
  };
  // Normal reflectance (red, green) as handbooks round it (CRC Handbook, optical properties of metals): two digits.
  const Rgb ag = reflectance("Ag"), al = reflectance("Al"), au = reflectance("Au"), cu = reflectance("Cu");
  EXPECT_NEAR(ag.r, 0.97, 0.02);
  EXPECT_NEAR(ag.b, 0.94, 0.03);
  EXPECT_NEAR(al.r, 0.91, 0.02);
  EXPECT_NEAR(al.b, 0.92, 0.02);
  EXPECT_NEAR(au.r, 0.93, 0.02);
  EXPECT_NEAR(au.b, 0.37, 0.03);
  EXPECT_NEAR(cu.r, 0.93, 0.02);
  EXPECT_NEAR(cu.g, 0.61, 0.03);
  const Rgb brass = reflectance("CuZn");
  EXPECT_TRUE(brass.r > brass.g && brass.g > brass.b);
}

TEST(spectra, oxides_follow_their_dispersion_formulas) {
  const Rgb mgo = *metal_rgb("metal-MgO-eta"), tio2 = *metal_rgb("metal-TiO2-eta");
  for (int i = 0; i < 3; ++i) {
    const double l2 = std::pow(kRgbWavelengths_nm[i] / 1000.0, 2);  // square micrometres
    const double stephens_malitson =
        std::sqrt(1 + 1.111033 * l2 / (l2 - 0.0712465 * 0.0712465) + 0.8460085 * l2 / (l2 - 0.1375204 * 0.1375204) +
                  7.808527 * l2 / (l2 - 26.89302 * 26.89302));
    const double devore = std::sqrt(7.197 + 0.3322 / (l2 - 0.0843));
    // Linear interpolation between tabulated wavelengths.
    EXPECT_NEAR(i == 0 ? mgo.r : i == 1 ? mgo.g : mgo.b, stephens_malitson, 0.002) << i;
    EXPECT_NEAR(i == 0 ? tio2.r : i == 1 ? tio2.g : tio2.b, devore, 0.01) << i;
  }
  EXPECT_TRUE(is_black(*metal_rgb("metal-MgO-k")));
}

TEST(spectra, names_are_exact) {
  for (const char* metal : {"Ag", "Al", "Au", "Cu", "CuZn", "MgO", "TiO2"}) {
    EXPECT_TRUE(metal_rgb(std::string("metal-") + metal + "-eta").has_value()) << metal;
    EXPECT_TRUE(metal_rgb(std::string("metal-") + metal + "-k").has_value()) << metal;
  }
  for (const char* none : {"metal-Ag", "metal-Ag-n", "metal-Xx-eta", "Ag-eta", "", "metal-"}) {
    EXPECT_FALSE(metal_rgb(none).has_value()) << none;
  }
  // Crown below flint: n_d of the catalogue.
  EXPECT_FLOAT_EQ(*glass_eta("glass-BK7"), 1.5168f);
  EXPECT_LT(*glass_eta("glass-FK51A"), *glass_eta("glass-BK7"));
  EXPECT_LT(*glass_eta("glass-BAF10"), *glass_eta("glass-F5"));
  EXPECT_LT(*glass_eta("glass-F10"), *glass_eta("glass-F11"));
  EXPECT_LT(*glass_eta("glass-F11"), *glass_eta("glass-LASF9"));
  EXPECT_FALSE(glass_eta("BK7").has_value());
}

}  // namespace
}  // namespace spillway::tools
