#include "pipeline/pack/scene_packer.h"

#include <algorithm>

#include "cache/section_file.h"
#include "pipeline/evaluate_texture.h"
#include "pipeline/light_validation.h"
#include "pipeline/pack/bake_micromap.h"
#include "pipeline/pack/dice_subdivision.h"
#include "pipeline/pack/make_motion.h"
#include "pipeline/pack/pack_attributes.h"
#include "pipeline/pack/pack_environment.h"
#include "pipeline/pack/pack_image.h"
#include "pipeline/pack/pack_lights.h"
#include "pipeline/pack/pack_page_tree.h"
#include "pipeline/pack/pack_pages.h"
#include "pipeline/pack/spool_mesh.h"
#include "pipeline/shutter.h"
#include "pipeline/source_files.h"
#include "pipeline/store.h"
#include "pipeline/scene_validation.h"
#include "shading/bsdf.h"

namespace spillway::pipeline {
namespace {

namespace fs = std::filesystem;

// Whether this is a name that packing gives, possibly one left by a packing that was killed.
bool is_name_of_ours(const std::string& name) {
  for (const char* ours : {kManifestFile, kTracePagesFile, kAttributesFile, kVolumesFile})
    if (name == ours || (name.starts_with(std::string(ours) + ".") && name.ends_with(".tmp"))) return true;
  return name == kTexturesDirectory;
}

// A directory with things of others in it is probably a mistake, and packing would write among them.
Status check_directory(const fs::path& directory) {
  std::error_code code;
  fs::create_directories(directory, code);
  if (!fs::is_directory(directory, code))
    return error("{}: cannot be made a directory; name another store", directory.string());
  if (fs::exists(directory / kManifestFile, code)) return {};
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, code))
    if (!is_name_of_ours(entry.path().filename().string()))
      return error("{}: holds '{}', which is no part of a store; name a new or empty directory", directory.string(),
                   entry.path().filename().string());
  for (const fs::directory_entry& entry : fs::directory_iterator(directory / kTexturesDirectory, code))
    if (const std::string name = entry.path().filename().string();
        !is_packed_image_name(name) && !is_face_container_name(name))
      return error("{}: is no image of a store; name a new or empty directory for the store", entry.path().string());
  return {};
}

// Leftovers of killed processes.
void remove_temporaries(const fs::path& directory) {
  std::error_code code;
  std::vector<fs::path> leftovers;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory, code)) {
    const std::string name = entry.path().filename().string();
    if (is_name_of_ours(name) && name.ends_with(".tmp")) leftovers.push_back(entry.path());
  }
  for (const fs::path& leftover : leftovers) fs::remove(leftover, code);
}

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
  PackedMedia media;
  std::unique_ptr<cache::TextureCache> textures;  // of the images; null without any
};

// ---- what is said ----

Result<std::unique_ptr<ScenePacker>> ScenePacker::create(const fs::path& store_directory, PackOptions options) {
  if (options.max_triangles_per_page == 0 || options.max_triangles_per_page > cache::kMaxTrianglesPerPage)
    return error("{} triangles a page; 1 to {} are possible", options.max_triangles_per_page,
                 cache::kMaxTrianglesPerPage);
  if (options.max_faces_per_attribute_block == 0 ||
      options.max_faces_per_attribute_block > cache::kMaxFacesPerAttributeBlock)
    return error("{} faces a block of attributes; 1 to {} are possible", options.max_faces_per_attribute_block,
                 cache::kMaxFacesPerAttributeBlock);
  SPILLWAY_TRY(check_dice_options(options.dice));
  SPILLWAY_TRY(check_directory(store_directory));
  std::unique_ptr<ScenePacker> packer(new ScenePacker());
  packer->directory_ = store_directory;
  packer->options_ = std::move(options);
  const fs::path& scratch = packer->options_.scratch;
  SPILLWAY_ASSIGN(packer->scratch_, cache::Scratch::create(scratch.empty() ? store_directory : scratch));
  SPILLWAY_ASSIGN(MeshSpool spool, MeshSpool::create(*packer->scratch_));
  packer->spool_ = std::make_unique<MeshSpool>(std::move(spool));
  packer->face_textures_ = std::make_unique<FaceTexturePacker>(store_directory / kTexturesDirectory,
                                                               packer->options_.max_face_container_bytes,
                                                               packer->options_.face_texture_codec);
  packer->instances_.emplace_back();
  packer->instances_[0] = {};
  return packer;
}

