// An instance is its object's shapes where its transform puts them: whatever affine map that is, and whatever emits.

#include <gtest/gtest.h>

#include <fstream>

#include "tests/tools/rendered.h"
#include "tools/metrics/statistical_equality.h"

namespace spillway::tools {
namespace {

// Smooth normals, a rough conductor, glass, and a lamp that shines to one side only: each sees a mirroring differently.
constexpr const char* kShapes = R"(
AttributeBegin
Material "conductor" "float roughness" 0.2
Translate -1 0.6 0 Shape "sphere" "float radius" 0.6
AttributeEnd
AttributeBegin
Material "dielectric"
Translate 1 0.5 0.4 ReverseOrientation Shape "sphere" "float radius" 0.5
AttributeEnd
AttributeBegin
Material "diffuse" "rgb reflectance" [0.7 0.5 0.3]
Shape "trianglemesh" "point3 P" [-3 0 -2 3 0 -2 3 0 2 -3 0 2] "integer indices" [0 2 1 0 3 2]
Translate 0 0.3 -0.8 Rotate 30 0 1 0 Scale 0.3 0.3 0.3
Shape "cylinder" "float zmin" -1 "float zmax" 1
AttributeEnd
AttributeBegin
Material "diffuse" "rgb reflectance" [0 0 0]
AreaLightSource "diffuse" "rgb L" [9 8 7]
Translate 0.4 2.2 0 Rotate 25 0 0 1
Shape "trianglemesh" "point3 P" [-0.5 0 -0.5 0.5 0 -0.5 0.5 0 0.5 -0.5 0 0.5] "integer indices" [0 1 2 0 2 3]
AttributeEnd
)";
constexpr const char* kView = R"(LookAt 0 2 7 0 0.7 0 0 1 0
Camera "perspective" "float fov" 40
Film "rgb" "integer xresolution" 32 "integer yresolution" 24 PixelFilter "box"
Integrator "path" "integer maxdepth" 6
WorldBegin
LightSource "infinite" "rgb L" [0.1 0.15 0.2]
)";

Picture rendered_text(const std::string& world) {
  const test::TemporaryDirectory directory;
  std::ofstream(directory.path() / "scene.pbrt") << kView << world;
  return rendered(directory.path() / "scene.pbrt", 512);
}

class Instances : public testing::TestWithParam<const char*> {};

TEST_P(Instances, look_as_their_shapes_would_where_they_stand) {
  const std::string place = GetParam();
  const Picture shapes = rendered_text(place + kShapes);
  const Picture instance = rendered_text("ObjectBegin \"all\"\n" + std::string(kShapes) + "ObjectEnd\n" + place +
                                         " ObjectInstance \"all\"\n");
  const EqualityReport report = statistical_equality(shapes, instance, metric_mask(shapes, instance, {}));
  EXPECT_TRUE(report.equal) << report.failing_pixels << " pixels, " << report.failing_blocks << " blocks";
  const Mean a = mean_of(shapes), b = mean_of(instance);
  const double four_errors = 4 * std::hypot(a.standard_error, b.standard_error);
  EXPECT_NEAR(a.value, b.value, std::max(four_errors, 0.001 * a.value));
  EXPECT_LT(four_errors, 0.02 * a.value);
  EXPECT_GT(a.value, 0.1);
}

std::string name_of(const testing::TestParamInfo<const char*>& info) {
  constexpr const char* kNames[] = {"Mirrored", "Sheared", "MirroredAndSheared", "MirroredAndTurned"};
  return kNames[info.index];
}

INSTANTIATE_TEST_SUITE_P(
    Transforms, Instances,
    testing::Values("Scale -1 1 1", "ConcatTransform [1 0 0 0 0.3 0.9 0 0 0.2 0.1 1.2 0 0 0 0 1]",
                    "Rotate 20 0 1 0 ConcatTransform [-1.2 0.1 0 0 0.2 1 0.1 0 0 0 -0.7 0 0.2 0 0 1] "
                    "Scale -1 1 1",
                    "Scale 1 1 -1 Rotate -15 0 0 1"),
    name_of);

}  // namespace
}  // namespace spillway::tools
