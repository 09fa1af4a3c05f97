#include "pipeline/store_validation.h"

#include <cmath>
#include <cstring>
#include <vector>

#include "pipeline/check_motion.h"
#include "pipeline/light_validation.h"
#include "pipeline/scene_validation.h"

namespace spillway::pipeline {
namespace {

// Each number of a stored inverse is rounded once (2^-24), and the product adds three such; four times that.
constexpr double kInverseTolerance = 0x1p-20;

bool all_finite(std::span<const float> values) {
  for (const float value : values)
    if (!std::isfinite(value)) return false;
  return true;
}

bool is_finite_transform(const Affine3& t) { return all_finite(std::span(&t.m[0][0], 12)); }

// product of the two, against the identity, each entry measured by the magnitudes that went into it
bool are_inverse(const Affine3& a, const Affine3& b) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) {
      double sum = j == 3 ? a.m[i][3] : 0, magnitude = std::fabs(sum);
      for (int k = 0; k < 3; ++k) {
        const double term = static_cast<double>(a.m[i][k]) * b.m[k][j];
        sum += term, magnitude += std::fabs(term);
      }
      if (std::fabs(sum - (i == j ? 1 : 0)) > kInverseTolerance * (magnitude + 1)) return false;
    }
  return true;
}

bool same(const Affine3& a, const Affine3& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

bool is_identity(const Affine3& t) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j)
      if (t.m[i][j] != (i == j ? 1.0f : 0.0f)) return false;
  return true;
}

bool is_texture(uint32_t texture, size_t count) { return texture == TextureId::kNone || texture < count; }

Status validate_media(const StoreTables& t, std::string_view where) {
  bool has_temperature = false;
  for (size_t i = 0; i < t.media.size(); ++i) {
    const Medium& medium = t.media[i];
    SPILLWAY_TRY(check_medium(medium, t.volume_grids.size(), fmt::format("{}: section '{}', item {}", where, section::kMedia, i)));
    if (!is_finite_transform(medium.density_from_world) || !is_finite_transform(medium.glow_from_world))
      return damaged(where, section::kMedia, i, "its transforms are not finite");
    has_temperature = has_temperature || medium.glow_kind == GlowKind::temperature;
  }
  if (t.media.size() > kMaxMedia) return damaged(where, section::kMedia, kMaxMedia, "too many");
  if (t.black_bodies.size() != kBlackBodyEntries && (has_temperature || !t.black_bodies.empty()))
    return damaged(where, section::kBlackBodies, 0, "{} colours instead of {}", t.black_bodies.size(), kBlackBodyEntries);
  const uint32_t camera = t.settings[0].render.camera_medium;
  if (camera != kNoMedium && camera >= t.media.size())
    return damaged(where, section::kSettings, 0, "the camera is in medium {} of {}", camera, t.media.size());
  for (size_t i = 0; i < t.camera_path.size(); ++i)
    if (const uint32_t medium = t.camera_path[i].medium; medium != kNoMedium && medium >= t.media.size())
      return damaged(where, section::kCameraPath, i, "its camera is in medium {} of {}", medium, t.media.size());
  return cache::validate_volume_tables(volume_tables(t), where);
}

