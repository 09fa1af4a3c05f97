#include "pipeline/store.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "cache/section_file.h"
#include "pipeline/source_files.h"
#include "pipeline/store_validation.h"

namespace spillway::pipeline {
namespace {

template <class T>
Status read_table(const cache::SectionReader& reader, const char* name, MemoryTag tag, Buffer<T>& table) {
  SPILLWAY_ASSIGN(table, reader.load<T>(name, tag));
  return {};
}

Result<StoreTables> read_tables(const cache::SectionReader& reader) {
  StoreTables t;
  SPILLWAY_TRY(read_table(reader, section::kSettings, MemoryTag::scene, t.settings));
  SPILLWAY_TRY(read_table(reader, section::kMeshes, MemoryTag::scene, t.meshes));
  SPILLWAY_TRY(read_table(reader, section::kMaterials, MemoryTag::scene, t.materials));
  SPILLWAY_TRY(read_table(reader, section::kTextures, MemoryTag::scene, t.textures));
  SPILLWAY_TRY(read_table(reader, section::kImages, MemoryTag::scene, t.images));
  SPILLWAY_TRY(read_table(reader, section::kFaceContainers, MemoryTag::scene, t.face_containers));
  SPILLWAY_TRY(read_table(reader, section::kFaceTextures, MemoryTag::scene, t.face_textures));
  SPILLWAY_TRY(read_table(reader, section::kLights, MemoryTag::lights, t.lights));
  SPILLWAY_TRY(read_table(reader, section::kLightCdf, MemoryTag::lights, t.light_cdf));
  SPILLWAY_TRY(read_table(reader, section::kEmitters, MemoryTag::lights, t.emitters));
  SPILLWAY_TRY(read_table(reader, section::kEmissions, MemoryTag::lights, t.emissions));
  SPILLWAY_TRY(read_table(reader, section::kLightNodes, MemoryTag::lights, t.light_nodes));
  SPILLWAY_TRY(read_table(reader, section::kLightRoots, MemoryTag::lights, t.light_roots));
  SPILLWAY_TRY(read_table(reader, section::kEmitterLeaves, MemoryTag::lights, t.emitter_leaves));
  SPILLWAY_TRY(read_table(reader, section::kInstanceLeaves, MemoryTag::lights, t.instance_leaves));
  SPILLWAY_TRY(read_table(reader, section::kPortals, MemoryTag::lights, t.portals));
  SPILLWAY_TRY(read_table(reader, section::kEnvironment, MemoryTag::lights, t.environment));
  SPILLWAY_TRY(read_table(reader, section::kPages, MemoryTag::scene, t.pages));
  SPILLWAY_TRY(read_table(reader, section::kTreeNodes, MemoryTag::page_tree, t.tree_nodes));
  SPILLWAY_TRY(read_table(reader, section::kTreeEntries, MemoryTag::page_tree, t.tree_entries));
  SPILLWAY_TRY(read_table(reader, section::kTreeObjects, MemoryTag::page_tree, t.tree_objects));
  SPILLWAY_TRY(read_table(reader, section::kInstances, MemoryTag::page_tree, t.instances));
  SPILLWAY_TRY(read_table(reader, section::kMotions, MemoryTag::page_tree, t.motions));
  SPILLWAY_TRY(read_table(reader, section::kAttributes, MemoryTag::scene, t.attributes));
  SPILLWAY_TRY(read_table(reader, section::kCameraPath, MemoryTag::scene, t.camera_path));
  SPILLWAY_TRY(read_table(reader, section::kContent, MemoryTag::scene, t.content));
  SPILLWAY_TRY(read_table(reader, section::kMedia, MemoryTag::scene, t.media));
  SPILLWAY_TRY(read_table(reader, section::kBlackBodies, MemoryTag::scene, t.black_bodies));
  SPILLWAY_TRY(read_table(reader, section::kVolumeGrids, MemoryTag::scene, t.volume_grids));
  SPILLWAY_TRY(read_table(reader, section::kVolumeEntries, MemoryTag::scene, t.volume_entries));
  SPILLWAY_TRY(read_table(reader, section::kVolumeCells, MemoryTag::scene, t.volume_cells));
  SPILLWAY_TRY(read_table(reader, section::kVolumeBricks, MemoryTag::scene, t.volume_bricks));
  SPILLWAY_TRY(read_table(reader, section::kSources, MemoryTag::scene, t.sources));
  if (reader.has(section::kLightImages)) {
    SPILLWAY_TRY(read_table(reader, section::kLightImages, MemoryTag::lights, t.light_images));
    SPILLWAY_TRY(read_table(reader, section::kLightTexels, MemoryTag::lights, t.light_texels));
  }
  if (reader.has(section::kDicing)) SPILLWAY_TRY(read_table(reader, section::kDicing, MemoryTag::scene, t.dicing));
  return t;
}

size_t environment_size(size_t texel_count) { return static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(texel_count)))); }

}  // namespace

