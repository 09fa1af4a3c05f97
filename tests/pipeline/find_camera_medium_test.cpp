// A camera whose medium the scene does not say: found by what divides media around it.

#include <gtest/gtest.h>

#include "pipeline/render/render_image.h"
#include "pipeline/store.h"
#include "tests/pipeline/pack_scene.h"

namespace spillway::pipeline {
namespace {

using test::TemporaryDirectory;

constexpr uint32_t kFog = 0, kSmoke = 1;

// A cube around the origin; its normals point outwards unless they are flipped.
struct Cube {
  float half = 1;
  uint32_t inside = kFog, outside = kNoMedium;
  bool flipped = false;     // normals inwards by flip_normals, with the sides given the other way round
  bool opaque = false;      // a wall that divides nothing
  size_t triangles = 12;    // fewer: it does not close
  uint32_t object = 0;
};

Status add_cube(SceneSink& sink, const Cube& cube) {
  test::MeshData mesh{"cube", {}, {}, {}, {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                           2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5}};
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back({i & 1 ? cube.half : -cube.half, i & 2 ? cube.half : -cube.half, i & 4 ? cube.half : -cube.half});
  mesh.indices.resize(3 * cube.triangles);
  MeshInput input = mesh.input(0);
  input.object = cube.object;
  if (!cube.opaque) {
    input.material = {};
    input.divides_media = true, input.flip_normals = cube.flipped;
    input.medium_inside = cube.flipped ? cube.outside : cube.inside;
    input.medium_outside = cube.flipped ? cube.inside : cube.outside;
  }
  return sink.add_mesh(input);
}

class FindCameraMedium : public testing::Test {
 protected:
  // What packing makes of a camera there.
  struct Found {
    uint32_t medium;
    std::vector<std::string> notes;
  };
  template <class Say>
  Found pack(Float3 eye, uint32_t said, const Say& say) {
    auto packer = ScenePacker::create(directory_ / "store", {});
    EXPECT_TRUE(packer);
    EXPECT_TRUE((*packer)->add_material(Material{}, "Wall"));
    for (const char* name : {"fog", "smoke"}) EXPECT_TRUE((*packer)->add_medium({name, Medium{}, {}}));
    SceneSettings settings = test::small_settings();
    settings.render.camera_medium = said, settings.render.samples_per_pixel = 4;
    auto& m = settings.camera.world_from_camera.m;
    m[0][3] = eye.x, m[1][3] = eye.y, m[2][3] = eye.z;
    (*packer)->set_settings(settings);
    shading::Light sky = test::light_of(shading::LightKind::infinite);
    EXPECT_TRUE((*packer)->add_light(sky));
    const Status is_said = say(**packer);
    EXPECT_TRUE(is_said) << is_said.error().message;
    const Status finished = (*packer)->finish();
    EXPECT_TRUE(finished) << finished.error().message;
    auto store = Store::open(directory_ / "store");
    EXPECT_TRUE(store) << store.error().message;
    return {store->settings().render.camera_medium, (*packer)->report().notes};
  }
  Found pack(Float3 eye, std::vector<Cube> cubes, uint32_t said = kMediumUnsaid) {
    return pack(eye, said, [&](SceneSink& sink) -> Status {
      for (const Cube& cube : cubes) SPILLWAY_TRY(add_cube(sink, cube));
      return {};
    });
  }
  RenderReport report() const {
    auto store = Store::open(directory_ / "store");
    RenderOptions options;
    options.settings = store->settings(), options.scratch_directory = directory_.path();
    auto image = render_image(*store, options);
    EXPECT_TRUE(image) << image.error().message;
    return image ? image->report : RenderReport{};
  }
  std::string rendered() const { return report().image_hash; }

