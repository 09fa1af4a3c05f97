#include "tools/city/pbrt_sink.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>

namespace spillway::tools::city {
namespace {

namespace fs = std::filesystem;
using pipeline::MaterialKind;

std::string rgb(std::string_view name, Rgb c) { return fmt::format(" \"rgb {}\" [ {} {} {} ]", name, c.r, c.g, c.b); }
std::string number(std::string_view name, float value) { return fmt::format(" \"float {}\" [ {} ]", name, value); }

std::string roughness(const pipeline::Material& m) {
  std::string text = number("uroughness", m.u_roughness.constant.r) + number("vroughness", m.v_roughness.constant.r);
  if (m.remap_roughness == 0) text += " \"bool remaproughness\" false";
  return text;
}

// A colour, or the texture that has its place.
std::string reflectance(const pipeline::Material& m) {
  const pipeline::Param& p = m.reflectance;
  return p.texture == TextureId::kNone ? rgb("reflectance", p.constant)
                                       : fmt::format(" \"texture reflectance\" \"paint{}\"", p.texture);
}

// Of the kinds that the palette has.
std::string parameters(const pipeline::Material& m) {
  switch (m.kind) {
    case MaterialKind::conductor:
      return " \"string type\" \"conductor\"" + reflectance(m) + roughness(m);
    case MaterialKind::coated_diffuse:
      return " \"string type\" \"coateddiffuse\"" + reflectance(m) + roughness(m) + number("eta", m.eta);
    case MaterialKind::diffuse_transmission:
      return " \"string type\" \"diffusetransmission\"" + rgb("reflectance", m.reflectance.constant) +
             rgb("transmittance", m.transmittance.constant);
    default:
      return " \"string type\" \"diffuse\"" + reflectance(m);
  }
}

bool is_textured(std::initializer_list<const pipeline::Param*> parameters) {
  return std::any_of(parameters.begin(), parameters.end(),
                     [](const auto* p) { return p->texture != TextureId::kNone; });
}

// What parameters() would leave out; nothing of what cities are made of.
Status check_written(const pipeline::Material& m, const std::string& name) {
  const bool known = m.kind == MaterialKind::diffuse || m.kind == MaterialKind::coated_diffuse ||
                     m.kind == MaterialKind::diffuse_transmission ||
                     (m.kind == MaterialKind::conductor && m.uses_reflectance);
  if (!known) return error("material {}: its kind is not written as pbrt text", name);
  if (is_textured({&m.u_roughness, &m.v_roughness, &m.transmittance}) ||
      (m.kind == MaterialKind::diffuse_transmission && is_textured({&m.reflectance})))
    return error("material {}: only textures of a diffuse, coated or metal reflectance are written as pbrt text", name);
  if (m.displacement != TextureId::kNone || m.normal_map != TextureId::kNone)
    return error("material {}: bump and normal maps are not written as pbrt text", name);
  return {};
}

Status check_written(const pipeline::MeshInput& mesh) {
  if (mesh.alpha.value != TextureId::kNone) return error("{}: masks are not written as pbrt text", mesh.name);
  if (mesh.flip_normals) return error("{}: reversed normals are not written as pbrt text", mesh.name);
  if (mesh.emits && mesh.emits_two_sided)
    return error("{}: light of both sides is not written as pbrt text", mesh.name);
  if (mesh.divides_media && mesh.material.valid())
    return error("{}: media at surfaces are not written as pbrt text", mesh.name);
  return {};
}

Status check_written(const pipeline::SubdivisionInput& s) {
  if (!s.sharp_vertices.empty() || s.displacement.value != TextureId::kNone || !s.cage.uvs.empty() ||
      s.boundary != pipeline::BoundaryRule::edges_and_corners)
    return error("{}: sharp vertices, displacement, uvs and other rules of cages are not written as pbrt text",
                 s.cage.name);
  return {};
}

void close_descriptor(int descriptor) { close(descriptor); }

// pbrt takes a matrix column by column.
std::string columns(const Affine3& a) {
  std::string text;
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row)
      text += fmt::format("{} ", row < 3 ? a.m[row][column] : column == 3 ? 1.0f : 0.0f);
  return text;
}

template <class T>
void put(std::vector<std::byte>& bytes, const T& value) {
  const auto* first = reinterpret_cast<const std::byte*>(&value);
  bytes.insert(bytes.end(), first, first + sizeof value);
}

size_t face_count(const pipeline::MeshInput& mesh) { return mesh.faces.back().face + size_t{1}; }

// Faces as quads; of one that is a triangle the last corner is there twice.
void put_faces(std::vector<std::byte>& bytes, const pipeline::MeshInput& mesh) {
  for (size_t t = 0; t < mesh.faces.size(); ++t) {
    const pipeline::TriangleFace& face = mesh.faces[t];
    if (t > 0 && mesh.faces[t - 1].face == face.face) continue;
    put(bytes, uint8_t{4});
    for (size_t k = 0; k < 3; ++k) put(bytes, mesh.indices[3 * t + k]);
    put(bytes, face.fourth_vertex);
    put(bytes, face.face);
  }
}

std::string ply_header(const pipeline::MeshInput& mesh) {
  std::string text = fmt::format("ply\nformat binary_little_endian 1.0\nelement vertex {}\n", mesh.positions.size());
  text += "property float x\nproperty float y\nproperty float z\n";
  if (!mesh.normals.empty()) text += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.uvs.empty()) text += "property float u\nproperty float v\n";
  text += fmt::format("element face {}\nproperty list uchar int vertex_indices\n",
                      mesh.faces.empty() ? mesh.indices.size() / 3 : face_count(mesh));
  return text + (mesh.faces.empty() ? "" : "property int face_indices\n") + "end_header\n";
}