Status validate_meshes(const StoreTables& t, std::string_view where) {
  uint64_t next_prim = 0, next_light = 0;
  for (size_t i = 0; i < t.meshes.size(); ++i) {
    const Mesh& mesh = t.meshes[i];
    if (mesh.prim_base != next_prim || mesh.face_count == 0)
      return damaged(where, section::kMeshes, i, "prims {} + {} do not follow {}", mesh.prim_base, mesh.face_count,
                     next_prim);
    if (mesh.material >= t.materials.size() || (i > 0 && mesh.material < t.meshes[i - 1].material))
      return damaged(where, section::kMeshes, i, "material {} is out of range or order", mesh.material);
    if (mesh.object >= t.tree_objects.size())
      return damaged(where, section::kMeshes, i, "object {} of {}", mesh.object, t.tree_objects.size());
    if (!is_texture(mesh.alpha_texture, t.textures.size()))
      return damaged(where, section::kMeshes, i, "alpha texture {} of {}", mesh.alpha_texture, t.textures.size());
    const bool divides = (mesh.flags & kMeshDividesMedia) != 0;
    for (const uint32_t medium : {mesh.medium_inside, mesh.medium_outside})
      if (medium != kNoMedium && (!divides || medium >= t.media.size()))
        return damaged(where, section::kMeshes, i, "medium {} of {}", medium, t.media.size());
    if ((mesh.flags & kMeshIsInterface) != 0 && !divides)
      return damaged(where, section::kMeshes, i, "an interface that divides nothing");
    if ((mesh.flags & ~(kMeshFlipNormals | kMeshHasNormals | kMeshHasUvs | kMeshDividesMedia | kMeshIsInterface)) != 0)
      return damaged(where, section::kMeshes, i, "unknown flags {:#x}", mesh.flags);
    next_prim += mesh.face_count;
    if (mesh.light_base == LightId::kNone) continue;
    if (mesh.light_base != next_light)
      return damaged(where, section::kMeshes, i, "lights from {} do not follow {}", mesh.light_base, next_light);
    next_light += mesh.face_count;
  }
  if (next_prim > PrimId::kNone) return damaged(where, section::kMeshes, t.meshes.size(), "too many prims");
  if (t.emitters.size() != next_light)
    return damaged(where, section::kEmitters, t.emitters.size(), "{} triangles emit, but meshes say {}",
                   t.emitters.size(), next_light);
  return {};
}

Status validate_environment(const StoreTables& t, std::string_view where) {
  const auto size = static_cast<uint64_t>(std::lround(std::sqrt(static_cast<double>(t.environment.size()))));
  if (size * size != t.environment.size() || size > kMaxEnvironmentSize)
    return damaged(where, section::kEnvironment, 0, "{} texels are no square of at most {}", t.environment.size(), kMaxEnvironmentSize);
  for (size_t i = 0; i < t.environment.size(); ++i) {
    const Rgb texel = t.environment[i];
    if (!is_finite(texel) || std::min({texel.r, texel.g, texel.b}) < 0)
      return damaged(where, section::kEnvironment, i, "({}, {}, {}) is negative or not finite", texel.r, texel.g, texel.b);
  }
  const auto lights = std::count_if(t.lights.begin(), t.lights.end(), [](const shading::Light& l) {
    return l.kind == shading::LightKind::infinite && l.image == 1;
  });
  if (lights != (t.environment.empty() ? 0 : 1))
    return damaged(where, section::kLights, 0, "{} have an image, of {} texels", lights, t.environment.size());
  return {};
}

// Locations follow each other without gaps.
Status validate_pages(const StoreTables& t, std::string_view where) {
  uint64_t offset = 0, triangles = 0;
  for (size_t i = 0; i < t.pages.size(); ++i) {
    const cache::PageLocation& page = t.pages[i];
    if (page.offset_bytes != offset || page.size_bytes == 0 || page.size_bytes % 4096 != 0 ||
        page.size_bytes > UINT64_MAX - offset)
      return damaged(where, section::kPages, i, "{} bytes at {} do not follow byte {}", page.size_bytes,
                     page.offset_bytes, offset);
    if (page.triangle_count == 0 || page.triangle_count > cache::kMaxTrianglesPerPage)
      return damaged(where, section::kPages, i, "{} triangles", page.triangle_count);
    if (page.object >= t.tree_objects.size() || (i > 0 && page.object < t.pages[i - 1].object))
      return damaged(where, section::kPages, i, "object {} is out of range or order", page.object);
    offset += page.size_bytes, triangles += page.triangle_count;
  }
  if (triangles != t.settings[0].statistics.triangle_count)
    return damaged(where, section::kPages, t.pages.size(), "{} triangles in all instead of {}", triangles,
                   t.settings[0].statistics.triangle_count);
  return {};
}