  TemporaryDirectory directory_;
};

TEST_F(FindCameraMedium, the_innermost_surface_around_the_camera_says_it) {
  const std::vector<Cube> nested = {{3, kFog, kNoMedium}, {1, kSmoke, kFog}};
  const Found inner = pack({0.2f, 0.1f, -0.3f}, nested);
  EXPECT_EQ(inner.medium, kSmoke);
  ASSERT_EQ(inner.notes.size(), 1u);
  EXPECT_NE(inner.notes[0].find("inside of smoke"), std::string::npos) << inner.notes[0];
  EXPECT_EQ(pack({2, 0.1f, -0.3f}, nested).medium, kFog);
  const Found outside = pack({0.2f, 5, -0.3f}, nested);
  EXPECT_EQ(outside.medium, kNoMedium);
  EXPECT_TRUE(outside.notes.empty());
}

TEST_F(FindCameraMedium, what_the_scene_says_is_not_looked_for) {
  for (const uint32_t said : {kNoMedium, kFog, kSmoke}) {
    const Found found = pack({0, 0, 0}, {{1, kSmoke, kFog}}, said);
    EXPECT_EQ(found.medium, said);
    EXPECT_TRUE(found.notes.empty());
  }
}

TEST_F(FindCameraMedium, walls_hide_nothing_and_normals_may_be_flipped) {
  EXPECT_EQ(pack({0.1f, 0.2f, 0}, {{2, kFog}, {0.5f, 0, 0, false, true}}).medium, kFog);
  EXPECT_EQ(pack({0.1f, 0.2f, 0}, {{2, kFog, kSmoke, true}}).medium, kFog);
  EXPECT_EQ(pack({9, 0.2f, 0}, {{2, kFog, kSmoke, true}}).medium, kSmoke);
  EXPECT_EQ(pack({0, 0, 0}, {{1, 0, 0, false, true}}).medium, kNoMedium);
}

TEST_F(FindCameraMedium, instances_divide_too_mirrored_ones_as_well) {
  for (const float x : {2.0f, -2.0f}) {
    const auto say = [&](SceneSink& sink) -> Status {
      const uint32_t object = sink.begin_object("puff");
      SPILLWAY_TRY(add_cube(sink, {1, kSmoke, kFog, false, false, 12, object}));
      Affine3 place;
      place.m[0][0] = x, place.m[1][1] = 0.5f, place.m[0][3] = 20, place.m[1][3] = 1;
      return sink.add_instance(object, place);
    };
    EXPECT_EQ(pack({21, 1.1f, 0}, kMediumUnsaid, say).medium, kSmoke) << x;
    EXPECT_EQ(pack({21, 2.1f, 0}, kMediumUnsaid, say).medium, kFog) << x;
  }
}

// One side is missing: most rays meet the others.
TEST_F(FindCameraMedium, a_hole_is_outvoted) {
  EXPECT_EQ(pack({0, 0, 0}, {{1, kFog, kNoMedium, false, false, 10}}).medium, kFog);
}

// Rays come in through the hole without the gas, or go out of it with the gas. It is told how often, and nothing hangs.
TEST_F(FindCameraMedium, surfaces_that_do_not_close_are_counted) {
  const auto met_in_another_medium = [&](Float3 eye, const std::vector<Cube>& cubes) {
    pack(eye, cubes);
    const RenderReport found = report();
    EXPECT_FALSE(found.faults.any());
    EXPECT_GT(found.track.segment_count, 0u);
    return found.shade.other_medium_count;
  };
  EXPECT_EQ(met_in_another_medium({0, 0, -4}, {{1, kFog}}), 0u);
  EXPECT_EQ(met_in_another_medium({0, 0, -4}, {{2, kFog}, {1, kSmoke, kFog}, {0.5f, 0, 0, false, true}}), 0u);
  EXPECT_GT(met_in_another_medium({0, 0, -4}, {{1, kFog, kNoMedium, false, false, 6}}), 0u);
  EXPECT_GT(met_in_another_medium({0, 0, -4}, {{2, kFog}, {1, kSmoke, kNoMedium}}), 50u);  // nested, and says it is not
}

TEST_F(FindCameraMedium, a_picture_with_what_was_found_is_the_picture_with_it_said) {
  const std::vector<Cube> scene = {{4, kFog}, {0.5f, 0, 0, false, true}};
  pack({0, 0, -3}, scene);
  const std::string found = rendered();
  pack({0, 0, -3}, scene, kFog);
  EXPECT_EQ(rendered(), found);
  pack({0, 0, -3}, scene, kNoMedium);
  EXPECT_NE(rendered(), found);
}

TEST_F(FindCameraMedium, the_rays_of_each_frame_begin_in_its_own) {
  const auto say_frames = [](SceneSink& sink) -> Status {
    std::vector<shading::Camera> cameras(3, test::small_settings().camera);
    for (shading::Camera& camera : cameras) camera.world_from_camera.m[2][3] = 0;
    cameras[2].world_from_camera.m[2][3] = -7;
    sink.set_camera_path(1, cameras);
    return add_cube(sink, {1, kFog});
  };
  const Found found = pack({0, 0, 0}, kMediumUnsaid, say_frames);
  EXPECT_EQ(found.medium, kFog);
  ASSERT_EQ(found.notes.size(), 2u);
  EXPECT_NE(found.notes[1].find("1 of 3 frames"), std::string::npos) << found.notes[1];
  std::vector<FrameCamera> path;
  std::vector<std::string> pictures;
  {
    auto store = Store::open(directory_ / "store");
    ASSERT_TRUE(store);
    path.assign(store->camera_path().begin(), store->camera_path().end());
    RenderOptions options;
    options.settings = store->settings(), options.scratch_directory = directory_.path();
    auto session = RenderSession::open(*store, options);
    ASSERT_TRUE(session);
    for (const FrameCamera& frame : path) {
      auto image = session->render(frame.camera, frame.medium);
      ASSERT_TRUE(image);
      pictures.push_back(image->report.image_hash);
      EXPECT_EQ(image->report.camera_medium, frame.medium);
    }
  }
  ASSERT_EQ(path.size(), 3u);
  EXPECT_EQ(path[1].medium, kFog);
  EXPECT_EQ(path[2].medium, kNoMedium);
  for (const size_t frame : {0, 2}) {
    const auto& m = path[frame].camera.world_from_camera.m;
    pack({m[0][3], m[1][3], m[2][3]}, {{1, kFog}}, path[frame].medium);
    EXPECT_EQ(rendered(), pictures[frame]) << frame;
  }
  pack({0, 0, 0}, kSmoke, say_frames);  // said: of all frames
  auto store = Store::open(directory_ / "store");
  for (const FrameCamera& frame : store->camera_path()) EXPECT_EQ(frame.medium, kSmoke);
}

TEST_F(FindCameraMedium, a_camera_that_leaves_its_medium_while_the_shutter_is_open_is_told) {
  for (const float to : {0.5f, 7.0f}) {
    const Found found = pack({0, 0, 0}, kMediumUnsaid, [&](SceneSink& sink) -> Status {
      SceneSettings settings = test::small_settings();
      settings.render.camera_medium = kMediumUnsaid;
      Affine3 &first = settings.camera.world_from_camera, second;
      for (int a = 0; a < 3; ++a) first.m[a][3] = 0;
      second = first, second.m[0][3] = to;
      sink.set_settings(settings);
      SPILLWAY_TRY(sink.set_camera_end(second));
      return add_cube(sink, {1, kFog});
    });
    EXPECT_EQ(found.medium, kFog);
    ASSERT_EQ(found.notes.size(), to > 1 ? 2u : 1u);
    if (to > 1) {
      EXPECT_NE(found.notes[1].find("moves from fog into no medium"), std::string::npos) << found.notes[1];
    }
  }
}

}  // namespace
}  // namespace spillway::pipeline
