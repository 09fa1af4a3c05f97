#include "pipeline/pack/scene_packer.h"

#include <tbb/task_arena.h>

#include <cmath>
#include <limits>

#include "pipeline/pack/pack_page_tree.h"
#include "pipeline/store.h"
#include "tests/pipeline/pack_scene.h"

namespace spillway::pipeline::test {
namespace {

class ScenePackerTest : public ::testing::Test {
 protected:
  void SetUp() override { write_mask(mask_); }

  void pack(const std::string& name, PackOptions options = {}) {
    const Status packed = pack_mixed(directory_ / name, mask_, std::move(options));
    ASSERT_TRUE(packed) << packed.error().message;
  }
  Store open(const std::string& name) {
    auto store = Store::open(directory_ / name);
    EXPECT_TRUE(store) << (store ? "" : store.error().message);
    return std::move(*store);
  }
  bool has_manifest(const std::string& name) { return std::filesystem::exists(directory_ / name / kManifestFile); }

  TemporaryDirectory directory_;
  std::filesystem::path mask_ = directory_ / "mask.ppm";
};

std::vector<std::byte> part_of(const std::string& file, uint64_t offset, uint64_t size) {
  const auto* bytes = reinterpret_cast<const std::byte*>(file.data());
  return {bytes + offset, bytes + offset + size};
}

// page bytes at the alignment that a reader gives them
Buffer<std::byte> aligned_part(const std::string& file, uint64_t offset, uint64_t size) {
  Buffer<std::byte> part(MemoryTag::pages, size);
  std::memcpy(part.data(), file.data() + offset, size);
  return part;
}

TEST_F(ScenePackerTest, a_mixed_scene_packs_and_opens_with_exact_counts) {
  pack("a.store");
  const Store store = open("a.store");
  const SceneStatistics& statistics = store.settings().statistics;
  EXPECT_EQ(statistics.triangle_count, 3200u + kSoupCount + 2 + 500 + 2);
  EXPECT_EQ(statistics.instanced_triangle_count, 3200u + kSoupCount + 2 + 3 * 500 + 2);
  EXPECT_EQ(statistics.degenerate_dropped_count, 2u);
  EXPECT_EQ(store.settings().camera.resolution_x_px, 64u);
  ASSERT_EQ(store.meshes().size(), 5u);
  const char* names[] = {"soup", "lamp", "tree", "grid", "leaf"};  // by material, then order of import
  for (uint32_t m = 0; m < 5; ++m) EXPECT_EQ(store.name_of("mesh", m), names[m]);
  EXPECT_EQ(store.name_of("material", 1), "Wall");
  EXPECT_EQ(store.name_of("object", 1), "Tree");
  EXPECT_EQ(store.instances().size(), 4u);  // the world and three trees; the empty ones stand nowhere
  EXPECT_EQ(store.pages().size(), 2u);
  EXPECT_EQ(store.images().size(), 1u);
  EXPECT_EQ(store.meshes()[3].flags, kMeshHasNormals | kMeshHasUvs);
  EXPECT_EQ(store.meshes()[1].flags, kMeshFlipNormals);
  EXPECT_EQ(store.mesh_of(PrimId{0}).value, 0u);
  EXPECT_EQ(store.mesh_of(PrimId{kSoupCount + 1}).value, 1u);
  EXPECT_EQ(store.mesh_of(PrimId{kSoupCount + 2}).value, 2u);
}

TEST_F(ScenePackerTest, every_triangle_is_in_one_attribute_block_bit_for_bit) {
  pack("a.store");
  const Store store = open("a.store");
  TrianglesByMesh expected = MixedScene{}.expected();
  const std::string file = file_bytes(store.attributes_path());
  uint32_t prims = 0;
  for (const AttributeLocation& location : store.attributes()) {
    const auto block = part_of(file, location.offset_bytes, location.size_bytes);
    const Status valid = cache::validate_attribute_block(block, "block");
    ASSERT_TRUE(valid) << valid.error().message;
    for (uint32_t p = location.first_prim; p < location.first_prim + location.prim_count; ++p, ++prims) {
      const cache::TriangleAttributes t = cache::triangle_attributes(block, PrimId{p});
      ASSERT_EQ(t.mesh, store.mesh_of(PrimId{p}));
      const Mesh& mesh = store.meshes()[t.mesh.value];
      const Triangle& triangle = expected[store.name_of("mesh", t.mesh.value)].at(p - mesh.prim_base);
      for (int k = 0; k < 3; ++k) ASSERT_TRUE(same_bits(t.position_object[k], triangle.vertex[k])) << p;
      ASSERT_EQ(t.has_normals, (mesh.flags & kMeshHasNormals) != 0);
    }
  }
  EXPECT_EQ(prims, 3200u + kSoupCount + 2 + 500 + 2);
}

TEST_F(ScenePackerTest, every_triangle_is_in_one_page_bit_for_bit) {
  for (const uint32_t page_triangles : {65536u, 900u}) {
    const std::string name = std::to_string(page_triangles);
    pack(name, {.max_triangles_per_page = page_triangles});
    const Store store = open(name);
    TrianglesByMesh expected = MixedScene{}.expected();
    const std::string file = file_bytes(store.trace_pages_path());
    std::vector<int> seen(store.settings().statistics.triangle_count, 0);
    for (const cache::PageLocation& location : store.pages()) {
      const auto bytes = aligned_part(file, location.offset_bytes, location.size_bytes);
      const Status valid = cache::validate_trace_page(bytes, "page");
      ASSERT_TRUE(valid) << valid.error().message;
      const cache::TracePageView page = cache::trace_page_view(bytes);
      EXPECT_LE(location.triangle_count, page_triangles);
      for (uint32_t lane = 0; lane < 4 * page.header->leaf_count; ++lane) {
        const cache::TraceLeaf& leaf = page.leaves[lane / 4];
        const uint32_t prim = leaf.prim[lane % 4];
        if (prim == PrimId::kNone) continue;
        ++seen.at(prim);
        const MeshId m = store.mesh_of(PrimId{prim});
        const Mesh& mesh = store.meshes()[m.value];
        EXPECT_EQ(mesh.object, location.object);
        const Triangle& triangle = expected[store.name_of("mesh", m.value)].at(prim - mesh.prim_base);
        for (int k = 0; k < 3; ++k)
          ASSERT_TRUE(same_bits({leaf.vertex[k][0][lane % 4], leaf.vertex[k][1][lane % 4], leaf.vertex[k][2][lane % 4]},
                                triangle.vertex[k]));
      }
    }
    for (size_t p = 0; p < seen.size(); ++p) ASSERT_EQ(seen[p], 1) << p;
  }
}

TEST_F(ScenePackerTest, lights_are_faces_in_order_then_others_then_infinite_ones) {
  pack("a.store");
  const Store store = open("a.store");
  const shading::LightTable table = store.light_table();
  ASSERT_EQ(table.emitters.size(), 2u);
  ASSERT_EQ(table.lights.size(), 2u);
  EXPECT_TRUE(table.tree.empty());  // so few are chosen by power
  EXPECT_EQ(store.settings().statistics.dark_light_count, 2u);  // the lamp's faces without area
  EXPECT_EQ(store.meshes()[1].light_base, 0u);
  EXPECT_EQ(store.meshes()[0].light_base, LightId::kNone);
  const auto lamp = MixedScene{}.expected()["lamp"];
  for (int i = 0; i < 2; ++i) {
    const shading::TriangleShape& shape = table.emitters[i].shape;
    EXPECT_TRUE(shape.position == lamp[i].vertex[0]);
    // Turned over: it emits against its winding.
    EXPECT_TRUE(shape.edge2 == lamp[i].vertex[1] - lamp[i].vertex[0]);
    EXPECT_TRUE(shape.edge1 == lamp[i].vertex[2] - lamp[i].vertex[0]);
    EXPECT_EQ(table.emissions[table.emitters[i].emission].two_sided, 0u);
    EXPECT_EQ(table.emissions[table.emitters[i].emission].radiance.g, 5);
  }
  EXPECT_EQ(table.lights[0].kind, shading::LightKind::point);
  EXPECT_EQ(table.lights[1].kind, shading::LightKind::infinite);  // last, though it was said before the point
  EXPECT_EQ(table.first_infinite, 1u);
  // In proportion to power; but the sky, far above the others here, gets no more than all of them.
  double power[3];
  for (int i = 0; i < 2; ++i)
    power[i] = shading::emitter_power(table.emitters[i].shape, table.emissions[table.emitters[i].emission]);
  power[2] = shading::light_power(table.lights[0], table.scene_radius_world);
  const double with_place = power[0] + power[1] + power[2];
  ASSERT_GT(shading::light_power(table.lights[1], table.scene_radius_world), with_place);
  double sum = 0;
  for (size_t i = 0; i < 3; ++i) {
    sum += power[i];
    EXPECT_NEAR(table.cdf[i + 1], sum / (2 * with_place), 1e-7);  // half an ulp of 1 for the rounding of each sum
  }
  EXPECT_EQ(table.cdf[4], 1);
}

// Corners of the prototype's triangles, transformed, must lie inside the world's box.
TEST_F(ScenePackerTest, the_world_holds_its_instances) {
  pack("a.store");
  const Store store = open("a.store");
  const Bounds3 world = store.settings().statistics.bounds_world;
  for (const cache::Instance& instance : store.instances().subspan(1))
    for (const Float3& p : MixedScene{}.tree.positions) {
      const Float3 q = instance.world_from_object.point(p);
      Bounds3 grown = world;
      grown.grow(q);
      ASSERT_TRUE(grown.lower == world.lower && grown.upper == world.upper);
    }
  EXPECT_GT(world.upper.x, 26);  // the last tree's 26 + 2 x + y / 2
  EXPECT_LT(world.upper.x, 29);
}

TEST_F(ScenePackerTest, threads_and_memory_do_not_show_in_the_store) {
  const PackOptions small_pages{.max_triangles_per_page = 1000};
  std::map<std::string, std::string> expected;
  std::map<uint64_t, uint64_t> read_bytes;  // by memory limit
  int packed = 0;
  for (const int threads : {1, 2, 7})
    for (const uint64_t limit : {uint64_t{1} << 20, uint64_t{1} << 30}) {
      const std::string name = std::to_string(packed++);
      PackOptions options = small_pages;
      options.memory_limit_bytes = limit;
      const uint64_t before = cache::io_use(cache::IoPurpose::pack).read_bytes;
      tbb::task_arena(threads).execute([&] { pack(name, options); });
      read_bytes[limit] += cache::io_use(cache::IoPurpose::pack).read_bytes - before;
      const auto files = all_files(directory_ / name);
      if (expected.empty()) expected = files;
      ASSERT_EQ(files.size(), 4u);
      for (const auto& [file, bytes] : expected) EXPECT_TRUE(files.at(file) == bytes) << file << ", " << threads;
    }
  // The limit bites: the small one takes several passes over the spool.
  EXPECT_GT(read_bytes[uint64_t{1} << 20], 2 * read_bytes[uint64_t{1} << 30]);
}

TEST_F(ScenePackerTest, other_pages_leave_attributes_lights_and_images_alone) {
  pack("large");
  pack("small", {.max_triangles_per_page = 700, .tree = {.branching = 4, .leaf_fill = 2}});
  const Store large = open("large"), small = open("small");
  EXPECT_GT(small.pages().size(), 30u);
  auto a = all_files(directory_ / "large"), b = all_files(directory_ / "small");
  EXPECT_TRUE(a[kAttributesFile] == b[kAttributesFile]);
  EXPECT_FALSE(a[kTracePagesFile] == b[kTracePagesFile]);
  EXPECT_TRUE(a["textures/00000.tif"] == b["textures/00000.tif"]);
  EXPECT_EQ(0, std::memcmp(&large.settings(), &small.settings(), sizeof(SceneSettings)));
  EXPECT_EQ(0, std::memcmp(large.light_table().cdf.data(), small.light_table().cdf.data(), 5 * sizeof(float)));
}

TEST_F(ScenePackerTest, pages_of_an_object_follow_each_other_in_space) {
  pack("a.store", {.max_triangles_per_page = 200});
  const Store store = open("a.store");
  // The mean distance of neighbours in the file against that of pages half the file apart.
  const std::string file = file_bytes(store.trace_pages_path());
  std::vector<Float3> centers;
  for (const cache::PageLocation& page : store.pages()) {
    if (page.object != 0) continue;
    cache::TracePageHeader header;
    std::memcpy(&header, file.data() + page.offset_bytes, sizeof header);
    centers.push_back((header.lower + header.upper) * 0.5f);
  }
  double near = 0, far = 0;
  const size_t n = centers.size();
  for (size_t i = 0; i + 1 < n; ++i) {
    near += length(centers[i + 1] - centers[i]);
    far += length(centers[(i + n / 2) % n] - centers[i]);
  }
  EXPECT_LT(near, 0.6 * far);  // equal in a random order; a third is usual
}

// ---- what is refused ----

struct BadMesh {
  const char* what;
  void (*spoil)(MeshData&);
};

TEST_F(ScenePackerTest, bad_meshes_are_refused_by_name_and_nothing_is_committed) {
  const BadMesh cases[] = {
      {"vertex 7", [](MeshData& m) { m.positions[7].y = std::numeric_limits<float>::quiet_NaN(); }},
      {"vertex 3", [](MeshData& m) { m.positions[3].z = -std::numeric_limits<float>::infinity(); }},
      {"beyond", [](MeshData& m) { m.positions[3].z = 2e18f; }},
      {"normal of vertex 5", [](MeshData& m) { m.normals[5].x = std::numeric_limits<float>::quiet_NaN(); }},
      {"uv of vertex 2", [](MeshData& m) { m.uvs[2].y = std::numeric_limits<float>::infinity(); }},
      {"of triangle 1 is 9", [](MeshData& m) { m.indices[4] = 9; }},
      {"multiple of three", [](MeshData& m) { m.indices.pop_back(); }},
      {"8 normals for 9", [](MeshData& m) { m.normals.pop_back(); }},
      {"8 uvs for 9", [](MeshData& m) { m.uvs.pop_back(); }},
  };
  int i = 0;
  for (const BadMesh& bad : cases) {
    const std::string name = std::to_string(i++);
    auto packer = ScenePacker::create(directory_ / name, {});
    ASSERT_TRUE(packer);
    (*packer)->set_settings(small_settings());
    ASSERT_TRUE((*packer)->add_material(Material{}, "Floor"));
    MeshData mesh = wavy_grid("models/bad.ply", 2, 1);
    bad.spoil(mesh);
    const Status added = (*packer)->add_mesh(mesh.input(0));
    ASSERT_FALSE(added) << bad.what;
    EXPECT_NE(added.error().message.find("models/bad.ply"), std::string::npos) << added.error().message;
    EXPECT_NE(added.error().message.find(bad.what), std::string::npos) << added.error().message;
    EXPECT_FALSE((*packer)->finish());
    packer->reset();
    EXPECT_TRUE(all_files(directory_ / name).empty());
  }
}

TEST_F(ScenePackerTest, references_to_nothing_are_refused) {
  const auto fails = [&](auto say) {
    auto packer = ScenePacker::create(directory_ / "refs", {});
    EXPECT_TRUE(packer);
    EXPECT_TRUE((*packer)->add_material(Material{}, "Floor"));
    EXPECT_FALSE(say(**packer));
    EXPECT_FALSE((*packer)->finish());
    EXPECT_FALSE(has_manifest("refs"));
  };
  const MeshData grid = wavy_grid("grid", 1, 1);
  const auto add = [&](SceneSink& sink, auto change) {
    MeshInput mesh = grid.input(0);
    change(mesh);
    return bool(sink.add_mesh(mesh));
  };
  fails([&](SceneSink& s) { return add(s, [](MeshInput& m) { m.material = MaterialId{1}; }); });
  fails([&](SceneSink& s) { return add(s, [](MeshInput& m) { m.alpha = TextureId{0}; }); });
  fails([&](SceneSink& s) { return add(s, [](MeshInput& m) { m.object = 1; }); });
  for (const float bad : {-1.0f, INFINITY, NAN})
    fails([&](SceneSink& s) { return add(s, [bad](MeshInput& m) { m.emits = true, m.emission = {bad, 0, 0}; }); });
  fails([&](SceneSink& s) { return bool(s.add_instance(1, Affine3{})); });
  fails([&](SceneSink& s) { return bool(s.add_instance(0, Affine3{})); });
  fails([&](SceneSink& s) {
    Affine3 flat;
    flat.m[2][2] = 0;
    return bool(s.add_instance(s.begin_object("p"), flat));
  });
  fails([&](SceneSink& s) { return bool(s.add_image(directory_ / "none.png", cache::TexelEncoding::srgb)); });
  fails([&](SceneSink& s) {
    TextureNode node;
    node.kind = TextureKind::scale, node.child[0] = node.child[1] = 0;
    return bool(s.add_texture(node));
  });
}

// Twenty nodes, a million lookups.
TEST_F(ScenePackerTest, textures_that_use_one_another_without_end_are_refused) {
  auto packer = ScenePacker::create(directory_ / "a.store", {});
  ASSERT_TRUE(packer);
  Result<TextureId> last = (*packer)->add_texture({});
  for (int i = 0; i < 20 && last; ++i) {
    TextureNode node;
    node.kind = TextureKind::scale, node.child[0] = node.child[1] = last->value;
    last = (*packer)->add_texture(node);
  }
  ASSERT_FALSE(last);
  EXPECT_NE(last.error().message.find("texture 16: asks for more than 65536 lookups"), std::string::npos) << last.error().message;
}

TEST_F(ScenePackerTest, a_scene_without_camera_or_with_an_absurd_one_is_refused) {
  auto packer = ScenePacker::create(directory_ / "a.store", {});
  ASSERT_TRUE(packer);
  EXPECT_FALSE((*packer)->finish());
  packer = ScenePacker::create(directory_ / "a.store", {});
  SceneSettings settings = small_settings();
  settings.camera.resolution_y_px = 0;
  (*packer)->set_settings(settings);
  EXPECT_FALSE((*packer)->finish());
  EXPECT_FALSE(has_manifest("a.store"));
}

TEST_F(ScenePackerTest, contents_that_differ_in_one_vertex_have_another_key) {
  const auto key = [&](const char* name, float x) {
    const auto packer = ScenePacker::create(directory_ / name, {});
    EXPECT_TRUE((*packer)->add_material({}, "grey"));
    MeshData mesh = wavy_grid("grid", 3, 3);
    mesh.positions[5].x += x;
    EXPECT_TRUE((*packer)->add_mesh(mesh.input(0)));
    (*packer)->set_settings(small_settings());
    EXPECT_TRUE((*packer)->finish());
    return open(name).content_key();
  };
  EXPECT_EQ(key("a.store", 0), key("b.store", 0));
  EXPECT_NE(key("c.store", 0.01f), key("d.store", 0));
}

TEST_F(ScenePackerTest, a_camera_path_that_makes_no_sense_is_refused) {
  const auto packer = ScenePacker::create(directory_ / "a.store", {});
  (*packer)->set_settings(small_settings());
  std::vector<shading::Camera> path(3, small_settings().camera);
  path[2].resolution_x_px /= 2;
  (*packer)->set_camera_path(10, path);
  const Status packed = (*packer)->finish();
  ASSERT_FALSE(packed);
  EXPECT_NE(packed.error().message.find("frame 12"), std::string::npos) << packed.error().message;
  EXPECT_FALSE(has_manifest("a.store"));
}

TEST_F(ScenePackerTest, an_image_that_is_none_fails_and_leaves_nothing) {
  std::ofstream(directory_ / "broken.ppm") << "P6\n4 4\n255\nab";
  auto packer = ScenePacker::create(directory_ / "a.store", {});
  ASSERT_TRUE(packer);
  const Status said = MixedScene{}.say(**packer, directory_ / "broken.ppm");
  ASSERT_TRUE(said) << said.error().message;
  const Status packed = (*packer)->finish();
  ASSERT_FALSE(packed);
  EXPECT_NE(packed.error().message.find("broken.ppm"), std::string::npos) << packed.error().message;
  EXPECT_TRUE(all_files(directory_ / "a.store").empty());
}

TEST_F(ScenePackerTest, too_little_memory_names_what_would_do) {
  const Status packed = pack_mixed(directory_ / "a.store", mask_, {.memory_limit_bytes = 100'000});
  ASSERT_FALSE(packed);
  EXPECT_NE(packed.error().message.find("--memory"), std::string::npos);
  EXPECT_TRUE(all_files(directory_ / "a.store").empty());
}

TEST_F(ScenePackerTest, packing_again_replaces_and_a_failed_import_keeps_the_old_store) {
  pack("a.store", {.max_triangles_per_page = 500});
  {
    auto packer = ScenePacker::create(directory_ / "a.store", {});
    ASSERT_TRUE(packer);
    EXPECT_FALSE((*packer)->add_instance(9, Affine3{}));
  }
  EXPECT_GT(open("a.store").pages().size(), 40u);
  std::ofstream(directory_ / "a.store" / "pages.trace.123.tmp") << "left by a killed process";
  std::ofstream(directory_ / "a.store" / "textures" / "00007.tif") << "of another scene";
  pack("a.store");
  pack("b.store");
  EXPECT_TRUE(all_files(directory_ / "a.store") == all_files(directory_ / "b.store"));
}

TEST_F(ScenePackerTest, a_directory_of_others_is_refused) {
  std::filesystem::create_directories(directory_ / "scene" / "textures");
  std::ofstream(directory_ / "scene" / "textures" / "bark.jpg") << "not ours";
  EXPECT_FALSE(ScenePacker::create(directory_ / "scene", {}));
  std::filesystem::create_directories(directory_ / "other");
  std::ofstream(directory_ / "other" / "scene.pbrt") << "not ours";
  EXPECT_FALSE(ScenePacker::create(directory_ / "other", {}));
  EXPECT_FALSE(ScenePacker::create(mask_, {}));
}

TEST_F(ScenePackerTest, an_image_is_packed_once_for_each_encoding) {
  auto packer = ScenePacker::create(directory_ / "a.store", {});
  ASSERT_TRUE(packer);
  const auto linear = (*packer)->add_image(mask_, cache::TexelEncoding::linear);
  const auto srgb = (*packer)->add_image(mask_, cache::TexelEncoding::srgb);
  const auto again = (*packer)->add_image(directory_ / "./mask.ppm", cache::TexelEncoding::linear);
  ASSERT_TRUE(linear && srgb && again);
  EXPECT_EQ(*linear, *again);
  EXPECT_NE(*linear, *srgb);
}

TEST_F(ScenePackerTest, nothing_may_follow_the_end) {
  auto packer = ScenePacker::create(directory_ / "a.store", {});
  ASSERT_TRUE(packer);
  ASSERT_TRUE(MixedScene{}.say(**packer, mask_));
  ASSERT_TRUE((*packer)->finish());
  EXPECT_FALSE((*packer)->add_mesh(wavy_grid("late", 1, 1).input(0)));
  EXPECT_FALSE((*packer)->finish());
  packer->reset();
  EXPECT_TRUE(Store::open(directory_ / "a.store"));
}

// ---- arithmetic of instances ----

TEST(transformed_bounds, hold_every_transformed_point) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> number(-1000, 1000), share(0, 1);
  for (int n = 0; n < 2000; ++n) {
    Affine3 t;
    for (auto& row : t.m)
      for (float& x : row) x = number(random);
    Bounds3 box;
    box.grow(Float3{number(random), number(random), number(random)});
    box.grow(Float3{number(random), number(random), number(random)});
    const Bounds3 out = transformed_bounds(t, box);
    for (int k = 0; k < 16; ++k) {
      const auto at = [&](int a, bool end) {
        if (end) return (k >> a & 1) != 0 ? box.upper[a] : box.lower[a];
        return box.lower[a] + share(random) * (box.upper[a] - box.lower[a]);
      };
      const bool corner = k < 8;
      const Float3 q = t.point({at(0, corner), at(1, corner), at(2, corner)});
      for (int a = 0; a < 3; ++a) ASSERT_TRUE(q[a] >= out.lower[a] && q[a] <= out.upper[a]);
    }
  }
}

TEST(invert, undoes_and_refuses_what_cannot_be_undone) {
  Affine3 t, inverse;
  t.m[0][0] = 0, t.m[0][1] = -2, t.m[1][0] = 4, t.m[1][1] = 0, t.m[0][3] = 10, t.m[2][3] = -3;
  ASSERT_TRUE(invert(t, inverse));
  // Powers of two: exact.
  EXPECT_TRUE(inverse.point(t.point({1, 2, 3})) == (Float3{1, 2, 3}));
  t.m[2][2] = 0;
  EXPECT_FALSE(invert(t, inverse));
  t.m[2][2] = std::numeric_limits<float>::infinity();
  EXPECT_FALSE(invert(t, inverse));
}

}  // namespace
}  // namespace spillway::pipeline::test
