#pragma once

// What the fuzzers run and the suite runs over their corpus: bytes of a stranger's, through a reader, in a folder that
// holds a few small files and is gone at the end of the process.
//
// Nothing outside that folder is opened: each '/' of a scene's text is made '_', so that no name leads out of it.
// Returns what is wrong: a broken promise to the sink or the caller, or nothing. Crashes are for the caller to see.

#include <cctype>
#include <cmath>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "tests/support/fuzz_folder.h"
#include "tests/tools/recording_sink.h"
#include "tools/import/import_pbrt.h"
#include "tools/import/ply.h"

namespace spillway::tools {

// With the files that scenes may name.
inline const test::FuzzFiles& scene_folder() {
  static const test::FuzzFiles& folder = []() -> const test::FuzzFiles& {
    const test::FuzzFiles& files = test::fuzz_folder();
    files.write("part.pbrt", "Shape \"disk\" \"float phimax\" 1\n");
    files.write("again.pbrt", "Include \"again.pbrt\"\n");
    files.write("twice.pbrt", "Include \"part.pbrt\" Include \"part.pbrt\"\n");
    files.write("lamp.spd", "# nm, W\n400 1\n700 2\n");
    files.write("mesh.ply",
                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
                "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
    return files;
  }();
  return folder;
}

// Keeps no mesh, and is full after kMostTriangles, so that time goes into the reader.
class FuzzSink : public RecordingSink {
 public:
  static constexpr uint64_t kMostTriangles = 20000;
  FuzzSink() { keep_meshes = false; }
  Result<TextureId> add_texture(const pipeline::TextureNode& node) override {
    expect_finite("a texture", node.value);
    expect_finite("a texture", node.uv_scale);
    expect_finite("a texture", node.uv_offset);
    expect_finite("a texture", {&node.texture_from_world.m[0][0], 12});
    return RecordingSink::add_texture(node);
  }
  Result<MaterialId> add_material(const pipeline::Material& m, std::string name) override {
    for (const pipeline::Param* p :
         {&m.reflectance, &m.transmittance, &m.u_roughness, &m.v_roughness, &m.base_u_roughness, &m.base_v_roughness,
          &m.conductor_eta, &m.conductor_k, &m.mix_amount})
      if (!is_finite(p->constant)) contract = "a material is not finite";
    expect_finite("a material", {&m.eta, 1});
    return RecordingSink::add_material(m, std::move(name));
  }
  Status add_light(const shading::Light& light) override {
    const bool finite =
        is_finite(light.radiance) && is_finite(light.position) && is_finite(light.edge1) && is_finite(light.edge2);
    if (!finite) contract = "a light is not finite";
    if (light.kind == shading::LightKind::spot || light.kind == shading::LightKind::distant) {
      if (std::fabs(length(light.edge1) - 1) > 1e-3f) contract = "the axis of a light is no unit vector";
    }
    return RecordingSink::add_light(light);
  }
  void set_settings(const pipeline::SceneSettings& given) override {
    const shading::Camera& c = given.camera;
    expect_finite("the camera", {&c.world_from_camera.m[0][0], 12});
    const float numbers[] = {c.tan_half_fov_x, c.tan_half_fov_y, c.screen_center_x, c.screen_center_y,
                             c.lens_radius,    c.focal_distance, c.shutter_open,    c.shutter_close};
    expect_finite("the camera", numbers);
    const float others[] = {given.filter.radius_px.x, given.filter.radius_px.y, given.filter.a, given.filter.b,
                            given.film.exposure_scale};
    expect_finite("the film", others);
    RecordingSink::set_settings(given);
  }
  Status add_mesh(const pipeline::MeshInput& mesh) override {
    if (mesh.indices.size() % 3 != 0) contract = "indices are not three a triangle";
    if (!mesh.normals.empty() && mesh.normals.size() != mesh.positions.size())
      contract = "normals are not one a vertex";
    if (!mesh.uvs.empty() && mesh.uvs.size() != mesh.positions.size()) contract = "uvs are not one a vertex";
    SPILLWAY_TRY(RecordingSink::add_mesh(mesh));
    if (triangle_count > kMostTriangles) return error("the disk is full");
    return {};
  }

 private:
  void expect_finite(const char* what, std::span<const float> values) {
    for (const float value : values)
      if (!std::isfinite(value)) contract = std::string(what) + " is not finite";
  }
};

// `folder/file:line:column: what`, or what is wrong with a whole file.
inline bool names_its_place(std::string_view message, std::string_view folder) {
  if (!message.starts_with(folder)) return false;
  message.remove_prefix(folder.size());
  for (const char* whole : {"no WorldBegin", "gzip"})
    if (message.find(whole) != std::string_view::npos) return true;
  for (size_t at = message.find(':'); at != std::string_view::npos; at = message.find(':', at + 1)) {
    if (at + 1 < message.size() && std::isdigit(static_cast<unsigned char>(message[at + 1])) != 0) return true;
  }
  return false;
}

// A text that begins with "#lenient" is imported so.
inline std::string fault_of_pbrt(std::string_view bytes) {
  std::string text(bytes);
  for (char& c : text) c = c == '/' ? '_' : c;
  const std::filesystem::path scene = scene_folder().write("scene.pbrt", text);
  FuzzSink sink;
  ImportReport report;
  ImportOptions options;
  options.lenient = text.starts_with("#lenient");
  options.most_diced_bytes = 1 << 20;
  const Status status = import_pbrt(scene, sink, options, report);
  if (!sink.contract.empty()) return sink.contract;
  if (!status && !names_its_place(status.error().message, scene_folder().path().string()))
    return "an error without a place: " + status.error().message;
  if (status && sink.settings_count != 1) return "a scene without settings";
  if (sink.finish_count != 0) return "finish() is the caller's";
  return {};
}

// Bytes that begin as gzip does are a .ply.gz.
inline std::string fault_of_ply(std::string_view bytes) {
  const bool is_packed = bytes.starts_with("\x1f\x8b");
  const Result<PlyMesh> mesh = read_ply(test::fuzz_folder().write(is_packed ? "some.ply.gz" : "some.ply", bytes));
  if (!mesh) return mesh.error().message.find("some.ply") == std::string::npos ? mesh.error().message : "";
  if (mesh->indices.size() % 3 != 0) return "indices are not three a triangle";
  for (const uint32_t index : mesh->indices)
    if (index >= mesh->positions.size()) return "index out of range";
  if (!mesh->normals.empty() && mesh->normals.size() != mesh->positions.size()) return "normals are not one a vertex";
  if (!mesh->uvs.empty() && mesh->uvs.size() != mesh->positions.size()) return "uvs are not one a vertex";
  // Of n bytes: at most n vertices of 3 bytes, one face of 4 corners a byte never; gzip packs a thousandfold.
  const size_t taken = mesh->positions.capacity() * sizeof(Float3) + mesh->normals.capacity() * sizeof(Float3) +
                       mesh->uvs.capacity() * sizeof(Float2) + mesh->indices.capacity() * sizeof(uint32_t);
  const size_t given = bytes.size() * (is_packed ? 1100 : 1);
  return taken > 64 * given ? "more memory than the file justifies" : "";
}

}  // namespace spillway::tools