Status validate_attributes(const StoreTables& t, std::string_view where) {
  uint64_t offset = 0, next_prim = 0;
  for (size_t i = 0; i < t.attributes.size(); ++i) {
    const AttributeLocation& block = t.attributes[i];
    if (block.offset_bytes != offset || block.size_bytes == 0 || block.size_bytes % 4096 != 0 || block.reserved != 0)
      return damaged(where, section::kAttributes, i, "{} bytes at {} do not follow byte {}", block.size_bytes,
                     block.offset_bytes, offset);
    if (block.first_prim != next_prim || block.prim_count == 0)
      return damaged(where, section::kAttributes, i, "prims {} + {} do not follow {}", block.first_prim,
                     block.prim_count, next_prim);
    offset += block.size_bytes, next_prim += block.prim_count;
  }
  const uint64_t prims = t.meshes.empty() ? 0 : uint64_t{t.meshes.end()[-1].prim_base} + t.meshes.end()[-1].face_count;
  if (next_prim != prims || prims != t.settings[0].statistics.triangle_count)
    return damaged(where, section::kAttributes, t.attributes.size(), "{} prims in all instead of {}", next_prim, prims);
  return {};
}

Status validate_instances(const StoreTables& t, std::string_view where) {
  for (size_t i = 0; i < t.instances.size(); ++i) {
    const cache::Instance& instance = t.instances[i];
    if (!is_finite_transform(instance.world_from_object) || !is_finite_transform(instance.object_from_world) ||
        !are_inverse(instance.world_from_object, instance.object_from_world))
      return damaged(where, section::kInstances, i, "the transforms are not inverse to each other");
    if (instance.object >= t.tree_objects.size() || (instance.object == 0) != (i == 0))
      return damaged(where, section::kInstances, i, "object {}", instance.object);
    if (instance.motion > (i == 0 ? 0 : t.motions.size()) ||
        (instance.motion != 0 && !same(instance.world_from_object, t.motions[instance.motion - 1].key[0])))
      return damaged(where, section::kInstances, i, "moves by motion {}, which is none of its own", instance.motion);
  }
  if (t.instances.empty() || !is_identity(t.instances[0].world_from_object) ||
      !is_identity(t.instances[0].object_from_world))
    return damaged(where, section::kInstances, 0, "is not the world");
  return {};
}

Status validate_motions(const StoreTables& t, std::string_view where) {
  for (size_t i = 0; i < t.motions.size(); ++i)
    if (const Status valid = check_motion(t.motions[i]); !valid)
      return damaged(where, section::kMotions, i, "what has it {}", valid.error().message);
  const shading::Camera& camera = t.settings[0].camera;
  if (camera.motion > t.motions.size() ||
      (camera.motion != 0 && !same(camera.world_from_camera, t.motions[camera.motion - 1].key[0])))
    return damaged(where, section::kSettings, 0, "the camera moves by motion {} of {}", camera.motion, t.motions.size());
  return {};
}

// Every entry hangs in exactly one tree, and in the one it belongs to. Called on trees that validate_page_tree accepts.
class TreeWalk {
 public:
  TreeWalk(const StoreTables& tables, std::string_view where)
      : t_(tables), where_(where), node_seen_(tables.tree_nodes.size()), entry_seen_(tables.tree_entries.size()),
        page_seen_(tables.pages.size()), instance_seen_(tables.instances.size()) {}

  Status walk() {
    for (uint32_t o = 0; o < t_.tree_objects.size(); ++o) SPILLWAY_TRY(visit(t_.tree_objects[o].root, o));
    SPILLWAY_TRY(check_all_seen(entry_seen_, section::kTreeEntries, 0));
    SPILLWAY_TRY(check_all_seen(page_seen_, section::kPages, 0));
    return check_all_seen(instance_seen_, section::kInstances, 1);
  }

 private:
  Status visit(uint32_t reference, uint32_t object) {
    if (reference == cache::kNoChild) return {};
    if ((reference & cache::kLeafBit) != 0) return visit_entry(reference & ~cache::kLeafBit, object);
    SPILLWAY_TRY(see(node_seen_, reference, section::kTreeNodes));
    const cache::TraceNode& node = t_.tree_nodes[reference];
    for (uint32_t c = 0; c < node.child_count; ++c) SPILLWAY_TRY(visit(node.child[c], object));
    return {};
  }