std::vector<std::byte> ply_bytes(const pipeline::MeshInput& mesh) {
  const std::string header = ply_header(mesh);
  std::vector<std::byte> bytes(header.size());
  std::memcpy(bytes.data(), header.data(), header.size());
  bytes.reserve(header.size() + mesh.positions.size() * 32 + mesh.indices.size() / 3 * 13);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    put(bytes, mesh.positions[i]);
    if (!mesh.normals.empty()) put(bytes, mesh.normals[i]);
    if (!mesh.uvs.empty()) put(bytes, mesh.uvs[i]);
  }
  if (!mesh.faces.empty()) {
    put_faces(bytes, mesh);
    return bytes;
  }
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    put(bytes, uint8_t{3});
    for (size_t k = 0; k < 3; ++k) put(bytes, mesh.indices[i + k]);
  }
  return bytes;
}

std::string settings_text(const pipeline::SceneSettings& s) {
  const Affine3& w = s.camera.world_from_camera;
  const Float3 x{w.m[0][0], w.m[1][0], w.m[2][0]}, y{w.m[0][1], w.m[1][1], w.m[2][1]},
      z{w.m[0][2], w.m[1][2], w.m[2][2]};
  std::string text = dot(cross(x, y), z) < 0 ? "Scale -1 1 1\nLookAt " : "LookAt ";
  for (int row = 0; row < 3; ++row) text += fmt::format("{} ", w.m[row][3]);
  text += " ";
  for (int row = 0; row < 3; ++row)
    text += fmt::format("{} ", static_cast<double>(w.m[row][3]) + 100 * static_cast<double>(w.m[row][2]));
  text += " ";
  for (int row = 0; row < 3; ++row) text += fmt::format("{} ", w.m[row][1]);
  const double tangent = std::min(s.camera.tan_half_fov_x, s.camera.tan_half_fov_y);
  text += fmt::format("\nCamera \"perspective\" \"float fov\" [ {} ]\n", std::atan(tangent) * 360 / M_PI);
  text += fmt::format(
      "Film \"rgb\" \"integer xresolution\" [ {} ] \"integer yresolution\" [ {} ] \"string filename\" \"city.exr\"\n",
      s.camera.resolution_x_px, s.camera.resolution_y_px);
  text += fmt::format("Sampler \"sobol\" \"integer pixelsamples\" [ {} ]\n", s.render.samples_per_pixel);
  return text + fmt::format("Integrator \"path\" \"integer maxdepth\" [ {} ]\n", s.render.max_depth);
}

}  // namespace

