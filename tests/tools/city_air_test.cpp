// Fog, low cloud and smoke of a city: the file they lie in, the media they become, and that plumes are nested in the rest.

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <tbb/task_arena.h>

#include <set>

#include "tests/support/file_bytes.h"
#include "tests/support/small_scene.h"
#include "tests/tools/planned_city.h"
#include "tests/tools/recording_sink.h"
#include "tools/city/city.h"
#include "tools/city/manifest.h"
#include "tools/city/pbrt_sink.h"
#include "tools/city/volume_file.h"
#include "tools/import/import_pbrt.h"

namespace spillway::tools::city {
namespace {

using test::bytes_of;

namespace fs = std::filesystem;

// With factories, whose chimneys smoke.
CityOptions foggy(AirKinds air = {true, true, true}) {
  CityOptions options;
  options.buildings = 260, options.detail_triangles = 700, options.trees = 0, options.cars = 0, options.seed = 5;
  options.street_lights = 20, options.air = air, options.air_cells = 24;
  return options;
}

openvdb::FloatGrid::Ptr read_grid(const fs::path& file, const std::string& name) {
  openvdb::initialize();
  openvdb::io::File in(file.string());
  in.open(false);
  return openvdb::gridPtrCast<openvdb::FloatGrid>(in.readGrid(name));
}

class CityAir : public testing::Test {
 protected:
  static const City& city() {
    static const City city = planned(foggy());
    return city;
  }
  test::TemporaryDirectory directory_;
  const fs::path air_ = directory_.path() / "air.vdb";
};

TEST_F(CityAir, the_file_has_the_same_bytes_for_any_number_of_threads) {
  std::string first;
  for (const int threads : {1, 2, 7}) {
    const fs::path file = directory_.path() / fmt::format("{}.vdb", threads);
    tbb::task_arena(threads).execute([&] {
      const Status written = planned(foggy()).write_air(file);
      ASSERT_TRUE(written) << written.error().message;
    });
    if (first.empty()) first = bytes_of(file);
    EXPECT_EQ(bytes_of(file) == first, true) << threads << " threads";
  }
  EXPECT_GT(first.size(), 50'000u);
  // Nothing but the files is left: leaves and temporary names are gone.
  EXPECT_EQ(std::distance(fs::directory_iterator(directory_.path()), fs::directory_iterator()), 3);
  CityOptions other = foggy();
  other.seed = 6;
  ASSERT_TRUE(planned(other).write_air(air_));
  EXPECT_NE(bytes_of(air_), first);
}

TEST_F(CityAir, the_library_reads_the_samples_that_were_meant) {
  const Terrain terrain({true, true, 400, 3});
  const Air air(terrain, 3, {true, true, false}, 16);
  const AirGrid grid = air.grid();
  const GridToWrite write{
      grid, [&](int32_t x, int32_t y, std::span<float> samples) { air.fill_column(grid, nullptr, x, y, samples); }};
  ASSERT_TRUE(write_volume_file(air_, {&write, 1}));
  const openvdb::FloatGrid::Ptr read = read_grid(air_, "air");
  const auto values = read->getConstAccessor();
  size_t above_zero = 0;
  std::vector<float> column(static_cast<size_t>(grid.count[2]));
  for (int32_t y = 0; y < grid.count[1]; y += 3)
    for (int32_t x = 0; x < grid.count[0]; x += 3) {
      air.fill_column(grid, nullptr, x, y, column);
      for (int32_t z = 0; z < grid.count[2]; ++z) {
        const float wanted = column[static_cast<size_t>(z)], got = values.getValue({x, y, z});
        ASSERT_NEAR(got, wanted, wanted * 0x1p-10f + 1e-7f);  // halves
        above_zero += got > 0 ? 1 : 0;
      }
    }
  EXPECT_GT(above_zero, 500u);
  const openvdb::Vec3d world = read->indexToWorld(openvdb::Vec3d(3, 5, 7));
  EXPECT_NEAR(world.x(), grid.origin.x + 3 * grid.step.x, 1e-3);
  EXPECT_NEAR(world.z(), grid.origin.z + 7 * grid.step.z, 1e-3);
}

TEST_F(CityAir, a_file_that_cannot_be_written_is_an_error_and_leaves_nothing) {
  const Terrain terrain({true, true, 400, 3});
  const Air air(terrain, 3, {true, false, false}, 8);
  const AirGrid grid = air.grid();
  const GridToWrite write{
      grid, [&](int32_t x, int32_t y, std::span<float> samples) { air.fill_column(grid, nullptr, x, y, samples); }};
  EXPECT_FALSE(write_volume_file(directory_.path() / "missing/air.vdb", {&write, 1}));
  fs::create_directory(air_);  // where the file should be
  const Status refused = write_volume_file(air_, {&write, 1});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("air.vdb"), std::string::npos) << refused.error().message;
  for (const auto& entry : fs::directory_iterator(directory_.path())) EXPECT_EQ(entry.path(), air_);
}

TEST_F(CityAir, every_kind_is_counted_and_said) {
  struct Case {
    AirKinds air;
    uint64_t spreading;
  };
  for (const Case& c : {Case{{true, false, false}, 1}, Case{{false, true, false}, 1}, Case{{false, false, true}, 0},
                        Case{{true, true, true}, 1}, Case{{false, false, false}, 0}}) {
    const City city = planned(foggy(c.air));
    RecordingSink sink;
    sink.keep_meshes = false;
    ASSERT_TRUE(city.emit(sink, "sky.exr", "air.vdb"));
    EXPECT_EQ(sink.contract, "");
    const CityCounts& counts = city.counts();
    EXPECT_EQ(counts.media, c.spreading + counts.plumes);
    EXPECT_EQ(counts.plumes > 0, c.air.smoke);
    EXPECT_EQ(sink.media.size(), counts.media);
    EXPECT_EQ(sink.volumes.size(), counts.media);
    EXPECT_EQ(sink.triangle_count, counts.unique_triangles());
    EXPECT_EQ(sink.settings.render.camera_medium, c.spreading > 0 ? 0 : pipeline::kNoMedium);
    EXPECT_EQ(manifest_json(city, foggy(c.air)).find("\"smoke_plumes\"") != std::string::npos, counts.media > 0);
  }
}

// What stands in the city is what it is without air: hulls come in between, and nothing else.
TEST_F(CityAir, the_rest_of_the_city_is_not_touched) {
  RecordingSink clear, hazy;
  ASSERT_TRUE(planned(foggy({})).emit(clear, "sky.exr"));
  ASSERT_TRUE(city().emit(hazy, "sky.exr", "air.vdb"));
  std::erase_if(hazy.meshes, [](const RecordedMesh& m) { return m.input.divides_media; });
  ASSERT_EQ(clear.meshes.size(), hazy.meshes.size());
  for (size_t i = 0; i < clear.meshes.size(); ++i) {
    EXPECT_EQ(clear.meshes[i].input.name, hazy.meshes[i].input.name);
    EXPECT_EQ(clear.meshes[i].positions == hazy.meshes[i].positions, true);
  }
  EXPECT_EQ(clear.settings.render.max_depth, 5u);
}

// A plume's grid holds fog and cloud, too: where a ray is in it, the grid of the whole does not count.
TEST_F(CityAir, plumes_are_apart_and_hold_the_fog_around_them) {
  CityOptions options = foggy();
  RecordingSink sink;
  ASSERT_TRUE(city().emit(sink, "sky.exr", "air.vdb"));
  std::vector<Bounds3> hulls;
  for (const RecordedMesh& mesh : sink.meshes) {
    if (!mesh.input.divides_media) continue;
    EXPECT_EQ(mesh.input.medium_outside, 0u);
    EXPECT_EQ(mesh.input.medium_inside, hulls.size() + 1);
    Bounds3 box;
    for (const Float3 p : mesh.positions) box.grow(p);
    // Closed and outwards: as much volume as the box has.
    double six_volumes = 0;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
      const Float3 a = mesh.positions[mesh.indices[i]] - box.lower, b = mesh.positions[mesh.indices[i + 1]] - box.lower,
                   c = mesh.positions[mesh.indices[i + 2]] - box.lower;
      six_volumes += static_cast<double>(spillway::dot(a, spillway::cross(b, c)));
    }
    const Float3 e = box.extent();
    EXPECT_NEAR(six_volumes / 6, static_cast<double>(e.x * e.y * e.z), 1e-3 * static_cast<double>(e.x * e.y * e.z));
    for (const Bounds3& other : hulls) {
      bool apart = false;
      for (int a = 0; a < 3; ++a) apart = apart || box.lower[a] > other.upper[a] || other.lower[a] > box.upper[a];
      EXPECT_TRUE(apart);
    }
    const View view = city().view(1);
    const Float3 eye{static_cast<float>(view.eye.x), static_cast<float>(view.eye.y), static_cast<float>(view.eye.z)};
    bool outside = false;
    for (int a = 0; a < 3; ++a) outside = outside || eye[a] < box.lower[a] || eye[a] > box.upper[a];
    EXPECT_TRUE(outside);
    hulls.push_back(box);
  }
  ASSERT_GT(hulls.size(), 0u);

