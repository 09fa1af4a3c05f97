#include "shading/light.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "shading/frame.h"
#include "shading/last_at_most.h"
#include "shading/smoothstep.h"
#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

float spot_falloff(const Light& light, Float3 w_from_light) {
  const float cosine = dot(light.edge1, w_from_light);
  if (cosine >= light.cos_falloff) return 1;
  return cosine <= light.cos_total ? 0 : smoothstep(light.cos_total, light.cos_falloff, cosine);
}

// The chance of a choice; the same subtraction wherever it is asked for.
float pmf(const LightTable& table, size_t choice) { return table.cdf[choice + 1] - table.cdf[choice]; }

// Of a point on an emitter whose radiance is looked up, seen from a mesh's face again. In double: floats cannot hold
// the fourth powers of small edges.
LightPlace place_on_mesh(const LightTable& table, const LightPick& pick, const TriangleShape& shape, Float3 point) {
  const EmissionPlace& place = table.places[table.emitters[pick.index].emission];
  if (!place.is_looked_up) return {};
  const auto at = [](Float3 v, int axis) { return static_cast<double>(v[axis]); };
  const auto product = [&](Float3 a, Float3 b, double(&out)[3]) {
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      out[i] = at(a, j) * at(b, k) - at(a, k) * at(b, j);
    }
  };
  const Float3 to_point = point - shape.position;
  double normal[3], of_first[3], of_second[3];
  product(shape.edge1, shape.edge2, normal);
  product(to_point, shape.edge2, of_first), product(shape.edge1, to_point, of_second);
  double squared = 0, first = 0, second = 0;
  for (int i = 0; i < 3; ++i)
    squared += normal[i] * normal[i], first += of_first[i] * normal[i], second += of_second[i] * normal[i];
  const auto share = [&](double part) {
    return squared > 0 ? static_cast<float>(std::clamp(part / squared, 0.0, 1.0)) : 0.0f;
  };
  LightPlace result{pick.index + place.first_prim, share(first), share(second)};
  const bool is_mirrored = pick.instance != 0 && mirrors(table.tree.instances[pick.instance].world_from_object);
  if ((place.is_flipped != 0) != is_mirrored) std::swap(result.u, result.v);
  return result;
}

// Lights are the choices after these.
size_t first_light(const LightTable& table) { return table.tree.empty() ? table.emitters.size() : 1; }

// At the place on an emitter that was sampled.
LightSample emitter_sample(const LightTable& table, const LightPick& pick, const TriangleShape& shape, Float3 receiver,
                           const TrianglePoint& place) {
  LightSample sample;
  sample.point_world = place.point;
  const Float3 to_light = sample.point_world - receiver;
  sample.distance = length(to_light);
  if (!(sample.distance > 0)) return {};
  sample.w_next_world = to_light * (1 / sample.distance);
  sample.radiance = emitter_radiance(shape, table.emissions[table.emitters[pick.index].emission], sample.w_next_world);
  sample.pdf_solid_angle = pick.pmf * place.pdf_solid_angle;
  if (!table.places.empty()) sample.place = place_on_mesh(table, pick, shape, place.point);
  return sample;
}

LightSample sample_point(const LightTable& table, const Light& light, float chance, Float3 receiver) {
  const Float3 to_light = light.position - receiver;
  const float squared = length_squared(to_light);
  if (!(squared > 0)) return {};
  LightSample sample;
  sample.point_world = light.position;
  sample.distance = std::sqrt(squared);
  sample.w_next_world = to_light * (1 / sample.distance);
  sample.radiance = light.radiance * (1 / squared);
  if (light.kind == LightKind::spot) sample.radiance = sample.radiance * spot_falloff(light, -sample.w_next_world);
  if (throws_image(light))
    sample.radiance *= light_image_value(table.images, table.images.images[light.image - 1], -sample.w_next_world);
  sample.pdf_solid_angle = chance;
  sample.is_delta = true;
  return sample;
}

LightSample sample_distant(const Light& light, float chance) {
  LightSample sample;
  sample.distance = INFINITY;
  sample.w_next_world = -light.edge1;
  sample.radiance = light.radiance;
  sample.pdf_solid_angle = chance;
  sample.is_delta = true;
  return sample;
}

Float3 to_light_frame(const Light& light, Float3 w) {
  return {dot(light.position, w), dot(light.edge1, w), dot(light.edge2, w)};
}

