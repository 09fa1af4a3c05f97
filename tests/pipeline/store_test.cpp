#include "pipeline/store.h"

#include <cmath>
#include <limits>

#include "cache/base/hash.h"
#include "cache/trace_kernel.h"
#include "pipeline/store_validation.h"
#include "tests/pipeline/pack_scene.h"

namespace spillway::pipeline::test {
namespace {

// Two quads, a lamp, an instance that moves and a camera that does: a manifest of some thousand bytes, so that each can
// be tried. lit: the prototype emits too and stands still, so that the store has light trees.
Status pack_small(const std::filesystem::path& path, std::vector<std::filesystem::path> sources = {}, bool lit = false) {
  SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(path, {.source_files = std::move(sources)}));
  packer->set_settings(small_settings());
  packer->set_camera_path(7, std::vector{small_settings().camera, small_settings().camera});
  SPILLWAY_TRY(packer->add_texture(TextureNode{}) ? Status{} : error("texture"));
  TextureNode product;
  product.kind = TextureKind::scale, product.child[0] = product.child[1] = 0;
  SPILLWAY_TRY(packer->add_texture(product) ? Status{} : error("texture"));
  Material material;
  material.reflectance.texture = 1;
  SPILLWAY_TRY(packer->add_material(material, "Floor") ? Status{} : error("material"));
  Material mix;
  mix.kind = MaterialKind::mix, mix.mix_material[0] = mix.mix_material[1] = 0;
  SPILLWAY_TRY(packer->add_material(mix, "Mix") ? Status{} : error("material"));
  const MeshData floor = wavy_grid("floor", 2, 1), lamp = wavy_grid("lamp", 1, 1), tree = wavy_grid("tree", 1, 1);
  SPILLWAY_TRY(packer->add_mesh(floor.input(1)));
  MeshInput lamp_input = lamp.input(0);
  lamp_input.emits = true, lamp_input.emission = {1, 1, 1};
  SPILLWAY_TRY(packer->add_mesh(lamp_input));
  MeshInput tree_input = tree.input(0);
  tree_input.object = packer->begin_object("Tree");
  tree_input.emits = lit, tree_input.emission = {2, 1, 1};
  SPILLWAY_TRY(packer->add_mesh(tree_input));
  Affine3 end;
  end.m[0][0] = end.m[1][1] = 0.6f, end.m[1][0] = 0.8f, end.m[0][1] = -0.8f, end.m[2][3] = 1;
  SPILLWAY_TRY(packer->set_camera_end(end));
  if (!lit) SPILLWAY_TRY(packer->add_moving_instance(tree_input.object, Affine3{}, end));
  if (lit) SPILLWAY_TRY(packer->add_instance(tree_input.object, Affine3{}));
  if (lit) SPILLWAY_TRY(packer->add_instance(tree_input.object, Affine3{{{-2, 0, 0, 5}, {0, 1, 0, 0}, {0, 1, 1, 0}}}));
  SPILLWAY_TRY(packer->add_light(light_of(shading::LightKind::spot)));
  SPILLWAY_TRY(packer->add_light(light_of(shading::LightKind::distant)));
  return packer->finish();
}

class StoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const Status packed = pack_small(store_);
    ASSERT_TRUE(packed) << packed.error().message;
    manifest_ = file_bytes(store_ / kManifestFile);
  }
  // Another store in the place of the first.
  void pack_lit() {
    const Status packed = pack_small(store_, {}, true);
    ASSERT_TRUE(packed) << packed.error().message;
    manifest_ = file_bytes(store_ / kManifestFile);
  }
  void write_manifest(const std::string& bytes) {
    std::ofstream file(store_ / kManifestFile, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  // The start of section `name` in the manifest, and its entry.
  size_t section_offset(const std::string& name, size_t& entry);
  // Changes the manifest at a place of a section, with checksums put right again.
  void damage(const std::string& section, size_t byte, std::byte flip);
  template <class T>
  void set(const std::string& section, size_t byte, T value);
  void set_checksums(std::string& bytes, size_t entry);
  struct Counts {
    size_t tried = 0, refused = 0;
  };
  Counts flip_all(const std::vector<std::string>& sections);
  // One number put somewhere else: each must be refused, with the manifest named.
  struct Damage {
    const char* section;
    size_t byte;
    uint32_t value;
  };
  void expect_refused(std::span<const Damage> cases);

  TemporaryDirectory directory_;
  std::filesystem::path store_ = directory_ / "a.store";
  std::string manifest_;
};

// As drawn in cache/section_file.cpp.
constexpr size_t kHeaderBytes = 32, kEntryBytes = 56, kHeaderChecksumAt = 24;
constexpr size_t kEntryOffsetAt = 32, kEntrySizeAt = 40, kEntryChecksumAt = 48;

template <class T>
T value_at(const std::string& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

size_t StoreTest::section_offset(const std::string& name, size_t& entry) {
  const auto count = value_at<uint32_t>(manifest_, 12);
  for (uint32_t i = 0; i < count; ++i) {
    entry = kHeaderBytes + i * kEntryBytes;
    if (std::string(manifest_.c_str() + entry) == name) return value_at<uint64_t>(manifest_, entry + kEntryOffsetAt);
  }
  ADD_FAILURE() << "no section " << name;
  return 0;
}

void StoreTest::set_checksums(std::string& bytes, size_t entry) {
  const auto offset = value_at<uint64_t>(bytes, entry + kEntryOffsetAt);
  const auto size = value_at<uint64_t>(bytes, entry + kEntrySizeAt);
  const uint64_t sum = checksum(bytes.data() + offset, size);
  std::memcpy(bytes.data() + entry + kEntryChecksumAt, &sum, sizeof sum);
  const uint64_t zero = 0;
  std::memcpy(bytes.data() + kHeaderChecksumAt, &zero, sizeof zero);
  const size_t entries = value_at<uint32_t>(bytes, 12) * kEntryBytes;
  const uint64_t header = checksum(bytes.data() + kHeaderBytes, entries, checksum(bytes.data(), kHeaderBytes));
  std::memcpy(bytes.data() + kHeaderChecksumAt, &header, sizeof header);
}

void StoreTest::damage(const std::string& section, size_t byte, std::byte flip) {
  size_t entry = 0;
  std::string bytes = manifest_;
  const size_t at = section_offset(section, entry) + byte;
  bytes[at] = static_cast<char>(static_cast<std::byte>(bytes[at]) ^ flip);
  set_checksums(bytes, entry);
  write_manifest(bytes);
}

template <class T>
void StoreTest::set(const std::string& section, size_t byte, T value) {
  size_t entry = 0;
  std::string bytes = manifest_;
  std::memcpy(bytes.data() + section_offset(section, entry) + byte, &value, sizeof value);
  set_checksums(bytes, entry);
  write_manifest(bytes);
}

// Follows everything a renderer follows in the tables; under the sanitizers this is the test.
void use(const Store& store) {
  const auto prims = static_cast<uint32_t>(store.settings().statistics.triangle_count);
  for (uint32_t p = 0; p < prims; ++p) EXPECT_LT(store.mesh_of(PrimId{p}).value, store.meshes().size());
  for (const Mesh& mesh : store.meshes()) EXPECT_LT(mesh.material, store.materials().size());
  for (uint32_t m = 0; m < 3; ++m) (void)store.name_of("mesh", m);
  (void)store.is_current({});
  const shading::LightTable lights = store.light_table();
  EXPECT_LE(lights.first_infinite, lights.lights.size());
  for (const float u : {0.0f, 0.3f, 0.99f})
    (void)shading::sample_light(lights, {{0.3f, 0.2f, -2}, 0x8080}, {u, 0.5f}, {0.5f, 0.5f});
  const shading::LightReceiver receiver{{0.3f, 0.2f, -2}, 0x8080};
  for (const Mesh& mesh : store.meshes())
    for (uint32_t i = 0; mesh.light_base != LightId::kNone && i < store.instances().size(); ++i)
      for (uint32_t f = 0; f < mesh.face_count && store.instances()[i].object == mesh.object; ++f) {
        const shading::TriangleShape shape = shading::emitter_in_world(lights, i, mesh.light_base + f);
        (void)shading::emitter_pdf_solid_angle(lights, receiver, i, mesh.light_base + f, shape, shape.position);
      }

  const std::string file = file_bytes(store.trace_pages_path());
  std::vector<Buffer<std::byte>> pages;
  std::vector<cache::TracePageView> views;
  for (const cache::PageLocation& location : store.pages()) {
    pages.emplace_back(MemoryTag::pages, location.size_bytes);
    std::memcpy(pages.back().data(), file.data() + location.offset_bytes, location.size_bytes);
    ASSERT_TRUE(cache::validate_trace_page(pages.back(), "page"));
    views.push_back(cache::trace_page_view(pages.back()));
  }
  const cache::PageTree tree = store.page_tree();
  for (int i = 0; i < 8; ++i) {
    cache::TraceRay ray{{0.1f * static_cast<float>(i), 0.3f, 2}, INFINITY, {0.01f, 0.02f, -1}, 0};
    cache::TraceHit hit = cache::no_hit(ray);
    cache::TraceCounters counters;
    cache::DueVisits due;
    cache::trace_resident<cache::TraceMode::nearest>(tree, {views.data()}, ray, hit, counters, due);
    EXPECT_TRUE(hit.prim == PrimId::kNone || hit.prim < prims);
  }
}

// Every byte of the sections, three ways: refused, or a store that can be used.
StoreTest::Counts StoreTest::flip_all(const std::vector<std::string>& sections) {
  Counts counts;
  for (const std::string& section : sections) {
    size_t entry = 0;
    section_offset(section, entry);
    const auto size = value_at<uint64_t>(manifest_, entry + kEntrySizeAt);
    for (size_t i = 0; i < size; ++i)
      for (const std::byte flip : {std::byte{0x01}, std::byte{0x80}, std::byte{0xff}}) {
        damage(section, i, flip);
        const auto store = Store::open(store_);
        ++counts.tried;
        if (store) use(*store);
        if (!store) ++counts.refused;
      }
  }
  return counts;
}

TEST_F(StoreTest, a_good_one_opens_and_rays_hit_it) {
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  use(*store);
  EXPECT_EQ(store->settings().statistics.triangle_count, 12u);
  EXPECT_EQ(store->light_table().lights.size(), 2u);
  EXPECT_EQ(store->light_table().emitters.size(), 2u);
  EXPECT_EQ(store->textures_path(), store_ / "textures");
}

TEST_F(StoreTest, every_prefix_of_the_manifest_is_refused) {
  for (size_t size = 0; size < manifest_.size(); ++size) {
    write_manifest(manifest_.substr(0, size));
    ASSERT_FALSE(Store::open(store_)) << size;
  }
  write_manifest(manifest_);
  EXPECT_TRUE(Store::open(store_));
}

TEST_F(StoreTest, flipped_bytes_of_light_trees_are_refused_or_harmless) {
  pack_lit();
  const auto store = Store::open(store_);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->light_table().tree.nodes.size(), 2u);
  use(*store);
  const auto counts = flip_all({section::kEmitters, section::kEmissions, section::kLightNodes, section::kLightRoots,
                                section::kEmitterLeaves, section::kInstanceLeaves, section::kLightCdf});
  EXPECT_GT(counts.tried, 1500u);
  EXPECT_GT(counts.refused, counts.tried / 5);
}

TEST_F(StoreTest, flipped_bytes_under_right_checksums_are_refused_or_harmless) {
  const auto counts = flip_all({section::kSettings, section::kMeshes,      section::kMaterials,  section::kTextures,
                         section::kLights,   section::kLightCdf,    section::kPages,      section::kTreeNodes,
                         section::kTreeEntries, section::kTreeObjects, section::kInstances, section::kAttributes,
                         section::kNames,    section::kSources});
  EXPECT_GT(counts.tried, 4000u);
  EXPECT_GT(counts.refused, counts.tried / 10);  // most bytes are fractions of floats, colours and names, of which any is possible
}


void StoreTest::expect_refused(std::span<const Damage> cases) {
  for (const Damage& d : cases) {
    set(d.section, d.byte, d.value);
    const auto store = Store::open(store_);
    ASSERT_FALSE(store) << d.section << " byte " << d.byte << " = " << d.value;
    EXPECT_NE(store.error().message.find(kManifestFile), std::string::npos) << store.error().message;
  }
}

TEST_F(StoreTest, each_law_of_the_light_trees_is_checked) {
  pack_lit();
  const uint32_t nan = 0x7fc00000, none = shading::kNoLightNode;
  const auto child = [](int node, int slot) { return node * sizeof(shading::LightNode) + offsetof(shading::LightNode, child) + 4 * slot; };
  // Node 0 is the prototype's, with the faces 2 and 3; node 1 the world's, with the lamp, the spot and two instances.
  const Damage cases[] = {
      {section::kLightRoots, 0, 0},     // the prototype's tree, in the world too
      {section::kLightRoots, 0, 2},     // no such node
      {section::kLightRoots, 0, none},  // the world has lights
      {section::kLightRoots, 4, none},  // the prototype stands somewhere
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::node, 0)},      // itself
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::node, 1)},      // its own parent
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::node, 9)},      // beyond
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::emitter, 9)},   // beyond
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::emitter, 0)},   // of the world
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::instance, 1)},  // in a prototype
      {section::kLightNodes, child(0, 0), shading::light_child(shading::LightChild::light, 0)},     // in a prototype
      {section::kLightNodes, child(1, 0), shading::light_child(shading::LightChild::instance, 0)},  // the world
      {section::kLightNodes, child(1, 0), shading::light_child(shading::LightChild::light, 1)},     // has no place
      {section::kLightNodes, offsetof(shading::LightNode, parent), 0},
      {section::kLightNodes, offsetof(shading::LightNode, child_count), 0},
      {section::kLightNodes, offsetof(shading::LightNode, child_count), 9},
      {section::kLightNodes, offsetof(shading::LightNode, energy), nan},
      {section::kLightNodes, offsetof(shading::LightNode, energy), 0},
      {section::kLightNodes, offsetof(shading::LightNode, energy), 0x7f800000},  // infinite
      {section::kLightNodes, offsetof(shading::LightNode, origin), nan},
      {section::kLightNodes, offsetof(shading::LightNode, scale), 0xbf800000},  // negative
      {section::kLightNodes, offsetof(shading::LightNode, cone), 0xffffffff},
      {section::kEmitterLeaves, 0, 0},
      {section::kEmitterLeaves, 0, none},
      {section::kEmitterLeaves, 0, 1u << 30},
      {section::kInstanceLeaves, 0, 8},  // the world is no instance
      {section::kInstanceLeaves, 4, none},
      {section::kMeshes, sizeof(Mesh) + offsetof(Mesh, object), 0},  // whose faces stand in the tree of the other
  };
  expect_refused(cases);
}

