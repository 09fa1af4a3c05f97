// The painted city: which faces, how many texels, the same bytes for any number of threads, by text or packed at once.

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "cache/facetex_file.h"
#include "cache/texture_cache.h"
#include "pipeline/pack/scene_packer.h"
#include "pipeline/store.h"
#include "tests/support/file_bytes.h"
#include "tests/support/small_scene.h"
#include "tests/tools/planned_city.h"
#include "tests/tools/recording_sink.h"
#include "tools/city/city.h"
#include "tools/city/paint.h"
#include "tools/city/pbrt_sink.h"
#include "tools/import/import_pbrt.h"

namespace spillway::tools::city {
namespace {

using test::bytes_of;

namespace fs = std::filesystem;

CityOptions painted_city(double texels_per_metre) {
  CityOptions options;
  options.buildings = 20, options.detail_triangles = 900, options.trees = 5, options.cars = 5, options.seed = 11;
  options.texels_per_metre = texels_per_metre;
  return options;
}

class CityPaint : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(write_sky(sky_, TimeOfDay::day)); }
  fs::path packed(const std::string& name, const CityOptions& options) {
    const fs::path store = directory_.path() / name;
    auto packer = pipeline::ScenePacker::create(store, {});
    EXPECT_TRUE(packer);
    const Status said = planned(options).emit(**packer, sky_);
    EXPECT_TRUE(said) << said.error().message;
    const Status finished = (*packer)->finish();
    EXPECT_TRUE(finished) << finished.error().message;
    return store;
  }
  static fs::path paint_of(const fs::path& store) { return store / "textures/faces-00000.facetex"; }

  test::TemporaryDirectory directory_;
  const fs::path sky_ = directory_.path() / "sky.exr";
};

TEST_F(CityPaint, has_the_same_bytes_for_any_number_of_threads) {
  for (const int threads : {1, 2, 7}) {
    fs::path store;
    tbb::task_arena(threads).execute([&] { store = packed(fmt::format("store{}", threads), painted_city(1.5)); });
    for (const char* file : {"textures/faces-00000.facetex", pipeline::kManifestFile, pipeline::kAttributesFile})
      EXPECT_TRUE(bytes_of(store / file) == bytes_of(directory_.path() / "store1" / file)) << file << ' ' << threads;
  }
}

TEST_F(CityPaint, has_as_many_texels_as_were_planned) {
  for (const double texels_per_metre : {1.0, 1.7}) {
    const City city = planned(painted_city(texels_per_metre));
    const fs::path store = packed(fmt::format("store{}", texels_per_metre), painted_city(texels_per_metre));
    const auto file = cache::FaceTexFile::open(paint_of(store), {});
    ASSERT_TRUE(file) << file.error().message;
    uint64_t faces = 0, texels = 0;
    for (const cache::FaceTexTexture& texture : file->textures())
      for (const cache::FaceInfo& face : file->faces(texture))
        ++faces, texels += uint64_t{1} << (face.ulog2 + face.vlog2);
    EXPECT_EQ(faces, city.painted().faces);
    EXPECT_EQ(texels, city.painted().texels);
    EXPECT_GT(faces, 1000u);
    EXPECT_EQ(planned(painted_city(0)).painted().faces, 0u);
  }
}

TEST_F(CityPaint, text_brings_its_textures_packed) {
  const fs::path store = packed("direct", painted_city(1.5)), folder = directory_.path() / "text";
  auto sink = PbrtSink::create(folder, "city");
  ASSERT_TRUE(sink);
  ASSERT_TRUE(planned(painted_city(1.5)).emit(**sink, sky_));
  ASSERT_TRUE((*sink)->finish());
  auto packer = pipeline::ScenePacker::create(directory_.path() / "again", {});
  ASSERT_TRUE(packer);
  ImportReport report;
  const Status read = import_pbrt(folder / "city.pbrt", **packer, {}, report);
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_TRUE((*packer)->finish());
  EXPECT_TRUE(bytes_of(paint_of(directory_.path() / "again")) == bytes_of(paint_of(store)));
  const auto a = pipeline::Store::open(store), b = pipeline::Store::open(directory_.path() / "again");
  ASSERT_TRUE(a && b);
  ASSERT_EQ(a->face_textures().size(), b->face_textures().size());
  for (size_t i = 0; i < a->face_textures().size(); ++i) {
    EXPECT_EQ(a->face_textures()[i].texture, b->face_textures()[i].texture);
    EXPECT_EQ(a->face_textures()[i].face_count, b->face_textures()[i].face_count);
    EXPECT_EQ(a->face_textures()[i].mean[1], b->face_textures()[i].mean[1]);
  }
  EXPECT_EQ(a->settings().statistics.triangle_count, b->settings().statistics.triangle_count);
}

