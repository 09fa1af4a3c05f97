// From a hit to a place on a face, and face textures through packing and the renderer.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "pipeline/pack/scene_packer.h"
#include "pipeline/pack/spool_mesh.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/shade_path.h"
#include "tests/support/face_mesh.h"
#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

namespace fs = std::filesystem;

Float3 patch(const Float3 p[4], float u, float v) {
  return p[0] * ((1 - u) * (1 - v)) + p[1] * (u * (1 - v)) + p[2] * (u * v) + p[3] * ((1 - u) * v);
}

// The triangles that a quad is split into, as a mesh of its own says them.
MeshInput split_quad(const Float3 (&corner)[4], std::vector<uint32_t>& indices, std::vector<TriangleFace>& faces) {
  indices = {0, 1, 2, 0, 2, 3};
  faces = {{7, {0, 1, 2}, false, 3}, {7, {0, 2, 3}, false, 1}};
  MeshInput mesh;
  mesh.positions = corner, mesh.indices = indices, mesh.faces = faces;
  return mesh;
}

cache::TriangleAttributes attributes(const MeshInput& mesh, size_t t) {
  test::TemporaryDirectory directory;
  auto scratch = cache::Scratch::create(directory.path());
  auto spool = MeshSpool::create(**scratch);
  uint64_t degenerate = 0;
  auto spooled = spool_mesh(mesh, *spool, 100, degenerate);
  EXPECT_TRUE(spooled) << spooled.error().message;
  EXPECT_TRUE(spool->seal());
  SpoolReader reader(*spool);
  auto data = reader.read(spooled->chunks[0], true);
  data->mesh = 0, data->first_prim = 0;
  const Buffer<std::byte> block = cache::build_attribute_block(std::span(&*data, 1));
  EXPECT_TRUE(cache::validate_attribute_block(block, "block"));
  return cache::triangle_attributes(block, PrimId{static_cast<uint32_t>(t)});
}

TEST(FacePointTest, a_place_on_a_quad_has_the_uv_of_its_bilinear_patch) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> unit(0, 1);
  for (int trial = 0; trial < 60; ++trial) {
    // Convex, in a tilted plane.
    const Float3 ex{1, 0.2f, 0.5f}, ey{-0.3f, 1, 0.1f};
    Float3 corner[4];
    for (int k = 0; k < 4; ++k) {
      const float x = (k == 1 || k == 2 ? 1.0f : 0.0f) + (trial == 0 ? 0 : 0.6f * (unit(random) - 0.5f));
      const float y = (k >= 2 ? 1.0f : 0.0f) + (trial == 0 ? 0 : 0.6f * (unit(random) - 0.5f));
      corner[k] = ex * x + ey * y;
    }
    std::vector<uint32_t> indices;
    std::vector<TriangleFace> faces;
    const MeshInput mesh = split_quad(corner, indices, faces);
    for (size_t t = 0; t < 2; ++t) {
      const cache::TriangleAttributes triangle = attributes(mesh, t);
      ASSERT_TRUE(triangle.has_face);
      EXPECT_EQ(triangle.face.face, 7u);
      for (int i = 0; i < 40; ++i) {
        HitRecord hit{};
        hit.hit.u = unit(random), hit.hit.v = unit(random) * (1 - hit.hit.u);
        const Float3* p = triangle.position_object;
        const Float3 place = p[0] * (1 - hit.hit.u - hit.hit.v) + p[1] * hit.hit.u + p[2] * hit.hit.v;
        const FacePoint point = face_point(triangle, hit, {}, 0.01f, 1);
        EXPECT_LT(length(patch(corner, point.u, point.v) - place), 2e-5f) << trial;
        const float h = 1e-2f;
        const float along_u =
            length(patch(corner, point.u + h, point.v) - patch(corner, point.u - h, point.v)) / (2 * h);
        EXPECT_NEAR(point.width_u, 0.01f / along_u, 1e-4f);
      }
    }
  }
}

TEST(FacePointTest, both_triangles_of_a_bent_quad_agree_on_their_edge) {
  const Float3 corner[4] = {{0, 0, 0}, {1, 0, 0.3f}, {1.2f, 1, -0.2f}, {0, 0.9f, 0.4f}};
  std::vector<uint32_t> indices;
  std::vector<TriangleFace> faces;
  const MeshInput mesh = split_quad(corner, indices, faces);
  const auto first = attributes(mesh, 0), second = attributes(mesh, 1);
  for (float s = 0; s <= 1; s += 0.05f) {
    HitRecord a{}, b{};
    a.hit.v = s, b.hit.u = s;  // along the diagonal
    const FacePoint pa = face_point(first, a, {}, 0, 1), pb = face_point(second, b, {}, 0, 1);
    EXPECT_NEAR(pa.u, pb.u, 1e-5f);
    EXPECT_NEAR(pa.v, pb.v, 1e-5f);
  }
}