TEST_F(StoreTest, each_law_between_the_tables_is_checked_and_the_section_named) {
  const uint32_t nan = 0x7fc00000;
  const Damage cases[] = {
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, resolution_x_px), 0},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, resolution_y_px), 65537},
      {section::kSettings, offsetof(SceneSettings, camera) + 4, nan},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, tan_half_fov_x), nan},
      {section::kSettings, offsetof(SceneSettings, filter), 5},
      {section::kSettings, offsetof(SceneSettings, filter) + 4, 0},
      {section::kSettings, offsetof(SceneSettings, film) + offsetof(FilmSettings, crop_x0), 70},
      {section::kSettings, offsetof(SceneSettings, film) + offsetof(FilmSettings, exposure_scale), nan},
      {section::kSettings, offsetof(SceneSettings, render), 0},
      {section::kSettings, offsetof(SceneSettings, statistics) + offsetof(SceneStatistics, bounds_world), 0},
      {section::kCameraPath, offsetof(FrameCamera, frame), 8},  // twice
      {section::kCameraPath, offsetof(FrameCamera, camera) + offsetof(shading::Camera, resolution_x_px), 63},
      {section::kCameraPath, offsetof(FrameCamera, camera) + offsetof(shading::Camera, focal_distance), nan},
      {section::kCameraPath, offsetof(FrameCamera, camera) + offsetof(shading::Camera, motion), 1},
      {section::kMeshes, offsetof(Mesh, prim_base), 1},
      {section::kMeshes, offsetof(Mesh, face_count), 0},
      {section::kMeshes, offsetof(Mesh, material), 2},
      {section::kMeshes, offsetof(Mesh, material), 1},  // the next has 0
      {section::kMeshes, offsetof(Mesh, object), 2},
      {section::kMeshes, offsetof(Mesh, light_base), 1},
      {section::kMeshes, offsetof(Mesh, alpha_texture), 2},
      {section::kMeshes, offsetof(Mesh, flags), 1u << 7},
      {section::kMeshes, offsetof(Mesh, flags), kMeshIsInterface},
      {section::kMeshes, offsetof(Mesh, medium_inside), 0x00ff},
      {section::kMaterials, offsetof(Material, kind), 7},
      {section::kMaterials, offsetof(Material, reflectance) + offsetof(Param, texture), 2},
      {section::kMaterials, offsetof(Material, base_u_roughness), nan},
      {section::kMaterials, offsetof(Material, displacement), 2},
      {section::kMaterials, sizeof(Material) + offsetof(Material, mix_material), 1},
      {section::kTextures, sizeof(TextureNode) + offsetof(TextureNode, child), 1},  // itself
      {section::kTextures, offsetof(TextureNode, kind), 4},
      {section::kTextures, offsetof(TextureNode, wrap), 3},
      {section::kTextures, offsetof(TextureNode, filter), 3},
      {section::kTextures, offsetof(TextureNode, uv_scale), nan},
      {section::kTextures, offsetof(TextureNode, kind), static_cast<uint32_t>(TextureKind::image)},  // without image
      {section::kLights, offsetof(shading::Light, kind), 5},
      {section::kLights, offsetof(shading::Light, radiance), nan},
      {section::kLights, offsetof(shading::Light, kind), static_cast<uint32_t>(shading::LightKind::infinite)},  // not last
      {section::kLights, offsetof(shading::Light, edge1), 0x40000000},  // length
      {section::kEmitters, offsetof(shading::Emitter, emission), 1},
      {section::kEmitters, 0, nan},
      {section::kEmissions, 0, 0xbf800000},  // negative
      {section::kEmissions, offsetof(shading::Emission, two_sided), 2},
      {section::kLightCdf, 0, 0x3c000000},   // not 0
      {section::kLightCdf, 4, nan},
      {section::kLightCdf, 4, 0x3f800001},   // beyond 1
      {section::kLightCdf, 16, 0x3f7fffff},  // the last, just below 1
      {section::kPages, offsetof(cache::PageLocation, offset_bytes), 4096},
      {section::kPages, offsetof(cache::PageLocation, size_bytes), 100},
      {section::kPages, offsetof(cache::PageLocation, triangle_count), 9},
      {section::kPages, offsetof(cache::PageLocation, object), 1},
      {section::kTreeEntries, offsetof(cache::PageTreeEntry, kind), 2},
      {section::kTreeEntries, offsetof(cache::PageTreeEntry, index), 9},
      {section::kTreeEntries, offsetof(cache::PageTreeEntry, index), 0},  // the world's page, now twice
      {section::kTreeObjects, offsetof(cache::PageObject, root), cache::kNoChild},
      {section::kTreeObjects, offsetof(cache::PageObject, bounds_object), nan},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, motion), 3},
      {section::kSettings, offsetof(SceneSettings, camera) + offsetof(shading::Camera, shutter_open), 0x40000000},  // after
      {section::kSettings, offsetof(SceneSettings, motion), 0x40000000},  // ends before it starts
      {section::kMotions, 0, 0x3f800001},                                 // not where the camera is
      {section::kMotions, sizeof(Motion), 0x3f800001},                    // not where the instance is
      {section::kMotions, offsetof(Motion, rotation), 0x3f000000},
      {section::kMotions, offsetof(Motion, axis), nan},
      {section::kMotions, offsetof(Motion, turns), 0x3f000001},           // more than half a turn
      {section::kMotions, offsetof(Motion, turns), 0},                    // not as far as the other key
      {section::kMotions, offsetof(Motion, stretch), 0xbf800000},         // mirrored in one direction
      {section::kMotions, offsetof(Motion, stretch), 0},                  // flat
      {section::kMotions, offsetof(Motion, key) + sizeof(Affine3) + 12, 0x7f000000},  // too far
      {section::kInstances, sizeof(cache::Instance) + offsetof(cache::Instance, motion), 3},
      {section::kInstances, offsetof(cache::Instance, motion), 1},  // the world does not move
      {section::kInstances, 0, 0x3f800001},  // the world: not the identity
      {section::kInstances, sizeof(cache::Instance), 0x3f900000},  // not the inverse of the other
      {section::kInstances, sizeof(cache::Instance) + offsetof(cache::Instance, object), 0},
      {section::kAttributes, offsetof(AttributeLocation, first_prim), 1},
      {section::kAttributes, offsetof(AttributeLocation, prim_count), 11},
      {section::kAttributes, offsetof(AttributeLocation, size_bytes), 4097},
  };
  expect_refused(cases);
  set(section::kMeshes, offsetof(Mesh, alpha_texture), 2u);
  EXPECT_NE(Store::open(store_).error().message.find("'meshes', item 0"), std::string::npos);
}

