// Neither the unit of length nor that of light shows in a picture.

#include <gtest/gtest.h>

#include <fstream>

#include "tests/tools/rendered.h"

namespace spillway::tools {
namespace {

// A block on a floor under a panel and a sky, all sizes times `size`, all light times `light`.
Mean mean_of_block(double size, double light) {
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "scene.pbrt";
  const double s = size;
  std::ofstream(path) << fmt::format(
      "LookAt 0 {} {} 0 0 {} 0 0 1 Camera \"perspective\" \"float fov\" 32\n"
      "Film \"rgb\" \"integer xresolution\" 16 \"integer yresolution\" 16 PixelFilter \"box\" WorldBegin\n"
      "Scale {} {} {} LightSource \"infinite\" \"rgb L\" [0.5 0.6 0.7] \"float scale\" {}\n"
      "Material \"diffuse\" \"rgb reflectance\" [0.5 0.4 0.3]\n"
      "Shape \"trianglemesh\" \"point3 P\" [-8 -8 0 8 -8 0 8 8 0 -8 8 0] \"integer indices\" [0 1 2 0 2 3]\n"
      "Material \"conductor\" \"float roughness\" 0.1 AttributeBegin Translate 0 0 0.8\n"
      "Shape \"sphere\" \"float radius\" 0.8 AttributeEnd\n"
      "AreaLightSource \"diffuse\" \"rgb L\" [9 8 7] \"float scale\" {} Translate 1 -1 4\n"
      "Shape \"trianglemesh\" \"point3 P\" [-1 -1 0 -1 1 0 1 1 0 1 -1 0] \"integer indices\" [0 1 2 0 2 3]\n",
      -4 * s, 6 * s, 0.4 * s, s, s, s, light, light);
  Mean mean = mean_of(rendered(path, 256));
  mean.value /= light, mean.standard_error /= light;
  return mean;
}

TEST(ScaleLaws, means_do_not_change_with_the_unit_of_length) {
  const Mean one = mean_of_block(1, 1);
  EXPECT_LT(one.standard_error, 0.003 * one.value);
  for (const double size : {1e-8, 1e6}) {
    const Mean scaled = mean_of_block(size, 1);
    EXPECT_NEAR(scaled.value, one.value, 4 * std::hypot(one.standard_error, scaled.standard_error)) << size;
  }
}

TEST(ScaleLaws, means_follow_the_unit_of_light) {
  const Mean one = mean_of_block(1, 1);
  for (const double light : {1e-8, 1e6}) {
    const Mean scaled = mean_of_block(1, light);
    EXPECT_NEAR(scaled.value, one.value, 4 * std::hypot(one.standard_error, scaled.standard_error)) << light;
    EXPECT_LT(scaled.standard_error, 0.02 * one.value) << light;
  }
}

}  // namespace
}  // namespace spillway::tools