TEST(FacePointTest, a_triangle_that_is_a_face_has_its_weights_whichever_way_it_is_wound) {
  const Float3 corner[3] = {{0, 0, 0}, {2, 0, 0}, {0, 1, 0}};
  const std::vector<uint32_t> indices{0, 2, 1};
  const std::vector<TriangleFace> faces{{3, {0, 2, 1}, true, 0}};
  MeshInput mesh;
  mesh.positions = corner, mesh.indices = indices, mesh.faces = faces;
  HitRecord hit{};
  hit.hit.u = 0.25f, hit.hit.v = 0.5f;
  const FacePoint point = face_point(attributes(mesh, 0), hit, {}, 0.1f, 1);
  EXPECT_FLOAT_EQ(point.u, 0.5f);
  EXPECT_FLOAT_EQ(point.v, 0.25f);
  EXPECT_FLOAT_EQ(point.width_u, 0.05f);
  EXPECT_FLOAT_EQ(point.width_v, 0.1f);
}

// ---- scenes ----

class FaceSceneTest : public testing::Test {
 protected:
  // A wall of 2 x 1 quads before the camera; the texture has `face_count` faces.
  Status pack(uint32_t face_count, bool with_faces = true, uint64_t max_container_bytes = 1ull << 40) {
    PackOptions options;
    options.max_face_container_bytes = max_container_bytes;
    SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(store_, options));
    SceneSettings settings;
    settings.camera.resolution_x_px = settings.camera.resolution_y_px = 16;
    settings.camera.world_from_camera.m[2][3] = -2;
    settings.camera.tan_half_fov_x = settings.camera.tan_half_fov_y = 0.25f;  // nothing but wall
    settings.render.samples_per_pixel = 64;
    packer->set_settings(settings);
    Material material;
    for (int t = 0; t < 2; ++t) {
      const test::FaceGrid grid(face_count, 1);
      cache::FaceTexFormat format;
      const auto faces = grid.faces([](uint32_t) { return std::pair<uint8_t, uint8_t>{3, 3}; });
      SPILLWAY_ASSIGN(const FaceTextureId id,
                      packer->begin_face_texture(format, {"wall", cache::FaceShape::quad, {}, {}, faces}));
      for (uint32_t f = 0; f < face_count; ++f)
        SPILLWAY_TRY(packer->add_face(test::painted_face(
            format, faces[f], cache::FaceShape::quad, [&](double, double, uint32_t c) { return c == f ? 0.8 : 0.1; })));
      TextureNode node;
      node.kind = TextureKind::face, node.image = id.value;
      for (float& v : node.value) v = 1;
      SPILLWAY_ASSIGN(const TextureId texture, packer->add_texture(node));
      material.reflectance.texture = texture.value;
    }
    SPILLWAY_ASSIGN(const MaterialId painted, packer->add_material(material, "painted"));
    const Float3 positions[] = {{-1, -1, 0}, {0, -1, 0}, {1, -1, 0}, {-1, 1, 0}, {0, 1, 0}, {1, 1, 0}};
    const uint32_t indices[] = {0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4};
    const TriangleFace faces[] = {
        {0, {0, 1, 2}, false, 3}, {0, {0, 2, 3}, false, 1}, {1, {0, 1, 2}, false, 4}, {1, {0, 2, 3}, false, 2}};
    MeshInput mesh;
    mesh.name = "wall", mesh.positions = positions, mesh.indices = indices, mesh.material = painted;
    if (with_faces) mesh.faces = faces;
    SPILLWAY_TRY(packer->add_mesh(mesh));
    shading::Light sky{};
    sky.kind = shading::LightKind::infinite, sky.radiance = {1, 1, 1};
    SPILLWAY_TRY(packer->add_light(sky));
    return packer->finish();
  }
  static Rgb half_of(const Film& film, uint32_t x0) {
    Rgb sum{0, 0, 0};
    for (uint32_t y = 4; y < 12; ++y)
      for (uint32_t x = x0; x < x0 + 4; ++x) sum += film.pixel(x, y) * (1.0f / 32);
    return sum;
  }

  test::TemporaryDirectory directory_;
  fs::path store_ = directory_.path() / "wall.store";
};

