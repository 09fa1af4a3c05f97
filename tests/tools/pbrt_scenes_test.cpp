// The published scenes, where they are at hand: shared/scenes beside the source, or under SPILLWAY_SHARED.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "tests/tools/recording_sink.h"
#include "tools/import/import_pbrt.h"

namespace spillway::tools {
namespace {

std::filesystem::path shared_scene(const char* name) {
  const char* shared = std::getenv("SPILLWAY_SHARED");
  const std::filesystem::path root =
      shared != nullptr ? std::filesystem::path(shared) : std::filesystem::path(SPILLWAY_SOURCE_DIR) / ".." / "shared";
  return root / "scenes" / name / (std::string(name) + ".pbrt");
}

TEST(pbrt_scenes, bathroom_imports_completely) {
  const std::filesystem::path scene = shared_scene("bathroom");
  if (!std::filesystem::exists(scene)) GTEST_SKIP() << scene << " is not there: set SPILLWAY_SHARED";
  RecordingSink sink;
  sink.keep_meshes = false;
  ImportReport report;
  const Status status = import_pbrt(scene, sink, {}, report);
  ASSERT_TRUE(status) << status.error().message;
  EXPECT_EQ(sink.contract, "");
  EXPECT_EQ(sink.triangle_count, 592186u + 2);  // the faces of all PLY headers, and the window's light
  EXPECT_EQ(sink.mesh_count, 855u + 1);
  EXPECT_EQ(report.triangle_count, sink.triangle_count);
  EXPECT_EQ(sink.settings.camera.resolution_x_px, 1024u);
  EXPECT_EQ(sink.settings.render.max_depth, 17u);
  EXPECT_EQ(sink.settings.render.samples_per_pixel, 64u);
  EXPECT_EQ(sink.settings.filter.kind, shading::FilterKind::triangle);
  EXPECT_TRUE(report.warnings.empty()) << report.warnings[0];
}

TEST(pbrt_scenes, veach_ajar_imports_with_a_warning_for_its_integrator) {
  const std::filesystem::path scene = shared_scene("veach-ajar");
  if (!std::filesystem::exists(scene)) GTEST_SKIP() << scene << " is not there: set SPILLWAY_SHARED";
  RecordingSink sink;
  sink.keep_meshes = false;
  ImportReport report;
  const Status status = import_pbrt(scene, sink, {}, report);
  ASSERT_TRUE(status) << status.error().message;
  EXPECT_EQ(sink.contract, "");
  EXPECT_EQ(sink.triangle_count, 382688u + 2);  // two of its PLY files are used three times each; and the light
  ASSERT_EQ(report.warnings.size(), 1u);
  EXPECT_NE(report.warnings[0].find("veach-ajar.pbrt:1:12: integrator \"bdpt\""), std::string::npos);
}

TEST(pbrt_scenes, volumetric_caustic_is_read_with_its_gas) {
  const std::filesystem::path scene = shared_scene("volumetric-caustic");
  if (!std::filesystem::exists(scene)) GTEST_SKIP() << scene << " is not there: set SPILLWAY_SHARED";
  RecordingSink sink;
  ImportReport report;
  const Status status = import_pbrt(scene, sink, {}, report);
  ASSERT_TRUE(status) << status.error().message;
  EXPECT_EQ(sink.contract, "");
  ASSERT_EQ(sink.media.size(), 1u);
  EXPECT_EQ(sink.media[0].medium.sigma_s, (Rgb{1, 1, 1}));
  EXPECT_TRUE(is_black(sink.media[0].medium.sigma_a));
}

}  // namespace
}  // namespace spillway::tools