  Status visit_entry(uint32_t index, uint32_t object) {
    SPILLWAY_TRY(see(entry_seen_, index, section::kTreeEntries));
    const cache::PageTreeEntry entry = t_.tree_entries[index];
    if (entry.kind == 0) {
      if (t_.pages[entry.index].object != object)
        return damaged(where_, section::kTreeEntries, index, "page {} is of another object", entry.index);
      return see(page_seen_, entry.index, section::kPages);
    }
    if (object != 0) return damaged(where_, section::kTreeEntries, index, "an instance inside a prototype");
    return see(instance_seen_, entry.index, section::kInstances);
  }

  Status see(std::vector<bool>& seen, uint32_t index, const char* section) {
    if (seen[index]) return damaged(where_, section, index, "is in the page tree twice");
    seen[index] = true;
    return {};
  }

  Status check_all_seen(const std::vector<bool>& seen, const char* section, size_t first) const {
    for (size_t i = first; i < seen.size(); ++i)
      if (!seen[i]) return damaged(where_, section, i, "is not in the page tree");
    return {};
  }

  const StoreTables& t_;
  std::string_view where_;
  std::vector<bool> node_seen_, entry_seen_, page_seen_, instance_seen_;
};

Status validate_tree(const StoreTables& t, std::string_view where) {
  cache::PageTree tree;
  tree.nodes = t.tree_nodes;
  tree.entries = t.tree_entries;
  tree.objects = t.tree_objects;
  tree.instances = t.instances;
  tree.motions = t.motions;
  SPILLWAY_TRY(cache::validate_page_tree(tree, t.pages.size(), where));
  for (size_t o = 0; o < t.tree_objects.size(); ++o) {
    const cache::PageObject& object = t.tree_objects[o];
    const bool finite = is_finite(object.bounds_object.lower) && is_finite(object.bounds_object.upper);
    if (object.root != cache::kNoChild && (!finite || object.bounds_object.empty()))
      return damaged(where, section::kTreeObjects, o, "has no bounds");
  }
  return TreeWalk(t, where).walk();
}

bool is_file_name(const char (&name)[64]) {
  const auto* end = static_cast<const char*>(std::memchr(name, 0, sizeof name));
  const std::string_view text(name, end == nullptr ? 0 : static_cast<size_t>(end - name));
  return !text.empty() && text.find('/') == text.npos && text != "." && text != "..";
}

Status validate_images(const StoreTables& t, std::string_view where) {
  for (size_t i = 0; i < t.images.size(); ++i) {
    const cache::ImageInfo& image = t.images[i];
    if (!is_file_name(image.file_name)) return damaged(where, section::kImages, i, "its file name is none");
    if (image.width == 0 || image.height == 0 || image.channels == 0 || image.channels > 4 || image.levels == 0 ||
        image.levels > 32 || (image.texel_bytes != 1 && image.texel_bytes != 4) ||
        image.encoding > cache::TexelEncoding::srgb || !all_finite(image.mean) || image.not_finite > uint64_t{image.width} * image.height)
      return damaged(where, section::kImages, i, "impossible numbers");
  }
  return {};
}

Status check_file(const std::filesystem::path& path, uint64_t least_bytes) {
  std::error_code code;
  const uint64_t size = std::filesystem::file_size(path, code);
  if (code) return error("{}: is missing from the store: {}; pack the scene again", path.string(), code.message());
  if (size < least_bytes)
    return error("{}: has {} bytes, but the manifest needs {}; it was cut short, pack the scene again", path.string(),
                 size, least_bytes);
  return {};
}

Status validate_face_textures(const StoreTables& t, std::string_view where) {
  for (size_t c = 0; c < t.face_containers.size(); ++c) {
    const cache::FaceContainerInfo& info = t.face_containers[c];
    if (std::memchr(info.file_name, 0, sizeof info.file_name) == nullptr ||
        std::string_view(info.file_name).find('/') != std::string_view::npos)
      return damaged(where, section::kFaceContainers, c, "its file has no name");
    const bool holds_a_tile = info.tile_bytes > 0 && info.tile_bytes <= 16u << 2 * cache::kMostFaceTileLog2;
    if (!holds_a_tile || info.tile_count > (uint64_t{1} << 44) || info.face_count > (uint64_t{1} << 40))
      return damaged(where, section::kFaceContainers, c, "{} tiles of {} bytes for {} faces", info.tile_count,
                     info.tile_bytes, info.face_count);
  }
  for (size_t i = 0; i < t.face_textures.size(); ++i)
    if (t.face_textures[i].container >= t.face_containers.size())
      return damaged(where, section::kFaceTextures, i, "lies in file {} of {}", t.face_textures[i].container,
                     t.face_containers.size());
  return {};
}

}  // namespace

