// The second half of ScenePacker: what is made of the scene once all of it is known.

#include "pipeline/pack/scene_packer.h"

#include <algorithm>

#include "cache/section_file.h"
#include "pipeline/pack/bake_micromap.h"
#include "pipeline/pack/dice_subdivision.h"
#include "pipeline/pack/find_camera_medium.h"
#include "pipeline/pack/pack_attributes.h"
#include "pipeline/pack/pack_environment.h"
#include "pipeline/pack/pack_image.h"
#include "pipeline/pack/pack_lights.h"
#include "pipeline/pack/pack_page_tree.h"
#include "pipeline/pack/pack_pages.h"
#include "pipeline/pack/spool_mesh.h"
#include "pipeline/pack/store_directory.h"
#include "pipeline/scene_validation.h"
#include "pipeline/shutter.h"
#include "pipeline/source_files.h"
#include "pipeline/store.h"

namespace spillway::pipeline {
namespace {

namespace fs = std::filesystem;

std::string one_line(std::string text) {
  std::replace_if(text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
  return text;
}

}  // namespace

struct ScenePacker::Packed {
  std::vector<cache::ImageInfo> images;
  PackedFaceTextures faces;
  std::vector<AttributeLocation> attributes;
  PackedPages pages;
  ContentChecksums content;
  PackedPageTree tree;
  PackedLights lights;
  std::vector<Rgb> environment;
  PackedLightImages light_images;
  PackedMedia media;
  std::unique_ptr<cache::TextureCache> textures;  // of the images; null without any
};

Status ScenePacker::finish() {
  SPILLWAY_TRY(state_);
  if (!has_settings_) return failed(error("{}: the scene has no camera", directory_.string()));
  SPILLWAY_TRY(failed(check_settings(settings_, "the scene's settings")));
  SPILLWAY_TRY(failed(check_camera_path(camera_path_, settings_, "the scene's camera path")));
  report_.step("import").seconds = seconds_since_creation();
  const Status written = write_store();
  report_.seconds = seconds_since_creation();
  if (!written) {
    remove_output();
    return failed(written);
  }
  finished_ = true;
  state_ = error("{}: is packed; nothing may follow", directory_.string());
  return {};
}

// Numbers follow material, then order of import, so that the attribute file has the order of sorted hits.
Status ScenePacker::number_meshes() {
  std::stable_sort(scene_.meshes.begin(), scene_.meshes.end(),
                   [](const SpooledMesh& a, const SpooledMesh& b) { return a.row.material < b.row.material; });
  uint64_t prim = 0;
  for (uint32_t m = 0; m < scene_.meshes.size(); ++m) {
    SpooledMesh& mesh = scene_.meshes[m];
    if (mesh.row.material == interface_material_.value) mesh.row.flags |= kMeshIsInterface;
    if (prim + mesh.row.face_count >= cache::kLeafBit)
      return error("{}: the scene has more than {} triangles; split it", mesh.name, cache::kLeafBit);
    mesh.row.prim_base = static_cast<uint32_t>(prim);
    for (const MeshChunk& chunk : mesh.chunks) {
      scene_.chunks.push_back({chunk, m, static_cast<uint32_t>(prim)});
      prim += chunk.face_count;
    }
  }
  scene_.prim_count = static_cast<uint32_t>(prim);
  scene_.spool = spool_.get();
  return {};
}

// What stands nowhere has no box; trees have no place for it. Instances that emit come first, behind the world.
void ScenePacker::keep_instances_of_triangles() {
  std::vector<bool> has_triangles(scene_.object_count, false), emits(scene_.object_count, false);
  for (const SpooledMesh& mesh : scene_.meshes) {
    has_triangles[mesh.row.object] = true;
    if (mesh.emits) emits[mesh.row.object] = true;
  }
  std::erase_if(instances_, [&](const cache::Instance& i) { return i.object != 0 && !has_triangles[i.object]; });
  const auto others = std::stable_partition(instances_.begin() + 1, instances_.end(),
                                            [&](const cache::Instance& i) { return emits[i.object]; });
  emitting_instance_count_ = static_cast<size_t>(others - instances_.begin()) - 1;
  std::vector<Motion> motions;  // of those that are left, and of the camera
  const auto keep = [&](uint32_t& motion) {
    if (motion == 0) return;
    motions.push_back(motions_[motion - 1]);
    motion = static_cast<uint32_t>(motions.size());
  };
  keep(settings_.camera.motion);
  for (cache::Instance& instance : instances_) keep(instance.motion);
  motions_ = std::move(motions);
}

// Light trees know one place for each.
Status ScenePacker::check_emitters_stand_still() const {
  for (size_t i = 1; i <= emitting_instance_count_; ++i)
    if (instances_[i].motion != 0)
      return error("an instance of '{}' emits light and moves, which is not possible", object_names_[instances_[i].object - 1]);
  return {};
}

// Images come first: displacements look at them.
Status ScenePacker::dice_cages(const Packed& packed) {
  if (cages_.cages().empty()) return {};
  const PackStepTimer timer(report_, "dice");
  for (const FrameCamera& frame : camera_path_) options_.dice.cameras.push_back(frame.camera);
  if (options_.dice.cameras.empty()) options_.dice.cameras = {settings_.camera};
  if (const uint32_t motion = settings_.camera.motion; motion != 0 && camera_path_.empty())
    for (const float time : {0.5f, 1.0f}) {
      options_.dice.cameras.push_back(settings_.camera);
      options_.dice.cameras.back().world_from_camera = transform_at(motions_[motion - 1], time);
    }
  SPILLWAY_TRY(cages_.seal());
  const Displacement displacement(textures_, packed.images, packed.textures.get());
  const DicedScene diced{cages_, instances_, motions_, object_names_, scene_, *spool_, degenerate_count_, displacement};
  SPILLWAY_ASSIGN(report_.dice, dice_subdivision(diced, options_.dice, options_.max_faces_per_attribute_block));
  cages_ = {};
  return {};
}

// What the tables of the scene take while triangles are packed.
uint64_t ScenePacker::table_bytes() const {
  uint64_t bytes = scene_.chunks.size() * (sizeof(PlacedChunk) + sizeof(MeshChunk) + sizeof(uint32_t)) +
                   scene_.meshes.size() * sizeof(SpooledMesh) + instances_.size() * sizeof(cache::Instance);
  for (const SpooledMesh& mesh : scene_.meshes) bytes += mesh.name.capacity();
  return bytes;
}

// Refused now rather than after minutes of writing. Every triangle takes a quarter of a leaf and a share of a node.
Status ScenePacker::check_disk() const {
  constexpr uint64_t kLeastPageBytes = sizeof(cache::TraceLeaf) / 4 + sizeof(cache::TraceNode) / 32;
  const uint64_t needed = scene_.prim_count * kLeastPageBytes + least_attribute_bytes(scene_.chunks);
  std::error_code code;
  const fs::space_info space = fs::space(directory_, code);
  if (code || space.available >= needed) return {};
  return error("{}: the disk is full: the store needs at least {} bytes and {} are free; free space or name another place",
               directory_.string(), needed, space.available);
}

Status ScenePacker::write_store() {
  Packed packed;
  wrote_output_ = true;
  std::error_code code;
  fs::remove(directory_ / kManifestFile, code);
  if (code) return error("{}: cannot be removed: {}", (directory_ / kManifestFile).string(), code.message());
  remove_temporaries(directory_);

  SPILLWAY_TRY(write_images(packed));
  SPILLWAY_TRY(open_images(packed));
  SPILLWAY_TRY(dice_cages(packed));
  SPILLWAY_TRY(spool_->seal());
  SPILLWAY_TRY(number_meshes());
  keep_instances_of_triangles();
  SPILLWAY_TRY(check_emitters_stand_still());
  SPILLWAY_TRY(find_camera_medium());
  SPILLWAY_TRY(check_disk());
  SPILLWAY_TRY(write_attributes(packed));
  SPILLWAY_TRY(write_pages(packed));
  {
    const PackStepTimer timer(report_, "volumes");
    SPILLWAY_TRY(write_volumes(packed));
  }
  {
    const PackStepTimer timer(report_, "lights");
    SPILLWAY_TRY(write_lights(packed));
  }
  const PackStepTimer timer(report_, "manifest");
  return write_manifest(packed);
}

Status ScenePacker::write_images(Packed& packed) {
  const PackStepTimer timer(report_, "images");
  SPILLWAY_ASSIGN(packed.images,
                  pack_images(images_, directory_ / kTexturesDirectory, options_.memory_limit_bytes));
  SPILLWAY_ASSIGN(packed.faces, face_textures_->finish());
  remove_packed_images(directory_ / kTexturesDirectory, packed.images, packed.faces.containers);
  return {};
}

Status ScenePacker::write_attributes(Packed& packed) {
  const PackStepTimer timer(report_, "attributes");
  SPILLWAY_ASSIGN(auto attributes, cache::WriteFile::create(directory_ / kAttributesFile, cache::IoPurpose::pack));
  SPILLWAY_ASSIGN(packed.attributes, pack_attributes(scene_, options_.max_faces_per_attribute_block,
                                                     options_.memory_limit_bytes, attributes, packed.content.attributes));
  return attributes.commit();
}

Status ScenePacker::write_lights(Packed& packed) {
  if (environment_image_.valid()) {
    const uint32_t image = environment_image_.value;
    SPILLWAY_ASSIGN(packed.environment,
                    pack_environment(image, packed.images[image], *packed.textures, images_[image].file.string()));
  }
  SPILLWAY_TRY(write_light_images(packed));
  const BuildLightTreeOptions tree{.scratch = scratch_.get(), .memory_limit_bytes = options_.memory_limit_bytes / 8};
  SPILLWAY_ASSIGN(packed.lights, pack_lights(scene_, {lights_, packed.environment, packed.light_images.images,
                                                      instances_, emitting_instance_count_, packed.tree.bounds_world,
                                                      tree, textures_, packed.images, packed.textures.get()}));
  return {};
}

Status ScenePacker::write_light_images(Packed& packed) {
  if (image_lights_.empty()) return {};
  std::vector<std::string> names;
  for (const ImageSource& image : images_) names.push_back(image.file.string());
  SPILLWAY_ASSIGN(packed.light_images, pack_light_images(image_lights_, packed.images, names, packed.textures.get()));
  for (const ImageLightInput& image_light : image_lights_)
    for (shading::Light& light : lights_)
      if (shading::throws_image(light) && light.image == image_light.light.image) light = image_light.light;
  return {};
}

Status ScenePacker::open_images(Packed& packed) const {
  if (packed.images.empty()) return {};
  const uint64_t share = options_.memory_limit_bytes / 8;
  const uint64_t beside = cache::TextureCache::bytes_beside_tiles(packed.images, {});
  const cache::TextureCache::Options options{.memory_limit_bytes = share - std::min(share, beside)};
  SPILLWAY_ASSIGN(packed.textures, cache::TextureCache::open(directory_ / kTexturesDirectory, packed.images, options));
  return {};
}

// Where the scene does not say it; of each frame of a path by itself. Nothing is looked for where nothing divides media.
Status ScenePacker::find_camera_medium() {
  uint32_t& medium = settings_.render.camera_medium;
  if (medium != kMediumUnsaid) {
    for (FrameCamera& frame : camera_path_) frame.medium = medium;
    return {};
  }
  medium = kNoMedium;
  if (std::ranges::none_of(scene_.meshes, [](const SpooledMesh& m) { return (m.row.flags & kMeshDividesMedia) != 0; }))
    return {};
  const auto place_of = [](const Affine3& t) { return Float3{t.m[0][3], t.m[1][3], t.m[2][3]}; };
  std::vector<Float3> eyes = {place_of(settings_.camera.world_from_camera)};
  const bool moves = settings_.camera.motion != 0;
  eyes.push_back(moves ? place_of(transform_at(motions_[settings_.camera.motion - 1], 1)) : eyes[0]);
  for (const FrameCamera& frame : camera_path_) eyes.push_back(place_of(frame.camera.world_from_camera));
  SPILLWAY_ASSIGN(const std::vector<uint32_t> media, find_camera_media(scene_, instances_, eyes));
  medium = media[0];
  for (size_t i = 0; i < camera_path_.size(); ++i) camera_path_[i].medium = media[i + 2];
  note_camera_media(media[1]);
  return {};
}

void ScenePacker::note_camera_media(uint32_t at_second_key) {
  const uint32_t medium = settings_.render.camera_medium;
  const auto name_of = [&](uint32_t m) { return m == kNoMedium ? std::string("no medium") : media_.name(m); };
  constexpr const char* kSayIt = "MediumInterface before Camera says otherwise";
  if (medium != kNoMedium)
    report_.notes.push_back(fmt::format("the camera is inside of {}, which the scene does not say: its rays begin there; {}",
                                        media_.name(medium), kSayIt));
  if (at_second_key != medium)
    report_.notes.push_back(fmt::format("the camera moves from {} into {} while its shutter may be open: all of its rays "
                                        "begin in the first; {}",
                                        name_of(medium), name_of(at_second_key), kSayIt));
  const auto elsewhere = std::ranges::count_if(camera_path_, [&](const FrameCamera& f) { return f.medium != medium; });
  if (elsewhere > 0)
    report_.notes.push_back(fmt::format("{} of {} frames have their camera in another medium than {}: the rays of each "
                                        "begin in its own",
                                        elsewhere, camera_path_.size(), name_of(medium)));
}


// As long as any camera may look.
MovingInstances ScenePacker::moving_instances() const {
  const Shutter shutter = shutter_of(settings_);
  MovingInstances moving{motions_, shutter.earliest(), shutter.latest()};
  for (const FrameCamera& frame : camera_path_) {
    const Shutter other = shutter_of(frame.camera, settings_.motion);
    moving.first_time = std::min(moving.first_time, other.earliest());
    moving.last_time = std::max(moving.last_time, other.latest());
  }
  return moving;
}

Status ScenePacker::write_pages(Packed& packed) {
  const uint64_t held = table_bytes() + (packed.textures ? options_.memory_limit_bytes / 8 : 0);
  const PackPagesOptions options{options_.max_triangles_per_page, options_.tree,
                                 options_.memory_limit_bytes - std::min(options_.memory_limit_bytes, held)};
  const BakeMicromap bake = [&](uint32_t texture, const Float2(&uv)[3]) {
    return bake_micromap(uv, texture, textures_, packed.images, packed.textures.get());
  };
  SPILLWAY_ASSIGN(auto file, cache::WriteFile::create(directory_ / kTracePagesFile, cache::IoPurpose::pack));
  SPILLWAY_ASSIGN(packed.pages, pack_pages(scene_, bake, options, file, report_));
  packed.content.trace_pages = packed.pages.content;
  {
    const PackStepTimer timer(report_, "write_pages");
    SPILLWAY_TRY(file.commit());
  }
  const PackStepTimer timer(report_, "page_tree");
  packed.tree = pack_page_tree(packed.pages.bounds, packed.pages.pages, instances_, scene_.object_count,
                               options_.tree, moving_instances());
  return {};
}

double ScenePacker::seconds_since_creation() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - created_).count();
}

