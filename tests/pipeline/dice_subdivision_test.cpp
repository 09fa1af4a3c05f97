#include "pipeline/pack/dice_subdivision.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>

#include "pipeline/pack/dice_cache.h"
#include "pipeline/store.h"
#include "tests/pipeline/pack_scene.h"
#include "tests/support/cages.h"
#include "tests/support/kernel_scene.h"

namespace spillway::pipeline::test {
namespace {

using spillway::test::any_pieces;
using spillway::test::CageData;
using spillway::test::cube_cage;
using spillway::test::diced;
using spillway::test::KernelScene;
using spillway::test::equal_pieces;
using spillway::test::sheet_cage;
using spillway::test::tent_cage;
using spillway::test::torus_cage;

// 100 pixels across a unit at distance one, from z = -10 looking up z.
SceneSettings looking_at_origin() {
  SceneSettings settings;
  settings.camera.world_from_camera.m[2][3] = -10;
  settings.camera.tan_half_fov_x = settings.camera.tan_half_fov_y = 0.5f;
  settings.camera.resolution_x_px = settings.camera.resolution_y_px = 100;
  return settings;
}

Affine3 moved_to(float x, float y, float z) {
  Affine3 t;
  t.m[0][3] = x, t.m[1][3] = y, t.m[2][3] = z;
  return t;
}

Bounds3 box_around(Float3 p, float half) {
  Bounds3 box;
  box.grow(p - Float3{half, half, half}), box.grow(p + Float3{half, half, half});
  return box;
}

// ---- rates ----

TEST(dice_rates, pieces_are_the_fewest_powers_of_two_that_are_short_enough) {
  EXPECT_EQ(piece_count(0, 256), 1u);
  EXPECT_EQ(piece_count(1, 256), 1u);
  EXPECT_EQ(piece_count(1.01, 256), 2u);
  EXPECT_EQ(piece_count(4, 256), 4u);
  EXPECT_EQ(piece_count(4.1, 256), 8u);
  EXPECT_EQ(piece_count(INFINITY, 256), 256u);
  EXPECT_EQ(piece_count(NAN, 256), 1u);
}

TEST(dice_rates, lengths_on_the_picture_fall_with_distance) {
  const DiceView view(std::vector{looking_at_origin().camera});
  EXPECT_NEAR(view.px_per_unit(box_around({0, 0, 1}, 1), 0), 10, 1e-6);
  EXPECT_NEAR(view.px_per_unit(box_around({0, 0, 11}, 1), 0), 5, 1e-6);
  EXPECT_NEAR(view.px_per_unit(box_around({0, 0, -21}, 1), 0), 10, 1e-6);  // behind it, too
  EXPECT_TRUE(std::isinf(view.px_per_unit(box_around({0, 0, -10}, 1), 0)));
  EXPECT_NEAR(view.px_per_unit(box_around({0, 0, -10}, 1), 2), 50, 1e-6);
}

TEST(dice_rates, of_several_cameras_the_nearest_counts) {
  shading::Camera far = looking_at_origin().camera, near = far;
  near.world_from_camera.m[2][3] = -5;
  for (const auto& cameras : {std::vector{far, near}, std::vector{near, far}})
    EXPECT_NEAR(DiceView(cameras).px_per_unit(box_around({0, 0, 1}, 1), 0), 20, 1e-6);
  shading::Camera parallel = far;
  parallel.is_orthographic = 1;
  EXPECT_NEAR(DiceView(std::vector{parallel}).px_per_unit(box_around({0, 0, 500}, 1), 0), 100, 1e-6);
}

TEST(dice_rates, instances_share_details_by_powers_of_two) {
  const DiceView view(std::vector{looking_at_origin().camera});
  const Bounds3 box = box_around({0, 0, 0}, 0.5f);
  const auto detail = [&](const Affine3& at) { return detail_of_instance(view, box, at); };
  EXPECT_EQ(detail(moved_to(0, 0, 0.6f)), 4);    // 9.9 px a unit
  EXPECT_EQ(detail(moved_to(0, 0, 2.5f)), 4);    // 8.3
  EXPECT_EQ(detail(moved_to(0, 0, 3.1f)), 3);    // 7.9
  Affine3 large = moved_to(0, 0, 20.5f);
  large.m[0][0] = 4;
  EXPECT_EQ(detail(moved_to(0, 0, 20.5f)), 2);
  EXPECT_EQ(detail(large), 4);                   // its longest axis is four times as long
  EXPECT_EQ(detail(moved_to(0, 0, -10)), 10);    // around the camera: 100 / (0.1 * sqrt(3))
}

// ---- packing ----

class DiceSubdivisionTest : public ::testing::Test {
 protected:
  using Say = std::function<Status(SceneSink&)>;
  Status pack(const std::string& name, const Say& say, DiceOptions dice = {}) {
    PackOptions options;
    options.dice = std::move(dice);
    SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(directory_ / name, std::move(options)));
    packer->set_settings(looking_at_origin());
    SPILLWAY_ASSIGN([[maybe_unused]] const MaterialId material, packer->add_material(Material{}, "Clay"));
    SPILLWAY_TRY(say(*packer));
    SPILLWAY_TRY(packer->finish());
    report_ = packer->report().dice;
    return {};
  }
  Store packed(const std::string& name, const Say& say, DiceOptions dice = {}) {
    const Status status = pack(name, say, std::move(dice));
    EXPECT_TRUE(status) << (status ? "" : status.error().message);
    auto store = Store::open(directory_ / name);
    EXPECT_TRUE(store) << (store ? "" : store.error().message);
    return std::move(*store);
  }
  std::string failure(const Say& say, DiceOptions dice = {}) {
    const Status status = pack("failed.store", say, std::move(dice));
    return status ? "" : status.error().message;
  }