Result<std::unique_ptr<PbrtSink>> PbrtSink::create(const fs::path& folder, const std::string& main_name) {
  std::error_code code;
  fs::create_directories(folder / "geometry", code);
  if (!fs::is_directory(folder / "geometry", code))
    return error("{}: cannot be made a directory; name another folder", (folder / "geometry").string());
  fs::remove(folder / (main_name + ".pbrt"), code);
  std::unique_ptr<PbrtSink> sink(new PbrtSink());
  sink->folder_ = folder, sink->main_name_ = main_name;
  for (const auto& [text, name] :
       {std::pair{&sink->geometry_, "geometry.pbrt"}, {&sink->instances_, "instances.pbrt"}}) {
    SPILLWAY_ASSIGN(cache::WriteFile file, cache::WriteFile::create(folder / name, cache::IoPurpose::scene));
    text->file = std::make_unique<cache::WriteFile>(std::move(file));
  }
  return sink;
}

Error PbrtSink::with_progress(const Error& problem) const {
  return error("{}; {} MiB of the scene had been written", problem.message, written_bytes_ >> 20);
}

Status PbrtSink::append(Text& text, const std::string& line) {
  constexpr size_t kPiece = 1 << 20;
  text.pending += line;
  if (text.pending.size() < kPiece) return {};
  const Status written = text.file->append(std::as_bytes(std::span(text.pending)));
  if (!written) return with_progress(written.error());
  written_bytes_ += text.pending.size();
  text.pending.clear();
  return {};
}

Status PbrtSink::close(Text& text) {
  SPILLWAY_TRY(text.file->append(std::as_bytes(std::span(text.pending))));
  written_bytes_ += text.pending.size();
  return text.file->commit();
}

Status PbrtSink::write_whole(const std::string& name, const std::string& text) {
  SPILLWAY_ASSIGN(cache::WriteFile file, cache::WriteFile::create(folder_ / name, cache::IoPurpose::scene));
  SPILLWAY_TRY(file.append(std::as_bytes(std::span(text))));
  written_bytes_ += text.size();
  return file.commit();
}

std::string PbrtSink::in_folder(const fs::path& file) const {
  std::error_code code;
  const fs::path relative = fs::relative(file, folder_, code);
  return code || relative.empty() ? fs::absolute(file).string() : relative.string();
}

Result<uint32_t> PbrtSink::add_volume(const pipeline::VolumeInput& volume) {
  if (volume.file.empty()) return error("{}: only grids of files are written as pbrt text", volume.name);
  volumes_.emplace_back(in_folder(volume.file), volume.grid);
  return static_cast<uint32_t>(volumes_.size() - 1);
}

Result<uint32_t> PbrtSink::add_medium(const pipeline::MediumInput& input) {
  const pipeline::Medium& m = input.medium;
  const Affine3 identity;
  if (m.kind != pipeline::MediumKind::grid || m.glow_kind != pipeline::GlowKind::none ||
      std::memcmp(&input.world_from_medium, &identity, sizeof identity) != 0)
    return error("medium {}: only grids that neither glow nor are moved are written as pbrt text", input.name);
  const auto& [file, grid] = volumes_[m.density_volume];
  media_ += fmt::format(
      "MakeNamedMedium \"{}\" \"string type\" \"openvdb\" \"string filename\" \"{}\" \"string densityname\" \"{}\"{}{}{}\n",
      input.name, file, grid, rgb("sigma_a", m.sigma_a), rgb("sigma_s", m.sigma_s), number("g", m.g));
  medium_names_.push_back(input.name);
  return static_cast<uint32_t>(medium_names_.size() - 1);
}

std::string PbrtSink::medium_name(uint32_t medium) const {
  return medium == pipeline::kNoMedium ? "" : medium_names_[medium];
}

Result<ImageId> PbrtSink::add_image(const fs::path& file, cache::TexelEncoding) {
  images_.push_back(in_folder(file));
  return ImageId{static_cast<uint32_t>(images_.size() - 1)};
}

Result<TextureId> PbrtSink::add_texture(const pipeline::TextureNode& node) {
  if (node.kind != pipeline::TextureKind::face) return error("only face textures are written as pbrt text");
  const Painted& paint = face_textures_[node.image];
  materials_ +=
      fmt::format("Texture \"paint{}\" \"spectrum\" \"ptex\" \"string filename\" \"{}\" \"string texture\" \"{}\"\n",
                  texture_count_, paint.file, paint.name);
  return TextureId{texture_count_++};
}

