#include "pipeline/pack/scene_packer.h"

#include <algorithm>
#include <cmath>

#include "pipeline/evaluate_texture.h"
#include "pipeline/light_validation.h"
#include "pipeline/pack/make_motion.h"
#include "pipeline/pack/spool_mesh.h"
#include "pipeline/pack/store_directory.h"
#include "pipeline/scene_validation.h"
#include "pipeline/store.h"
#include "shading/bsdf.h"

namespace spillway::pipeline {

namespace fs = std::filesystem;

Result<std::unique_ptr<ScenePacker>> ScenePacker::create(const fs::path& store_directory, PackOptions options) {
  if (options.max_triangles_per_page == 0 || options.max_triangles_per_page > cache::kMaxTrianglesPerPage)
    return error("{} triangles a page; 1 to {} are possible", options.max_triangles_per_page,
                 cache::kMaxTrianglesPerPage);
  if (options.max_faces_per_attribute_block == 0 ||
      options.max_faces_per_attribute_block > cache::kMaxFacesPerAttributeBlock)
    return error("{} faces a block of attributes; 1 to {} are possible", options.max_faces_per_attribute_block,
                 cache::kMaxFacesPerAttributeBlock);
  SPILLWAY_TRY(check_dice_options(options.dice));
  SPILLWAY_TRY(check_store_directory(store_directory));
  std::unique_ptr<ScenePacker> packer(new ScenePacker());
  packer->directory_ = store_directory;
  packer->options_ = std::move(options);
  const fs::path& scratch = packer->options_.scratch;
  SPILLWAY_ASSIGN(packer->scratch_, cache::Scratch::create(scratch.empty() ? store_directory : scratch));
  SPILLWAY_ASSIGN(MeshSpool spool, MeshSpool::create(*packer->scratch_));
  packer->spool_ = std::make_unique<MeshSpool>(std::move(spool));
  packer->face_textures_ = std::make_unique<FaceTexturePacker>(store_directory / kTexturesDirectory,
                                                               packer->options_.max_face_container_bytes,
                                                               packer->options_.face_texture_codec,
                                                               packer->options_.face_tile_log2);
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
  if (light.image != 0) return failed(error("{}: an infinite light with an image is an environment", where));
  if (shading::throws_image(light)) return failed(error("{}: throws an image, and has none", where));
  lights_.push_back(light);
  return {};
}

Status ScenePacker::add_environment(const shading::Light& light, ImageId image) {
  SPILLWAY_TRY(state_);
  const std::string where = fmt::format("light {}", lights_.size());
  SPILLWAY_TRY(failed(check_light(light, where)));
  if (light.image == 0 || image.value >= images_.size()) return failed(error("{}: has no image", where));
  if (environment_image_.valid()) return failed(error("{}: is the second infinite light with an image; one is possible", where));
  lights_.push_back(light);
  environment_image_ = image;
  return {};
}

Status ScenePacker::add_image_light(const ImageLightInput& input) {
  SPILLWAY_TRY(state_);
  ImageLightInput light = input;
  light.light.image = static_cast<uint32_t>(image_lights_.size()) + 1;
  SPILLWAY_TRY(failed(check_light(light.light, light.name)));
  const bool is_projection = light.light.kind == shading::LightKind::projection;
  if (!shading::throws_image(light.light) || light.image.value >= images_.size())
    return failed(error("{}: throws no image", light.name));
  if (is_projection != (light.tangent > 0) || !std::isfinite(light.tangent))
    return failed(error("{}: throws its image on {} at distance 1", light.name, light.tangent));
  lights_.push_back(light.light);
  image_lights_.push_back(std::move(light));
  return {};
}

Result<uint32_t> ScenePacker::add_volume(const VolumeInput& volume) {
  SPILLWAY_TRY(state_);
  auto added = media_.add_volume(volume);
  if (!added) return fail<uint32_t>(added.error());
  if (!volume.file.empty()) add_source_file(volume.file);
  return added;
}

Result<std::shared_ptr<SampleStream>> ScenePacker::make_sample_stream() {
  constexpr uint64_t kBytes = 1 << 20;  // held, and of a block
  return std::make_shared<SampleStream>(cache::StreamOptions{.what = "samples of a volume",
                                                             .tag = MemoryTag::pack,
                                                             .purpose = cache::IoPurpose::pack,
                                                             .memory_limit_bytes = kBytes,
                                                             .block_bytes = kBytes,
                                                             .scratch = scratch_.get()});
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
  const uint32_t texture = mesh.emission_texture.value;
  if (mesh.emits && mesh.emission_texture.valid() &&
      (texture >= textures_.size() || !is_image_by_uv(textures_[texture])))
    return error("{}: emits by texture {} of {}, which is no image", mesh.name, texture, textures_.size());
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

// Gives what only divides media the material of its kind.
Status ScenePacker::name_material(MeshInput& mesh) {
  if (!mesh.divides_media || mesh.material.valid()) return {};
  SPILLWAY_ASSIGN(mesh.material, interface_material());
  mesh.alpha = {}, mesh.faces = {};
  return {};
}

Status ScenePacker::add_mesh(const MeshInput& given) {
  SPILLWAY_TRY(state_);
  MeshInput mesh = given;
  SPILLWAY_TRY(failed(check_mesh(mesh)));
  SPILLWAY_TRY(name_material(mesh));
  const std::vector<uint32_t> face_textures = face_textures_->size() == 0 ? std::vector<uint32_t>{} : face_textures_of(mesh);
  if (face_textures.empty()) mesh.faces = {};
  if (!face_textures.empty()) SPILLWAY_TRY(failed(check_faces(mesh, face_textures)));
  auto spooled = spool_mesh(mesh, *spool_, options_.max_faces_per_attribute_block, degenerate_count_);
  if (!spooled) return failed(spooled.error());
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

Status ScenePacker::add_subdivision(const SubdivisionInput& given) {
  SPILLWAY_TRY(state_);
  SPILLWAY_TRY(failed(check_mesh(given.cage)));
  SubdivisionInput subdivision = given;
  SPILLWAY_TRY(name_material(subdivision.cage));
  SPILLWAY_TRY(failed(check_displacement(subdivision)));
  // Its triangles have no corners that an image could be spread over by itself.
  if (subdivision.cage.emits && subdivision.cage.emission_texture.valid() && subdivision.cage.uvs.empty())
    return failed(error("{}: emits by an image, and has no uvs to place it by; give it \"point2 uv\"",
                        subdivision.cage.name));
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
  for (const shading::Camera& camera : cameras) camera_path_.push_back({first_frame++, kNoMedium, camera});
}

}  // namespace spillway::pipeline
