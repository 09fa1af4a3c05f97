#pragma once

// The scene sink that writes a store.
//
// Owns: the store directory while it packs; scratch files; tables of what was said so far.
// Memory: tag pack. Meshes go to scratch at once and leave a row of some hundred bytes, cages too; finish() holds as many
//         triangles at a time as the limit allows beside those rows (40 bytes each).
// Threads: one caller; finish() works on all threads of the current arena.
// Fails: the first error is final: every later call returns it. A store that is already in the directory stays whole
//        until finish() begins to write; from then on there is no manifest until all else is in place. What a failed
//        packing wrote is removed.
// Order: the store's bytes depend on what was said and in which order alone, not on threads, memory limit or scratch.

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cache/attribute_block.h"
#include "cache/base/memory.h"
#include "cache/file.h"
#include "cache/trace_page.h"
#include "pipeline/pack/build_trees.h"
#include "pipeline/pack/cage_spool.h"
#include "pipeline/pack/dice_rates.h"
#include "pipeline/pack/mesh_spool.h"
#include "pipeline/pack/pack_face_textures.h"
#include "pipeline/pack/pack_images.h"
#include "pipeline/pack/pack_media.h"
#include "pipeline/pack/pack_page_tree.h"
#include "pipeline/pack/pack_report.h"
#include "pipeline/pack/scene_sink.h"
#include "pipeline/scene_validation.h"

namespace spillway::pipeline {

struct PackOptions {
  // Meaning: goes into the manifest.
  std::vector<std::filesystem::path> source_files{};  // what the store is made from, see Store::is_current
  DiceOptions dice{};                               // how finely cages are diced, and for which cameras
  // Performance: pages and blocks differ, pictures do not.
  uint32_t max_triangles_per_page = 65536;          // 1..65536; larger: fewer, longer reads
  BuildOptions tree{};
  uint64_t max_face_container_bytes = 256ull << 20;  // larger: fewer files of face textures
  cache::FaceTexCodec face_texture_codec = cache::FaceTexCodec::lz4;  // zstd: smaller, slower to unpack
  uint32_t face_tile_log2 = cache::kFaceTileLog2;  // of an edge of their tiles; larger: fewer reads of more bytes
  uint32_t max_faces_per_attribute_block = cache::kMaxFacesPerAttributeBlock;  // larger: fewer, longer reads
  int32_t volume_brick_voxels = 32;                 // 8, 16, 32 or 64; larger: fewer, longer reads
  // Performance: the store's bytes do not differ.
  uint64_t memory_limit_bytes = 2ull << 30;         // larger: fewer passes over the spooled meshes
  std::filesystem::path scratch{};                  // empty: the store directory; holds all triangles once
};

class ScenePacker final : public SceneSink {
 public:
  static Result<std::unique_ptr<ScenePacker>> create(const std::filesystem::path& store_directory, PackOptions options);
  ~ScenePacker() override;

  Result<ImageId> add_image(const std::filesystem::path& file, cache::TexelEncoding encoding) override;
  Result<FaceTextureId> add_face_texture(const std::filesystem::path& file, TexelCurve encoding,
                                         const std::string& name) override;
  Result<FaceTextureId> begin_face_texture(const cache::FaceTexFormat& format, cache::FaceTextureShape texture) override;
  Status add_face(std::span<const std::byte> texels) override;
  Status add_faces(std::span<const std::vector<std::byte>> faces) override;
  Result<TextureId> add_texture(const TextureNode& node) override;
  Result<MaterialId> add_material(const Material& material, std::string name) override;
  Status add_light(const shading::Light& light) override;
  Status add_environment(const shading::Light& light, ImageId image) override;
  Status add_image_light(const ImageLightInput& light) override;
  Result<uint32_t> add_volume(const VolumeInput& volume) override;
  Result<std::shared_ptr<SampleStream>> make_sample_stream() override;
  Result<uint32_t> add_medium(const MediumInput& medium) override;
  void set_black_bodies(std::span<const Rgb> table) override { media_.set_black_bodies(table); }
  Status add_portal(const shading::Portal& portal) override;
  uint32_t begin_object(std::string name) override;
  Status add_mesh(const MeshInput& mesh) override;
  Status add_subdivision(const SubdivisionInput& subdivision) override;
  Status add_instance(uint32_t object, const Affine3& world_from_object) override;
  Status add_moving_instance(uint32_t object, const Affine3& start, const Affine3& end) override;
  void set_settings(const SceneSettings& settings) override;
  Status set_camera_end(const Affine3& world_from_camera) override;
  void set_camera_path(uint32_t first_frame, std::span<const shading::Camera> cameras) override;
  Status finish() override;

