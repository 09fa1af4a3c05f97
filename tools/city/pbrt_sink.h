#pragma once

// A scene sink that writes pbrt-v4's text and binary PLY files, without any extension but cages, .facetex and .vdb files.
//
// Owns: the folder's files: materials.pbrt, objects.pbrt, geometry.pbrt, instances.pbrt, geometry/*.ply,
//       textures/*.facetex, and the main file, which is written last, so that a scene that is half there does not look
//       whole.
// Memory: one mesh's bytes; the text of the objects.
// Threads: one caller.
// Fails: the first error of the disk, with what had been written by then.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cache/file.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::tools::city {

class PbrtSink final : public pipeline::SceneSink {
 public:
  // The main file's name without extension, such as "city".
  static Result<std::unique_ptr<PbrtSink>> create(const std::filesystem::path& folder, const std::string& main_name);

  Result<ImageId> add_image(const std::filesystem::path& file, cache::TexelEncoding encoding) override;
  // Of face textures alone.
  Result<TextureId> add_texture(const pipeline::TextureNode& node) override;
  Result<FaceTextureId> begin_face_texture(const cache::FaceTexFormat& format, cache::FaceTextureShape texture) override;
  Status add_face(std::span<const std::byte> texels) override { return container_->add_face(texels); }
  Status add_faces(std::span<const std::vector<std::byte>> faces) override { return container_->add_faces(faces); }
  Result<MaterialId> add_material(const pipeline::Material& material, std::string name) override;
  Status add_light(const shading::Light& light) override;
  Status add_environment(const shading::Light& light, ImageId image) override;
  Status add_portal(const shading::Portal&) override { return error("portals are not written as pbrt text"); }
  // Of grids of .vdb files, and media of one grid that scatters alike everywhere; before the settings.
  Result<uint32_t> add_volume(const pipeline::VolumeInput& volume) override;
  Result<uint32_t> add_medium(const pipeline::MediumInput& medium) override;
  uint32_t begin_object(std::string name) override;
  Status add_mesh(const pipeline::MeshInput& mesh) override;
  Status add_subdivision(const pipeline::SubdivisionInput& subdivision) override;
  Status add_instance(uint32_t object, const Affine3& world_from_object) override;
  void set_settings(const pipeline::SceneSettings& settings) override { settings_ = settings; }
  // A main file a frame: city.0007.pbrt; city.pbrt is the first.
  void set_camera_path(uint32_t first_frame, std::span<const shading::Camera> cameras) override {
    first_frame_ = first_frame, cameras_.assign(cameras.begin(), cameras.end());
  }
  Status finish() override;

  [[nodiscard]] uint64_t written_bytes() const { return written_bytes_; }

 private:
  // Text that goes to a file in pieces of a MiB.
  struct Text {
    std::string pending;
    std::unique_ptr<cache::WriteFile> file;
  };
  struct Object {
    std::string name, text;
  };

  // Of one texture: where it is.
  struct Painted {
    std::string file, name;
  };

  PbrtSink() = default;
  Status append(Text& text, const std::string& line);
  Status close(Text& text);
  Status add_hull(const pipeline::MeshInput& mesh);
  [[nodiscard]] std::string medium_name(uint32_t medium) const;
  [[nodiscard]] std::string in_folder(const std::filesystem::path& file) const;
  Status add_shape(const pipeline::MeshInput& mesh, const std::string& shape);
  Status write_main(const std::string& name, const pipeline::SceneSettings& settings);
  Status write_whole(const std::string& name, const std::string& text);
  Status write_ply(const std::string& name, const pipeline::MeshInput& mesh);
  [[nodiscard]] Status sync_folder() const;
  [[nodiscard]] Error with_progress(const Error& problem) const;

  std::filesystem::path folder_;
  std::string main_name_, media_, materials_, lights_, hulls_;
  std::vector<std::string> images_, material_names_, medium_names_;
  std::vector<std::pair<std::string, std::string>> volumes_;  // file and grid
  std::vector<Object> objects_;
  std::vector<Painted> face_textures_;
  uint32_t texture_count_ = 0, container_count_ = 0;
  std::unique_ptr<cache::FaceTexWriter> container_;  // the last one
  Text geometry_, instances_;
  pipeline::SceneSettings settings_;
  uint32_t first_frame_ = 1;
  std::vector<shading::Camera> cameras_;
  uint64_t written_bytes_ = 0;
};

}  // namespace spillway::tools::city
