#pragma once

// One vertex of a path, from numbers to numbers: shared, word for word, by the streamed stages and by the depth-first
// reference integrator, so that their images agree bit for bit.

#include <bit>
#include <cstdint>

#include "cache/attribute_block.h"
#include "pipeline/records.h"
#include "pipeline/scene.h"
#include "pipeline/shutter.h"
#include "shading/bsdf.h"
#include "shading/frame.h"
#include "shading/light.h"
#include "shading/sampler.h"

namespace spillway::pipeline {

// Where a hit is on a face of a face texture. (u, v) of a quad are those of its bilinear patch.
struct FacePoint {
  uint32_t face;
  float u, v;
  float width_u, width_v;  // footprint of the path's cone, along u and v
  float random;            // of the path and its bounce, in [0, 1): chooses between levels
};

// A hit with its geometry, in world space.
struct ShadingPoint {
  Float3 position;
  Float3 normal_geometric;  // unit; the side that an area light of this mesh emits to
  Float3 normal_shading;    // unit, on the side of normal_geometric
  Float3 dpdu;              // in world units per uv unit; zero without a usable parametrisation
  Float3 dpdv;
  Float2 uv;
  float width_world;        // footprint of the path's cone on a surface that faces it
  float width_uv;           // the same in uv units
  float time;               // of the path: the rays that leave keep it
  float apart_world = 0;    // from the surface that the kernel sees, at most, by rounding: rays leave from beyond that
  // What a ray that leaves is in, by the side of normal_geometric that it leaves on.
  uint32_t medium_inside = kNoMedium, medium_outside = kNoMedium;
  const FacePoint* face = nullptr;  // of a mesh with face textures
};

// The media on both sides: those of a mesh that divides media, else the one that the ray came through.
void set_media(const Mesh& mesh, uint32_t medium_of_ray, ShadingPoint& point);
[[nodiscard]] inline uint32_t medium_beyond(const ShadingPoint& point, Float3 w_next) {
  return dot(w_next, point.normal_geometric) > 0 ? point.medium_outside : point.medium_inside;
}

// Transforms of the instance that was hit, at the time of the path; null: the world itself.
struct InstanceTransform {
  const Affine3* world_from_object = nullptr;
  const Affine3* object_from_world = nullptr;
  float time = 0;
};

[[nodiscard]] ShadingPoint shading_point(const cache::TriangleAttributes& triangle, const HitRecord& hit,
                                         const InstanceTransform& instance, bool flip_normals);

// Of a triangle that has_face. width_world: of the shading point.
[[nodiscard]] FacePoint face_point(const cache::TriangleAttributes& triangle, const HitRecord& hit,
                                   const InstanceTransform& instance, float width_world, uint32_t seed);

// What of the scene and the options a path needs to know. Spans, valid for the whole render.
struct PathSettings {
  shading::LightTable lights;
  uint32_t max_depth = 5;
  uint32_t seed = 0;
  shading::SamplerKind sampler = shading::SamplerKind::sobol;
  Shutter shutter = {};
  std::span<const Medium> media = {};
  Estimator estimator = Estimator::mis_power;
  bool roulette = true;
};

// Numbers that a vertex still needs from the scene's tables and textures.
struct SurfaceValues {
  shading::BsdfParams bsdf;
  Float3 normal_shading;                // bumped
  uint32_t light = LightId::kNone;      // emitter of the face, when it emits
  Rgb emitted{1, 1, 1};                 // what its radiance is multiplied by: what was looked up
};

struct ShadedVertex {
  bool has_splat = false;
  bool has_path = false;
  bool has_shadow = false;
  SplatRecord splat;
  cache::TraceRay path_ray;
  PathRecord path;
  cache::TraceRay shadow_ray;
  ShadowRecord shadow;
  shading::LightPlace shadow_end;  // where on its light, when emission is looked up there
};

// What a vertex needs before a light is sampled.
struct VertexStart {
  bool goes_on = false;      // else the path ends here
  bool asks_lights = false;  // light_query() is to be answered; else nothing comes of lights
  shading::Frame frame;
  Float3 w_prev_local;
  shading::LightReceiver receiver;
  shading::BouncePoints points;
  [[nodiscard]] shading::LightQuery light_query() const {
    return {receiver, points[shading::kBounceLightSelect], points[shading::kBounceLight]};
  }
};
[[nodiscard]] VertexStart begin_vertex(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                                       const SurfaceValues& surface);
// light: the answer; of a vertex that does not ask, any sample whose pdf is 0.
[[nodiscard]] ShadedVertex end_vertex(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                                      const SurfaceValues& surface, const VertexStart& start,
                                      const shading::LightSample& light);

// Both, and the light between: emission met by chance, next-event estimation, and the next direction of the path.
// Based on: Kajiya 1986; MIS with the power heuristic (Veach 1997, section 9.2); roulette as in pbrt-v4 section 13.4
// except that survival is capped where light is scattered, so that lossless scenes end.
[[nodiscard]] ShadedVertex shade_vertex(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                                        const SurfaceValues& surface);

// A place where a path collided in its medium: next-event estimation by the phase function, and the next direction.
// What it weighs and emits track_media has said already; hit.path.position_previous is the place.
[[nodiscard]] ShadedVertex shade_medium(const PathSettings& settings, const HitRecord& hit);

// Light from outside the scene; has_splat false when there is none.
[[nodiscard]] SplatRecord escaped_splat(const PathSettings& settings, const PathRecord& path, Float3 direction_world);

// The record of a shadow ray that a surface of unknown opacity stopped for now; that of one that arrived at `end`, to
// be looked up there; and what it brings then.
[[nodiscard]] HitRecord shadow_hit(const cache::TraceRay& ray, const cache::TraceHit& hit, const ShadowRecord& shadow,
                                   const shading::LightPlace& end);
[[nodiscard]] HitRecord arrived_hit(const cache::TraceRay& ray, const ShadowRecord& shadow,
                                    const shading::LightPlace& end);
[[nodiscard]] SplatRecord arrived_splat(const HitRecord& hit, const SurfaceValues& surface);
// What shadow_hit was given.
[[nodiscard]] inline shading::LightPlace shadow_end(const HitRecord& hit) {
  return std::bit_cast<shading::LightPlace>(hit.path.position_previous);
}

// Whether a surface of fractional opacity stops this ray: a hash of (path, bounce, instance, prim), never a dimension.
[[nodiscard]] bool stopped_by_alpha(const HitRecord& hit, uint32_t seed, float alpha);

// The same ray, going on behind the point it was let through.
[[nodiscard]] cache::TraceRay ray_beyond(const HitRecord& hit, const ShadingPoint& point);

[[nodiscard]] inline shading::SampleKey sample_key(const PathRecord& path, uint32_t seed,
                                                   shading::SamplerKind sampler = shading::SamplerKind::sobol) {
  return {path.sink, path.sample, seed, sampler};
}

}  // namespace spillway::pipeline