Result<FaceTextureId> PbrtSink::begin_face_texture(const cache::FaceTexFormat& format,
                                                   cache::FaceTextureShape texture) {
  constexpr uint64_t kContainerBytes = 256 << 20;
  if (container_ && container_->written_bytes() >= kContainerBytes) {
    SPILLWAY_TRY(container_->finish());
    container_.reset();
  }
  if (!container_) {
    std::error_code code;
    fs::create_directories(folder_ / "textures", code);
    const std::string name = fmt::format("textures/paint{:03}.facetex", container_count_++);
    SPILLWAY_ASSIGN(container_, cache::FaceTexWriter::create(folder_ / name, format, cache::IoPurpose::scene));
  }
  face_textures_.push_back({fmt::format("textures/paint{:03}.facetex", container_count_ - 1), texture.name});
  SPILLWAY_TRY(container_->begin_texture(std::move(texture)));
  return FaceTextureId{static_cast<uint32_t>(face_textures_.size() - 1)};
}

Result<MaterialId> PbrtSink::add_material(const pipeline::Material& material, std::string name) {
  SPILLWAY_TRY(check_written(material, name));
  materials_ += fmt::format("MakeNamedMaterial \"{}\"{}\n", name, parameters(material));
  material_names_.push_back(std::move(name));
  return MaterialId{static_cast<uint32_t>(material_names_.size() - 1)};
}

Status PbrtSink::add_light(const shading::Light& light) {
  if (light.kind != shading::LightKind::distant) return error("only distant lights are written as pbrt text");
  const Float3 from = light.edge1 * -1.0f;
  lights_ += fmt::format("LightSource \"distant\"{} \"point3 from\" [ {} {} {} ] \"point3 to\" [ 0 0 0 ]\n",
                         rgb("L", light.radiance), from.x, from.y, from.z);
  return {};
}

Status PbrtSink::add_environment(const shading::Light&, ImageId image) {
  lights_ += fmt::format("LightSource \"infinite\" \"string filename\" \"{}\"\n", images_[image.value]);
  return {};
}

uint32_t PbrtSink::begin_object(std::string name) {
  objects_.push_back({std::move(name), {}});
  return static_cast<uint32_t>(objects_.size());
}

Status PbrtSink::write_ply(const std::string& name, const pipeline::MeshInput& mesh) {
  const std::vector<std::byte> bytes = ply_bytes(mesh);
  const std::string path = (folder_ / name).string();
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return error("{}: cannot be written: {}", path, std::strerror(errno));
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
  const int problem = errno;
  const bool closed = std::fclose(file) == 0;
  if (!written || !closed) return error("{}: cannot be written: {}", path, std::strerror(written ? errno : problem));
  written_bytes_ += bytes.size();
  return {};
}

// Tens of thousands of files are synced at once, before the main file makes a scene of them.
Status PbrtSink::sync_folder() const {
  const int folder = open(folder_.c_str(), O_RDONLY | O_DIRECTORY);
  const bool synced = folder >= 0 && syncfs(folder) == 0;
  const int problem = errno;
  if (folder >= 0) close_descriptor(folder);
  if (!synced) return error("{}: cannot be synced: {}", folder_.string(), std::strerror(problem));
  return {};
}

Status PbrtSink::add_mesh(const pipeline::MeshInput& mesh) {
  SPILLWAY_TRY(check_written(mesh));
  if (mesh.divides_media) return add_hull(mesh);
  const std::string name = "geometry/" + mesh.name + ".ply";
  const Status written = write_ply(name, mesh);
  if (!written) return with_progress(written.error());
  return add_shape(mesh, fmt::format("Shape \"plymesh\" \"string filename\" \"{}\"\n", name));
}