TEST_F(FaceSceneTest, each_face_shows_its_own_colour_and_a_file_holds_many_textures) {
  const Status packed = pack(2);
  ASSERT_TRUE(packed) << packed.error().message;
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->face_containers().size(), 1u);
  EXPECT_EQ(store->face_textures().size(), 2u);
  EXPECT_NEAR(store->face_textures()[0].mean[0], 0.45f, 0.01f);
  RenderOptions options;
  options.settings = store->settings();
  const auto image = render_image(*store, options);
  ASSERT_TRUE(image) << image.error().message;
  const Rgb left = half_of(*image->film, 3), right = half_of(*image->film, 9);
  EXPECT_NEAR(left.r, 0.8f, 0.02f);
  EXPECT_NEAR(left.g, 0.1f, 0.02f);
  EXPECT_NEAR(right.g, 0.8f, 0.02f);
  EXPECT_NEAR(right.r, 0.1f, 0.02f);
  ASSERT_EQ(image->report.by_texture.size(), 2u);
  EXPECT_EQ(image->report.by_texture[1].name, "wall");
  EXPECT_GT(image->report.by_texture[1].counters.lookups, 100u);
  EXPECT_EQ(image->report.by_texture[0].counters.lookups, 0u);
  uint64_t in_waves = 0;
  for (const WaveReport& wave : image->report.waves) in_waves += wave.textures.lookups;
  EXPECT_EQ(in_waves, image->report.textures.lookups);
}

TEST_F(FaceSceneTest, a_container_each_is_the_same_image) {
  std::string hash;
  for (const uint64_t most : {uint64_t{1} << 40, uint64_t{1}}) {
    const Status packed = pack(2, true, most);
    ASSERT_TRUE(packed) << packed.error().message;
    const auto store = Store::open(store_);
    ASSERT_TRUE(store);
    EXPECT_EQ(store->face_containers().size(), most == 1 ? 2u : 1u);
    RenderOptions options;
    options.settings = store->settings();
    const auto image = render_image(*store, options);
    ASSERT_TRUE(image);
    if (hash.empty()) hash = image->report.image_hash;
    EXPECT_EQ(image->report.image_hash, hash);
  }
}

TEST_F(FaceSceneTest, a_texture_with_another_number_of_faces_is_refused_with_both) {
  for (const uint32_t count : {1u, 3u}) {
    const Status packed = pack(count);
    ASSERT_FALSE(packed);
    EXPECT_NE(packed.error().message.find(fmt::format("wall: has 2 faces, but its face texture 'wall' has {}", count)),
              std::string::npos)
        << packed.error().message;
    EXPECT_FALSE(fs::exists(store_ / kTexturesDirectory / "faces-00000.facetex"));
  }
  const Status without = pack(2, false);
  ASSERT_FALSE(without);
  EXPECT_NE(without.error().message.find("has no faces"), std::string::npos) << without.error().message;
}

TEST_F(FaceSceneTest, a_missing_or_damaged_file_is_an_error_before_anything_is_rendered) {
  ASSERT_TRUE(pack(2));
  const fs::path file = store_ / kTexturesDirectory / "faces-00000.facetex";
  RenderOptions options;
  {
    const auto store = Store::open(store_);
    ASSERT_TRUE(store);
    options.settings = store->settings();
    fs::resize_file(file, fs::file_size(file) - 1);
    int waves = 0;
    options.on_progress = [&](const RenderProgress&) { ++waves; };
    const auto image = render_image(*store, options);
    ASSERT_FALSE(image);
    EXPECT_NE(image.error().message.find("faces-00000.facetex"), std::string::npos) << image.error().message;
    EXPECT_EQ(waves, 0);
  }
  fs::remove(file);
  EXPECT_FALSE(Store::open(store_));
}

