#pragma once

// A packed scene, opened for rendering: the manifest's tables, every reference in them checked.
//
// Owns: the tables, and the distribution of the environment's light. Memory: tag scene; the page tree under page_tree, lights under lights.
// Threads: const after open().
// Fails: open() refuses a directory without manifest, a damaged or inconsistent one, and missing or short files, naming
//        file, section and index. Pages, attribute blocks and images are checked when they are read.
// Format: the sections named in pipeline/scene.h, and `sources`: see pipeline/source_files.h.

#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/trace_page.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

namespace section {
inline constexpr const char* kSources = "sources";  // char: the files that the store was made from
}

// The manifest's contents.
struct StoreTables {
  Buffer<SceneSettings> settings;  // one
  Buffer<Mesh> meshes;
  Buffer<Material> materials;
  Buffer<TextureNode> textures;
  Buffer<cache::ImageInfo> images;
  Buffer<cache::FaceContainerInfo> face_containers;
  Buffer<cache::FaceTextureInfo> face_textures;
  Buffer<shading::Light> lights;
  Buffer<float> light_cdf;
  Buffer<shading::Emitter> emitters;
  Buffer<shading::Emission> emissions;
  Buffer<shading::LightNode> light_nodes;
  Buffer<uint32_t> light_roots, emitter_leaves, instance_leaves;
  Buffer<shading::Portal> portals;
  Buffer<Rgb> environment;
  Buffer<shading::LightImage> light_images;
  Buffer<Rgb> light_texels;
  Buffer<cache::PageLocation> pages;
  Buffer<cache::TraceNode> tree_nodes;
  Buffer<cache::PageTreeEntry> tree_entries;
  Buffer<cache::PageObject> tree_objects;
  Buffer<cache::Instance> instances;
  Buffer<Motion> motions;
  Buffer<AttributeLocation> attributes;
  Buffer<FrameCamera> camera_path;
  Buffer<ContentChecksums> content;  // one
  Buffer<Medium> media;
  Buffer<Rgb> black_bodies;
  Buffer<cache::VolumeGrid> volume_grids;
  Buffer<uint32_t> volume_entries;
  Buffer<float> volume_cells;
  Buffer<cache::VolumeBrickLocation> volume_bricks;
  Buffer<char> sources;
  Buffer<DicingRecord> dicing;  // one, or none
};

[[nodiscard]] inline cache::VolumeTables volume_tables(const StoreTables& t) {
  return {t.volume_grids, t.volume_entries, t.volume_cells, t.volume_bricks};
}

// The sphere around the scene's box by which distant and infinite lights are measured; radius 1 for an empty scene.
struct SceneSphere {
  Float3 center{0, 0, 0};
  float radius = 1;
};
[[nodiscard]] SceneSphere scene_sphere(const Bounds3& bounds_world);

class Store {
 public:
  static Result<Store> open(const std::filesystem::path& directory);

  [[nodiscard]] const std::filesystem::path& directory() const { return directory_; }
  [[nodiscard]] std::filesystem::path trace_pages_path() const { return directory_ / kTracePagesFile; }
  [[nodiscard]] std::filesystem::path attributes_path() const { return directory_ / kAttributesFile; }
  [[nodiscard]] std::filesystem::path volumes_path() const { return directory_ / kVolumesFile; }
  [[nodiscard]] std::filesystem::path textures_path() const { return directory_ / kTexturesDirectory; }

  [[nodiscard]] const SceneSettings& settings() const { return tables_.settings[0]; }
  [[nodiscard]] std::span<const Mesh> meshes() const { return tables_.meshes; }
  [[nodiscard]] std::span<const Material> materials() const { return tables_.materials; }
  [[nodiscard]] std::span<const TextureNode> textures() const { return tables_.textures; }
  [[nodiscard]] std::span<const cache::ImageInfo> images() const { return tables_.images; }
  [[nodiscard]] std::span<const cache::FaceContainerInfo> face_containers() const { return tables_.face_containers; }
  [[nodiscard]] std::span<const cache::FaceTextureInfo> face_textures() const { return tables_.face_textures; }
  [[nodiscard]] std::span<const shading::Light> lights() const { return tables_.lights; }
  [[nodiscard]] std::span<const shading::Emitter> emitters() const { return tables_.emitters; }
  [[nodiscard]] std::span<const shading::Emission> emissions() const { return tables_.emissions; }
  [[nodiscard]] std::span<const shading::Portal> portals() const { return tables_.portals; }
  [[nodiscard]] std::span<const Rgb> environment() const { return tables_.environment; }
  [[nodiscard]] std::span<const shading::LightImage> light_images() const { return tables_.light_images; }
  [[nodiscard]] std::span<const Rgb> light_texels() const { return tables_.light_texels; }
  [[nodiscard]] std::span<const cache::PageLocation> pages() const { return tables_.pages; }
  [[nodiscard]] std::span<const cache::Instance> instances() const { return tables_.instances; }
  [[nodiscard]] std::span<const Motion> motions() const { return tables_.motions; }
  [[nodiscard]] std::span<const AttributeLocation> attributes() const { return tables_.attributes; }
  [[nodiscard]] std::span<const FrameCamera> camera_path() const { return tables_.camera_path; }
  // Of everything a picture can depend on besides settings and cameras: pages, attributes, images by their names, tables.
  [[nodiscard]] uint64_t content_key() const { return content_key_; }

  // Views into this store, which must outlive them.
  [[nodiscard]] cache::PageTree page_tree() const;
  [[nodiscard]] shading::LightTable light_table() const;

  // Null when the scene has no subdivision surfaces.
  [[nodiscard]] const DicingRecord* dicing() const { return tables_.dicing.empty() ? nullptr : tables_.dicing.data(); }

  [[nodiscard]] MediumTables medium_tables() const {
    return {tables_.media, volume_tables(tables_), tables_.black_bodies};
  }

  // prim must be one of the scene's.
  [[nodiscard]] MeshId mesh_of(PrimId prim) const;
  // What the scene calls `kind` ("mesh", "material", "object") number `index`; empty when unknown. Reads all names from the
  // file: they are not kept.
  [[nodiscard]] std::string name_of(std::string_view kind, uint32_t index) const;

  // Whether each of `sources` is among the files that the store was made from, and none of those has changed.
  [[nodiscard]] bool is_current(std::span<const std::filesystem::path> sources) const;

 private:
  Store() = default;
  void build_environment();
  [[nodiscard]] shading::LightTree light_tree() const;

  std::filesystem::path directory_;
  StoreTables tables_;
  uint64_t content_key_ = 0;
  Buffer<float> environment_row_cdf_, environment_texel_cdf_;
};

}  // namespace spillway::pipeline