Float3 direction_of_image(const LightTable& table, const Light& light, Float2 u) {
  const Float3 w = sample_environment(table.environment, u);
  return normalize(light.position * w.x + light.edge1 * w.y + light.edge2 * w.z);
}

// Of infinite light `i` of the table; null: it is seen all around.
const Portal* portal_of(const LightTable& table, size_t i) {
  const bool has = !table.portals.empty() && table.portals[0].light == i - table.first_infinite;
  return has ? &table.portals[0] : nullptr;
}

Float3 direction_of_infinite(const LightTable& table, size_t i, Float3 from, Float2 u) {
  const Light& light = table.lights[i];
  if (const Portal* portal = portal_of(table, i)) {  // half of the samples go through it, half by the light alone
    if (u.x < 0.5f) return sample_portal(*portal, from, {2 * u.x, u.y});
    u.x = 2 * u.x - 1;
  }
  return light.image ? direction_of_image(table, light, u) : uniform_direction(u);
}

EnvironmentValue value_of_infinite(const LightTable& table, size_t i, Float3 from, Float3 w) {
  const Light& light = table.lights[i];
  EnvironmentValue value{light.radiance, 0.25f / kPi};
  if (light.image) {
    value = environment_value(table.environment, to_light_frame(light, w));
    value.radiance = light.radiance * value.radiance;
  }
  if (const Portal* portal = portal_of(table, i)) {
    if (!looks_through(*portal, from, w)) value.radiance = {0, 0, 0};
    value.pdf_solid_angle = 0.5f * value.pdf_solid_angle + 0.5f * portal_pdf_solid_angle(*portal, from, w);
  }
  return value;
}

// A direction from one of them, weighed by all.
LightSample sample_infinite(const LightTable& table, size_t i, Float3 from, Float2 u) {
  LightSample sample;
  sample.distance = INFINITY;
  sample.w_next_world = direction_of_infinite(table, i, from, u);
  const EnvironmentValue value = infinite_value(table, from, sample.w_next_world);
  sample.radiance = value.radiance, sample.pdf_solid_angle = value.pdf_solid_angle;
  return sample;
}

}  // namespace

float light_power(const Light& light, float scene_radius_world, float of_image) {
  const float l = std::max(0.0f, luminance(light.radiance)) * (light.image ? of_image : 1);
  const float disk = kPi * scene_radius_world * scene_radius_world;
  switch (light.kind) {
    case LightKind::point:
      return 4 * kPi * l;
    case LightKind::spot:
      return 2 * kPi * l * (1 - 0.5f * (light.cos_total + light.cos_falloff));
    case LightKind::distant:
      return l * disk;
    case LightKind::infinite:
      return l * kPi * disk;
    case LightKind::goniometric:
    case LightKind::projection:
      return l;
  }
  return 0;
}

float emitter_power(const TriangleShape& shape, const Emission& emission) {
  const float l = std::max(0.0f, luminance(emission.radiance));
  return l * kPi * 0.5f * length(cross(shape.edge1, shape.edge2)) * (emission.two_sided ? 2.0f : 1.0f);
}

