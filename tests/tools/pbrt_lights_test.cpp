// Lights with images, from pbrt's words to numbers. What they shine: tests/failures/light_images_test.cpp.

#include <OpenImageIO/imageio.h>

#include <limits>

#include "pipeline/pack/scene_packer.h"
#include "pipeline/store.h"
#include "tests/support/small_scene.h"
#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

using shading::LightKind;

constexpr float kTolerance = 1e-6f;

TEST(pbrt_lights, goniometric_lights_turn_their_pole_to_y) {
  const Imported imported = import_world(
      "Translate 1 2 3 Scale 2 2 2 LightSource \"goniometric\" \"string filename\" \"a.exr\" \"rgb I\" [4 5 6] "
      "\"float scale\" 0.5 \"float power\" 10");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.image_lights.size(), 1u);
  const pipeline::ImageLightInput& light = imported.sink.image_lights[0];
  EXPECT_EQ(light.light.kind, LightKind::goniometric);
  EXPECT_EQ(light.light.position, (Float3{1, 2, 3}));
  EXPECT_EQ(light.axis[0], (Float3{1, 0, 0}));
  EXPECT_EQ(light.axis[1], (Float3{0, 0, 1}));
  EXPECT_EQ(light.axis[2], (Float3{0, 1, 0}));
  EXPECT_EQ(light.light.radiance, (Rgb{20, 25, 30}));
  EXPECT_TRUE(light.is_power);
  EXPECT_EQ(light.tangent, 0);
  EXPECT_EQ(imported.report.light_count, 1u);
  EXPECT_EQ(imported.report.image_count, 1u);
}

TEST(pbrt_lights, a_goniometric_light_without_an_image_is_a_point) {
  const Imported imported = import_world("LightSource \"goniometric\" \"rgb I\" [1 2 3]");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.lights.size(), 1u);
  EXPECT_EQ(imported.sink.lights[0].kind, LightKind::point);
  EXPECT_EQ(imported.sink.lights[0].radiance, (Rgb{1, 2, 3}));
}

TEST(pbrt_lights, projections_look_along_z_with_their_top_at_y) {
  const Imported imported = import_world(
      "Translate 1 2 3 LightSource \"projection\" \"string filename\" \"a.exr\" \"float fov\" 60 \"float scale\" 7");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.image_lights.size(), 1u);
  const pipeline::ImageLightInput& light = imported.sink.image_lights[0];
  EXPECT_EQ(light.light.kind, LightKind::projection);
  EXPECT_EQ(light.light.position, (Float3{1, 2, 3}));
  EXPECT_EQ(light.light.edge1, (Float3{0, 0, 1}));
  EXPECT_EQ(light.axis[1], (Float3{0, -1, 0}));
  EXPECT_EQ(light.axis[2], (Float3{0, 0, 1}));
  EXPECT_NEAR(light.tangent, 1 / std::sqrt(3.0f), kTolerance);
  EXPECT_EQ(light.light.radiance, (Rgb{7, 7, 7}));
  EXPECT_FALSE(light.is_power);
}

TEST(pbrt_lights, area_lights_take_an_image) {
  const Imported imported = import_world(
      "AreaLightSource \"diffuse\" \"string filename\" \"a.png\" \"float scale\" 3 \"bool twosided\" true\n" +
      std::string(kTriangle));
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.meshes.size(), 1u);
  const pipeline::MeshInput& mesh = imported.sink.meshes[0].input;
  EXPECT_TRUE(mesh.emits && mesh.emits_two_sided && mesh.emission_texture.valid());
  EXPECT_FALSE(mesh.emission_is_mean);
  EXPECT_EQ(mesh.emission, (Rgb{3, 3, 3}));
  const pipeline::TextureNode& node = imported.sink.textures[mesh.emission_texture.value];
  EXPECT_TRUE(pipeline::is_image_by_uv(node));
  EXPECT_EQ(node.wrap, cache::WrapMode::clamp);
  EXPECT_EQ(node.value[2], 1);
  EXPECT_EQ(imported.sink.images[0].second, cache::TexelEncoding::srgb);
}

// ---- what images make of it ----

std::string packing_error(const std::string& light, int width, int height, const std::vector<float>& texels) {
  const test::TemporaryDirectory directory;
  std::vector<float> rgb;
  for (const float t : texels) rgb.insert(rgb.end(), {t, t, t});
  const std::string path = (directory.path() / "a.exr").string();
  const auto output = OIIO::ImageOutput::create(path);
  EXPECT_TRUE(output && output->open(path, OIIO::ImageSpec(width, height, 3, OIIO::TypeFloat)) &&
              output->write_image(OIIO::TypeFloat, rgb.data()) && output->close());
  const auto file = directory.path() / "scene.pbrt";
  std::ofstream(file) << "WorldBegin\n" << light << std::string(kTriangle);
  auto packer = pipeline::ScenePacker::create(directory.path() / "a.store", {});
  EXPECT_TRUE(packer);
  ImportReport report;
  Status status = import_pbrt(file, **packer, {}, report);
  if (status) status = (*packer)->finish();
  return status ? "" : status.error().message;
}

TEST(pbrt_lights, images_that_cannot_be_light_are_refused_with_the_place) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinite = std::numeric_limits<float>::infinity();
  const std::string goniometric = "LightSource \"goniometric\" \"string filename\" \"a.exr\"\n",
                    projection = "LightSource \"projection\" \"string filename\" \"a.exr\" \"float power\" 3\n",
                    area = "AreaLightSource \"diffuse\" \"string filename\" \"a.exr\" \"float power\" 3\n";
  EXPECT_EQ(packing_error(goniometric, 2, 2, {1, 2, 3, 4}), "");
  EXPECT_EQ(packing_error(projection, 2, 1, {1, 2}), "");
  EXPECT_EQ(packing_error(area, 2, 1, {1, 2}), "");
  struct Case {
    const std::string& light;
    int width, height;
    std::vector<float> texels;
    const char* place;
    const char* why;
  };
  for (const Case& c :
       {Case{goniometric,
             2,
             1,
             {1, 2},
             "scene.pbrt:2:13: ",
             "2 x 1 texels; the image of a goniometric light is a square"},
        Case{goniometric, 2, 2, {1, 2, nan, 4}, "scene.pbrt:2:13: ", "texel (0, 1) is infinite or no number"},
        Case{goniometric, 2, 2, {1, -2, 3, 4}, "scene.pbrt:2:13: ", "texel (1, 0) is (-2, -2, -2)"},
        Case{projection, 2, 1, {0, 0}, "scene.pbrt:2:13: ", "is black, and cannot emit"},
        Case{projection, 2, 1, {1, infinite}, "scene.pbrt:2:13: ", "infinite or no number"},
        Case{area, 2, 1, {0, 0}, "scene.pbrt:3:1", "emits a black image"},
        Case{area, 2, 1, {1, nan}, "scene.pbrt:3:1", "texel (1, 0) of the image it emits is infinite"}}) {
    const std::string message = packing_error(c.light, c.width, c.height, c.texels);
    EXPECT_NE(message.find(c.place), std::string::npos) << message;
    EXPECT_NE(message.find(c.why), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace spillway::tools