TEST_F(CityPaint, a_texture_that_a_file_does_not_hold_is_refused_by_name) {
  const fs::path store = packed("direct", painted_city(1));
  auto packer = pipeline::ScenePacker::create(directory_.path() / "other", {});
  ASSERT_TRUE(packer);
  const auto missing = (*packer)->add_face_texture(paint_of(store), {}, "nowhere");
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("none is 'nowhere'"), std::string::npos) << missing.error().message;
  auto second = pipeline::ScenePacker::create(directory_.path() / "third", {});
  const auto unnamed = (*second)->add_face_texture(paint_of(store), {}, "");
  ASSERT_FALSE(unnamed);
  EXPECT_NE(unnamed.error().message.find("name it"), std::string::npos) << unnamed.error().message;
}

// Bounded memory: batches that end, whatever the city.
class BatchSink : public RecordingSink {
 public:
  size_t largest = 0, faces = 0;
  BatchSink() { keep_meshes = false; }
  Result<FaceTextureId> begin_face_texture(const cache::FaceTexFormat&, cache::FaceTextureShape shape) override {
    expected_ += shape.faces.size();
    return FaceTextureId{0};
  }
  Status add_faces(std::span<const std::vector<std::byte>> batch) override {
    size_t bytes = 0;
    for (const auto& face : batch) bytes += face.size();
    largest = std::max(largest, bytes), faces += batch.size();
    return {};
  }
  [[nodiscard]] bool is_complete() const { return faces == expected_; }

 private:
  size_t expected_ = 0;
};

TEST_F(CityPaint, is_said_in_pieces_of_a_few_megabytes) {
  BatchSink sink;
  ASSERT_TRUE(planned(painted_city(6)).emit(sink, sky_));
  EXPECT_TRUE(sink.is_complete());
  EXPECT_EQ(sink.faces, planned(painted_city(6)).painted().faces);
  EXPECT_LT(sink.largest, size_t{20} << 20);  // two million texels, and one face
  EXPECT_GT(sink.largest, size_t{2} << 20);
}

TEST_F(CityPaint, bytes_choose_the_texels) {
  CityOptions options = painted_city(0);
  options.texture_bytes = 30 << 20;
  const City city = planned(options);
  EXPECT_NEAR(static_cast<double>(city.predicted_texture_bytes()), 30 << 20, 8 << 20);
  const fs::path store = packed("sized", options);
  EXPECT_NEAR(static_cast<double>(fs::file_size(paint_of(store))), 30 << 20, 10 << 20);
  options.texture_bytes = 1ull << 50;
  const auto absurd = City::plan(options);
  ASSERT_FALSE(absurd);
  EXPECT_NE(absurd.error().message.find("--textures"), std::string::npos);
}

// Three quads in a row along x, each from x to x + 1, and one that stands on the last one's edge.
PaintedMesh some_quads() {
  PaintedMesh mesh;
  for (int x = 0; x < 4; ++x)
    for (int z = 0; z < 2; ++z) mesh.positions.push_back({static_cast<float>(x), 0, static_cast<float>(z)});
  mesh.positions.push_back({3, 2, 0}), mesh.positions.push_back({3, 2, 1});
  mesh.faces = {{{0, 2, 3, 1}, 1, Surface::brick_red, {5, 5}},
                {{4, 5, 3, 2}, 1, Surface::brick_red, {5, 5}},  // turned: its edge 2 is that of the first
                {{4, 6, 7, 5}, 1, Surface::brick_red, {5, 5}},
                {{6, 8, 9, 7}, 1, Surface::brick_red, {5, 5}}};
  return mesh;
}

