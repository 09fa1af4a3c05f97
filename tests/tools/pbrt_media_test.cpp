// Media as pbrt's language says them: coefficients, and what glows.

#include <algorithm>

#include "cache/base/memory.h"
#include "pipeline/pack/scene_packer.h"
#include "shading/noise.h"
#include "tests/tools/import_text.h"
#include "tools/import/params.h"

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

std::vector<float> samples_of(const pipeline::VolumeInput& volume) {
  std::vector<float> samples(volume.samples->size());
  EXPECT_TRUE(volume.samples->read(0, samples));
  return samples;
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

TEST(PbrtMedia, files_glow_by_the_grid_that_is_named) {
  const std::string vdb = "\"string type\" \"openvdb\" \"string filename\" \"a.vdb\" ";
  const auto volumes = [](const Imported& imported) {
    std::vector<std::string> grids;
    for (const pipeline::VolumeInput& volume : imported.sink.volumes) grids.push_back(volume.grid);
    return grids;
  };
  const Imported shine =
      import_medium(vdb + "\"string emissionname\" \"shine\" \"rgb Le\" [1 2 3] \"float LeScale\" 2");
  ASSERT_EQ(shine.error, "");
  EXPECT_EQ(volumes(shine), (std::vector<std::string>{"density", "shine"}));
  EXPECT_EQ(shine.sink.media.at(0).medium.glow_kind, GlowKind::scaled);
  EXPECT_EQ(shine.sink.media[0].medium.glow_volume, 1u);
  EXPECT_EQ(shine.sink.media[0].medium.glow, (Rgb{2, 4, 6}));
  EXPECT_EQ(import_medium(vdb + "\"string emissionname\" \"shine\"").sink.media.at(0).medium.glow, (Rgb{1, 1, 1}));
  const Imported hot = import_medium(vdb + "\"string densityname\" \"smoke\" \"string temperaturename\" \"heat\"");
  ASSERT_EQ(hot.error, "");
  EXPECT_EQ(volumes(hot), (std::vector<std::string>{"smoke", "heat"}));
  EXPECT_EQ(hot.sink.media.at(0).medium.glow_kind, GlowKind::temperature);
  EXPECT_EQ(import_medium(vdb).sink.media.at(0).medium.glow_kind, GlowKind::none);
  EXPECT_TRUE(
      starts_with(import_medium(vdb + "\"string temperaturename\" \"heat\" \"string emissionname\" \"shine\"").error,
                  "scene.pbrt:2:17: a medium has \"temperaturename\" or \"emissionname\", not both"));
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

const std::string kColors = "\"string type\" \"rgbgrid\" \"integer nx\" 2 ";
const std::string kSigmaA = "\"rgb sigma_a\" [1 2 3 4 5 6] ", kSigmaS = "\"rgb sigma_s\" [0.5 0 1 2 3 0] ";

TEST(PbrtMedia, grids_of_colours_are_volumes_of_three_channels) {
  const Imported both = import_medium(kColors + kSigmaA + kSigmaS + "\"float scale\" 2 \"float g\" 0.5");
  ASSERT_EQ(both.error, "");
  const Medium& medium = both.sink.media.at(0).medium;
  EXPECT_EQ(medium.kind, pipeline::MediumKind::color_grid);
  EXPECT_EQ(medium.sigma_t(), (Rgb{2, 2, 2}));
  EXPECT_EQ(medium.g, 0.5f);
  EXPECT_EQ(medium.glow_kind, GlowKind::none);
  ASSERT_EQ(both.sink.volumes.size(), 2u);
  EXPECT_EQ(both.sink.volumes[0].channels, 3u);
  EXPECT_EQ(samples_of(both.sink.volumes[medium.density_volume]), (std::vector<float>{1.5f, 2, 4, 6, 8, 6}));
  EXPECT_EQ(samples_of(both.sink.volumes[medium.scatter_volume]), (std::vector<float>{0.5f, 0, 1, 2, 3, 0}));
  // What is not given is one.
  const Imported absorbs = import_medium(kColors + kSigmaA), scatters = import_medium(kColors + kSigmaS);
  EXPECT_EQ(samples_of(absorbs.sink.volumes.at(0)), (std::vector<float>{2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(samples_of(absorbs.sink.volumes.at(1)), std::vector<float>(6, 1));
  EXPECT_EQ(samples_of(scatters.sink.volumes.at(0)), (std::vector<float>{1.5f, 1, 2, 3, 4, 1}));
  for (const char* scale : {"LeScale", "Lescale"}) {
    const Imported glows = import_medium(kColors + kSigmaA + "\"rgb Le\" [1 0 0 0 1 0] \"float " + scale + "\" 3");
    ASSERT_EQ(glows.error, "");
    EXPECT_EQ(glows.sink.media[0].medium.glow_kind, GlowKind::colors);
    EXPECT_EQ(glows.sink.media[0].medium.glow, (Rgb{3, 3, 3}));
    EXPECT_EQ(samples_of(glows.sink.volumes.at(glows.sink.media[0].medium.glow_volume)),
              (std::vector<float>{1, 0, 0, 0, 1, 0}));
  }
  // A white of another space is a white.
  const Imported wide =
      import_world("ColorSpace \"rec2020\"\nMakeNamedMedium \"m\" \"string type\" \"rgbgrid\" \"rgb sigma_s\" [2 2 2]");
  ASSERT_EQ(wide.error, "");
  for (const float value : samples_of(wide.sink.volumes.at(1))) EXPECT_NEAR(value, 2, 1e-4);
}

TEST(PbrtMedia, grids_of_colours_that_make_no_sense_are_refused) {
  const auto expect = [](const std::string& parameters, const char* said) {
    const std::string message = import_medium(parameters).error;
    EXPECT_TRUE(starts_with(message, "scene.pbrt:2:")) << message;
    EXPECT_NE(message.find(said), std::string::npos) << parameters << ": " << message;
  };
  expect(kColors, "give one of them");
  expect(kColors + "\"rgb sigma_a\" [1 2 3]", "6 in all, not 3");
  expect(kColors + "\"rgb sigma_a\" [1 2 3 4 -5 6]", "sample 1 is negative");
  expect(kColors + kSigmaS + "\"rgb Le\" [1 0 0 0 1 0]", "emits what it absorbs");
  expect(kColors + kSigmaA + "\"rgb Le\" [1 0 0]", "6 in all, not 3");
  expect(kColors + kSigmaA + "\"float LeScale\" 2", "has no parameter \"float LeScale\"");
  expect(kColors + kSigmaA + "\"float scale\" -2", "finite and not negative");
  expect(kColors + kSigmaA + "\"float g\" 1", "its g is 1");
  expect(kColors + kSigmaA + "\"integer ny\" 0", "nx, ny and nz");
  expect(kColors + kSigmaA + "\"integer ny\" 1048576 \"integer nz\" 1048576", "in all");
  expect(kColors + kSigmaA + "\"float density\" [1 1]", "has no parameter \"float density\"");
}

TEST(PbrtMedia, clouds_are_sampled_where_their_noise_can_be_seen) {
  const std::string cloud = "\"string type\" \"cloud\" ";
  // Without noise a cloud is a ramp in y: twice what is below one half.
  const Imported ramp =
      import_medium(cloud + "\"float frequency\" 0 \"float wispiness\" 0 \"float density\" 9 \"rgb sigma_s\" [4 5 6]");
  ASSERT_EQ(ramp.error, "");
  EXPECT_EQ(ramp.sink.media[0].medium.sigma_s, (Rgb{4, 5, 6}));
  const pipeline::VolumeInput& volume = ramp.sink.volumes.at(0);
  EXPECT_EQ(volume.counts, (std::array<int32_t, 3>{16, 16, 16}));
  const std::vector<float> samples = samples_of(volume);
  ASSERT_EQ(samples.size(), 16u * 16 * 16);
  for (int32_t y = 0; y < 16; ++y) {
    const float at = (static_cast<float>(y) + 0.5f) / 16;
    EXPECT_NEAR(samples[16 * y], std::clamp(2 * (0.5f - at), 0.0f, 1.0f), 1e-5) << y;
  }
  const Imported wispy = import_medium(cloud + "\"float frequency\" 2 \"point3 p0\" [0 0.5 0] \"point3 p1\" [2 1 9]");
  const pipeline::VolumeInput& noise = wispy.sink.volumes.at(0);
  EXPECT_EQ(noise.counts, (std::array<int32_t, 3>{128, 32, 256}));
  const std::vector<float> wisps = samples_of(noise);
  ASSERT_EQ(wisps.size(), 128u * 32 * 256);
  for (const auto& [x, y, z] : {std::array{0, 0, 0}, std::array{17, 3, 200}, std::array{127, 31, 255}}) {
    const Float3 p{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
    EXPECT_EQ(wisps[(z * 32 + y) * 128 + x], shading::cloud_density(noise.medium_from_lattice.point(p), {1, 1, 2}));
  }
  EXPECT_NE(import_medium(cloud + "\"point3 p1\" [1 0 1]").error.find("along axis 1"), std::string::npos);
  EXPECT_NE(import_medium(cloud + "\"rgb Le\" [1 1 1]").error.find("has no parameter"), std::string::npos);
  EXPECT_NE(import_medium("\"string type\" \"fog\"").error.find("\"rgbgrid\", \"cloud\""), std::string::npos);
}

// Coefficients, samples, shapes of grids: each is named at its place.
TEST(PbrtMedia, media_that_make_no_sense_are_refused) {
  const auto expect = [](const std::string& world, const char* said) {
    const std::string message = import_world(world).error;
    EXPECT_TRUE(starts_with(message, "scene.pbrt:2:")) << message;
    EXPECT_NE(message.find(said), std::string::npos) << world << ": " << message;
  };
  const auto medium = [](const std::string& parameters) { return "MakeNamedMedium \"m\" " + parameters; };
  const std::string grid = "\"string type\" \"uniformgrid\" ";
  expect(medium(grid + "\"float density\" nan"), "nan instead of a finite number");
  expect(medium(grid + "\"float density\" inf"), "inf instead of a finite number");
  expect(medium(grid + "\"float density\" 1e39"), "fits a 32-bit float");
  expect(medium(grid), "without \"float density\"");
  expect(medium(kFog + "\"rgb sigma_a\" [1e30 0 0] \"float scale\" 1e30"), "must be finite and not negative");
  expect(medium(kFog + "\"float g\" -1"), "its g is -1");
  expect(medium("\"string type\" \"openvdb\""), "takes \"string filename\"");
  expect("Scale 1 0 1 " + medium(kFog), "singular");
  expect("Transform [nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1] " + medium(kFog), "nan instead of a finite number");
  expect("MediumInterface \"m\" \"\" " + std::string(kTriangle), "there is no medium");
}

std::string packing_error(const std::string& world) {
  const auto scene = write_file("scene.pbrt", "WorldBegin\n" + world + "\n" + std::string(kTriangle));
  auto packer = pipeline::ScenePacker::create(test_folder() / "a.store", {});
  EXPECT_TRUE(packer);
  ImportReport report;
  Status status = import_pbrt(scene, **packer, {}, report);
  if (status) status = (*packer)->finish();
  return status ? "" : status.error().message;
}

// Numbers too many to be held go to a stream of the sink's as they are read; what is said of them stays the same.
TEST(PbrtMedia, long_lists_of_samples_are_streams) {
  constexpr int kCount = 300 * 300;
  static_assert(kCount > static_cast<int>(kHeldNumbers));
  std::string numbers;
  for (int i = 0; i < kCount; ++i) numbers += fmt::format("{} ", i % 1000);
  const std::string grid = "\"string type\" \"uniformgrid\" \"integer nx\" 300 ";
  const Imported imported =
      import_medium(grid + "\"float density\" [" + numbers + "] \"integer ny\" 300 \"float Lescale\" [" + numbers +
                    "] \"rgb Le\" [1 1 1]");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.volumes.size(), 2u);
  for (const pipeline::VolumeInput& volume : imported.sink.volumes) {
    const std::vector<float> samples = samples_of(volume);
    ASSERT_EQ(samples.size(), size_t{kCount});
    for (int i = 0; i < kCount; ++i) ASSERT_EQ(samples[i], static_cast<float>(i % 1000));
  }
  const std::string scale = import_medium(kGrid + "\"float scale\" [" + numbers + "]").error;
  EXPECT_NE(scale.find("\"float scale\" takes 1 value, not 90000"), std::string::npos) << scale;
}

// Colours too; sums and colours of other spaces are made from what was read, some at a time.
TEST(PbrtMedia, long_lists_of_colours_are_streams) {
  constexpr int kCount = 300 * 300;
  static_assert(3 * kCount > 3 << 16);
  std::string absorbs, scatters;
  for (int i = 0; i < 3 * kCount; ++i) absorbs += fmt::format("{} ", i % 1000), scatters += fmt::format("{} ", i % 7);
  const std::string grid = "\"string type\" \"rgbgrid\" \"integer nx\" 300 \"integer ny\" 300 ";
  const std::string colors = "\"rgb sigma_a\" [" + absorbs + "] \"rgb Le\" [" + absorbs + "] ";
  const Imported both = import_medium(grid + colors + "\"rgb sigma_s\" [" + scatters + "]");
  ASSERT_EQ(both.error, "");
  ASSERT_EQ(both.sink.volumes.size(), 3u);
  const pipeline::Medium& medium = both.sink.media.at(0).medium;
  const std::vector<float> total = samples_of(both.sink.volumes[medium.density_volume]);
  const std::vector<float> scatter = samples_of(both.sink.volumes[medium.scatter_volume]);
  const std::vector<float> glow = samples_of(both.sink.volumes[medium.glow_volume]);
  ASSERT_EQ(total.size(), 3u * kCount);
  ASSERT_EQ(scatter.size(), total.size());
  ASSERT_EQ(glow.size(), total.size());
  for (int i = 0; i < 3 * kCount; ++i) {
    ASSERT_EQ(glow[i], static_cast<float>(i % 1000));
    ASSERT_EQ(scatter[i], static_cast<float>(i % 7));
    ASSERT_EQ(total[i], glow[i] + scatter[i]);
  }
  const std::string negative =
      import_medium(grid + "\"rgb sigma_a\" [" + absorbs.substr(0, absorbs.size() - 4) + "-1 ]").error;
  EXPECT_NE(negative.find("\"rgb sigma_a\": sample 89999 is negative"), std::string::npos) << negative;
  const std::string fog = import_medium(kFog + "\"rgb sigma_a\" [" + absorbs + "]").error;
  EXPECT_NE(fog.find("\"rgb sigma_a\" takes 3 values, not 270000"), std::string::npos) << fog;
}

// 16 MiB of samples, of which a slab as high as a brick is held at a time (3.2 MiB), and buffers of a MiB.
TEST(PbrtMedia, what_is_held_of_given_grids_is_in_the_budget) {
  const auto held = [](int side) {
    std::string numbers(2 * static_cast<size_t>(side) * side * side, ' ');
    for (size_t i = 0; i < numbers.size(); i += 2) numbers[i] = static_cast<char>('1' + i / 2 % 7);
    memory_reset_peaks();
    const std::string text = fmt::format(
        "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" {0} \"integer ny\" {0} "
        "\"integer nz\" {0} \"float density\" [{1}]",
        side, numbers);
    EXPECT_EQ(packing_error(text), "");
    return memory_use(MemoryTag::pack).peak_bytes + memory_use(MemoryTag::streams).peak_bytes;
  };
  const uint64_t little = held(2), large = held(160);
  EXPECT_LT(large, little + (9 << 20));
  EXPECT_GT(large, little + 33 * 160 * 160 * sizeof(float));
}

// What only the samples or both transforms together tell.
TEST(PbrtMedia, grids_that_cannot_be_packed_are_named) {
  const std::string grid = "MakeNamedMedium \"m\" \"string type\" \"uniformgrid\" \"integer nx\" 2 \"float density\" ";
  EXPECT_EQ(packing_error(grid + "[1 2]"), "");
  EXPECT_NE(packing_error(grid + "[1 -2]").find("scene.pbrt:2:64: the sample at (1, 0, 0) is -2"), std::string::npos)
      << packing_error(grid + "[1 -2]");
  EXPECT_NE(packing_error(grid + "[1 2 3]").find("2 x 1 x 1 samples of one, but 3 numbers"), std::string::npos);
  const std::string flat = packing_error(grid + "[1 2] \"point3 p1\" [1 0 1]");
  EXPECT_NE(flat.find("medium \"m\": its transform, or its grid's, has no finite inverse"), std::string::npos) << flat;
  const std::string tiny = packing_error("Scale 1e-25 1e-25 1e-25 " + grid + "[1 2] \"point3 p1\" [1e-15 1 1]");
  EXPECT_NE(tiny.find("has no finite inverse"), std::string::npos) << tiny;
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