namespace {

LightPick choose_light(const LightTable& table, const LightReceiver& receiver, Float2 u_select) {
  if (table.empty()) return {};
  const size_t choice = last_at_most(table.cdf.first(table.cdf.size() - 1), u_select.x);
  const float chance = pmf(table, choice);
  LightPick pick{LightChild::light, static_cast<uint32_t>(choice - first_light(table)), 0, chance};
  if (choice < first_light(table)) {
    pick.kind = LightChild::emitter, pick.index = static_cast<uint32_t>(choice);
    if (!table.tree.empty()) {
      // The tree is the first choice: what is below its share is the place inside.
      const double u_tree =
          (static_cast<double>(u_select.x) + static_cast<double>(u_select.y) * 0x1p-24) / static_cast<double>(chance);
      pick = pick_light(table.tree, receiver, std::min(u_tree, 0x1.fffffffffffffp-1));
      pick.pmf = chance * pick.pmf;
    }
  }
  return pick;
}

LightSample sample_picked(const LightTable& table, const LightPick& pick, const LightReceiver& receiver, Float2 u) {
  if (pick.kind == LightChild::emitter) {
    const TriangleShape shape = emitter_in_world(table, pick.instance, pick.index);
    const Float3 from = receiver.position_world;
    return emitter_sample(table, pick, shape, from,
                          table.emitters_by_area ? sample_triangle_by_area(shape, from, u) : sample_triangle(shape, from, u));
  }
  if (pick.kind != LightChild::light) return {};
  const Light& light = table.lights[pick.index];
  switch (light.kind) {
    case LightKind::point:
    case LightKind::spot:
    case LightKind::goniometric:
    case LightKind::projection:
      return sample_point(table, light, pick.pmf, receiver.position_world);
    case LightKind::distant:
      return sample_distant(light, pick.pmf);
    case LightKind::infinite:
      return sample_infinite(table, pick.index, receiver.position_world, u);
  }
  return {};
}

constexpr size_t kLightsAtOnce = 64;

// At most kLightsAtOnce: points on triangles are found together.
void sample_some(const LightTable& table, std::span<const LightQuery> queries, std::span<LightSample> samples) {
  std::array<LightPick, kLightsAtOnce> picks;
  std::array<uint32_t, kLightsAtOnce> asking;
  std::array<TriangleQuery, kLightsAtOnce> triangles;
  std::array<TrianglePoint, kLightsAtOnce> points;
  size_t count = 0;
  for (uint32_t i = 0; i < queries.size(); ++i) {
    const auto& [receiver, u_select, u] = queries[i];
    const LightPick pick = picks[i] = choose_light(table, receiver, u_select);
    if (pick.kind == LightChild::emitter && !table.emitters_by_area) {
      asking[count] = i;
      triangles[count++] = {emitter_in_world(table, pick.instance, pick.index), receiver.position_world, u};
    } else {
      samples[i] = sample_picked(table, pick, receiver, u);
    }
  }
  sample_triangles(std::span(triangles).first(count), points);
  for (size_t t = 0; t < count; ++t)
    samples[asking[t]] =
        emitter_sample(table, picks[asking[t]], triangles[t].triangle, triangles[t].receiver, points[t]);
}

}  // namespace

LightSample sample_light(const LightTable& table, const LightReceiver& receiver, Float2 u_select, Float2 u) {
  return sample_picked(table, choose_light(table, receiver, u_select), receiver, u);
}

void sample_lights(const LightTable& table, std::span<const LightQuery> queries, std::span<LightSample> samples) {
  for (size_t first = 0; first < queries.size(); first += kLightsAtOnce)
    sample_some(table, queries.subspan(first, std::min(kLightsAtOnce, queries.size() - first)), samples.subspan(first));
}

TriangleShape emitter_in_world(const LightTable& table, uint32_t instance, uint32_t emitter) {
  const TriangleShape& shape = table.emitters[emitter].shape;
  if (instance == 0) return shape;
  const Affine3& t = table.tree.instances[instance].world_from_object;
  TriangleShape moved{t.point(shape.position), t.vector(shape.edge1), t.vector(shape.edge2)};
  // A mirror turns cross products over, but not the side.
  if (mirrors(t)) std::swap(moved.edge1, moved.edge2);
  return moved;
}

Rgb emitter_radiance(const TriangleShape& shape_world, const Emission& emission, Float3 w_world) {
  const float facing = -dot(cross(shape_world.edge1, shape_world.edge2), w_world);
  return emission.two_sided || facing > 0 ? emission.radiance : Rgb{0, 0, 0};
}

float emitter_pdf_solid_angle(const LightTable& table, const LightReceiver& receiver, uint32_t instance,
                              uint32_t emitter, const TriangleShape& shape_world, Float3 point_world) {
  const float place = table.emitters_by_area
                          ? triangle_pdf_by_area(shape_world, receiver.position_world, point_world)
                          : triangle_pdf_solid_angle(shape_world, receiver.position_world, point_world);
  if (table.tree.empty()) return pmf(table, emitter) * place;
  return pmf(table, 0) * emitter_pmf(table.tree, receiver, instance, emitter) * place;
}

bool has_infinite_light(const LightTable& table) { return table.first_infinite < table.lights.size(); }

EnvironmentValue infinite_value(const LightTable& table, Float3 from_world, Float3 w_world) {
  EnvironmentValue sum{{0, 0, 0}, 0};
  for (size_t i = table.first_infinite; i < table.lights.size(); ++i) {
    const EnvironmentValue value = value_of_infinite(table, i, from_world, w_world);
    sum.radiance += value.radiance;
    sum.pdf_solid_angle += pmf(table, first_light(table) + i) * value.pdf_solid_angle;
  }
  return sum;
}

}  // namespace spillway::shading