  // What the steps cost; whole after finish().
  [[nodiscard]] const PackReport& report() const { return report_; }
  // More of PackOptions::source_files, found while importing. Images are added by themselves.
  void add_source_file(const std::filesystem::path& file) { options_.source_files.push_back(file); }

 private:
  struct Packed;  // what finish() has made

  ScenePacker() = default;
  template <class T>
  Result<T> fail(Error problem);
  Status failed(Status status);
  Status check_mesh(const MeshInput& mesh) const;
  Result<MaterialId> interface_material();
  Status name_material(MeshInput& mesh);
  [[nodiscard]] std::vector<uint32_t> face_textures_of(const MeshInput& mesh) const;
  Status check_faces(const MeshInput& mesh, const std::vector<uint32_t>& face_textures) const;
  Status check_object(uint32_t object) const;
  Status add_placed(uint32_t object, const Affine3& world_from_object, const Motion* motion);
  Status write_store();
  Status check_displacement(const SubdivisionInput& subdivision) const;
  Status dice_cages(const Packed& packed);
  Status number_meshes();
  void keep_instances_of_triangles();
  Status check_emitters_stand_still() const;
  [[nodiscard]] MovingInstances moving_instances() const;
  [[nodiscard]] uint64_t table_bytes() const;
  Status check_disk() const;
  [[nodiscard]] double seconds_since_creation() const;
  Status write_images(Packed& packed);
  Status write_attributes(Packed& packed);
  Status write_lights(Packed& packed);
  Status write_light_images(Packed& packed);
  Status open_images(Packed& packed) const;
  Status write_pages(Packed& packed);
  Status write_volumes(Packed& packed) const;
  Status find_camera_medium();
  void note_camera_media(uint32_t at_second_key);
  SceneStatistics statistics(const Packed& packed) const;
  [[nodiscard]] std::string name_lines() const;
  Status write_manifest(const Packed& packed);
  void remove_output();

  std::filesystem::path directory_;
  PackOptions options_;
  std::unique_ptr<cache::Scratch> scratch_;
  std::unique_ptr<MeshSpool> spool_;
  SpooledScene scene_;
  CageSpool cages_;
  SceneSettings settings_;
  std::vector<FrameCamera> camera_path_;
  std::vector<ImageSource> images_;
  std::map<std::pair<std::string, cache::TexelEncoding>, ImageId> image_ids_;
  std::unique_ptr<FaceTexturePacker> face_textures_;
  std::vector<TextureNode> textures_;
  TextureCosts texture_costs_;
  std::vector<Material> materials_;
  std::vector<std::string> material_names_, object_names_;
  SaidMedia media_;
  MaterialId interface_material_;  // of meshes that only divide media
  std::vector<shading::Light> lights_;
  std::vector<ImageLightInput> image_lights_;  // each is in lights_ too
  std::vector<shading::Portal> portals_;
  ImageId environment_image_;
  std::vector<cache::Instance> instances_;
  std::vector<Motion> motions_;
  size_t emitting_instance_count_ = 0;
  uint64_t degenerate_count_ = 0, dark_light_count_ = 0;
  PackReport report_;
  std::chrono::steady_clock::time_point created_ = std::chrono::steady_clock::now();
  Status state_;               // the first error
  bool has_settings_ = false;
  bool wrote_output_ = false;  // files of ours may be in the directory
  bool finished_ = false;
};

}  // namespace spillway::pipeline
