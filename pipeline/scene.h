#pragma once

// The tables of a packed scene: what the store's manifest holds and every stage reads. Plain arrays of plain structs.

#include <cstdint>
#include <string>

#include "cache/base/ids.h"
#include "cache/base/motion.h"
#include "cache/base/vec.h"
#include "cache/texture_cache.h"
#include "pipeline/medium.h"
#include "shading/camera.h"
#include "shading/light.h"
#include "shading/sampler.h"

namespace spillway::pipeline {

// ---- textures: a small graph; nodes come after the nodes they use ----

enum class TextureKind : uint32_t {
  constant,
  image,
  scale,
  mix,
  checkerboard,
  bilerp,
  direction_mix,
  dots,
  face,
  fbm,
  wrinkled,
  windy,
  marble,
};

// How a place becomes the st of a texture, or its place (x, y, z) in solid ones. All but uv start from the point in the
// texture's own space, texture_from_world.
enum class TextureMapping : uint32_t {
  uv,           // st = uv * scale + offset
  spherical,    // s: angle from +z in half turns; t: angle about z, in turns
  cylindrical,  // s: angle about z, in turns; t: z
  planar,       // st = (x, y)
  solid,        // three dimensions
};

struct TextureNode {
  TextureKind kind = TextureKind::constant;
  // constant. image: multiplied onto the texel (pbrt's scale). direction_mix: unit direction in the world. fbm,
  // wrinkled: roughness, octaves. marble: roughness, octaves, scale, variation.
  float value[4] = {0, 0, 0, 1};
  uint32_t image = ImageId::kNone;  // face: a FaceTextureId
  cache::WrapMode wrap = cache::WrapMode::repeat;
  cache::TexelFilter filter = cache::TexelFilter::bilinear;  // face: trilinear, or else a level chosen at random
  uint32_t invert = 0;
  uint32_t is_float = 0;  // image: the mean of red, green and blue stands for all three
  TextureMapping mapping = TextureMapping::uv;
  float uv_scale[2] = {1, 1};
  float uv_offset[2] = {0, 0};
  Affine3 texture_from_world;
  // scale: a, b. mix: a, b, amount. checkerboard: where both cells are even or odd, elsewhere. bilerp: at st 00, 01,
  // 10,
  // 11. direction_mix: where the normal lies along the direction, across it. dots: inside, outside.
  uint32_t child[4] = {TextureId::kNone, TextureId::kNone, TextureId::kNone, TextureId::kNone};
};

// How many children a node of the kind has; they come before it.
[[nodiscard]] constexpr uint32_t child_count(TextureKind kind) {
  switch (kind) {
    case TextureKind::scale:
    case TextureKind::checkerboard:
    case TextureKind::direction_mix:
    case TextureKind::dots:
      return 2;
    case TextureKind::mix: return 3;
    case TextureKind::bilerp: return 4;
    default: return 0;
  }
}

// What an emission may be multiplied by.
[[nodiscard]] constexpr bool is_image_by_uv(const TextureNode& node) {
  return node.kind == TextureKind::image && node.mapping == TextureMapping::uv;
}

// A material parameter: a constant, or the texture node that gives it.
struct Param {
  Rgb constant{0, 0, 0};
  uint32_t texture = TextureId::kNone;
};

// ---- materials ----

enum class MaterialKind : uint32_t {
  diffuse, conductor, dielectric, thin_dielectric, coated_diffuse, coated_conductor, diffuse_transmission, mix,
};

struct Material {
  MaterialKind kind = MaterialKind::diffuse;
  uint32_t remap_roughness = 1;           // alpha = sqrt(roughness)
  Param reflectance;                      // diffuse, coated_diffuse; conductor when uses_reflectance
  Param transmittance;                    // diffuse_transmission
  uint32_t uses_reflectance = 0;          // conductor given by reflectance instead of eta and k
  Param u_roughness, v_roughness;         // of the surface, or of the coat of coated_*
  Param base_u_roughness, base_v_roughness;  // of the conductor below a coat
  Param conductor_eta, conductor_k;
  float eta = 1.5f;                       // dielectric, coat
  float coat_internal_reflectance = 0;    // shading::internal_diffuse_reflectance(eta), set by the packer
  uint32_t displacement = TextureId::kNone;  // bump map, world units along the normal
  uint32_t normal_map = TextureId::kNone;    // tangent space: (n + 1) / 2, z along the normal; never with displacement
  uint32_t mix_material[2] = {MaterialId::kNone, MaterialId::kNone};
  Param mix_amount;                       // 0 takes the first, 1 the second
};

// ---- meshes, numbered by (material, order of import) ----

enum MeshFlag : uint32_t {
  kMeshFlipNormals = 1,   // reverse orientation xor a mirroring transform
  kMeshHasNormals = 2,
  kMeshHasUvs = 4,
  kMeshDividesMedia = 8,  // medium_inside and medium_outside count: rays that cross it change their medium
  kMeshIsInterface = 16,  // it does nothing else: not a surface
};

struct Mesh {
  uint32_t prim_base;   // first PrimId
  uint32_t face_count;
  uint32_t material;
  uint32_t object;      // 0: the world
  uint32_t light_base = LightId::kNone;  // emitter of face 0, when the mesh emits; faces follow
  uint32_t alpha_texture = TextureId::kNone;  // or none: opaque
  uint32_t flags;       // MeshFlag
  uint16_t medium_inside = static_cast<uint16_t>(kNoMedium);  // where the normal does not point
  uint16_t medium_outside = static_cast<uint16_t>(kNoMedium);
};
static_assert(sizeof(Mesh) == 32);

// One line a block of the attribute file, by ascending first_prim.
struct AttributeLocation {
  uint64_t offset_bytes;
  uint32_t size_bytes;
  uint32_t first_prim;
  uint32_t prim_count;
  uint32_t reserved;
};

// ---- lights: shading::Light, and the image of an infinite one ----

inline constexpr uint32_t kMaxEnvironmentSize = 8192;  // texels an edge
inline constexpr uint32_t kMaxLightImageSize = 4096;   // of goniometric lights and projections

// ---- what the scene says about the picture; the command line may override ----

inline constexpr float kLeastExposure = 1e-30f, kMostExposure = 1e30f;  // whose inverses are numbers, too

struct FilmSettings {
  uint32_t crop_x0 = 0, crop_y0 = 0, crop_x1 = 0, crop_y1 = 0;  // pixels, half open; all zero: everything
  float exposure_scale = 1;  // radiance to pixel value (pbrt: imaging ratio)
};

// How a light is chosen for next-event estimation: noise and time differ, the mean does not.
enum class LightSelection : uint32_t {
  tree,     // by power in scenes with few lights, which have no tree
  power,
  uniform,  // among the lights that have a place
};

// How a path gathers light at a vertex. The mean is the same for all; all but the first are there to measure it by.
enum class Estimator : uint32_t {
  mis_power,      // lights and BSDF, weighed by the power heuristic
  mis_balance,    // the same by the balance heuristic
  light,          // lights alone, but for what they cannot sample: mirrors and glass
  light_by_area,  // the same with points spread evenly over the area of a light, wherever it is seen from
  bsdf,           // BSDF alone, but for what it cannot find: points, spots and suns
  hemisphere,     // directions spread evenly over the hemisphere instead
};

// How images are filtered: as each texture says, or all alike.
enum class TextureFilter : uint32_t { of_texture, point, bilinear, trilinear };

// Over what the bound of a medium's density is taken: cells are tight, grids are loose.
enum class MajorantExtent : uint32_t { cell, brick, grid };

struct RenderSettings {
  uint32_t samples_per_pixel = 16;
  uint32_t max_depth = 5;      // bounces, as pbrt counts
  uint32_t seed = 0;
  uint32_t camera_medium = kNoMedium;  // that the camera is in
  shading::SamplerKind sampler = shading::SamplerKind::sobol;
  LightSelection light_selection = LightSelection::tree;
  Estimator estimator = Estimator::mis_power;
  uint32_t roulette = 1;  // 0: paths end at max_depth, or when they carry nothing
  TextureFilter texture_filter = TextureFilter::of_texture;
  MajorantExtent majorants = MajorantExtent::cell;
};

// The times of the two keys of what moves, on the clock of the camera's shutter.
struct MotionSettings {
  float start_time = 0, end_time = 1;
};

struct SceneStatistics {
  uint64_t triangle_count = 0;           // unique, as stored
  uint64_t instanced_triangle_count = 0;  // as seen
  uint64_t degenerate_dropped_count = 0;
  uint64_t dark_light_count = 0;  // lights, and triangles of emitters, that have no area or emit nothing
  Bounds3 bounds_world;
};

struct SceneSettings {
  shading::Camera camera;
  shading::Filter filter;
  FilmSettings film;
  RenderSettings render;
  MotionSettings motion;
  SceneStatistics statistics;
};

// A camera of the path that a shot's frames follow.
struct FrameCamera {
  uint32_t frame = 0;
  uint32_t medium = kNoMedium;  // that the camera is in
  shading::Camera camera;
};
static_assert(sizeof(FrameCamera) == 8 + sizeof(shading::Camera));  // no padding in the store

// Of what the manifest does not hold: the checksums of all parts of a file, chained in their order.
struct ContentChecksums {
  uint64_t trace_pages = 0, attributes = 0;
};

// How the subdivision surfaces of the scene were diced.
struct DicingRecord {
  uint64_t cage_count;      // once for each level of detail
  uint64_t triangle_count;
  float edge_length_px;
  uint32_t reserved;
};

// Files of a store (a directory).
inline constexpr const char* kManifestFile = "manifest.spw";
inline constexpr const char* kTracePagesFile = "pages.trace";
inline constexpr const char* kAttributesFile = "attributes.blocks";
inline constexpr const char* kVolumesFile = "volumes.bricks";
inline constexpr const char* kTexturesDirectory = "textures";
inline constexpr const char* kStoreKind = "SPWSTORE";
inline constexpr uint32_t kStoreVersion = 16;

// Section names of the manifest. Arrays of the struct named.
namespace section {
inline constexpr const char* kSettings = "settings";            // SceneSettings[1]
inline constexpr const char* kMeshes = "meshes";                // Mesh
inline constexpr const char* kMaterials = "materials";          // Material
inline constexpr const char* kTextures = "textures";            // TextureNode
inline constexpr const char* kImages = "images";                // cache::ImageInfo
inline constexpr const char* kFaceContainers = "face_containers";  // cache::FaceContainerInfo
inline constexpr const char* kFaceTextures = "face_textures";  // cache::FaceTextureInfo
inline constexpr const char* kLights = "lights";                // shading::Light
inline constexpr const char* kLightCdf = "light_cdf";           // float
inline constexpr const char* kEmitters = "emitters";            // shading::Emitter
inline constexpr const char* kEmissions = "emissions";          // shading::Emission
inline constexpr const char* kLightNodes = "light_nodes";       // shading::LightNode
inline constexpr const char* kLightRoots = "light_roots";       // uint32_t, by object
inline constexpr const char* kEmitterLeaves = "emitter_leaves";    // uint32_t, by emitter
inline constexpr const char* kInstanceLeaves = "instance_leaves";  // uint32_t, by instance
inline constexpr const char* kPortals = "portals";                 // shading::Portal: none or one
inline constexpr const char* kEnvironment = "environment";      // Rgb: the square image of an infinite light, row by row
inline constexpr const char* kLightImages = "light_images";     // shading::LightImage; absent without any
inline constexpr const char* kLightTexels = "light_texels";     // Rgb: of light_images
inline constexpr const char* kPages = "pages";                  // cache::PageLocation
inline constexpr const char* kTreeNodes = "tree_nodes";         // cache::TraceNode
inline constexpr const char* kTreeEntries = "tree_entries";     // cache::PageTreeEntry
inline constexpr const char* kTreeObjects = "tree_objects";     // cache::PageObject
inline constexpr const char* kInstances = "instances";          // cache::Instance
inline constexpr const char* kMotions = "motions";              // Motion: of instances and the camera
inline constexpr const char* kAttributes = "attributes";        // AttributeLocation
inline constexpr const char* kDicing = "dicing";                // DicingRecord[1]; absent without cages
inline constexpr const char* kCameraPath = "camera_path";       // FrameCamera, by ascending frame; may be empty
inline constexpr const char* kContent = "content";              // ContentChecksums[1]
inline constexpr const char* kMedia = "media";                  // Medium
inline constexpr const char* kBlackBodies = "black_bodies";     // Rgb, kBlackBodyEntries or none
inline constexpr const char* kVolumeGrids = "volume_grids";     // cache::VolumeGrid
inline constexpr const char* kVolumeEntries = "volume_entries";  // uint32: a brick, or none
inline constexpr const char* kVolumeCells = "volume_cells";     // float: the largest value of a cell
inline constexpr const char* kVolumeBricks = "volume_bricks";   // cache::VolumeBrickLocation
inline constexpr const char* kNames = "names";                  // char: lines "mesh 3 models/a.ply", "material 2 Floor", ...
}  // namespace section

}  // namespace spillway::pipeline