TEST_F(CityPaint, faces_name_the_neighbours_that_continue_them) {
  PaintedMesh mesh = some_quads();
  const auto infos = face_infos(mesh);
  EXPECT_EQ(infos[0].adjacent_faces[1], 1u);
  EXPECT_EQ(infos[0].adjacent_edge(1), 2u);
  EXPECT_EQ(infos[1].adjacent_faces[2], 0u);
  EXPECT_EQ(infos[1].adjacent_edge(2), 1u);
  EXPECT_EQ(infos[1].adjacent_faces[0], 2u);
  EXPECT_EQ(infos[2].adjacent_faces[3], 1u);
  EXPECT_EQ(infos[2].adjacent_faces[1], cache::kNoFace);  // around a corner
  for (uint32_t f = 0; f < 4; ++f)
    EXPECT_EQ(cache::first_inconsistent_edge(infos, cache::FaceShape::quad, f), cache::kNoFace);
  mesh.faces[0].wall = 2, mesh.faces[2].surface = Surface::limestone;
  for (const cache::FaceInfo& face : face_infos(mesh))
    for (const uint32_t other : face.adjacent_faces) EXPECT_EQ(other, cache::kNoFace);
  mesh = some_quads();
  for (PaintedFace& face : mesh.faces) face.surface = Surface::glass_dark;
  EXPECT_EQ(face_infos(mesh)[0].adjacent_faces[1], cache::kNoFace);
}

// Where two faces of a city share an edge at one resolution, what is seen on it is the same from both.
TEST_F(CityPaint, is_continuous_across_edges) {
  const fs::path store = packed("store", painted_city(3));
  const auto opened = pipeline::Store::open(store);
  const auto file = cache::FaceTexFile::open(paint_of(store), {});
  ASSERT_TRUE(opened && file);
  auto cache =
      cache::TextureCache::open(opened->textures_path(), {}, {}, opened->face_containers(), opened->face_textures());
  ASSERT_TRUE(cache) << cache.error().message;
  size_t edges = 0, named = 0, compared = 0;
  for (uint32_t t = 0; t < opened->face_textures().size(); ++t) {
    const auto faces = file->faces(file->textures()[opened->face_textures()[t].texture]);
    for (uint32_t f = 0; f < faces.size(); ++f)
      for (uint32_t e = 0; e < 4; ++e, ++edges) {
        if (faces[f].adjacent_faces[e] == cache::kNoFace) continue;
        ++named;
        const cache::FaceInfo& other = faces[faces[f].adjacent_faces[e]];
        const bool is_turned = (e ^ faces[f].adjacent_edge(e)) & 1;
        if (faces[f].ulog2 != (is_turned ? other.vlog2 : other.ulog2) ||
            faces[f].vlog2 != (is_turned ? other.ulog2 : other.vlog2))
          continue;
        const auto middle = [](uint32_t edge) {
          return std::pair(edge == 1 ? 1.0f : edge == 3 ? 0.0f : 0.5f, edge == 2 ? 1.0f : edge == 0 ? 0.0f : 0.5f);
        };
        const auto [u, v] = middle(e);
        const auto [s, r] = middle(faces[f].adjacent_edge(e));
        const std::array<cache::FaceTextureRequest, 2> requests = {
            {{t, f, u, v, 0, 0, 0, {}}, {t, faces[f].adjacent_faces[e], s, r, 0, 0, 0, {}}}};
        std::array<cache::Texel, 2> values;
        ASSERT_TRUE((*cache)->look_up_faces(requests, values));
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(values[0].value[c], values[1].value[c], 1e-5) << t << ' ' << f << ' ' << e;
        ++compared;
      }
  }
  EXPECT_GT(named, edges / 50);
  EXPECT_GT(compared, 100u);
}

TEST_F(CityPaint, faces_that_continue_each_other_are_painted_on) {
  WallGrid wall;
  wall.frame = {{100, 50, 7}, {1, 0}}, wall.base_z = 7, wall.width_m = 8, wall.top_m = 8, wall.key = 5;
  const auto paint = [&](Surface surface, float x0, float x1, uint8_t ulog2) {
    const std::array<Float3, 4> corners = {Float3{x0, 50, 7}, {x1, 50, 7}, {x1, 50, 15}, {x0, 50, 15}};
    return painted_texels({.surface = surface, .size = {ulog2, 6}}, corners, wall);
  };
  for (const Surface surface : {Surface::brick_red, Surface::limestone, Surface::plaster_cream, Surface::wood_green}) {
    const auto whole = paint(surface, 100, 108, 6), left = paint(surface, 100, 104, 5),
               right = paint(surface, 104, 108, 5);
    size_t different = 0;
    for (size_t row = 0; row < 64; ++row)
      for (size_t x = 0; x < 64 * 3; ++x) {
        const std::byte part = x < 96 ? left[row * 96 + x] : right[row * 96 + x - 96];
        different += whole[row * 192 + x] != part;
      }
    EXPECT_LE(different, 12u) << name(surface);  // rounding of places
  }
  EXPECT_NE(paint(Surface::brick_red, 100, 108, 6), paint(Surface::brick_brown, 100, 108, 6));
}

}  // namespace
}  // namespace spillway::tools::city
