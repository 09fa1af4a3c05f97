#pragma once

// Where importers and generators put a scene. One implementation: ScenePacker, which writes a store.
//
// Threads: one caller. Memory: add_mesh may be called with views of memory that is reused afterwards.
// Fails: any call may return an error (disk, invalid geometry); the store is then never committed.

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "cache/base/result.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

// One triangle mesh in the space of its object. Arrays are checked: NaN or infinite vertices and indices out of range are
// errors that name `name`; triangles of zero area are dropped and counted.
struct MeshInput {
  std::string name;                      // "models/Mesh001.ply" or "scene.pbrt:41:1", for messages and info
  std::span<const Float3> positions;
  std::span<const Float3> normals;       // empty, or one a position
  std::span<const Float2> uvs;           // empty, or one a position
  std::span<const uint32_t> indices;     // three a triangle
  MaterialId material;
  TextureId alpha;                       // none: opaque
  bool flip_normals = false;
  uint32_t object = 0;                   // 0: the world, else from begin_object
  bool emits = false;                    // only in the world
  Rgb emission{0, 0, 0};
  bool emits_two_sided = false;
};

class SceneSink {
 public:
  virtual ~SceneSink() = default;

  virtual Result<ImageId> add_image(const std::filesystem::path& file, cache::TexelEncoding encoding) = 0;
  virtual Result<TextureId> add_texture(const TextureNode& node) = 0;
  virtual Result<MaterialId> add_material(const Material& material, std::string name) = 0;
  virtual Status add_light(const shading::Light& light) = 0;  // point, spot, distant, infinite
  // An infinite light with has_image, and its image; one a scene.
  virtual Status add_environment(const shading::Light& light, ImageId image) = 0;
  virtual uint32_t begin_object(std::string name) = 0;        // a prototype; its meshes name it
  virtual Status add_mesh(const MeshInput& mesh) = 0;
  virtual Status add_instance(uint32_t object, const Affine3& world_from_object) = 0;
  // Moves from the first place to the second, between the times of MotionSettings; sinks that only see still scenes refuse.
  virtual Status add_moving_instance(uint32_t object, const Affine3& start, const Affine3& end);
  virtual void set_settings(const SceneSettings& settings) = 0;  // camera, filter, film, render
  // The camera moves from where the settings have it to here. After set_settings; refused likewise.
  virtual Status set_camera_end(const Affine3& world_from_camera);
  // One camera a frame, from `first_frame` on, of the resolution of the settings' camera: what `render --frames` follows.
  // Without a path there is one frame, of the settings' camera. A path's cameras stand still
  // while the shutter is open; sinks that have no use for one leave it.
  virtual void set_camera_path(uint32_t first_frame, std::span<const shading::Camera> cameras);
  // Everything said: pack, and commit the store. Nothing may follow.
  virtual Status finish() = 0;
};

inline Status SceneSink::add_moving_instance(uint32_t object, const Affine3& /*start*/, const Affine3& /*end*/) {
  return error("instances of object {} cannot move here", object);
}
inline Status SceneSink::set_camera_end(const Affine3& /*world_from_camera*/) {
  return error("the camera cannot move here");
}
inline void SceneSink::set_camera_path(uint32_t /*first_frame*/, std::span<const shading::Camera> /*cameras*/) {}

}  // namespace spillway::pipeline
