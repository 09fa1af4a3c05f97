// Media as pbrt's language says them: coefficients, and what glows.

#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

using pipeline::GlowKind;
using pipeline::Medium;

Imported import_medium(const std::string& parameters) { return import_world("MakeNamedMedium \"m\" " + parameters); }

Medium medium_of(const std::string& parameters) {
  const Imported imported = import_medium(parameters);
  EXPECT_EQ(imported.error, "") << parameters;
  return imported.sink.media.size() == 1 ? imported.sink.media[0].medium : Medium{};
}

const std::string kFog = "\"string type\" \"homogeneous\" ";
const std::string kGrid = "\"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" [1 2] ";

TEST(PbrtMedia, coefficients_are_rgb_or_spectra_of_any_kind) {
  const Medium rgb = medium_of(kFog + "\"rgb sigma_a\" [1 2 3] \"rgb sigma_s\" [4 5 6] \"float scale\" 2");
  EXPECT_EQ(rgb.sigma_a, (Rgb{2, 4, 6}));
  EXPECT_EQ(rgb.sigma_s, (Rgb{8, 10, 12}));
  const Medium grey = medium_of(kFog + "\"spectrum sigma_a\" [300 0.5 900 0.5]");
  for (const float value : {grey.sigma_a.r, grey.sigma_a.g, grey.sigma_a.b}) EXPECT_NEAR(value, 0.5, 1e-4);
  write_file("grey.spd", "300 0.25 900 0.25");
  EXPECT_NEAR(medium_of(kFog + "\"spectrum sigma_s\" \"grey.spd\"").sigma_s.g, 0.25, 1e-4);
  EXPECT_TRUE(starts_with(import_medium(kFog + "\"rgb sigma_a\" [1 2 -3]").error,
                          "scene.pbrt:2:49: \"sigma_a\" must not be negative"));
}

// The figures of the papers; per millimetre, as pbrt takes them.
TEST(PbrtMedia, presets_are_what_was_measured) {
  const Medium milk = medium_of(kFog + "\"string preset\" \"Wholemilk\" \"rgb sigma_a\" [9 9 9]");
  EXPECT_EQ(milk.sigma_s, (Rgb{2.55f, 3.21f, 3.77f}));
  EXPECT_EQ(milk.sigma_a, (Rgb{0.0011f, 0.0024f, 0.014f}));
  const Medium wine = medium_of(kFog + "\"string preset\" \"Merlot\" \"float scale\" 10");
  EXPECT_EQ(wine.sigma_a, (Rgb{0.11632f, 0.25191f, 0.29434f}) * 10.0f);
  EXPECT_EQ(wine.sigma_s, (Rgb{2.1129e-05f, 0, 0}) * 10.0f);
  EXPECT_EQ(medium_of(kFog + "\"string preset\" \"Head & Shoulders Shampoo\"").sigma_s.g, 0.028804f);
  EXPECT_EQ(medium_of(kFog + "\"string preset\" \"Pacific Ocean Surface Water\"").sigma_a.r, 0.031845f);
  EXPECT_NE(import_medium(kFog + "\"string preset\" \"wholemilk\"").error.find("no measured medium \"wholemilk\""),
            std::string::npos);
}

TEST(PbrtMedia, what_glows_has_the_colour_of_a_light) {
  const Medium fog = medium_of(kFog + "\"rgb Le\" [1 2 3] \"float Lescale\" 2");
  EXPECT_EQ(fog.glow_kind, GlowKind::constant);
  EXPECT_EQ(fog.glow, (Rgb{2, 4, 6}));
  const auto lamp = import_world("LightSource \"point\" \"spectrum I\" \"stdillum-A\"").sink.lights.at(0).radiance;
  EXPECT_EQ(medium_of(kFog + "\"spectrum Le\" \"stdillum-A\"").glow, lamp);
  EXPECT_EQ(medium_of(kFog + "\"rgb Le\" [0 0 0] \"float Lescale\" 2").glow_kind, GlowKind::none);
  EXPECT_EQ(medium_of(kGrid + "\"rgb Le\" [1 2 3] \"float Lescale\" 2").glow, (Rgb{2, 4, 6}));
  const Medium grid = medium_of(kGrid + "\"rgb Le\" [1 2 3] \"float Lescale\" [2 3]");
  EXPECT_EQ(grid.glow_kind, GlowKind::scaled);
  EXPECT_EQ(grid.glow_volume, 1u);
  const Medium hot = medium_of(kGrid + "\"float temperature\" [1000 2000] \"float Lescale\" 3");
  EXPECT_EQ(hot.glow_kind, GlowKind::temperature);
  EXPECT_EQ(hot.glow, (Rgb{3, 3, 3}));
}

// What would be left out of the picture is refused by name.
TEST(PbrtMedia, no_glow_is_dropped_silently) {
  const auto expect = [](const std::string& parameters, const char* said) {
    const std::string message = import_medium(parameters).error;
    EXPECT_NE(message.find(said), std::string::npos) << parameters << ": " << message;
  };
  const std::string vdb = "\"string type\" \"openvdb\" \"string filename\" \"a.vdb\" ";
  expect(vdb + "\"rgb Le\" [1 1 1]", "medium type \"openvdb\" has no parameter \"rgb Le\"");
  expect(vdb + "\"float LeScale\" 2", "has no parameter \"float LeScale\"");
  expect(kFog + "\"float Lescale\" 2", "has no parameter \"float Lescale\"");
  expect(kGrid + "\"float Lescale\" [2 3]", "has no parameter \"float Lescale\"");
  expect(kGrid + "\"float temperature\" [1 2] \"float Lescale\" [2 3]", "\"float Lescale\" takes 1 value, not 2");
  expect(kGrid + "\"float temperature\" [1 2] \"rgb Le\" [2 3 4]", "not both");
}

TEST(PbrtMedia, a_camera_without_a_medium_interface_says_none) {
  const auto camera_medium = [](const std::string& before_camera) {
    const Imported imported = import_text("MakeNamedMedium \"m\" " + kFog + "\n" + before_camera +
                                          "Camera \"perspective\"\nWorldBegin\nMediumInterface \"m\" \"\"\n");
    EXPECT_EQ(imported.error, "");
    return imported.sink.settings.render.camera_medium;
  };
  EXPECT_EQ(camera_medium(""), pipeline::kMediumUnsaid);
  EXPECT_EQ(camera_medium("MediumInterface \"\" \"m\"\n"), 0u);
  EXPECT_EQ(camera_medium("MediumInterface \"\"\n"), pipeline::kNoMedium);
}

}  // namespace
}  // namespace spillway::tools
