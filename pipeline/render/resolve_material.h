#pragma once

// From a material of the scene and a place on a surface to numbers: textures looked up, mixes decided, bumps applied.
// Lookups of a block of hits go to the texture cache together, in two rounds: what decides (alpha, mix amounts), then
// what is left of the chosen materials. Where shadow rays arrived, what emits is looked up and nothing else.

#include <cstdint>
#include <span>
#include <vector>

#include "pipeline/evaluate_texture.h"
#include "pipeline/render/shade_path.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

struct MaterialTables {
  std::span<const Mesh> meshes;
  std::span<const Material> materials;
  const TextureEvaluator* textures = nullptr;
  // Of scenes that look emission up, else empty: shading::LightTable's.
  std::span<const shading::Emission> emissions = {};
  std::span<const shading::Emitter> emitters = {};
};

// One hit of a block on its way through the resolver.
struct SurfaceQuery {
  const HitRecord* hit = nullptr;
  const ShadingPoint* point = nullptr;
  uint32_t mesh = 0;
  // Out:
  bool stopped = true;         // by its alpha; false: the ray goes on behind the point, values are not resolved
  uint32_t material = 0;       // the leaf that mixes chose
  SurfaceValues values;
};

class MaterialResolver {
 public:
  explicit MaterialResolver(const MaterialTables& tables, uint32_t seed);

  // Reused from block to block by one thread; a place for lookups.
  struct Scratch {
    std::vector<TextureQuery> queries;
    std::vector<cache::Texel> values;
    std::vector<uint32_t> pending;
    TextureEvaluator::Scratch evaluator;
  };
  // Values depend on each hit alone, not on the block.
  Status resolve(std::span<SurfaceQuery> block, Scratch& scratch) const;
  // The lookups in face textures that resolve() may make, of all parts of a mix.
  void append_face_requests(const SurfaceQuery& query, std::vector<cache::FaceTextureRequest>& requests) const;

 private:
  Status decide_alpha(std::span<SurfaceQuery> block, Scratch& scratch) const;
  Status decide_mixes(std::span<SurfaceQuery> block, Scratch& scratch) const;
  Status look_up_emission(std::span<SurfaceQuery> block, Scratch& scratch) const;
  Status resolve_leaves(std::span<SurfaceQuery> block, Scratch& scratch) const;

  MaterialTables tables_;
  uint32_t seed_;
  std::vector<shading::BsdfParams> constants_;  // one a material: what its constants give
  std::vector<uint8_t> is_textured_;            // one a material
  std::vector<std::vector<uint32_t>> face_textures_;  // one a material: texture nodes that look into face textures
};

}  // namespace spillway::pipeline
