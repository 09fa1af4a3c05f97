#pragma once

// Small scenes built in code, said to a sink, with the triangles that must come out.

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "pipeline/pack/scene_packer.h"

namespace spillway::pipeline::test {

// A directory that goes away with the test.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (std::filesystem::temp_directory_path() / "spillway-pack-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~TemporaryDirectory() {
    std::error_code code;
    std::filesystem::remove_all(path_, code);
  }
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

struct MeshData {
  std::string name;
  std::vector<Float3> positions, normals;
  std::vector<Float2> uvs;
  std::vector<uint32_t> indices;

  [[nodiscard]] MeshInput input(uint32_t material) const {
    MeshInput mesh;
    mesh.name = name;
    mesh.positions = positions, mesh.normals = normals, mesh.uvs = uvs, mesh.indices = indices;
    mesh.material = MaterialId{material};
    return mesh;
  }
};

// n x n quads over [0, size]^2, wavy, with normals and uvs.
inline MeshData wavy_grid(std::string name, uint32_t n, float size) {
  MeshData mesh{std::move(name), {}, {}, {}, {}};
  for (uint32_t y = 0; y <= n; ++y)
    for (uint32_t x = 0; x <= n; ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(n), v = static_cast<float>(y) / static_cast<float>(n);
      mesh.positions.push_back({u * size, v * size, 0.1f * u * v - 0.07f * v * v});
      mesh.normals.push_back({0.1f * v, 0.1f * u, 1});
      mesh.uvs.push_back({u, v});
    }
  for (uint32_t y = 0; y < n; ++y)
    for (uint32_t x = 0; x < n; ++x) {
      const uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, d, a, d, c});
    }
  return mesh;
}

// Small triangles anywhere in a cube, in no spatial order.
inline MeshData triangle_soup(std::string name, uint32_t count, float size, uint32_t seed) {
  MeshData mesh{std::move(name), {}, {}, {}, {}};
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(0, size), step(0.01f, 0.1f);
  for (uint32_t i = 0; i < count; ++i) {
    const Float3 p{place(random), place(random), place(random)};
    const Float3 q = p + Float3{step(random), 0, 0}, r = p + Float3{0, step(random), 0.01f};
    mesh.positions.insert(mesh.positions.end(), {p, q, r});
    mesh.indices.insert(mesh.indices.end(), {3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

inline SceneSettings small_settings() {
  SceneSettings settings;
  settings.camera.resolution_x_px = 64, settings.camera.resolution_y_px = 48;
  return settings;
}

inline shading::Light light_of(shading::LightKind kind) {
  shading::Light light{};
  light.kind = kind;
  light.radiance = {1, 2, 3};
  light.position = {0, 0, 5};
  light.edge1 = {0, 0, 1};
  light.cos_total = 0.5f, light.cos_falloff = 0.75f;
  return light;
}

struct Triangle {
  Float3 vertex[3];
};
using TrianglesByMesh = std::map<std::string, std::vector<Triangle>>;

inline std::vector<Triangle> triangles_of(const MeshData& mesh) {
  std::vector<Triangle> triangles;
  for (size_t i = 0; i < mesh.indices.size(); i += 3)
    triangles.push_back({{mesh.positions[mesh.indices[i]], mesh.positions[mesh.indices[i + 1]],
                          mesh.positions[mesh.indices[i + 2]]}});
  return triangles;
}

inline bool same_bits(const Float3& a, const Float3& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

// 4 x 4 texels, left half black, right half white.
inline void write_mask(const std::filesystem::path& path) {
  std::ofstream file(path, std::ios::binary);
  file << "P6\n4 4\n255\n";
  for (int i = 0; i < 16; ++i) file << std::string(3, i % 4 < 2 ? '\0' : '\xff');
}

// A bit of everything: two materials against the order of meshes, a mesh of several blocks, a lamp with two degenerate
// faces, a prototype with three instances, an empty prototype, an alpha mask, two more lights.
inline constexpr uint32_t kSoupCount = 20000;
struct MixedScene {
  MeshData grid = wavy_grid("grid", 40, 10);
  MeshData soup = triangle_soup("soup", kSoupCount, 10, 1);
  MeshData lamp{"lamp", {{0, 0, 9}, {1, 0, 9}, {0, 1, 9}, {1, 1, 9}, {2, 0, 9}}, {}, {},
                {0, 1, 2, /* repeated */ 1, 1, 3, /* in line */ 0, 1, 4, 1, 3, 2}};
  MeshData tree = triangle_soup("tree", 500, 1, 2);
  MeshData leaf = wavy_grid("leaf", 1, 1);

  [[nodiscard]] TrianglesByMesh expected() const {
    TrianglesByMesh all;
    for (const MeshData* mesh : {&grid, &soup, &lamp, &tree, &leaf}) all[mesh->name] = triangles_of(*mesh);
    all["lamp"].erase(all["lamp"].begin() + 1, all["lamp"].begin() + 3);
    return all;
  }

  Status say(SceneSink& sink, const std::filesystem::path& mask) const {
    sink.set_settings(small_settings());
    SPILLWAY_ASSIGN(const ImageId image, sink.add_image(mask, cache::TexelEncoding::linear));
    TextureNode node;
    node.kind = TextureKind::image, node.image = image.value, node.value[0] = node.value[1] = node.value[2] = 1;
    SPILLWAY_ASSIGN(const TextureId alpha, sink.add_texture(node));
    SPILLWAY_ASSIGN([[maybe_unused]] const MaterialId floor, sink.add_material(Material{}, "Floor"));
    SPILLWAY_ASSIGN([[maybe_unused]] const MaterialId wall, sink.add_material(Material{}, "Wall"));
    SPILLWAY_TRY(sink.add_mesh(grid.input(1)));
    SPILLWAY_TRY(sink.add_mesh(soup.input(0)));
    MeshInput lamp_input = lamp.input(0);
    lamp_input.emits = lamp_input.flip_normals = true, lamp_input.emission = {4, 5, 6};
    SPILLWAY_TRY(sink.add_mesh(lamp_input));
    const uint32_t tree_object = sink.begin_object("Tree"), empty_object = sink.begin_object("Empty");
    MeshInput tree_input = tree.input(0);
    tree_input.object = tree_object;
    SPILLWAY_TRY(sink.add_mesh(tree_input));
    MeshInput leaf_input = leaf.input(1);
    leaf_input.alpha = alpha;
    SPILLWAY_TRY(sink.add_mesh(leaf_input));
    for (int i = 0; i < 3; ++i) {
      Affine3 t;
      t.m[0][0] = 2, t.m[0][1] = 0.5f, t.m[0][3] = 20 + 3 * static_cast<float>(i);
      SPILLWAY_TRY(sink.add_instance(tree_object, t));
      SPILLWAY_TRY(sink.add_instance(empty_object, t));
    }
    SPILLWAY_TRY(sink.add_light(light_of(shading::LightKind::infinite)));
    return sink.add_light(light_of(shading::LightKind::point));
  }
};

inline std::string file_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Every file below a directory, by its relative name.
inline std::map<std::string, std::string> all_files(const std::filesystem::path& directory) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(directory))
    if (entry.is_regular_file())
      files[std::filesystem::relative(entry.path(), directory).string()] = file_bytes(entry.path());
  return files;
}

inline Status pack_mixed(const std::filesystem::path& store, const std::filesystem::path& mask, PackOptions options) {
  SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(store, std::move(options)));
  SPILLWAY_TRY(MixedScene{}.say(*packer, mask));
  return packer->finish();
}

}  // namespace spillway::pipeline::test
