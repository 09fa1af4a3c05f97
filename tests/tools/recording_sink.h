#pragma once

// A scene sink that keeps all it hears, and checks what every sink may rely on.

#include <string>
#include <utility>
#include <vector>

#include "pipeline/pack/scene_sink.h"
#include "pipeline/pack/subdivision_cage.h"
#include "pipeline/scene_validation.h"

namespace spillway::tools {

struct RecordedMesh {
  pipeline::MeshInput input;  // its spans are not to be used: the arrays below are copies
  std::vector<Float3> positions, normals;
  std::vector<Float2> uvs;
  std::vector<uint32_t> indices;
};

struct RecordedCage {
  pipeline::SubdivisionInput input;  // its spans are not to be used
  std::vector<Float3> positions;
  std::vector<Float2> uvs;
  std::vector<uint32_t> indices, corner_counts, uv_indices, holes;
  std::vector<pipeline::SharpEdge> sharp_edges;
  std::vector<pipeline::SharpVertex> sharp_vertices;
};

class RecordingSink : public pipeline::SceneSink {
 public:
  bool keep_meshes = true;  // else only counted
  std::vector<std::pair<std::string, cache::TexelEncoding>> images;
  std::vector<pipeline::TextureNode> textures;
  std::vector<pipeline::Material> materials;
  std::vector<std::string> material_names;
  std::vector<shading::Light> lights;
  std::vector<ImageId> environments;
  std::vector<pipeline::ImageLightInput> image_lights;
  std::vector<shading::Portal> portals;
  std::vector<std::string> objects;
  std::vector<RecordedMesh> meshes;
  std::vector<RecordedCage> cages;
  std::vector<std::pair<uint32_t, Affine3>> instances;
  struct Moving {
    uint32_t object;
    Affine3 start, end;
  };
  std::vector<Moving> moving;
  std::vector<Affine3> camera_ends;
  pipeline::SceneSettings settings;
  int settings_count = 0, finish_count = 0;
  uint64_t mesh_count = 0, triangle_count = 0;
  std::vector<pipeline::VolumeInput> volumes;
  std::vector<pipeline::MediumInput> media;
  std::vector<Rgb> black_bodies;
  std::string contract;  // what the importer did wrong, or empty