// A scene without volumes has no file of them.
Status ScenePacker::write_volumes(Packed& packed) const {
  const fs::path path = directory_ / kVolumesFile;
  std::error_code code;
  fs::remove(path, code);
  if (media_.medium_count() == 0) return {};
  SPILLWAY_ASSIGN(auto bricks, cache::WriteFile::create(path, cache::IoPurpose::pack));
  SPILLWAY_ASSIGN(packed.media, media_.pack(bricks, path, {options_.volume_brick_voxels, options_.memory_limit_bytes}));
  return media_.has_volumes() ? bricks.commit() : Status{};
}

SceneStatistics ScenePacker::statistics(const Packed& packed) const {
  std::vector<uint64_t> triangles(scene_.object_count, 0);
  for (const SpooledMesh& mesh : scene_.meshes) triangles[mesh.row.object] += mesh.row.face_count;
  SceneStatistics statistics;
  statistics.triangle_count = scene_.prim_count;
  for (const cache::Instance& instance : instances_) statistics.instanced_triangle_count += triangles[instance.object];
  statistics.degenerate_dropped_count = degenerate_count_;
  statistics.dark_light_count = dark_light_count_ + packed.lights.dark_count;
  statistics.bounds_world = packed.tree.bounds_world;
  return statistics;
}