  const Terrain terrain({true, true, city().radius_m(), options.seed});
  const Air all(terrain, options.seed, {true, true, true}, 24), smoke_alone(terrain, options.seed, {false, false, true}, 24),
      rest(terrain, options.seed, {true, true, false}, 24);
  const Vec3 mouth{0, -0.1 * city().radius_m(), 12};
  const std::vector<Plume> plumes = all.plumes({{mouth, 1.5}}, {});
  ASSERT_EQ(plumes.size(), 1u);
  const AirGrid& grid = plumes[0].grid;
  std::vector<float> sum(static_cast<size_t>(grid.count[2])), smoke(sum), fog(sum);
  double smoky = 0, foggy_share = 0;
  for (int32_t y = 0; y < grid.count[1]; y += 2)
    for (int32_t x = 0; x < grid.count[0]; x += 2) {
      all.fill_column(grid, &plumes[0], x, y, sum);
      smoke_alone.fill_column(grid, &plumes[0], x, y, smoke);
      rest.fill_column(grid, nullptr, x, y, fog);
      for (size_t z = 0; z < sum.size(); ++z) {
        ASSERT_NEAR(sum[z], smoke[z] + fog[z], 1e-6f * (1 + sum[z]));
        smoky += static_cast<double>(smoke[z]), foggy_share += static_cast<double>(fog[z]);
      }
    }
  EXPECT_GT(smoky, 10);
  EXPECT_GT(foggy_share, 1);
  EXPECT_TRUE(all.plumes({{mouth, 1.5}}, std::array{mouth + Vec3{1, 0, 4}}).empty());  // a camera stands there
}

TEST_F(CityAir, text_says_the_same_media) {
  ASSERT_TRUE(write_sky(directory_.path() / "sky.exr", TimeOfDay::day));
  auto sink = PbrtSink::create(directory_.path(), "city");
  ASSERT_TRUE(sink) << sink.error().message;
  RecordingSink direct, imported;
  direct.keep_meshes = false;
  ASSERT_TRUE(city().emit(**sink, directory_.path() / "sky.exr", air_));
  ASSERT_TRUE((*sink)->finish());
  ASSERT_TRUE(city().emit(direct, directory_.path() / "sky.exr", air_));
  ImportReport report;
  const Status read = import_pbrt(directory_.path() / "city.pbrt", imported, {}, report);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(report.warnings.empty()) << report.warnings.front();
  ASSERT_EQ(imported.media.size(), direct.media.size());
  for (size_t i = 0; i < imported.media.size(); ++i) {
    const pipeline::Medium &a = imported.media[i].medium, &b = direct.media[i].medium;
    EXPECT_EQ(a.sigma_s, b.sigma_s);
    EXPECT_EQ(a.sigma_a, b.sigma_a);
    EXPECT_EQ(a.g, b.g);
    EXPECT_EQ(a.glow_kind, b.glow_kind);
    EXPECT_EQ(imported.volumes[a.density_volume].grid, direct.volumes[b.density_volume].grid);
    EXPECT_EQ(fs::weakly_canonical(imported.volumes[a.density_volume].file), fs::weakly_canonical(air_));
    EXPECT_EQ(std::memcmp(&imported.media[i].world_from_medium, &direct.media[i].world_from_medium, sizeof(Affine3)), 0);
  }
  EXPECT_EQ(imported.settings.render.camera_medium, direct.settings.render.camera_medium);
  EXPECT_EQ(imported.settings.render.max_depth, direct.settings.render.max_depth);
  EXPECT_EQ(imported.triangle_count, direct.triangle_count);
  size_t hulls = 0;
  for (const RecordedMesh& mesh : imported.meshes) {
    if (!mesh.input.divides_media) continue;
    EXPECT_FALSE(mesh.input.material.valid());
    EXPECT_EQ(mesh.input.medium_inside, ++hulls);
    EXPECT_EQ(mesh.input.medium_outside, 0u);
  }
  EXPECT_EQ(hulls, city().counts().plumes);
}

}  // namespace
}  // namespace spillway::tools::city