TEST_F(StoreTest, the_camera_path_is_kept_and_the_contents_have_a_key) {
  const auto store = Store::open(store_);
  ASSERT_TRUE(store);
  ASSERT_EQ(store->camera_path().size(), 2u);
  EXPECT_EQ(store->camera_path()[1].frame, 8u);
  const shading::Camera camera = small_settings().camera;
  EXPECT_EQ(std::memcmp(&store->camera_path()[1].camera, &camera, sizeof camera), 0);
  const std::filesystem::path other = directory_ / "b.store";
  ASSERT_TRUE(pack_small(other, {directory_ / "a.store" / kManifestFile}));
  EXPECT_EQ(Store::open(other)->content_key(), store->content_key());  // whatever it was made from
  set(section::kMaterials, offsetof(Material, eta), 1.25f);
  EXPECT_NE(Store::open(store_)->content_key(), store->content_key());
}

TEST_F(StoreTest, missing_and_short_files_are_named) {
  for (const char* name : {kTracePagesFile, kAttributesFile}) {
    const std::string whole = file_bytes(store_ / name);
    std::filesystem::resize_file(store_ / name, whole.size() - 1);
    auto store = Store::open(store_);
    ASSERT_FALSE(store);
    EXPECT_NE(store.error().message.find(name), std::string::npos);
    std::filesystem::remove(store_ / name);
    store = Store::open(store_);
    ASSERT_FALSE(store);
    EXPECT_NE(store.error().message.find(name), std::string::npos);
    std::ofstream(store_ / name, std::ios::binary).write(whole.data(), static_cast<std::streamsize>(whole.size()));
    EXPECT_TRUE(Store::open(store_));
  }
  std::filesystem::remove(store_ / kManifestFile);
  const auto store = Store::open(store_);
  ASSERT_FALSE(store);
  EXPECT_NE(store.error().message.find("is no store"), std::string::npos);
}