ScenePacker::~ScenePacker() {
  if (!finished_) remove_output();
}

template <class T>
Result<T> ScenePacker::fail(Error problem) {
  if (state_) state_ = problem;
  return problem;
}

Status ScenePacker::failed(Status status) {
  if (!status && state_) state_ = status;
  return status;
}

Result<ImageId> ScenePacker::add_image(const fs::path& file, cache::TexelEncoding encoding) {
  if (!state_) return state_.error();
  std::error_code code;
  const fs::path whole = fs::weakly_canonical(file, code);
  const auto [found, is_new] = image_ids_.try_emplace({(code ? file : whole).string(), encoding},
                                                      ImageId{static_cast<uint32_t>(images_.size())});
  if (!is_new) return found->second;
  if (!fs::is_regular_file(file, code)) {
    image_ids_.erase(found);
    return fail<ImageId>(error("{}: is no image file, or cannot be read", file.string()));
  }
  images_.push_back({file, encoding});
  add_source_file(file);
  return found->second;
}

Result<FaceTextureId> ScenePacker::add_face_texture(const fs::path& file, TexelCurve encoding,
                                                    const std::string& name) {
  if (!state_) return state_.error();
  auto added = face_textures_->add_file(file, encoding, name);
  if (!added) return fail<FaceTextureId>(added.error());
  add_source_file(file);
  return added;
}

Result<FaceTextureId> ScenePacker::begin_face_texture(const cache::FaceTexFormat& format,
                                                      cache::FaceTextureShape texture) {
  if (!state_) return state_.error();
  auto begun = face_textures_->begin(format, std::move(texture));
  if (!begun) return fail<FaceTextureId>(begun.error());
  return begun;
}

Status ScenePacker::add_face(std::span<const std::byte> texels) {
  SPILLWAY_TRY(state_);
  return failed(face_textures_->add_face(texels));
}

Status ScenePacker::add_faces(std::span<const std::vector<std::byte>> faces) {
  SPILLWAY_TRY(state_);
  return failed(face_textures_->add_faces(faces));
}

Result<TextureId> ScenePacker::add_texture(const TextureNode& node) {
  if (!state_) return state_.error();
  const size_t index = textures_.size();
  const std::string item = fmt::format("texture {}", index);
  Status valid = check_texture(node, index, images_.size(), face_textures_->size(), item);
  if (valid) valid = texture_costs_.add(node, item);
  if (!valid) return fail<TextureId>(valid.error());
  textures_.push_back(node);
  return TextureId{static_cast<uint32_t>(index)};
}

Result<MaterialId> ScenePacker::add_material(const Material& material, std::string name) {
  if (!state_) return state_.error();
  const size_t index = materials_.size();
  const Status valid = check_material(material, index, textures_.size(), fmt::format("material '{}'", name));
  if (!valid) return fail<MaterialId>(valid.error());
  if (material.displacement != TextureId::kNone && !face_textures_in(textures_, material.displacement).empty())
    return fail<MaterialId>(error("material '{}': a face texture cannot be its displacement", name));
  materials_.push_back(material);
  materials_.back().coat_internal_reflectance = shading::internal_diffuse_reflectance(material.eta);
  material_names_.push_back(std::move(name));
  return MaterialId{static_cast<uint32_t>(index)};
}

