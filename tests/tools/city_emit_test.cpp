// A city said to a sink: the same for any number of threads, as many triangles as were counted before.

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "cache/base/hash.h"
#include "pipeline/pack/scene_packer.h"
#include "pipeline/store.h"
#include "tests/support/file_bytes.h"
#include "tests/support/small_scene.h"
#include "tests/tools/planned_city.h"
#include "tests/tools/recording_sink.h"
#include "tools/city/city.h"
#include "tools/city/pbrt_sink.h"
#include "tools/import/import_pbrt.h"

namespace spillway::tools::city {
namespace {

using test::bytes_of;

namespace fs = std::filesystem;

CityOptions small_city() {
  CityOptions options;
  options.buildings = 60, options.detail_triangles = 900, options.trees = 40, options.cars = 30, options.seed = 11;
  options.time = TimeOfDay::night;
  return options;
}

// Folds everything into one number, keeping nothing.
class HashingSink : public RecordingSink {
 public:
  uint64_t hash = 0, emitting = 0, cages = 0;
  HashingSink() { keep_meshes = false; }
  Status add_mesh(const pipeline::MeshInput& mesh) override {
    fold(mesh.name.data(), mesh.name.size());
    fold(mesh.positions.data(), mesh.positions.size_bytes());
    fold(mesh.normals.data(), mesh.normals.size_bytes());
    fold(mesh.indices.data(), mesh.indices.size_bytes());
    if (mesh.emits) emitting += mesh.indices.size() / 3;
    return RecordingSink::add_mesh(mesh);
  }
  Status add_subdivision(const pipeline::SubdivisionInput& s) override {
    fold(s.cage.name.data(), s.cage.name.size());
    fold(s.cage.positions.data(), s.cage.positions.size_bytes());
    fold(s.cage.indices.data(), s.cage.indices.size_bytes());
    fold(s.sharp_edges.data(), s.sharp_edges.size_bytes());
    ++cages;
    return RecordingSink::add_subdivision(s);
  }
  Status add_instance(uint32_t object, const Affine3& world_from_object) override {
    fold(&object, sizeof object);
    fold(&world_from_object, sizeof world_from_object);
    return RecordingSink::add_instance(object, world_from_object);
  }

