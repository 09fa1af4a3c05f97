#pragma once

// Makes the light tables.
//
// In:     the spooled scene (emissive meshes), the other lights in the order of the scene, their images, the
//         environment's texels, instances (those of objects that emit come first), the bounds of the world; the
//         textures that emissions are multiplied by.
// Out:    an emitter a face of an emissive mesh, by ascending prim, once however often its object stands; light_base of
//         the meshes set; the other lights, infinite ones last; the tree, in scenes with more than kFewLights lights
//         that have a place, or with instances that emit; the cumulative distribution in proportion to power.
//         A textured emitter is as strong as its texture is on it, estimated from a few footprints, and at least
//         kLeastOfMeanTexel of the whole image: what they miss is never left without a chance.
// Memory: tag pack: one chunk of a mesh, what the tree's builder takes, and the tables.
// Order:  serial; sums in double, in the order of the tables.
//
// Lights without a place (sun, sky) are chosen beside the others, by power: for the sky that is what a disk as large as
// the scene would catch, which compares mean irradiances out of doors. Indoors it is far too much, and costs the lamps
// their samples; so that lights without a place get at most half of them all. It depends on the scene alone.

#include <span>
#include <vector>

#include "cache/trace_page.h"
#include "pipeline/pack/build_light_tree.h"
#include "pipeline/pack/mesh_spool.h"
#include "shading/light.h"

namespace spillway::pipeline {

// So many lights are chosen by power, wherever they are; a tree would cost more than it saves.
inline constexpr size_t kFewLights = 16;

inline constexpr float kLeastOfMeanTexel = 1.0f / 64;

struct PackedLights {
  std::vector<shading::Emitter> emitters;
  std::vector<shading::Emission> emissions;
  std::vector<shading::Light> lights;
  std::vector<float> cdf;   // see shading::LightTable
  LightTrees trees;         // empty without a tree
  uint64_t dark_count = 0;  // lights and faces of emitters that shine nothing, and are no lights
};

struct PackLightsInput {
  std::span<const shading::Light> other_lights;
  std::span<const Rgb> environment;
  std::span<const shading::LightImage> light_images;
  std::span<const cache::Instance> instances;
  size_t emitting_instance_count = 0;
  Bounds3 bounds_world;
  BuildLightTreeOptions tree;
  std::span<const TextureNode> textures;
  std::span<const cache::ImageInfo> images;
  cache::TextureCache* image_cache = nullptr;  // null: there are no images
};

Result<PackedLights> pack_lights(SpooledScene& scene, const PackLightsInput& input);

}  // namespace spillway::pipeline
