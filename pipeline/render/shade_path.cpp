#include "pipeline/render/shade_path.h"

#include <cmath>

#include "shading/medium.h"
#include "shading/trigonometry.h"

namespace spillway::pipeline {
namespace {

// Roulette starts where pbrt-v4's does; beyond kRouletteCapBounce even a lossless path ends where it is scattered, with
// the stated chance.
constexpr uint32_t kRouletteFirstBounce = 2;
constexpr uint32_t kRouletteCapBounce = 16;
constexpr float kRouletteSurvivalCap = 0.97f;

// Triangles thinner than this in uv (double area) give no derivatives.
constexpr float kDegenerateUv = 1e-20f;

Float3 interpolate(const Float3 p[3], float u, float v) { return p[0] * (1 - u - v) + p[1] * u + p[2] * v; }

struct Parametrisation {
  Float3 dpdu{0, 0, 0}, dpdv{0, 0, 0};
  float uv_per_world = 0;  // square root of the ratio of areas
};

Parametrisation parametrisation(const Float3 p[3], const Float2 uv[3]) {
  const Float3 e1 = p[1] - p[0], e2 = p[2] - p[0];
  const Float2 d1 = uv[1] - uv[0], d2 = uv[2] - uv[0];
  const float determinant = d1.x * d2.y - d1.y * d2.x;
  const float area = length(cross(e1, e2));
  if (!(std::fabs(determinant) > kDegenerateUv) || !(area > 0)) return {};
  const float inverse = 1 / determinant;
  return {(e1 * d2.y - e2 * d1.y) * inverse, (e2 * d1.x - e1 * d2.x) * inverse,
          std::sqrt(std::fabs(determinant) / area)};
}

// The interpolated normal, unless it is degenerate; on the side of the geometric one.
Float3 shading_normal(const cache::TriangleAttributes& triangle, const HitRecord& hit,
                      const InstanceTransform& instance, Float3 normal_geometric) {
  if (!triangle.has_normals) return normal_geometric;
  Float3 n = interpolate(triangle.normal_object, hit.hit.u, hit.hit.v);
  if (instance.object_from_world != nullptr) n = instance.object_from_world->transposed_vector(n);
  const float squared = length_squared(n);
  if (!(squared > 0) || !std::isfinite(squared)) return normal_geometric;
  n = n * (1 / std::sqrt(squared));
  return dot(n, normal_geometric) < 0 ? -n : n;
}

struct Corners {
  Float3 p[3];
  // By way of the edges: what all corners share, the height of a floor say, stays exact.
  [[nodiscard]] Float3 at(float u, float v) const { return p[0] + ((p[1] - p[0]) * u + (p[2] - p[0]) * v); }
};

Corners corners_world(const cache::TriangleAttributes& triangle, const InstanceTransform& instance) {
  Corners corners;
  for (int i = 0; i < 3; ++i) {
    corners.p[i] = triangle.position_object[i];
    if (instance.world_from_object != nullptr) corners.p[i] = instance.world_from_object->point(corners.p[i]);
  }
  return corners;
}

// Roundings (2^-24) between a place as computed here and the triangle's plane as the kernel meets it: the sums that
// lead to the place and to the ray's origin (four of the place's coordinates), the differences, normal and products of
// the kernel (about six of the triangle's size); twice that. An instance's place has passed two transforms besides.
constexpr float kPlaceRoundings = 8 * 0x1p-24f, kSizeRoundings = 12 * 0x1p-24f, kMovedRoundings = 24 * 0x1p-24f;

// Flat walls along the axes only err along their normal: far from the origin most errors lie in the plane.
float apart_by_rounding(const Corners& corners, const InstanceTransform& instance, Float3 position, Float3 n) {
  Float3 size{0, 0, 0};
  for (const Float3& corner : corners.p)
    for (int a = 0; a < 3; ++a) size[a] = std::max(size[a], std::fabs(corner[a] - position[a]));
  if (instance.world_from_object != nullptr) {
    const auto& m = instance.world_from_object->m;
    return kMovedRoundings * (max_abs(position) + max_abs(size) + max_abs({m[0][3], m[1][3], m[2][3]}));
  }
  const auto along_normal = [&](Float3 v) {
    return std::fabs(n.x * v.x) + std::fabs(n.y * v.y) + std::fabs(n.z * v.z);
  };
  return kPlaceRoundings * along_normal(position) + kSizeRoundings * along_normal(size);
}

}  // namespace

ShadingPoint shading_point(const cache::TriangleAttributes& triangle, const HitRecord& hit,
                           const InstanceTransform& instance, bool flip_normals) {
  const Corners corners = corners_world(triangle, instance);
  ShadingPoint point;
  point.position = corners.at(hit.hit.u, hit.hit.v);
  Float3 n = normalize(cross(corners.p[1] - corners.p[0], corners.p[2] - corners.p[0]));
  const bool mirrored = instance.world_from_object != nullptr && shading::mirrors(*instance.world_from_object);
  if (flip_normals != mirrored) n = -n;
  point.normal_geometric = n;
  point.apart_world = apart_by_rounding(corners, instance, point.position, n);
  point.normal_shading = shading_normal(triangle, hit, instance, n);
  static constexpr Float2 kDefaultUv[3] = {{0, 0}, {1, 0}, {1, 1}};  // pbrt-v4, Triangle without uv
  const Float2* uv = triangle.has_uvs ? triangle.uv : kDefaultUv;
  const Parametrisation map = parametrisation(corners.p, uv);
  point.dpdu = map.dpdu, point.dpdv = map.dpdv;
  point.uv = uv[0] * (1 - hit.hit.u - hit.hit.v) + uv[1] * hit.hit.u + uv[2] * hit.hit.v;
  const float distance = hit.hit.t * length(hit.direction_world);
  point.width_world = hit.path.cone_width + hit.path.cone_spread * distance;
  point.width_uv = point.width_world * map.uv_per_world;
  point.time = instance.time;
  return point;
}

namespace {

bool finds_light_by_chance_alone(const PathSettings& settings) {
  return settings.estimator == Estimator::bsdf || settings.estimator == Estimator::hemisphere;
}

// What light that was met by chance weighs, with the densities of both strategies.
float weight_by_chance(const PathSettings& settings, float pdf_bsdf, float pdf_light) {
  if (settings.estimator == Estimator::mis_power) return shading::power_heuristic(pdf_bsdf, pdf_light);
  if (settings.estimator == Estimator::mis_balance) return shading::balance_heuristic(pdf_bsdf, pdf_light);
  return finds_light_by_chance_alone(settings) || !(pdf_light > 0) ? 1.0f : 0.0f;
}

// What a sample of a light weighs; nothing could meet a delta by chance.
float weight_at_light(const PathSettings& settings, const shading::LightSample& light, float pdf_bsdf) {
  if (light.is_delta) return 1;
  if (settings.estimator == Estimator::mis_power) return shading::power_heuristic(light.pdf_solid_angle, pdf_bsdf);
  if (settings.estimator == Estimator::mis_balance) return shading::balance_heuristic(light.pdf_solid_angle, pdf_bsdf);
  return finds_light_by_chance_alone(settings) ? 0.0f : 1.0f;
}

// Whether a sample of the lights can bring anything: infinite ones are the last of the table, all before are deltas.
bool samples_lights(const PathSettings& settings) {
  return !settings.lights.empty() && (!finds_light_by_chance_alone(settings) || settings.lights.first_infinite > 0);
}

// The part of an emitter's light that BSDF sampling is credited with.
bool emission_splat(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                    const SurfaceValues& surface, SplatRecord& splat) {
  const uint32_t emitter = surface.light;
  const shading::LightTable& lights = settings.lights;
  const uint32_t instance = hit.hit.instance;
  const shading::TriangleShape shape = shading::emitter_in_world(lights, instance, emitter);
  const shading::Emission& emission = lights.emissions[lights.emitters[emitter].emission];
  const Rgb radiance = shading::emitter_radiance(shape, emission, hit.direction_world) * surface.emitted;
  if (is_black(radiance)) return false;
  float weight = 1;
  if (hit.path.pdf_previous > 0) {
    const shading::LightReceiver receiver{hit.path.position_previous, hit.path.normal_previous};
    const float pdf_light =
        shading::emitter_pdf_solid_angle(lights, receiver, instance, emitter, shape, point.position);
    weight = weight_by_chance(settings, hit.path.pdf_previous, pdf_light);
  }
  splat = {hit.path.sink, hit.path.sample, emission_event(hit.path.bounce), hit.path.throughput * radiance * weight};
  return true;
}

// A ray from `origin` to where the light was sampled, short of the light itself.
cache::TraceRay shadow_ray(Float3 origin, const shading::LightSample& sample, float time) {
  if (!std::isfinite(sample.distance)) return {origin, INFINITY, sample.w_next_world, time};
  const Float3 to_light = sample.point_world - origin;
  // The light's own surface lies at 1, give or take the rounding of coordinates of this size.
  const float margin = 64 * 0x1p-24f * (1 + max_abs(sample.point_world) / sample.distance);
  return {origin, 1 - margin, to_light, time};
}

// Who receives light here, as a tree sees it: a normal on the side that the path came from, where light of the other
// side is lost. Scenes without a tree do not ask.
shading::LightReceiver light_receiver(const PathSettings& settings, const ShadingPoint& point,
                                      const SurfaceValues& surface, const shading::Frame& frame, Float3 w_prev_local) {
  if (settings.lights.tree.empty() || shading::transmits(surface.bsdf)) return {point.position, 0};
  return {point.position, shading::pack_receiver_normal(w_prev_local.z < 0 ? -frame.z : frame.z)};
}

void next_event(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                const SurfaceValues& surface, const VertexStart& start, const shading::LightSample& light,
                ShadedVertex& out) {
  if (!(light.pdf_solid_angle > 0) || is_black(light.radiance)) return;
  const shading::BsdfValue f =
      shading::evaluate_bsdf(surface.bsdf, start.w_prev_local, start.frame.local_from_world(light.w_next_world));
  if (is_black(f.f_cos)) return;
  const float weight = weight_at_light(settings, light, f.pdf_solid_angle);
  const Rgb contribution = hit.path.throughput * f.f_cos * light.radiance * (weight / light.pdf_solid_angle);
  if (is_black(contribution)) return;
  const Float3 origin =
      shading::ray_origin(point.position, point.normal_geometric, light.w_next_world, point.apart_world);
  out.shadow_ray = shadow_ray(origin, light, point.time);
  if (!(out.shadow_ray.t_max > 0)) return;
  out.shadow = {hit.path.sink, hit.path.sample, medium_beyond(point, light.w_next_world), hit.path.bounce,
                contribution};
  out.shadow_end = light.place;
  out.has_shadow = true;
}

// At a surface; beyond kRouletteCapBounce even a lossless path ends. Not where it is mirrored or passes smooth glass:
// through a stack of panes it does hundreds of times, and survivors would carry e^(0.03 n): no picture in any time.
float surface_cap(const PathRecord& path, bool is_delta) {
  return is_delta || path.bounce < kRouletteCapBounce ? 1.0f : kRouletteSurvivalCap;
}
// Gas that loses nothing is left sooner or later, after thousands of collisions where it is thick: survivors of a cap
// would then carry e^(0.03 n), whose variance has no bound.
constexpr float kMediumCap = 1;

// Ends the path with a chance that grows as it carries less; survivors carry more.
bool survives_roulette(const PathSettings& settings, PathRecord& path, float u, float cap) {
  if (path.bounce < kRouletteFirstBounce || !settings.roulette) return true;
  const Rgb t = path.throughput;
  const float carried = std::max({std::fabs(t.r), std::fabs(t.g), std::fabs(t.b)}) * path.eta_scale;
  const float survival = std::min(carried, cap);
  if (u >= survival) return false;
  path.throughput = path.throughput * (1 / survival);
  return true;
}

// A broad lobe spreads the cone: half the angle whose solid angle is 1/pdf (Akenine-Moeller et al. 2021, section 4).
void spread_cone(PathRecord& path, float pdf_solid_angle) {
  path.cone_spread = std::max(path.cone_spread, 0.5f / std::sqrt(std::max(1.0f, pdf_solid_angle)));
}

void next_direction(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                    const SurfaceValues& surface, const VertexStart& start, ShadedVertex& out) {
  const Float2 choose = start.points[shading::kBounceLobeAndRoulette];
  const auto sample_direction =
      settings.estimator == Estimator::hemisphere ? shading::sample_evenly : shading::sample_bsdf;
  const shading::BsdfSample sample =
      sample_direction(surface.bsdf, start.w_prev_local, start.points[shading::kBounceBsdf], choose.x);
  if (is_black(sample.weight)) return;
  PathRecord path = hit.path;
  path.bounce += 1;
  path.throughput *= sample.weight;
  path.eta_scale *= sample.eta_scale;
  if (!survives_roulette(settings, path, choose.y, surface_cap(path, sample.is_delta))) return;
  path.pdf_previous = sample.is_delta ? 0 : sample.pdf_solid_angle;
  path.position_previous = start.receiver.position_world, path.normal_previous = start.receiver.packed_normal;
  path.cone_width = point.width_world;
  if (!sample.is_delta) spread_cone(path, sample.pdf_solid_angle);
  const Float3 w_next = start.frame.world_from_local(sample.w_next_local);
  path.medium = medium_beyond(point, w_next);
  const Float3 origin = shading::ray_origin(point.position, point.normal_geometric, w_next, point.apart_world);
  out.path_ray = {origin, INFINITY, w_next, point.time};
  out.path = path;
  out.has_path = true;
}

}  // namespace

VertexStart begin_vertex(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                         const SurfaceValues& surface) {
  VertexStart start;
  if (hit.path.bounce >= settings.max_depth) return start;
  start.frame = shading::frame_from_z_and_tangent(surface.normal_shading, point.dpdu);
  start.w_prev_local = start.frame.local_from_world(-hit.direction_world);
  if (start.w_prev_local.z == 0) return start;
  start.goes_on = true;
  start.receiver = light_receiver(settings, point, surface, start.frame, start.w_prev_local);
  start.points = shading::sample_bounce(sample_key(hit.path, settings.seed, settings.sampler), hit.path.bounce);
  start.asks_lights = samples_lights(settings) && shading::has_continuous_lobe(surface.bsdf);
  return start;
}

ShadedVertex end_vertex(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                        const SurfaceValues& surface, const VertexStart& start, const shading::LightSample& light) {
  ShadedVertex out;
  if (surface.light != LightId::kNone) out.has_splat = emission_splat(settings, hit, point, surface, out.splat);
  if (!start.goes_on) return out;
  next_event(settings, hit, point, surface, start, light, out);
  next_direction(settings, hit, point, surface, start, out);
  return out;
}

ShadedVertex shade_vertex(const PathSettings& settings, const HitRecord& hit, const ShadingPoint& point,
                          const SurfaceValues& surface) {
  const VertexStart start = begin_vertex(settings, hit, point, surface);
  shading::LightSample light;
  if (start.asks_lights) {
    const auto [receiver, u_select, u] = start.light_query();
    light = shading::sample_light(settings.lights, receiver, u_select, u);
  }
  return end_vertex(settings, hit, point, surface, start, light);
}

namespace {

void next_event_in_medium(const PathSettings& settings, const HitRecord& hit, float g, float time,
                          const shading::BouncePoints& points, ShadedVertex& out) {
  if (!samples_lights(settings)) return;
  const Float3 place = hit.path.position_previous;
  const shading::LightSample light = shading::sample_light(
      settings.lights, {place, 0}, points[shading::kBounceLightSelect], points[shading::kBounceLight]);
  if (!(light.pdf_solid_angle > 0) || is_black(light.radiance)) return;
  const float phase = shading::henyey_greenstein(g, dot(hit.direction_world, light.w_next_world));
  const float weight = weight_at_light(settings, light, phase);
  const Rgb contribution = hit.path.throughput * light.radiance * (phase * weight / light.pdf_solid_angle);
  if (is_black(contribution)) return;
  out.shadow_ray = shadow_ray(place, light, time);
  if (!(out.shadow_ray.t_max > 0)) return;
  out.shadow = {hit.path.sink, hit.path.sample, hit.path.medium, hit.path.bounce, contribution};
  out.shadow_end = light.place;
  out.has_shadow = true;
}

}  // namespace

ShadedVertex shade_medium(const PathSettings& settings, const HitRecord& hit) {
  ShadedVertex out;
  if (hit.path.bounce >= settings.max_depth) return out;
  const float g = settings.media[hit.path.medium].g;
  const shading::SampleKey key = sample_key(hit.path, settings.seed, settings.sampler);
  const float time = ray_time(settings.shutter, key);
  const shading::BouncePoints points = shading::sample_bounce(key, hit.path.bounce);
  next_event_in_medium(settings, hit, g, time, points, out);
  const bool evenly = settings.estimator == Estimator::hemisphere;
  const Float2 u = points[shading::kBounceBsdf];
  const Float3 w_next =
      evenly ? shading::uniform_direction(u) : shading::sample_henyey_greenstein(g, hit.direction_world, u);
  const float phase = shading::henyey_greenstein(g, dot(hit.direction_world, w_next));
  out.path = hit.path;
  if (evenly) out.path.throughput = out.path.throughput * (phase * 4 * shading::kPi);
  out.path.bounce += 1;
  out.path.normal_previous = 0;  // receives from all sides
  if (!survives_roulette(settings, out.path, points[shading::kBounceLobeAndRoulette].y, kMediumCap)) return out;
  out.path.pdf_previous = phase;
  out.path.cone_width = hit.path.cone_width + hit.path.cone_spread * hit.hit.t * length(hit.direction_world);
  spread_cone(out.path, out.path.pdf_previous);
  out.path_ray = {hit.path.position_previous, INFINITY, w_next, time};
  out.has_path = true;
  return out;
}

void set_media(const Mesh& mesh, uint32_t medium_of_ray, ShadingPoint& point) {
  const bool divides = (mesh.flags & kMeshDividesMedia) != 0;
  point.medium_inside = divides ? mesh.medium_inside : medium_of_ray;
  point.medium_outside = divides ? mesh.medium_outside : medium_of_ray;
}

SplatRecord escaped_splat(const PathSettings& settings, const PathRecord& path, Float3 direction_world) {
  const auto [radiance, pdf_by_light] =
      shading::infinite_value(settings.lights, path.position_previous, direction_world);
  const float weight = path.pdf_previous > 0 ? weight_by_chance(settings, path.pdf_previous, pdf_by_light) : 1;
  return {path.sink, path.sample, emission_event(path.bounce), path.throughput * radiance * weight};
}

HitRecord shadow_hit(const cache::TraceRay& ray, const cache::TraceHit& hit, const ShadowRecord& shadow,
                     const shading::LightPlace& end) {
  HitRecord record{hit, ray.direction_world, ray.t_max, {}, 1};
  record.path.sink = shadow.sink, record.path.sample = shadow.sample, record.path.medium = shadow.medium;
  record.path.bounce = static_cast<uint16_t>(shadow.bounce), record.path.throughput = shadow.contribution;
  record.path.position_previous = std::bit_cast<Float3>(end);
  return record;
}

// Textures see no more of it than the place on the face, so that the instance does not matter.
HitRecord arrived_hit(const cache::TraceRay& ray, const ShadowRecord& shadow, const shading::LightPlace& end) {
  HitRecord record = shadow_hit(ray, {ray.t_max, end.u, end.v, end.prim, 0, 0}, shadow, end);
  record.is_shadow = kShadowArrived;
  return record;
}

SplatRecord arrived_splat(const HitRecord& hit, const SurfaceValues& surface) {
  return {hit.path.sink, hit.path.sample, shadow_event(hit.path.bounce), hit.path.throughput * surface.emitted};
}

bool stopped_by_alpha(const HitRecord& hit, uint32_t seed, float alpha) {
  if (alpha >= 1) return true;
  if (alpha <= 0) return false;
  const uint32_t event = hit.is_shadow ? shadow_event(hit.path.bounce) : emission_event(hit.path.bounce);
  return shading::hashed_1d(sample_key(hit.path, seed), shading::SampleStream::decisions, hit.hit.instance,
                            hit.hit.prim, event) < alpha;
}

cache::TraceRay ray_beyond(const HitRecord& hit, const ShadingPoint& point) {
  const Float3 origin =
      shading::ray_origin(point.position, point.normal_geometric, hit.direction_world, point.apart_world);
  const float rest = hit.t_max - hit.hit.t;
  if (!std::isfinite(rest)) return {origin, rest, hit.direction_world, point.time};
  // The end stays where it was, just before the light: moved with the origin, it would lie behind it.
  constexpr float kRoundings = 4 * 0x1p-24f;
  const Float3 to_end = point.position + hit.direction_world * rest - origin;
  if (!(dot(to_end, hit.direction_world) > 0)) return {origin, 0, hit.direction_world, point.time};
  return {origin, 1 - kRoundings, to_end, point.time};
}

}  // namespace spillway::pipeline