Status ScenePacker::add_light(const shading::Light& light) {
  SPILLWAY_TRY(state_);
  const std::string where = fmt::format("light {}", lights_.size());
  SPILLWAY_TRY(failed(check_light(light, where)));
  if (light.has_image != 0) return failed(error("{}: an infinite light with an image is an environment", where));
  lights_.push_back(light);
  return {};
}

Status ScenePacker::add_environment(const shading::Light& light, ImageId image) {
  SPILLWAY_TRY(state_);
  const std::string where = fmt::format("light {}", lights_.size());
  SPILLWAY_TRY(failed(check_light(light, where)));
  if (light.has_image == 0 || image.value >= images_.size()) return failed(error("{}: has no image", where));
  if (environment_image_.valid()) return failed(error("{}: is the second infinite light with an image; one is possible", where));
  lights_.push_back(light);
  environment_image_ = image;
  return {};
}

Result<uint32_t> ScenePacker::add_volume(const VolumeInput& volume) {
  SPILLWAY_TRY(state_);
  auto added = media_.add_volume(volume);
  if (!added) return fail<uint32_t>(added.error());
  if (!volume.file.empty()) add_source_file(volume.file);
  return added;
}

Result<uint32_t> ScenePacker::add_medium(const MediumInput& medium) {
  SPILLWAY_TRY(state_);
  auto added = media_.add_medium(medium);
  return added ? std::move(added) : fail<uint32_t>(added.error());
}

// Meshes have a material each; this one's is never asked for.
Result<MaterialId> ScenePacker::interface_material() {
  if (interface_material_.valid()) return interface_material_;
  SPILLWAY_ASSIGN(interface_material_, add_material(Material{}, "interface"));
  return interface_material_;
}

Status ScenePacker::add_portal(const shading::Portal& portal) {
  SPILLWAY_TRY(state_);
  const auto infinite = static_cast<uint32_t>(std::count_if(
      lights_.begin(), lights_.end(), [](const shading::Light& l) { return l.kind == shading::LightKind::infinite; }));
  if (infinite == 0 || !portals_.empty())
    return failed(error("a portal needs an infinite light before it, and is the only one of the scene"));
  portals_.push_back(portal);
  portals_.back().light = infinite - 1;
  return failed(check_portal(portals_.back(), infinite, "portal"));
}

uint32_t ScenePacker::begin_object(std::string name) {
  object_names_.push_back(std::move(name));
  return scene_.object_count++;
}

Status ScenePacker::check_mesh(const MeshInput& mesh) const {
  const bool is_interface = mesh.divides_media && !mesh.material.valid();
  if (is_interface && mesh.emits) return error("{}: emits light, but has no material; give it one", mesh.name);
  for (const uint32_t medium : {mesh.medium_inside, mesh.medium_outside})
    if (mesh.divides_media && medium != kNoMedium && medium >= media_.medium_count())
      return error("{}: divides medium {} of {}", mesh.name, medium, media_.medium_count());
  if (!is_interface && mesh.material.value >= materials_.size())
    return error("{}: uses material {} of {}", mesh.name, mesh.material.value, materials_.size());
  if (mesh.alpha.valid() && mesh.alpha.value >= textures_.size())
    return error("{}: uses texture {} of {} as alpha", mesh.name, mesh.alpha.value, textures_.size());
  if (mesh.object >= scene_.object_count)
    return error("{}: is of object {}, but there are {}", mesh.name, mesh.object, scene_.object_count);
  const Rgb l = mesh.emission;
  if (mesh.emits && (!is_finite(l) || l.r < 0 || l.g < 0 || l.b < 0))
    return error("{}: emits ({}, {}, {}); emission must be finite and not negative", mesh.name, l.r, l.g, l.b);
  return {};
}