 private:
  void fold(const void* bytes, size_t size) { hash = checksum(bytes, size, hash); }
};

TEST(CityEmit, says_the_same_with_any_number_of_threads) {
  uint64_t first = 0;
  for (const int threads : {1, 2, 7}) {
    HashingSink sink;
    tbb::task_arena(threads).execute([&] {
      const City city = planned(small_city());
      ASSERT_TRUE(city.emit(sink, "sky.exr"));
    });
    if (threads == 1) first = sink.hash;
    EXPECT_EQ(sink.hash, first) << threads << " threads";
    EXPECT_EQ(sink.contract, "");
  }
  HashingSink other;
  CityOptions options = small_city();
  options.seed = 12;
  ASSERT_TRUE(planned(options).emit(other, "sky.exr"));
  EXPECT_NE(other.hash, first);
}

TEST(CityEmit, counts_are_exact) {
  for (const uint64_t buildings : {0, 1, 60, 61}) {
    CityOptions options = small_city();
    options.buildings = buildings, options.tessellate = buildings % 2 == 1;
    if (buildings < 60) options.trees.reset(), options.cars.reset(), options.detail_triangles.reset();
    const City city = planned(options);
    HashingSink sink;
    ASSERT_TRUE(city.emit(sink, "sky.exr"));
    const CityCounts& counts = city.counts();
    EXPECT_EQ(sink.triangle_count, counts.unique_triangles());
    EXPECT_EQ(sink.instances.size(), counts.instances);
    EXPECT_EQ(sink.emitting, counts.light_triangles);
    EXPECT_EQ(sink.cages, options.tessellate ? 0 : counts.cages);
    EXPECT_EQ(counts.instances, counts.street_lights + counts.trees + counts.cars + counts.lanterns + counts.boats +
                                    counts.sea_tiles);
  }
}

TEST(CityEmit, counts_are_exact_with_instanced_buildings) {
  CityOptions options = small_city();
  options.unique = 0.25;
  const City city = planned(options);
  HashingSink sink;
  ASSERT_TRUE(city.emit(sink, "sky.exr"));
  const CityCounts& counts = city.counts();
  EXPECT_GT(counts.instanced_buildings, 20u);
  EXPECT_EQ(sink.triangle_count, counts.unique_triangles());
  EXPECT_EQ(sink.instances.size(), counts.instances);
}

TEST(CityEmit, detail_is_the_mean_of_a_building) {
  for (const double detail : {700.0, 1900.0}) {
    CityOptions options;
    options.buildings = 1500, options.detail_triangles = detail;
    const City city = planned(options);
    const double mean = static_cast<double>(city.counts().building_triangles) / 1500;
    EXPECT_NEAR(mean, detail, 0.25 * detail);  // calibrated on a sample of blocks
  }
}

TEST(CityEmit, by_day_nothing_but_the_sky_and_the_sun_shines) {
  CityOptions options = small_city();
  options.time = TimeOfDay::day;
  HashingSink sink;
  ASSERT_TRUE(planned(options).emit(sink, "sky.exr"));
  EXPECT_EQ(sink.emitting, 0u);
  EXPECT_EQ(sink.lights.size(), 2u);
}

TEST(CityEmit, text_refuses_what_it_would_leave_out) {
  const test::TemporaryDirectory folder;
  auto sink = PbrtSink::create(folder.path(), "city");
  ASSERT_TRUE(sink) << sink.error().message;
  pipeline::Material glass, bumpy, rough, plain;
  glass.kind = pipeline::MaterialKind::dielectric;
  bumpy.displacement = 0, rough.kind = pipeline::MaterialKind::coated_diffuse, rough.u_roughness.texture = 0;
  for (const pipeline::Material& material : {glass, bumpy, rough}) EXPECT_FALSE((*sink)->add_material(material, "wall"));
  const auto wall = (*sink)->add_material(plain, "wall");
  ASSERT_TRUE(wall);
  pipeline::MeshInput masked, reversed, both_sides, fog;
  masked.alpha = TextureId{0}, reversed.flip_normals = true, fog.divides_media = true;
  both_sides.emits = both_sides.emits_two_sided = true;
  for (pipeline::MeshInput* mesh : {&masked, &reversed, &both_sides, &fog}) {
    mesh->name = "leaf", mesh->material = *wall;
    const Status refused = (*sink)->add_mesh(*mesh);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().message.find("leaf"), std::string::npos) << refused.error().message;
  }
}

TEST(CityEmit, text_and_store_hold_the_same_scene) {
  const test::TemporaryDirectory folder;
  const City city = planned(small_city());
  const fs::path sky = folder.path() / "sky.exr";
  ASSERT_TRUE(write_sky(sky, TimeOfDay::night));
  {
    auto sink = PbrtSink::create(folder.path(), "city");
    ASSERT_TRUE(sink) << sink.error().message;
    ASSERT_TRUE(city.emit(**sink, sky));
    EXPECT_FALSE(fs::exists(folder.path() / "city.pbrt"));  // the main file comes last
    const Status finished = (*sink)->finish();
    ASSERT_TRUE(finished) << finished.error().message;
  }
  HashingSink imported, direct;
  ImportReport report;
  const Status read = import_pbrt(folder.path() / "city.pbrt", imported, {}, report);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(report.warnings.empty()) << report.warnings.front();
  ASSERT_TRUE(city.emit(direct, sky));
  EXPECT_EQ(imported.triangle_count, direct.triangle_count);
  EXPECT_EQ(imported.mesh_count, direct.mesh_count);
  EXPECT_EQ(imported.instances.size(), direct.instances.size());
  EXPECT_EQ(imported.cages, direct.cages);
  EXPECT_EQ(imported.lights.size(), direct.lights.size());
  const shading::Camera& a = imported.settings.camera;
  const shading::Camera& b = direct.settings.camera;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      EXPECT_NEAR(a.world_from_camera.m[row][column], b.world_from_camera.m[row][column], 1e-3);
  EXPECT_NEAR(a.tan_half_fov_x, b.tan_half_fov_x, 1e-5);
}

TEST(CityEmit, stores_have_the_same_bytes_for_any_number_of_threads) {
  const test::TemporaryDirectory folder;
  const fs::path sky = folder.path() / "sky.exr";
  ASSERT_TRUE(write_sky(sky, TimeOfDay::night));
  CityOptions options = small_city();
  options.tessellate = true;
  for (const int threads : {1, 2, 7}) {
    const fs::path store = folder.path() / fmt::format("store{}", threads);
    tbb::task_arena(threads).execute([&] {
      auto packer = pipeline::ScenePacker::create(store, {});
      ASSERT_TRUE(packer);
      ASSERT_TRUE(planned(options).emit(**packer, sky));
      const Status finished = (*packer)->finish();
      ASSERT_TRUE(finished) << finished.error().message;
    });
    for (const char* file : {pipeline::kTracePagesFile, pipeline::kAttributesFile, pipeline::kManifestFile})
      EXPECT_EQ(bytes_of(store / file) == bytes_of(folder.path() / "store1" / file), true) << file << ", " << threads;
  }
  const auto store = pipeline::Store::open(folder.path() / "store1");
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->settings().statistics.triangle_count, planned(options).counts().unique_triangles());
  EXPECT_EQ(store->settings().statistics.degenerate_dropped_count, 0u);
}

}  // namespace
}  // namespace spillway::tools::city