// Where a medium begins, and nothing else.
Status PbrtSink::add_hull(const pipeline::MeshInput& mesh) {
  if (mesh.object != 0) return error("{}: media of objects are not written as pbrt text", mesh.name);
  hulls_ += fmt::format("AttributeBegin\nMediumInterface \"{}\" \"{}\"\nMaterial \"interface\"\n",
                        medium_name(mesh.medium_inside), medium_name(mesh.medium_outside));
  hulls_ += "Shape \"trianglemesh\" \"point3 P\" [";
  for (const Float3 p : mesh.positions) hulls_ += fmt::format(" {} {} {}", p.x, p.y, p.z);
  hulls_ += fmt::format(" ]\n  \"integer indices\" [ {} ]\nAttributeEnd\n", fmt::join(mesh.indices, " "));
  return {};
}

Status PbrtSink::add_subdivision(const pipeline::SubdivisionInput& s) {
  SPILLWAY_TRY(check_written(s.cage));
  SPILLWAY_TRY(check_written(s));
  std::string text = "Shape \"subdivmesh\" \"point3 P\" [";
  for (const Float3 p : s.cage.positions) text += fmt::format(" {} {} {}", p.x, p.y, p.z);
  text += fmt::format(" ]\n  \"integer indices\" [ {} ]", fmt::join(s.cage.indices, " "));
  if (!s.sharp_edges.empty()) {
    text += "\n  \"integer creaseindices\" [";
    for (const pipeline::SharpEdge& e : s.sharp_edges) text += fmt::format(" {} {}", e.vertices[0], e.vertices[1]);
    text += " ] \"float creasesharpness\" [";
    for (const pipeline::SharpEdge& e : s.sharp_edges) text += fmt::format(" {}", e.sharpness);
    text += " ]";
  }
  if (!s.holes.empty()) text += fmt::format("\n  \"integer holeindices\" [ {} ]", fmt::join(s.holes, " "));
  return add_shape(s.cage, text + "\n");
}

Status PbrtSink::add_shape(const pipeline::MeshInput& mesh, const std::string& shape) {
  std::string text = fmt::format("NamedMaterial \"{}\"\n{}", material_names_[mesh.material.value], shape);
  if (mesh.emits)
    text =
        fmt::format("AttributeBegin\nAreaLightSource \"diffuse\"{}\n{}AttributeEnd\n", rgb("L", mesh.emission), text);
  if (mesh.object == 0) return append(geometry_, text);
  objects_[mesh.object - 1].text += text;
  return {};
}

Status PbrtSink::add_instance(uint32_t object, const Affine3& world_from_object) {
  return append(instances_, fmt::format("AttributeBegin\nTransform [ {}]\nObjectInstance \"{}\"\nAttributeEnd\n",
                                        columns(world_from_object), objects_[object - 1].name));
}

Status PbrtSink::finish() {
  SPILLWAY_TRY(close(geometry_));
  SPILLWAY_TRY(close(instances_));
  if (container_) SPILLWAY_TRY(container_->finish());
  std::string objects;
  for (const Object& object : objects_)
    objects += fmt::format("ObjectBegin \"{}\"\n{}ObjectEnd\n", object.name, object.text);
  SPILLWAY_TRY(write_whole("objects.pbrt", objects));
  SPILLWAY_TRY(write_whole("materials.pbrt", materials_));
  SPILLWAY_TRY(sync_folder());
  for (size_t i = 0; i < cameras_.size(); ++i) {
    pipeline::SceneSettings settings = settings_;
    settings.camera = cameras_[i];
    SPILLWAY_TRY(write_main(fmt::format("{}.{:04}.pbrt", main_name_, first_frame_ + i), settings));
  }
  return write_main(main_name_ + ".pbrt", settings_);
}

Status PbrtSink::write_main(const std::string& name, const pipeline::SceneSettings& settings) {
  std::string main = media_;  // in the world's space
  if (const uint32_t around = settings.render.camera_medium; around != pipeline::kNoMedium)
    main += fmt::format("MediumInterface \"{0}\" \"{0}\"\n", medium_name(around));
  main += settings_text(settings) + "\nWorldBegin\n" + lights_ + "Include \"materials.pbrt\"\n";
  if (!objects_.empty()) main += "Include \"objects.pbrt\"\n";
  main += "Include \"geometry.pbrt\"\nInclude \"instances.pbrt\"\n" + hulls_;
  return write_whole(name, main);
}

}  // namespace spillway::tools::city