// Of its material, the parts of that, and its alpha.
std::vector<uint32_t> ScenePacker::face_textures_of(const MeshInput& mesh) const {
  std::vector<uint32_t> found;
  const auto add = [&](uint32_t texture) {
    for (const uint32_t face_texture : face_textures_in(textures_, texture)) found.push_back(face_texture);
  };
  if (mesh.alpha.valid()) add(mesh.alpha.value);
  std::vector<uint32_t> pending{mesh.material.value};
  while (!pending.empty()) {
    const Material& material = materials_[pending.back()];
    pending.pop_back();
    for (const uint32_t texture : face_texture_params(material, textures_)) add(texture);
    if (material.kind == MaterialKind::mix)
      pending.insert(pending.end(), std::begin(material.mix_material), std::end(material.mix_material));
  }
  return found;
}

Status ScenePacker::check_faces(const MeshInput& mesh, const std::vector<uint32_t>& face_textures) const {
  if (mesh.faces.empty())
    return error(
        "{}: its material '{}' uses a face texture, but the shape has no faces: it must be a plymesh or trianglemesh",
        mesh.name, material_names_[mesh.material.value]);
  uint32_t faces = 0;
  bool has_whole = false, has_quads = false;
  for (const TriangleFace& f : mesh.faces)
    faces = std::max(faces, f.face + 1), has_whole = has_whole || f.is_whole, has_quads = has_quads || !f.is_whole;
  for (const uint32_t texture : face_textures) {
    const FaceTexturePacker::Requirements& wanted = face_textures_->requirements(texture);
    const bool wrong_count =
        faces > wanted.face_count || faces == 0 || (faces < wanted.face_count && !wanted.has_subfaces);
    if (wrong_count)
      return error("{}: has {} faces, but its face texture '{}' has {}", mesh.name, faces, wanted.name,
                   wanted.face_count);
    if (wanted.shape == cache::FaceShape::quad ? has_whole : has_quads)
      return error("{}: has {}, but its face texture '{}' is for {}", mesh.name, has_whole ? "triangles" : "quads",
                   wanted.name, wanted.shape == cache::FaceShape::quad ? "quads" : "triangles");
  }
  return {};
}

Status ScenePacker::check_object(uint32_t object) const {
  if (object != 0 && object < scene_.object_count) return {};
  return error("instance {}: is of object {}, but there are 1 to {}", instances_.size(), object, scene_.object_count - 1);
}

Status ScenePacker::add_mesh(const MeshInput& given) {
  SPILLWAY_TRY(state_);
  MeshInput mesh = given;
  SPILLWAY_TRY(failed(check_mesh(mesh)));
  const bool is_interface = mesh.divides_media && !mesh.material.valid();
  if (is_interface) {
    SPILLWAY_ASSIGN(mesh.material, interface_material());
    mesh.alpha = {}, mesh.faces = {};
  }
  const std::vector<uint32_t> face_textures = face_textures_->size() == 0 ? std::vector<uint32_t>{} : face_textures_of(mesh);
  if (face_textures.empty()) mesh.faces = {};
  if (!face_textures.empty()) SPILLWAY_TRY(failed(check_faces(mesh, face_textures)));
  auto spooled = spool_mesh(mesh, *spool_, options_.max_faces_per_attribute_block, degenerate_count_);
  if (!spooled) return failed(spooled.error());
  if (is_interface) spooled->row.flags |= kMeshIsInterface;
  if (mesh.emits) dark_light_count_ += mesh.indices.size() / 3 - (spooled->emits ? spooled->row.face_count : 0);
  if (!spooled->chunks.empty()) scene_.meshes.push_back(std::move(*spooled));
  return {};
}

Status ScenePacker::check_displacement(const SubdivisionInput& subdivision) const {
  const TextureId texture = subdivision.displacement;
  const std::string& name = subdivision.cage.name;
  if (!texture.valid()) return {};
  if (texture.value >= textures_.size())
    return error("{}: is displaced by texture {} of {}", name, texture.value, textures_.size());
  if (subdivision.cage.uvs.empty() && reads_uvs(textures_, texture.value))
    return error("{}: is displaced by a texture of uvs, and has none", name);
  if (!face_textures_in(textures_, texture.value).empty())
    return error("{}: a face texture cannot displace it", name);
  return {};
}