// Where the four texels of a bilinear lookup lie. A neighbour is `uneven` when it is finer along one side more than
// along the other: no level of it has texels as large as ours.
enum class Reach : uint32_t { face, edge, uneven, corner };
Reach reach_of(const nlohmann::json& faces, const nlohmann::json& face, float u, float v) {
  const int ulog2 = face["ulog2"], vlog2 = face["vlog2"];
  const float half_u = 0.5f / static_cast<float>(1 << ulog2), half_v = 0.5f / static_cast<float>(1 << vlog2);
  const bool leaves_u = u < half_u || u > 1 - half_u, leaves_v = v < half_v || v > 1 - half_v;
  if (leaves_u && leaves_v) return Reach::corner;
  if (!leaves_u && !leaves_v) return Reach::face;
  const size_t edge = leaves_u ? (u < half_u ? 3 : 1) : (v < half_v ? 0 : 2);
  const int neighbour = face["adjfaces"][edge], across = face["adjedges"][edge];
  if (neighbour < 0) return Reach::edge;
  int more_u = faces[static_cast<size_t>(neighbour)]["ulog2"], more_v = faces[static_cast<size_t>(neighbour)]["vlog2"];
  if ((static_cast<int>(edge) ^ across) & 1) std::swap(more_u, more_v);
  return std::max(0, more_u - ulog2) == std::max(0, more_v - vlog2) ? Reach::edge : Reach::uneven;
}

// All that the library was asked lies beside some copies of this repository.
nlohmann::json reference_values(const std::string& name) {
  const fs::path source = SPILLWAY_SOURCE_DIR, all = source / "../shared/ptex" / (name + ".json");
  std::ifstream stream(fs::exists(all) ? all : source / "tests/data/ptex" / (name + ".json"));
  return nlohmann::json::parse(stream);
}

// A .ptx file, packed, is what the reference library says: its bilinear values inside faces and across edges. Where it
// is not, docs/facetex.md says how much: at corners where not four quads meet.
TEST_F(FaceSceneTest, packed_ptx_files_agree_with_the_reference_inside_faces_and_across_edges) {
  const fs::path data = fs::path(SPILLWAY_SOURCE_DIR) / "tests/data/ptex";
  for (const char* name : {"cube", "quads60", "subface_prism6"}) {
    FaceTexturePacker packer(directory_.path(), 1ull << 40, cache::FaceTexCodec::zstd, cache::kFaceTileLog2);
    const auto added = packer.add_file(data / (std::string(name) + ".ptx"), {});
    ASSERT_TRUE(added) << added.error().message;
    const auto packed = packer.finish();
    ASSERT_TRUE(packed) << packed.error().message;
    const auto cache = cache::TextureCache::open(directory_.path(), {}, {}, packed->containers, packed->textures);
    ASSERT_TRUE(cache) << cache.error().message;
    const nlohmann::json values = reference_values(name);
    std::array<int, 4> compared = {0, 0, 0, 0}, off = {0, 0, 0, 0};
    std::array<float, 4> worst = {0, 0, 0, 0};
    for (const auto& s : values["samples"]) {
      if (s["filter"] != "bilinear" || s["uw1"] != 0 || s["uw2"] != 0 || s["blur"] != 0 || s["noedgeblend"]) continue;
      const float u = s["u"], v = s["v"];
      const Reach reach = reach_of(values["faces"], values["faces"][s["face"].get<size_t>()], u, v);
      const cache::FaceTextureRequest request{0, s["face"], u, v, 0, 0, 0, cache::FaceLevelChoice::stochastic};
      cache::Texel texel{};
      ASSERT_TRUE((*cache)->look_up_faces({&request, 1}, {&texel, 1}));
      float difference = 0;
      for (size_t c = 0; c < 3; ++c)
        difference = std::max(difference, std::fabs(texel.value[c] - s["value"][c].get<float>()));
      const auto which = static_cast<size_t>(reach);
      ++compared[which], off[which] += difference > 0.5f / 255, worst[which] = std::max(worst[which], difference);
      const float allowed = reach == Reach::corner ? 0.167f : reach == Reach::uneven ? 1.0f / 255 : 0.5f / 255;
      EXPECT_LE(difference, allowed) << s.dump();
    }
    for (const auto& [reach, where] : {std::pair{Reach::face, "inside faces"},
                                       {Reach::edge, "across edges"},
                                       {Reach::uneven, "beside uneven neighbours"},
                                       {Reach::corner, "at corners"}}) {
      const auto which = static_cast<size_t>(reach);
      std::printf("%s %s: %d values, %d off by more than half a step, at most %.5f\n", name, where, compared[which],
                  off[which], static_cast<double>(worst[which]));
    }
    EXPECT_GE(compared[0], 3) << name;
    EXPECT_GE(compared[1], 1) << name;
    EXPECT_LE(off[2], 1) << name;
  }
}

}  // namespace
}  // namespace spillway::pipeline