Status validate_tables(const StoreTables& t, std::string_view where) {
  if (t.settings.size() != 1) return damaged(where, section::kSettings, 0, "{} settings", t.settings.size());
  SPILLWAY_TRY(check_settings(t.settings[0], fmt::format("{}: section '{}'", where, section::kSettings)));
  SPILLWAY_TRY(check_camera_path(t.camera_path, t.settings[0], fmt::format("{}: section '{}'", where, section::kCameraPath)));
  if (t.content.size() != 1) return damaged(where, section::kContent, 0, "{} checksums of contents", t.content.size());
  if (t.dicing.size() > 1) return damaged(where, section::kDicing, 1, "{} records of dicing", t.dicing.size());
  SPILLWAY_TRY(validate_images(t, where));
  TextureCosts texture_costs;
  for (size_t i = 0; i < t.textures.size(); ++i) {
    const std::string item = fmt::format("{}: section '{}', item {}", where, section::kTextures, i);
    SPILLWAY_TRY(check_texture(t.textures[i], i, t.images.size(), t.face_textures.size(), item));
    SPILLWAY_TRY(texture_costs.add(t.textures[i], item));
  }
  for (size_t i = 0; i < t.materials.size(); ++i)
    SPILLWAY_TRY(check_material(t.materials[i], i, t.textures.size(),
                                fmt::format("{}: section '{}', item {}", where, section::kMaterials, i)));
  SPILLWAY_TRY(validate_face_textures(t, where));
  SPILLWAY_TRY(validate_meshes(t, where));
  SPILLWAY_TRY(validate_lights(t, where));
  SPILLWAY_TRY(validate_environment(t, where));
  SPILLWAY_TRY(validate_pages(t, where));
  SPILLWAY_TRY(validate_attributes(t, where));
  SPILLWAY_TRY(validate_motions(t, where));
  SPILLWAY_TRY(validate_instances(t, where));
  SPILLWAY_TRY(validate_tree(t, where));
  SPILLWAY_TRY(validate_light_trees(t, where));
  SPILLWAY_TRY(validate_media(t, where));
  const Bounds3& world = t.settings[0].statistics.bounds_world;
  const Bounds3& object = t.tree_objects[0].bounds_object;
  const bool empty = t.tree_objects[0].root == cache::kNoChild;
  if (!empty && !(world.lower == object.lower && world.upper == object.upper))
    return damaged(where, section::kSettings, 0, "the bounds of the scene are not those of its tree");
  if (empty && !world.empty()) return damaged(where, section::kSettings, 0, "an empty scene with bounds");
  return {};
}

Status validate_files(const StoreTables& t, const std::filesystem::path& directory) {
  const uint64_t page_bytes = t.pages.empty() ? 0 : t.pages.end()[-1].offset_bytes + t.pages.end()[-1].size_bytes;
  const uint64_t attribute_bytes =
      t.attributes.empty() ? 0 : t.attributes.end()[-1].offset_bytes + t.attributes.end()[-1].size_bytes;
  SPILLWAY_TRY(check_file(directory / kTracePagesFile, page_bytes));
  SPILLWAY_TRY(check_file(directory / kAttributesFile, attribute_bytes));
  if (!t.volume_bricks.empty()) {
    const cache::VolumeBrickLocation& last = t.volume_bricks.end()[-1];
    SPILLWAY_TRY(check_file(directory / kVolumesFile, last.offset_bytes + last.size_bytes));
  }
  for (const cache::ImageInfo& image : t.images)
    SPILLWAY_TRY(check_file(directory / kTexturesDirectory / image.file_name, 1));
  for (const cache::FaceContainerInfo& container : t.face_containers)
    SPILLWAY_TRY(check_file(directory / kTexturesDirectory / container.file_name, 1));
  return {};
}

}  // namespace spillway::pipeline