Status ScenePacker::add_subdivision(const SubdivisionInput& subdivision) {
  SPILLWAY_TRY(state_);
  SPILLWAY_TRY(failed(check_mesh(subdivision.cage)));
  if (!subdivision.cage.material.valid())
    return failed(error("{}: a subdivided cage without a material is not possible; give it one", subdivision.cage.name));
  SPILLWAY_TRY(failed(check_displacement(subdivision)));
  if (face_textures_->size() > 0 && !face_textures_of(subdivision.cage).empty())
    return failed(error("{}: a subdivision surface cannot have face textures yet", subdivision.cage.name));
  auto cage = make_cage(subdivision);
  if (!cage) return failed(cage.error());
  return failed(cages_.append(std::move(*cage), *scratch_));
}

Status ScenePacker::add_placed(uint32_t object, const Affine3& world_from_object, const Motion* motion) {
  cache::Instance instance{};
  instance.object = object;
  instance.world_from_object = world_from_object;
  if (!invert(world_from_object, instance.object_from_world))
    return failed(error("instance {} (of '{}'): its transform has no finite inverse", instances_.size(),
                        object_names_[object - 1]));
  if (motion != nullptr) {
    motions_.push_back(*motion);
    instance.motion = static_cast<uint32_t>(motions_.size());
  }
  instances_.push_back(instance);
  return {};
}

Status ScenePacker::add_instance(uint32_t object, const Affine3& world_from_object) {
  SPILLWAY_TRY(state_);
  SPILLWAY_TRY(failed(check_object(object)));
  return add_placed(object, world_from_object, nullptr);
}

Status ScenePacker::add_moving_instance(uint32_t object, const Affine3& start, const Affine3& end) {
  SPILLWAY_TRY(state_);
  SPILLWAY_TRY(failed(check_object(object)));
  const Result<Motion> motion = make_motion(start, end);
  if (!motion)
    return failed(error("instance {} (of '{}'): {}", instances_.size(), object_names_[object - 1], motion.error().message));
  return add_placed(object, start, &*motion);
}

void ScenePacker::set_settings(const SceneSettings& settings) {
  settings_ = settings;
  has_settings_ = true;
}

Status ScenePacker::set_camera_end(const Affine3& world_from_camera) {
  SPILLWAY_TRY(state_);
  const Result<Motion> motion = make_motion(settings_.camera.world_from_camera, world_from_camera);
  if (!motion) return failed(error("the camera: {}", motion.error().message));
  motions_.push_back(*motion);
  settings_.camera.motion = static_cast<uint32_t>(motions_.size());
  return {};
}

void ScenePacker::set_camera_path(uint32_t first_frame, std::span<const shading::Camera> cameras) {
  camera_path_.clear();
  for (const shading::Camera& camera : cameras) camera_path_.push_back({first_frame++, 0, camera});
}

// ---- what is made of it ----

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
  const uint64_t needed = scene_.prim_count * kLeastPageBytes + attribute_bytes(scene_.chunks);
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
  const BuildLightTreeOptions tree{.scratch = scratch_.get(), .memory_limit_bytes = options_.memory_limit_bytes / 8};
  SPILLWAY_ASSIGN(packed.lights, pack_lights(scene_, {lights_, packed.environment, instances_, emitting_instance_count_,
                                                      packed.tree.bounds_world, tree}));
  return {};
}

Status ScenePacker::open_images(Packed& packed) const {
  if (packed.images.empty()) return {};
  const cache::TextureCache::Options options{.memory_limit_bytes = options_.memory_limit_bytes / 8};
  SPILLWAY_ASSIGN(packed.textures, cache::TextureCache::open(directory_ / kTexturesDirectory, packed.images, options));
  return {};
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