  Result<ImageId> add_image(const std::filesystem::path& file, cache::TexelEncoding encoding) override {
    images.emplace_back(file.filename().string(), encoding);
    return ImageId{static_cast<uint32_t>(images.size() - 1)};
  }
  Result<TextureId> add_texture(const pipeline::TextureNode& node) override {
    if (node.kind == pipeline::TextureKind::image && node.image >= images.size()) contract = "image after its texture";
    for (const uint32_t child : node.child) {
      if (child != TextureId::kNone && child >= textures.size()) contract = "texture before its children";
    }
    textures.push_back(node);
    return TextureId{static_cast<uint32_t>(textures.size() - 1)};
  }
  Result<MaterialId> add_material(const pipeline::Material& material, std::string name) override {
    for (const uint32_t part : material.mix_material) {
      if (part != MaterialId::kNone && part >= materials.size()) contract = "material before its parts";
    }
    materials.push_back(material);
    material_names.push_back(std::move(name));
    return MaterialId{static_cast<uint32_t>(materials.size() - 1)};
  }
  Status add_light(const shading::Light& light) override {
    lights.push_back(light);
    return {};
  }
  Status add_environment(const shading::Light& light, ImageId image) override {
    if (image.value >= images.size()) contract = "image after its light";
    environments.push_back(image);
    return add_light(light);
  }
  Status add_image_light(const pipeline::ImageLightInput& light) override {
    if (light.image.value >= images.size()) contract = "image after its light";
    image_lights.push_back(light);
    return add_light(light.light);
  }
  Result<uint32_t> add_volume(const pipeline::VolumeInput& volume) override {
    volumes.push_back(volume);
    return static_cast<uint32_t>(volumes.size() - 1);
  }
  Result<uint32_t> add_medium(const pipeline::MediumInput& medium) override {
    for (const uint32_t volume : {medium.medium.density_volume, medium.medium.glow_volume})
      if (volume != pipeline::Medium::kNoVolume && volume >= volumes.size()) contract = "medium before its volumes";
    SPILLWAY_TRY(pipeline::check_medium(medium.medium, volumes.size(), medium.name));
    media.push_back(medium);
    return static_cast<uint32_t>(media.size() - 1);
  }
  void set_black_bodies(std::span<const Rgb> table) override { black_bodies.assign(table.begin(), table.end()); }
  Status add_portal(const shading::Portal& portal) override {
    if (lights.empty() || lights.back().kind != shading::LightKind::infinite) contract = "portal without its light";
    portals.push_back(portal);
    return {};
  }
  uint32_t begin_object(std::string name) override {
    objects.push_back(std::move(name));
    return static_cast<uint32_t>(objects.size());
  }
  // Only what divides media may have no material.
  void expect_known(const pipeline::MeshInput& mesh) {
    const bool is_interface = mesh.divides_media && !mesh.material.valid();
    if (!is_interface && mesh.material.value >= materials.size()) contract = "mesh before its material";
    for (const uint32_t medium : {mesh.medium_inside, mesh.medium_outside})
      if (mesh.divides_media && medium != pipeline::kNoMedium && medium >= media.size()) contract = "mesh before its media";
    if (mesh.object > objects.size()) contract = "mesh of no object";
  }
  Status add_mesh(const pipeline::MeshInput& mesh) override {
    expect_known(mesh);
    if (mesh.alpha.valid() && mesh.alpha.value >= textures.size()) contract = "mesh before its alpha";
    if (mesh.emission_texture.valid() && mesh.emission_texture.value >= textures.size())
      contract = "mesh before its emission";
    for (const uint32_t index : mesh.indices) {
      if (index >= mesh.positions.size()) contract = "index out of range";
    }
    ++mesh_count, triangle_count += mesh.indices.size() / 3;
    if (!keep_meshes) return {};
    meshes.push_back({mesh,
                      {mesh.positions.begin(), mesh.positions.end()},
                      {mesh.normals.begin(), mesh.normals.end()},
                      {mesh.uvs.begin(), mesh.uvs.end()},
                      {mesh.indices.begin(), mesh.indices.end()}});
    return {};
  }
  Status add_subdivision(const pipeline::SubdivisionInput& s) override {
    expect_known(s.cage);
    if (s.displacement.valid() && s.displacement.value >= textures.size()) contract = "cage before its displacement";
    if (const auto made = pipeline::make_cage(s); !made) return made.error();
    cages.push_back({s,
                     {s.cage.positions.begin(), s.cage.positions.end()},
                     {s.cage.uvs.begin(), s.cage.uvs.end()},
                     {s.cage.indices.begin(), s.cage.indices.end()},
                     {s.corner_counts.begin(), s.corner_counts.end()},
                     {s.uv_indices.begin(), s.uv_indices.end()},
                     {s.holes.begin(), s.holes.end()},
                     {s.sharp_edges.begin(), s.sharp_edges.end()},
                     {s.sharp_vertices.begin(), s.sharp_vertices.end()}});
    return {};
  }
  Status add_instance(uint32_t object, const Affine3& world_from_object) override {
    if (object == 0 || object > objects.size()) contract = "instance of no object";
    instances.emplace_back(object, world_from_object);
    return {};
  }
  Status add_moving_instance(uint32_t object, const Affine3& start, const Affine3& end) override {
    if (object == 0 || object > objects.size()) contract = "instance of no object";
    moving.push_back({object, start, end});
    return {};
  }
  Status set_camera_end(const Affine3& world_from_camera) override {
    if (settings_count == 0) contract = "the camera's end before its settings";
    camera_ends.push_back(world_from_camera);
    return {};
  }
  void set_settings(const pipeline::SceneSettings& given) override { settings = given, ++settings_count; }
  Status finish() override {
    ++finish_count;
    return {};
  }
};

}  // namespace spillway::tools