std::string ScenePacker::name_lines() const {
  std::string lines;
  const auto add = [&](const char* kind, size_t index, const std::string& name) {
    lines += fmt::format("{} {} {}\n", kind, index, one_line(name));
  };
  for (size_t i = 0; i < scene_.meshes.size(); ++i) add("mesh", i, scene_.meshes[i].name);
  for (size_t i = 0; i < material_names_.size(); ++i) add("material", i, material_names_[i]);
  for (uint32_t i = 0; i < face_textures_->size(); ++i) add("face_texture", i, face_textures_->requirements(i).name);
  for (size_t i = 0; i < object_names_.size(); ++i) add("object", i + 1, object_names_[i]);
  return lines;
}

Status ScenePacker::write_manifest(const Packed& packed) {
  // No padding inside, whose bytes would be anything.
  static_assert(sizeof(SceneSettings) == 240);
  settings_.statistics = statistics(packed);
  report_.triangle_count = scene_.prim_count, report_.instance_count = instances_.size() - 1;
  report_.mesh_count = scene_.meshes.size(), report_.attribute_block_count = packed.attributes.size();
  std::vector<Mesh> meshes;
  for (const SpooledMesh& mesh : scene_.meshes) meshes.push_back(mesh.row);
  const std::string names = name_lines(), sources = source_record(options_.source_files);

  cache::SectionWriter writer(kStoreKind, kStoreVersion);
  const auto add = [&](const char* name, const auto& items) {
    writer.add_view(name, std::as_bytes(std::span(items.data(), items.size())));
  };
  add(section::kMedia, packed.media.media);
  add(section::kBlackBodies, packed.media.black_bodies);
  add(section::kVolumeGrids, packed.media.volumes.grids);
  add(section::kVolumeEntries, packed.media.volumes.entries);
  add(section::kVolumeCells, packed.media.volumes.cell_max);
  add(section::kVolumeBricks, packed.media.volumes.bricks);
  writer.add(section::kSettings, std::as_bytes(std::span(&settings_, 1)));
  add(section::kMeshes, meshes);
  add(section::kMaterials, materials_);
  add(section::kTextures, textures_);
  add(section::kImages, packed.images);
  add(section::kFaceContainers, packed.faces.containers);
  add(section::kFaceTextures, packed.faces.textures);
  add(section::kLights, packed.lights.lights);
  add(section::kLightCdf, packed.lights.cdf);
  add(section::kEmitters, packed.lights.emitters);
  add(section::kEmissions, packed.lights.emissions);
  add(section::kLightNodes, packed.lights.trees.nodes);
  add(section::kLightRoots, packed.lights.trees.roots);
  add(section::kEmitterLeaves, packed.lights.trees.emitter_leaves);
  add(section::kInstanceLeaves, packed.lights.trees.instance_leaves);
  add(section::kPortals, portals_);
  add(section::kEnvironment, packed.environment);
  if (!packed.light_images.images.empty()) {
    add(section::kLightImages, packed.light_images.images);
    add(section::kLightTexels, packed.light_images.texels);
  }
  add(section::kPages, packed.pages.pages);
  add(section::kTreeNodes, packed.tree.nodes);
  add(section::kTreeEntries, packed.tree.entries);
  add(section::kTreeObjects, packed.tree.objects);
  add(section::kInstances, instances_);
  add(section::kMotions, motions_);
  add(section::kAttributes, packed.attributes);
  add(section::kCameraPath, camera_path_);
  writer.add(section::kContent, std::as_bytes(std::span(&packed.content, 1)));
  add(section::kNames, names);
  add(section::kSources, sources);
  const DicingRecord dicing{report_.dice.cage_count, report_.dice.triangle_count, options_.dice.edge_length_px, 0};
  if (dicing.cage_count > 0) writer.add(section::kDicing, std::as_bytes(std::span(&dicing, 1)));
  return writer.write(directory_ / kManifestFile);
}

void ScenePacker::remove_output() {
  if (!wrote_output_) return;
  std::error_code code;
  for (const char* file : {kManifestFile, kTracePagesFile, kAttributesFile, kVolumesFile}) fs::remove(directory_ / file, code);
  remove_packed_images(directory_ / kTexturesDirectory, {}, {});
  wrote_output_ = false;
}

}  // namespace spillway::pipeline