TEST_F(StoreTest, a_store_is_current_until_a_source_changes) {
  const std::filesystem::path a = directory_ / "scene.pbrt", b = directory_ / "mesh file.ply";
  std::ofstream(a) << "one";
  std::ofstream(b) << "two";
  ASSERT_TRUE(pack_small(store_, {b, a}));
  const auto store = Store::open(store_);
  ASSERT_TRUE(store);
  EXPECT_TRUE(store->is_current(std::vector{a}));
  EXPECT_TRUE(store->is_current(std::vector{a, b}));
  EXPECT_FALSE(store->is_current(std::vector{directory_ / "other.pbrt"}));
  const auto changed = std::filesystem::last_write_time(b);
  std::filesystem::last_write_time(b, changed + std::chrono::seconds(1));
  EXPECT_FALSE(store->is_current(std::vector{a}));  // what the scene includes counts, too
  std::filesystem::last_write_time(b, changed);
  EXPECT_TRUE(store->is_current(std::vector{a}));
  std::ofstream(b) << "three";
  std::filesystem::last_write_time(b, changed);
  EXPECT_FALSE(store->is_current(std::vector{a}));
  std::filesystem::remove(b);
  EXPECT_FALSE(store->is_current(std::vector{a}));
}

TEST_F(StoreTest, a_store_of_unknown_sources_is_never_current) {
  EXPECT_FALSE(Store::open(store_)->is_current({}));
}

TEST_F(StoreTest, an_empty_scene_packs_and_opens) {
  const auto packer = ScenePacker::create(directory_ / "empty", {});
  ASSERT_TRUE(packer);
  (*packer)->set_settings(small_settings());
  const Status packed = (*packer)->finish();
  ASSERT_TRUE(packed) << packed.error().message;
  const auto store = Store::open(directory_ / "empty");
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_EQ(store->settings().statistics.triangle_count, 0u);
  EXPECT_EQ(store->light_table().scene_radius_world, 1);
  use(*store);
}

}  // namespace
}  // namespace spillway::pipeline::test