  TemporaryDirectory directory_;
  DiceReport report_;
};

Status say_cage(SceneSink& sink, const CageData& cage) { return sink.add_subdivision(cage.input()); }

TEST_F(DiceSubdivisionTest, edges_are_no_longer_than_asked_on_the_picture) {
  // A cube of sharp edges, ten pixels wide at its near side: edges of at most 10 and at least half of that.
  CageData box = cube_cage();
  for (const auto& [a, b] : {std::pair{0u, 1u}, {1u, 2u}, {2u, 3u}, {3u, 0u}, {4u, 5u}, {5u, 6u}, {6u, 7u}, {7u, 4u}, {0u, 4u}, {1u, 5u}, {2u, 6u}, {3u, 7u}})
    box.sharp_edges.push_back({{a, b}, 10});
  for (const auto& [length, triangles] : {std::pair{10.5f, 12u}, {5.2f, 12u * 4}, {2.6f, 12u * 16}}) {
    const Store store = packed(fmt::format("{}.store", length), [&](SceneSink& s) { return say_cage(s, box); }, {.edge_length_px = length});
    EXPECT_EQ(store.settings().statistics.triangle_count, triangles);
    ASSERT_NE(store.dicing(), nullptr);
    EXPECT_EQ(store.dicing()->edge_length_px, length);
    EXPECT_EQ(store.dicing()->cage_count, 1u);
    EXPECT_EQ(store.meshes()[0].flags, kMeshHasNormals);
  }
}

TEST_F(DiceSubdivisionTest, a_scene_without_cages_knows_nothing_of_dicing) {
  const MeshData grid = wavy_grid("grid", 4, 1);
  const Store store = packed("plain.store", [&](SceneSink& s) { return s.add_mesh(grid.input(0)); });
  EXPECT_EQ(store.dicing(), nullptr);
}

TEST_F(DiceSubdivisionTest, near_instances_are_diced_finer_and_keep_their_other_triangles) {
  const MeshData grid = wavy_grid("grid", 2, 1);
  const Store store = packed("cars.store", [&](SceneSink& s) -> Status {
    const uint32_t car = s.begin_object("Car"), wheel = s.begin_object("Wheel"), unused = s.begin_object("Unused");
    const CageData cage = cube_cage();
    SubdivisionInput body = cage.input();
    body.cage.object = car;
    SPILLWAY_TRY(s.add_subdivision(body));
    body.cage.object = unused;
    SPILLWAY_TRY(s.add_subdivision(body));
    body.cage.object = wheel;
    SPILLWAY_TRY(s.add_subdivision(body));
    MeshInput plate = grid.input(0);
    plate.object = car;
    SPILLWAY_TRY(s.add_mesh(plate));
    for (const float z : {0.0f, 0.5f, 30.0f}) SPILLWAY_TRY(s.add_instance(car, moved_to(0, 0, z)));
    return s.add_instance(wheel, moved_to(3, 0, 1));
  }, {.edge_length_px = 1});
  // Two details of the car and one of the wheel; two near cars share one.
  EXPECT_EQ(report_.cage_count, 3u);
  const SceneStatistics& statistics = store.settings().statistics;
  EXPECT_EQ(statistics.triangle_count, report_.triangle_count + 8);
  // Of the world; cars with their plates, and with their bodies; the wheel.
  ASSERT_EQ(store.instances().size(), 1u + 3 + 3 + 1);
  std::map<uint32_t, uint64_t> triangles;
  for (const Mesh& mesh : store.meshes()) triangles[mesh.object] += mesh.face_count;
  std::map<float, uint64_t> by_depth;
  for (const cache::Instance& i : store.instances().subspan(1)) by_depth[i.world_from_object.m[2][3]] += triangles[i.object];
  EXPECT_EQ(by_depth[0.0f], by_depth[0.5f]);
  EXPECT_GT(by_depth[0.0f], 4 * by_depth[30.0f] - 100);
}

TEST_F(DiceSubdivisionTest, threads_do_not_show_in_the_store) {
  const CageData torus = torus_cage(16, 12), tent = tent_cage();
  const auto say = [&](SceneSink& s) -> Status {
    for (int i = 0; i < 5; ++i) SPILLWAY_TRY(say_cage(s, tent));
    return say_cage(s, torus);
  };
  std::map<std::string, std::string> expected;
  for (const int threads : {1, 2, 7}) {
    const std::string name = fmt::format("{}.store", threads);
    tbb::task_arena(threads).execute([&] { packed(name, say, {.edge_length_px = 1}); });
    auto files = all_files(directory_ / name);
    if (threads == 1) expected = std::move(files);
    else
      for (const auto& [file, bytes] : expected) EXPECT_TRUE(files.at(file) == bytes) << file << ", " << threads;
  }
}

TEST_F(DiceSubdivisionTest, what_was_diced_before_is_found_again) {
  const CageData torus = torus_cage(16, 12), ring = torus_cage(10, 8);
  const DiceOptions dice{.edge_length_px = 1, .cache_directory = directory_ / "diced"};
  const auto say = [&](SceneSink& s) -> Status {
    SPILLWAY_TRY(say_cage(s, torus));
    return say_cage(s, ring);
  };
  packed("first.store", say, dice);
  EXPECT_EQ(report_.cached_cage_count, 0u);
  packed("second.store", say, dice);
  EXPECT_EQ(report_.cached_cage_count, 2u);
  EXPECT_EQ(report_.cached_triangle_count, report_.triangle_count);
  EXPECT_TRUE(all_files(directory_ / "first.store") == all_files(directory_ / "second.store"));
  packed("third.store", say, {.edge_length_px = 1});
  EXPECT_TRUE(all_files(directory_ / "first.store") == all_files(directory_ / "third.store"));
  packed("coarse.store", say, {.edge_length_px = 2, .cache_directory = directory_ / "diced"});
  EXPECT_EQ(report_.cached_cage_count, 0u);
  // One cage changes: the other is found.
  CageData bent = ring;
  bent.positions[10].z += 0.01f;
  packed("bent.store", [&](SceneSink& s) -> Status {
    SPILLWAY_TRY(say_cage(s, torus));
    return say_cage(s, bent);
  }, dice);
  EXPECT_EQ(report_.cached_cage_count, 1u);
  EXPECT_EQ(report_.cage_count, 2u);
}

TEST_F(DiceSubdivisionTest, a_damaged_cache_is_named) {
  const CageData torus = torus_cage(16, 12);
  const DiceOptions dice{.edge_length_px = 1, .cache_directory = directory_ / "diced"};
  const auto say = [&](SceneSink& s) { return say_cage(s, torus); };
  packed("first.store", say, dice);
  const auto kept = all_files(directory_ / "diced");
  ASSERT_EQ(kept.size(), 1u);
  const auto& [name, bytes] = *kept.begin();
  const auto with = [&](const std::string& other) {
    std::ofstream(directory_ / "diced" / name, std::ios::binary) << other;
    return failure(say, dice);
  };
  for (const size_t size : {size_t{0}, size_t{31}, size_t{40}, bytes.size() / 2, bytes.size() - 1})
    EXPECT_NE(with(bytes.substr(0, size)).find(name), std::string::npos) << size;
  EXPECT_NE(with(bytes + '\0').find(name), std::string::npos);
  for (const size_t at : {size_t{3}, size_t{9}, size_t{25}, size_t{100}, bytes.size() - 2}) {
    std::string flipped = bytes;
    flipped[at] = static_cast<char>(flipped[at] ^ 16);
    EXPECT_NE(with(flipped).find(name), std::string::npos) << at;
  }
  EXPECT_EQ(with(bytes), "");
}

TEST_F(DiceSubdivisionTest, too_many_triangles_are_refused_with_their_number) {
  const CageData torus = torus_cage(16, 12);
  const std::string message = failure([&](SceneSink& s) { return say_cage(s, torus); }, {.edge_length_px = 1, .most_triangles = 1000});
  EXPECT_TRUE(message.starts_with("cage: asks for ")) << message;
  EXPECT_NE(message.find("1000 are allowed"), std::string::npos) << message;
}

TEST_F(DiceSubdivisionTest, options_and_uses_that_make_no_sense_are_refused) {
  const CageData cage = cube_cage();
  const auto say = [&](SceneSink& s) { return say_cage(s, cage); };
  for (const float length : {0.0f, -1.0f, NAN, INFINITY}) EXPECT_NE(failure(say, {.edge_length_px = length}), "");
  for (const uint32_t pieces : {0u, 3u, 2048u}) EXPECT_NE(failure(say, {.most_pieces = pieces}), "");
  EXPECT_EQ(failure([&](SceneSink& s) -> Status {
              SubdivisionInput input = cage.input();
              input.displacement = TextureId{0};
              return s.add_subdivision(input);
            }),
            "cage: is displaced by texture 0 of 0");
  EXPECT_EQ(failure([&](SceneSink& s) -> Status {
              TextureNode node, checks;
              SPILLWAY_ASSIGN(const TextureId one, s.add_texture(node));
              checks.kind = TextureKind::checkerboard, checks.child[0] = checks.child[1] = one.value;
              SubdivisionInput input = cage.input();
              SPILLWAY_ASSIGN(input.displacement, s.add_texture(checks));
              return s.add_subdivision(input);
            }),
            "cage: is displaced by a texture of uvs, and has none");
}

TEST_F(DiceSubdivisionTest, a_texture_displaces_in_units_of_the_object) {
  CageData sheet = sheet_cage(4);
  for (Float3& p : sheet.positions) p.z = 0;
  const Store store = packed("raised.store", [&](SceneSink& s) -> Status {
    TextureNode node;
    node.value[0] = node.value[1] = node.value[2] = 0.5f;
    SubdivisionInput input = sheet.input();
    SPILLWAY_ASSIGN(input.displacement, s.add_texture(node));
    input.displacement_scale = -3;
    return s.add_subdivision(input);
  });
  EXPECT_FLOAT_EQ(store.settings().statistics.bounds_world.lower.z, -1.5f);
  EXPECT_FLOAT_EQ(store.settings().statistics.bounds_world.upper.z, -1.5f);
}

TEST(dice_displacement, checks_raise_half_of_a_sheet) {
  // 2 x 2 checks of height 0 and 1 over the uvs: away from their edges every point is at one or the other.
  std::vector<TextureNode> nodes(3);
  nodes[0].value[0] = 0, nodes[1].value[0] = 1;
  nodes[2].kind = TextureKind::checkerboard, nodes[2].child[0] = 0, nodes[2].child[1] = 1;
  nodes[2].uv_scale[0] = nodes[2].uv_scale[1] = 2;
  CageData sheet = sheet_cage(4);
  for (Float3& p : sheet.positions) p.z = 0;
  SubdivisionInput input = sheet.input();
  input.displacement = TextureId{2};
  const SubdivisionCage cage = *make_cage(input);
  const Displacement displacement(nodes, {}, nullptr);
  int low = 0, high = 0;
  for (const DicedPiece& piece : diced(cage, equal_pieces(16), displacement.heights(cage)))
    for (size_t i = 0; i < piece.positions.size(); ++i) {
      const Float2 uv = piece.uvs[i];
      if (std::fabs(uv.x - 0.5f) < 0.1f || std::fabs(uv.y - 0.5f) < 0.1f) continue;
      const bool raised = (uv.x < 0.5f) != (uv.y < 0.5f);
      // At the rim the filter reaches over 0 and 1, where the pattern goes on.
      if (std::min({uv.x, uv.y, 1 - uv.x, 1 - uv.y}) < 0.1f) continue;
      ASSERT_FLOAT_EQ(piece.positions[i].z, raised ? 1 : 0) << uv.x << ' ' << uv.y;
      raised ? ++high : ++low;
    }
  EXPECT_GT(low, 500);
  EXPECT_GT(high, 500);
  EXPECT_TRUE(displacement.status());
}

TEST(dice_subdivision, no_ray_leaves_a_closed_surface) {
  std::vector<PackTriangle> triangles;
  std::vector<Float3> edge_points;
  for (const DicedPiece& piece : diced(tent_cage().cage(), any_pieces(32)))
    for (size_t i = 0; i < piece.indices.size(); i += 3) {
      PackTriangle triangle{};
      for (size_t k = 0; k < 3; ++k) triangle.vertex[k] = piece.positions[piece.indices[i + k]];
      triangle.prim = static_cast<uint32_t>(triangles.size());
      triangles.push_back(triangle);
      for (size_t k = 0; k < 3; ++k) {
        edge_points.push_back(triangle.vertex[k]);
        edge_points.push_back((triangle.vertex[k] + triangle.vertex[(k + 1) % 3]) * 0.5f);
      }
    }
  KernelScene scene;
  for (size_t first = 0; first < triangles.size(); first += 500)
    scene.add_page(std::span(triangles).subspan(first, std::min<size_t>(500, triangles.size() - first)));
  scene.finish();
  ASSERT_GT(edge_points.size(), 5000u);
  for (const Float3 target : edge_points)
    ASSERT_NE(scene.trace(spillway::test::ray_from_to({0.5f, 0.5f, 0.6f}, target)).prim, PrimId::kNone);
}

}  // namespace
}  // namespace spillway::pipeline::test
