#pragma once

// Where importers and generators put a scene. One implementation: ScenePacker, which writes a store.
//
// Threads: one caller. Memory: add_mesh may be called with views of memory that is reused afterwards.
// Fails: any call may return an error (disk, invalid geometry); the store is then never committed.

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "cache/base/result.h"
#include "cache/facetex_writer.h"
#include "cache/record_stream.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

// One triangle mesh in the space of its object. Arrays are checked: NaN or infinite vertices and indices out of range are
// errors that name `name`; triangles of zero area are dropped and counted.
struct TriangleFace {
  uint32_t face = 0;              // of the mesh's face textures
  uint8_t corner[3] = {0, 1, 2};  // which of the face's corners (cache/face_layout.h) the triangle's are
  bool is_whole = false;          // the face is this triangle
  uint32_t fourth_vertex = 0;     // of a quad: its other corner
};

struct MeshInput {
  std::string name;                      // "models/Mesh001.ply" or "scene.pbrt:41:1", for messages and info
  std::span<const Float3> positions;
  std::span<const Float3> normals;       // empty, or one a position
  std::span<const Float2> uvs;           // empty, or one a position
  std::span<const uint32_t> indices;     // three a triangle
  std::span<const TriangleFace> faces;   // empty, or one a triangle: for materials with face textures
  MaterialId material;
  TextureId alpha;                       // none: opaque
  bool flip_normals = false;
  uint32_t object = 0;                   // 0: the world, else from begin_object
  bool emits = false;                    // in an object: at each of its instances
  Rgb emission{0, 0, 0};
  bool emits_two_sided = false;
  TextureId emission_texture;            // an image that multiplies the emission; none: it is the same everywhere
  bool emission_is_mean = false;         // the emission is what it comes to where texels have their mean luminance
  bool divides_media = false;            // rays that cross it change their medium; without a material it does nothing else
  uint32_t medium_inside = kNoMedium, medium_outside = kNoMedium;  // from add_medium; outside: where the normal points
};

// Numbers in the order of their coming; finished before they are handed on.
using SampleStream = cache::RecordStream<float>;

// Samples of a volume: a grid of a file, or given here.
struct VolumeInput {
  std::string name;                // for messages
  std::filesystem::path file;      // .vdb or .nvdb; empty: samples are given
  std::string grid;                // of the file
  // What is given: samples x fastest, from lattice point (0, 0, 0) on; channels of a sample together.
  std::array<int32_t, 3> counts{0, 0, 0};
  uint32_t channels = 1;           // 3: a colour
  std::shared_ptr<const SampleStream> samples = nullptr;
  Affine3 medium_from_lattice{};
};

struct MediumInput {
  std::string name;
  Medium medium;                   // without its transforms
  Affine3 world_from_medium;
};

// A goniometric light or a projection. Its radiance multiplies the texels; with is_power it is what they come to when
// integrated over all directions.
struct ImageLightInput {
  std::string name;      // for messages
  shading::Light light;  // without its place in the table of images
  ImageId image;
  Float3 axis[3];     // see shading::LightImage
  float tangent = 0;  // projection: of half the field of view of the image's shorter axis
  bool is_power = false;
};

// How the texels of a face texture are to be understood.
struct TexelCurve {
  cache::FaceTexEncoding kind = cache::FaceTexEncoding::linear;
  float gamma = 1;
  auto operator<=>(const TexelCurve&) const = default;
};

// ---- Catmull-Clark cages ----

// What becomes of faces at the cage's boundary: have no surface; its edges are creases; and its corners are sharp, too.
enum class BoundaryRule : uint32_t { none, edges, edges_and_corners };

// Where face-varying values are interpolated linearly, from nowhere to everywhere.
enum class UvRule : uint32_t { none, corners_only, corners_plus1, corners_plus2, boundaries, all };

// 0 is smooth, 10 and more is sharp for ever; between, each level of subdivision takes one away.
struct SharpEdge {
  uint32_t vertices[2];
  float sharpness;
};
struct SharpVertex {
  uint32_t vertex;
  float sharpness;
};

// A cage and its limit surface (Catmull and Clark 1978; creases: DeRose et al. 1998), which is diced at finish(), when
// cameras and instances are known: no edge longer than PackOptions::dice says, pieces of an edge in powers of two.
// Checked besides what MeshInput says: faces of at least three different corners, two faces at most at an edge, which
// they pass in opposite directions, one fan of faces at a vertex, sharpness of edges that exist. Normals are the limit
// surface's, outside where corners are seen counterclockwise; flip_normals turns them, and the side that emits.
struct SubdivisionInput {
  MeshInput cage;                           // indices: the corners of all faces; no normals; uvs: see uv_indices
  std::span<const uint32_t> corner_counts;  // one a face
  std::span<const uint32_t> uv_indices;     // of cage.uvs, one a corner; empty: uvs are one a position
  std::span<const SharpEdge> sharp_edges;   // of an edge named twice the last counts
  std::span<const SharpVertex> sharp_vertices;
  std::span<const uint32_t> holes;          // faces that shape the surface and are left out
  BoundaryRule boundary = BoundaryRule::edges_and_corners;
  UvRule uv_rule = UvRule::corners_plus1;
  // Moves points along the normal by the texture's (first) value times the scale, in units of the object.
  TextureId displacement;                   // none: not displaced
  float displacement_scale = 1;
};

