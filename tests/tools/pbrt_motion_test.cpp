// ActiveTransform, TransformTimes: what moves, from where to where.

#include <gtest/gtest.h>

#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

const std::string kTri(kTriangle);

void expect_at(const Affine3& transform, Float3 want) {
  const Float3 origin = transform.point({0, 0, 0});
  EXPECT_NEAR(origin.x, want.x, 1e-6f);
  EXPECT_NEAR(origin.y, want.y, 1e-6f);
  EXPECT_NEAR(origin.z, want.z, 1e-6f);
}

bool has_warning(const Imported& imported, std::string_view text) {
  for (const std::string& warning : imported.report.warnings)
    if (warning.find(text) != std::string::npos) return true;
  return false;
}

constexpr const char* kStep = "ActiveTransform EndTime Translate 0 2 0 ActiveTransform All ";

TEST(PbrtMotion, a_moving_shape_is_an_instance_of_an_object_of_its_own) {
  const Imported imported = import_world("Translate 1 0 0 AttributeBegin " + std::string(kStep) + "Scale -3 3 3\n" +
                                         kTri + "AttributeEnd\n" + kTri);
  ASSERT_EQ(imported.error, "");
  const RecordingSink& sink = imported.sink;
  ASSERT_EQ(sink.meshes.size(), 2u);
  EXPECT_EQ(sink.meshes[0].input.object, 1u);
  EXPECT_EQ(sink.meshes[0].positions[1], (Float3{1, 0, 0}));  // in its own space
  EXPECT_FALSE(sink.meshes[0].input.flip_normals);            // the instance mirrors
  EXPECT_EQ(sink.meshes[1].input.object, 0u);
  EXPECT_EQ(sink.meshes[1].positions[0], (Float3{1, 0, 0}));  // AttributeEnd ends the motion
  ASSERT_EQ(sink.moving.size(), 1u);
  EXPECT_EQ(sink.moving[0].object, 1u);
  expect_at(sink.moving[0].start, {1, 0, 0});
  expect_at(sink.moving[0].end, {1, 2, 0});
  EXPECT_EQ(sink.moving[0].start.m[0][0], -3);
  EXPECT_TRUE(sink.instances.empty());
  EXPECT_TRUE(imported.report.warnings.empty());
}

TEST(PbrtMotion, instances_move_and_stand) {
  const Imported imported =
      import_world("ObjectBegin \"a\" Translate 0 0 1\n" + kTri + "ObjectEnd\nAttributeBegin " + kStep +
                   "ObjectInstance \"a\"\nAttributeEnd\nObjectInstance \"a\"\n"
                   "ActiveTransform StartTime Translate 5 0 0 ObjectInstance \"a\"\n");
  ASSERT_EQ(imported.error, "");
  const RecordingSink& sink = imported.sink;
  ASSERT_EQ(sink.moving.size(), 2u);
  expect_at(sink.moving[0].start, {0, 0, 0});
  expect_at(sink.moving[0].end, {0, 2, 0});
  expect_at(sink.moving[1].start, {5, 0, 0});
  expect_at(sink.moving[1].end, {0, 0, 0});
  ASSERT_EQ(sink.instances.size(), 1u);
  EXPECT_EQ(sink.meshes[0].positions[0], (Float3{0, 0, 1}));
}

TEST(PbrtMotion, a_shape_that_moves_in_an_object_moves_with_its_instances) {
  const Imported imported = import_world("ObjectBegin \"a\"\n" + kTri + kStep + kTri + "ObjectEnd\nTranslate 1 0 0 " +
                                         "ObjectInstance \"a\"\n" + kStep + "ObjectInstance \"a\"\n");
  ASSERT_EQ(imported.error, "");
  const RecordingSink& sink = imported.sink;
  ASSERT_EQ(sink.objects.size(), 2u);
  EXPECT_EQ(sink.meshes[1].input.object, 2u);
  ASSERT_EQ(sink.instances.size(), 1u);  // of what stands still in the object
  ASSERT_EQ(sink.moving.size(), 3u);
  EXPECT_EQ(sink.moving[0].object, 2u);
  expect_at(sink.moving[0].start, {1, 0, 0});
  expect_at(sink.moving[0].end, {1, 2, 0});
  EXPECT_EQ(sink.moving[2].object, 2u);
  expect_at(sink.moving[2].end, {1, 4, 0});
}

// Parts times instances grow faster than the text that says them.
TEST(PbrtMotion, instances_of_parts_that_move_are_bounded) {
  std::string scene = "WorldBegin\nObjectBegin \"a\"\n";
  for (int i = 0; i < 10; ++i) scene += kStep + kTri;
  scene += "ObjectEnd\n";
  for (int i = 0; i < 10; ++i) scene += "ObjectInstance \"a\"\n";
  const auto import = [&](uint64_t most) {
    Imported imported;
    const Status status = import_pbrt(write_file("scene.pbrt", scene), imported.sink, {.most_moving_instances = most},
                                      imported.report);
    imported.error = status ? "" : status.error().message;
    return imported;
  };
  EXPECT_EQ(import(100).error, "");
  EXPECT_EQ(import(100).sink.moving.size(), 100u);
  const Imported refused = import(99);
  EXPECT_NE(refused.error.find("scene.pbrt:23:1: object \"a\" holds 10 parts that move"), std::string::npos)
      << refused.error;
  EXPECT_EQ(refused.sink.moving.size(), 90u);
}

