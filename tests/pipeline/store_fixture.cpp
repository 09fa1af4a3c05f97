#include "tests/pipeline/store_fixture.h"

#include <fstream>

#include "cache/base/hash.h"
#include "cache/trace_kernel.h"

namespace spillway::pipeline::test {
namespace {

// As drawn in cache/section_file.cpp.
constexpr size_t kHeaderBytes = 32, kEntryBytes = 56, kHeaderChecksumAt = 24;
constexpr size_t kEntryOffsetAt = 32, kEntrySizeAt = 40, kEntryChecksumAt = 48;

template <class T>
T value_at(const std::string& bytes, size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

}  // namespace

Status pack_small(const std::filesystem::path& path, std::vector<std::filesystem::path> sources, bool lit) {
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

Status pack_gas(const std::filesystem::path& path) {
  SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(path, {}));
  SceneSettings settings = small_settings();
  settings.render.camera_medium = 0;
  packer->set_settings(settings);
  Medium fog;
  fog.sigma_a = {0.1f, 0.2f, 0.3f}, fog.sigma_s = {1, 1, 1}, fog.g = 0.5f;
  SPILLWAY_TRY(packer->add_medium({"fog", fog, Affine3{}}) ? Status{} : error("fog"));
  Medium fire = fog;
  fire.kind = MediumKind::grid, fire.glow_kind = GlowKind::temperature, fire.glow = {1, 1, 1};
  for (uint32_t* volume : {&fire.density_volume, &fire.glow_volume}) {
    SPILLWAY_ASSIGN(const auto samples, to_sample_stream(*packer, std::array<float, 8>{0, 1, 2, 3, 4, 5, 6, 7}));
    SPILLWAY_ASSIGN(*volume, packer->add_volume({"grid", {}, {}, {2, 2, 2}, 1, samples}));
  }
  packer->set_black_bodies(std::vector<Rgb>(kBlackBodyEntries, Rgb{1, 0.5f, 0.25f}));
  SPILLWAY_TRY(packer->add_medium({"fire", fire, Affine3{}}) ? Status{} : error("fire"));
  SPILLWAY_TRY(packer->add_material(Material{}, "Box") ? Status{} : error("material"));
  const MeshData box = wavy_grid("box", 1, 1);
  MeshInput input = box.input(0);
  input.divides_media = true, input.medium_inside = 1, input.medium_outside = 0;
  SPILLWAY_TRY(packer->add_mesh(input));
  return packer->finish();
}

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

void StoreTest::expect_refused(std::span<const Damage> cases) {
  for (const Damage& d : cases) {
    set(d.section, d.byte, d.value);
    const auto store = Store::open(store_);
    ASSERT_FALSE(store) << d.section << " byte " << d.byte << " = " << d.value;
    EXPECT_NE(store.error().message.find(kManifestFile), std::string::npos) << store.error().message;
  }
}

}  // namespace spillway::pipeline::test