// As RenderSettings::camera_medium: the scene does not say it. Packing looks for it (find_camera_medium.h), and says what
// it found in the report's notes.
inline constexpr uint32_t kMediumUnsaid = UINT32_MAX;

class SceneSink {
 public:
  virtual ~SceneSink() = default;

  virtual Result<ImageId> add_image(const std::filesystem::path& file, cache::TexelEncoding encoding) = 0;
  // A .ptx file, or a texture of a .facetex file: the one of that name, or its only one. The texels of a .ptx file are
  // understood by `encoding`, floats always as linear.
  virtual Result<FaceTextureId> add_face_texture(const std::filesystem::path& file, TexelCurve encoding,
                                                 const std::string& name) {
    (void)encoding, (void)name;
    return error("{}: face textures are not taken here", file.string());
  }
  // A face texture made face by face: add_face for each, in order, before anything else is said of face textures.
  virtual Result<FaceTextureId> begin_face_texture(const cache::FaceTexFormat& format, cache::FaceTextureShape texture) {
    (void)format;
    return error("{}: face textures are not taken here", texture.name);
  }
  virtual Status add_face(std::span<const std::byte> texels) {
    (void)texels;
    return error("face textures are not taken here");
  }
  // The same of several; sinks may use all threads.
  virtual Status add_faces(std::span<const std::vector<std::byte>> faces) {
    for (const std::vector<std::byte>& face : faces) SPILLWAY_TRY(add_face(face));
    return {};
  }
  virtual Result<TextureId> add_texture(const TextureNode& node) = 0;
  virtual Result<MaterialId> add_material(const Material& material, std::string name) = 0;
  virtual Status add_light(const shading::Light& light) = 0;  // point, spot, distant, infinite
  // An infinite light with image 1, and that image; one a scene.
  virtual Status add_environment(const shading::Light& light, ImageId image) = 0;
  virtual Status add_image_light(const ImageLightInput& light);
  // Sinks that have no use for media refuse them.
  virtual Result<uint32_t> add_volume(const VolumeInput& volume);
  // For a VolumeInput's samples. Here: in memory.
  virtual Result<std::shared_ptr<SampleStream>> make_sample_stream();
  virtual Result<uint32_t> add_medium(const MediumInput& medium);
  virtual void set_black_bodies(std::span<const Rgb> /*table*/) {}  // kBlackBodyEntries; where a medium has a temperature
  // Of the infinite light that was added last, whatever it says of the light itself; one a scene.
  virtual Status add_portal(const shading::Portal& portal) = 0;
  virtual uint32_t begin_object(std::string name) = 0;        // a prototype; its meshes name it
  virtual Status add_mesh(const MeshInput& mesh) = 0;
  virtual Status add_subdivision(const SubdivisionInput& subdivision);
  virtual Status add_instance(uint32_t object, const Affine3& world_from_object) = 0;
  // Moves from the first place to the second: between the times of MotionSettings.
  virtual Status add_moving_instance(uint32_t object, const Affine3& start, const Affine3& end);
  virtual void set_settings(const SceneSettings& settings) = 0;  // camera, filter, film, render
  // The camera moves from where the settings have it to here. After set_settings.
  virtual Status set_camera_end(const Affine3& world_from_camera);
  // One camera a frame, from `first_frame` on, of the resolution of the settings' camera: what `render --frames` follows.
  // Without a path there is one frame, of the settings' camera. A path's cameras stand still
  // while the shutter is open; sinks that have no use for one leave it.
  virtual void set_camera_path(uint32_t first_frame, std::span<const shading::Camera> cameras);
  // Everything said: pack, and commit the store. Nothing may follow.
  virtual Status finish() = 0;
};

// Samples that are at hand, as a stream of the sink's.
inline Result<std::shared_ptr<SampleStream>> to_sample_stream(SceneSink& sink, std::span<const float> samples) {
  SPILLWAY_ASSIGN(std::shared_ptr<SampleStream> stream, sink.make_sample_stream());
  SPILLWAY_TRY(stream->append(samples));
  SPILLWAY_TRY(stream->finish());
  return stream;
}

// Sinks that have no use for these refuse them.
inline Result<uint32_t> SceneSink::add_volume(const VolumeInput& volume) {
  return error("{}: volumes are not possible here", volume.name);
}
inline Result<std::shared_ptr<SampleStream>> SceneSink::make_sample_stream() {
  return std::make_shared<SampleStream>(cache::StreamOptions{
      .what = "samples of a volume", .tag = MemoryTag::pack, .purpose = cache::IoPurpose::pack});
}
inline Result<uint32_t> SceneSink::add_medium(const MediumInput& medium) {
  return error("{}: media are not possible here", medium.name);
}
inline Status SceneSink::add_image_light(const ImageLightInput& light) {
  return error("{}: lights with images are not possible here", light.name);
}
inline Status SceneSink::add_subdivision(const SubdivisionInput& subdivision) {
  return error("{}: subdivided cages are not possible here", subdivision.cage.name);
}
inline Status SceneSink::add_moving_instance(uint32_t object, const Affine3& /*start*/, const Affine3& /*end*/) {
  return error("object {}: instances that move are not possible here", object);
}
inline Status SceneSink::set_camera_end(const Affine3& /*world_from_camera*/) {
  return error("a camera that moves is not possible here");
}
inline void SceneSink::set_camera_path(uint32_t /*first_frame*/, std::span<const shading::Camera> /*cameras*/) {}

}  // namespace spillway::pipeline