TEST(PbrtMotion, what_moves_alike_in_an_object_is_one_part) {
  const Imported imported = import_world("ObjectBegin \"a\"\n" + std::string(kStep) + kTri + kTri +
                                         "Translate 1 0 0\n" + kTri + "ObjectEnd\nObjectInstance \"a\"\n");
  ASSERT_EQ(imported.error, "");
  EXPECT_EQ(imported.sink.meshes.size(), 3u);
  EXPECT_EQ(imported.sink.meshes[0].input.object, imported.sink.meshes[1].input.object);
  EXPECT_NE(imported.sink.meshes[0].input.object, imported.sink.meshes[2].input.object);
  EXPECT_EQ(imported.sink.moving.size(), 2u);
}

TEST(PbrtMotion, coordinate_systems_keep_both_places) {
  const Imported imported =
      import_world("AttributeBegin " + std::string(kStep) + "CoordinateSystem \"here\" AttributeEnd\n" +
                   "CoordSysTransform \"here\" Translate 1 0 0\n" + kTri);
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.moving.size(), 1u);
  expect_at(imported.sink.moving[0].start, {1, 0, 0});
  expect_at(imported.sink.moving[0].end, {1, 2, 0});
}

TEST(PbrtMotion, the_camera_moves_as_pbrts_by_the_inverses) {
  const Imported imported = import_text(
      "TransformTimes 0.5 2\nTranslate 0 0 4 ActiveTransform EndTime Translate 1 0 0\n"
      "Camera \"perspective\" \"float shutteropen\" 0.25 \"float shutterclose\" 0.75\n"
      "WorldBegin\n" +
      kTri);
  ASSERT_EQ(imported.error, "");
  const RecordingSink& sink = imported.sink;
  expect_at(sink.settings.camera.world_from_camera, {0, 0, -4});
  ASSERT_EQ(sink.camera_ends.size(), 1u);
  expect_at(sink.camera_ends[0], {-1, 0, -4});
  EXPECT_EQ(sink.settings.motion.start_time, 0.5f);
  EXPECT_EQ(sink.settings.motion.end_time, 2);
  EXPECT_EQ(sink.settings.camera.shutter_open, 0.25f);
  EXPECT_EQ(sink.settings.camera.shutter_close, 0.75f);
  EXPECT_TRUE(sink.moving.empty());  // WorldBegin begins anew, with both
  EXPECT_EQ(sink.meshes.size(), 1u);
}

TEST(PbrtMotion, what_stands_still_has_none_of_it) {
  const Imported imported = import_text(
      "TransformTimes 0 2\nActiveTransform EndTime Translate 0 0 4 ActiveTransform StartTime "
      "Translate 0 0 4 Camera \"perspective\"\nWorldBegin\nActiveTransform StartTime "
      "Translate 1 0 0 ActiveTransform EndTime Translate 1 0 0\n" +
      kTri);
  ASSERT_EQ(imported.error, "");
  EXPECT_TRUE(imported.sink.moving.empty());
  EXPECT_TRUE(imported.sink.camera_ends.empty());
  EXPECT_EQ(imported.sink.meshes[0].input.object, 0u);
}

TEST(PbrtMotion, lights_stand_still_with_a_warning) {
  const Imported imported = import_world(std::string(kStep) + "LightSource \"point\" \"rgb I\" [1 1 1]");
  ASSERT_EQ(imported.error, "");
  ASSERT_EQ(imported.sink.lights.size(), 1u);
  EXPECT_EQ(imported.sink.lights[0].position, (Float3{0, 0, 0}));
  EXPECT_TRUE(has_warning(imported, "scene.pbrt:2:61: lights do not move: this one stays where it is at the first"));
}

TEST(PbrtMotion, emitters_that_move_are_refused_or_stand_still) {
  const std::string lamp = "AreaLightSource \"diffuse\"\n" + kTri;
  const Imported refused = import_world(kStep + lamp);
  EXPECT_TRUE(starts_with(refused.error, "scene.pbrt:3:1: a shape that emits moves, which is not supported"))
      << refused.error;
  const Imported lenient = import_world(kStep + lamp, true);
  ASSERT_EQ(lenient.error, "");
  EXPECT_TRUE(lenient.sink.moving.empty());
  ASSERT_EQ(lenient.sink.meshes.size(), 1u);
  EXPECT_EQ(lenient.sink.meshes[0].positions[0], (Float3{0, 0, 0}));
  EXPECT_TRUE(has_warning(lenient, "stays where it is at the first of TransformTimes (ignored"));
  // In an object that moves, too.
  const std::string object = "ObjectBegin \"lamp\" " + lamp + "ObjectEnd\n" + kStep + "\nObjectInstance \"lamp\"";
  EXPECT_TRUE(starts_with(import_world(object).error, "scene.pbrt:6:1: a shape that emits moves"))
      << import_world(object).error;
  const Imported instance = import_world(object, true);
  ASSERT_EQ(instance.error, "");
  EXPECT_EQ(instance.sink.meshes[0].positions[0], (Float3{0, 0, 0}));
}

TEST(PbrtMotion, either_place_must_have_an_inverse) {
  const Imported imported = import_world("ActiveTransform EndTime\nScale 0 1 1\n" + kTri);
  EXPECT_TRUE(starts_with(imported.error, "scene.pbrt:3:1: Scale makes the transform singular")) << imported.error;
}

}  // namespace
}  // namespace spillway::tools