SceneSphere scene_sphere(const Bounds3& bounds_world) {
  if (bounds_world.empty()) return {};
  const float radius = length(bounds_world.extent()) * 0.5f;
  return {bounds_world.center(), radius > 0 ? radius : 1};
}

Result<Store> Store::open(const std::filesystem::path& directory) {
  Store store;
  store.directory_ = directory;
  const std::filesystem::path manifest = directory / kManifestFile;
  std::error_code code;
  if (!std::filesystem::exists(manifest, code))
    return error("{}: is no store, or one whose packing did not finish (it has no {}); pack the scene",
                 directory.string(), kManifestFile);
  SPILLWAY_ASSIGN(const cache::SectionReader reader,
                  cache::SectionReader::open(manifest, kStoreKind, kStoreVersion));
  SPILLWAY_ASSIGN(store.tables_, read_tables(reader));
  SPILLWAY_TRY(validate_tables(store.tables_, manifest.string()));
  SPILLWAY_TRY(validate_files(store.tables_, directory));
  store.content_key_ = reader.checksum_without({section::kSettings, section::kCameraPath, section::kSources});
  store.build_environment();
  return store;
}

void Store::build_environment() {
  const size_t size = environment_size(tables_.environment.size());
  if (size == 0) return;
  environment_row_cdf_ = Buffer<float>(MemoryTag::lights, size + 1);
  environment_texel_cdf_ = Buffer<float>(MemoryTag::lights, size * (size + 1));
  shading::build_environment_cdfs(static_cast<uint32_t>(size), tables_.environment, environment_row_cdf_, environment_texel_cdf_);
}

cache::PageTree Store::page_tree() const {
  const Bounds3& bounds = settings().statistics.bounds_world;
  cache::PageTree tree;
  tree.nodes = tables_.tree_nodes;
  tree.entries = tables_.tree_entries;
  tree.objects = tables_.tree_objects;
  tree.instances = tables_.instances;
  tree.motions = tables_.motions;
  tree.scene_extent_world = bounds.empty() ? 0 : std::max(max_abs(bounds.lower), max_abs(bounds.upper));
  return tree;
}

shading::LightTable Store::light_table() const {
  const auto first_infinite =
      std::find_if(tables_.lights.begin(), tables_.lights.end(),
                   [](const shading::Light& light) { return light.kind == shading::LightKind::infinite; });
  shading::LightTable table;
  table.emitters = tables_.emitters, table.emissions = tables_.emissions;
  table.lights = tables_.lights, table.cdf = tables_.light_cdf;
  table.scene_radius_world = scene_sphere(settings().statistics.bounds_world).radius;
  table.first_infinite = static_cast<uint32_t>(first_infinite - tables_.lights.begin());
  table.environment = {static_cast<uint32_t>(environment_size(tables_.environment.size())), tables_.environment,
                       environment_row_cdf_, environment_texel_cdf_};
  table.portals = tables_.portals;
  table.images = {tables_.light_images, tables_.light_texels};
  table.tree = light_tree();
  return table;
}

shading::LightTree Store::light_tree() const {
  // What shading reads of an instance is how cache::Instance begins.
  static_assert(std::is_standard_layout_v<cache::Instance> && std::is_standard_layout_v<shading::LightInstance>);
  static_assert(offsetof(cache::Instance, world_from_object) == offsetof(shading::LightInstance, world_from_object) &&
                offsetof(cache::Instance, object_from_world) == offsetof(shading::LightInstance, object_from_world) &&
                offsetof(cache::Instance, object) == offsetof(shading::LightInstance, object));
  shading::LightTree tree;
  tree.nodes = tables_.light_nodes, tree.roots = tables_.light_roots;
  tree.emitter_leaves = tables_.emitter_leaves, tree.instance_leaves = tables_.instance_leaves;
  tree.instances = {tables_.instances.data(), sizeof(cache::Instance)};
  return tree;
}

MeshId Store::mesh_of(PrimId prim) const {
  const auto after = std::upper_bound(tables_.meshes.begin(), tables_.meshes.end(), prim.value,
                                      [](uint32_t p, const Mesh& mesh) { return p < mesh.prim_base; });
  return MeshId{static_cast<uint32_t>(after - tables_.meshes.begin()) - 1};
}

std::string Store::name_of(std::string_view kind, uint32_t index) const {
  const auto reader = cache::SectionReader::open(directory_ / kManifestFile, kStoreKind, kStoreVersion);
  if (!reader) return {};
  const auto names = reader->load<char>(section::kNames, MemoryTag::scene);
  if (!names) return {};
  const std::string prefix = fmt::format("{} {} ", kind, index);
  std::string_view rest(names->data(), names->size());
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    if (line.starts_with(prefix)) return std::string(line.substr(prefix.size()));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
  }
  return {};
}

bool Store::is_current(std::span<const std::filesystem::path> sources) const {
  return sources_unchanged({tables_.sources.data(), tables_.sources.size()}, sources);
}

}  // namespace spillway::pipeline
