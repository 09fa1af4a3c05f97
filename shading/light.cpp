#include "shading/light.h"

#include <algorithm>
#include <cmath>

#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

float smoothstep(float edge0, float edge1, float x) {
  const float t = std::clamp((x - edge0) / (edge1 - edge0), 0.0f, 1.0f);
  return t * t * (3 - 2 * t);
}

float spot_falloff(const Light& light, Float3 w_from_light) {
  const float cosine = dot(light.edge1, w_from_light);
  if (cosine >= light.cos_falloff) return 1;
  return cosine <= light.cos_total ? 0 : smoothstep(light.cos_total, light.cos_falloff, cosine);
}

// The chance of a light; the same subtraction wherever it is asked for.
float pmf(const LightTable& table, uint32_t index) { return table.cdf[index + 1] - table.cdf[index]; }

// The one place where an area density becomes one over solid angle: sampling and chance hits both come here, so that
// their bits agree. Infinite at grazing angles is given as 0: such samples carry nothing.
float pdf_from_area(const Light& light, float chance, Float3 receiver_world, Float3 point_world) {
  const Float3 n = cross(light.edge1, light.edge2);
  const Float3 to_light = point_world - receiver_world;
  const float squared = length_squared(to_light);
  const float cosine_times = std::fabs(dot(n, to_light));  // cos * double_area * distance
  if (!(cosine_times > 0)) return 0;
  // distance^2 / (area cos): the length of n, twice the area, cancels against the cosine's.
  return chance * 2 * squared * std::sqrt(squared) / cosine_times;
}

LightSample sample_triangle(const Light& light, float chance, Float3 receiver, Float2 u) {
  // Uniform on the triangle without a fold (Heitz 2019, A Low-Distortion Map Between Triangle and Square).
  float b1 = u.x * 0.5f, b2 = u.y * 0.5f;
  const float offset = b2 - b1;
  if (offset > 0)
    b2 += offset;
  else
    b1 -= offset;
  LightSample sample;
  sample.point_world = light.position + light.edge1 * b1 + light.edge2 * b2;
  const Float3 to_light = sample.point_world - receiver;
  sample.distance = length(to_light);
  if (!(sample.distance > 0)) return {};
  sample.w_next_world = to_light * (1 / sample.distance);
  sample.radiance = triangle_radiance(light, sample.w_next_world);
  sample.pdf_solid_angle = pdf_from_area(light, chance, receiver, sample.point_world);
  return sample;
}

LightSample sample_point(const Light& light, float chance, Float3 receiver) {
  const Float3 to_light = light.position - receiver;
  const float squared = length_squared(to_light);
  if (!(squared > 0)) return {};
  LightSample sample;
  sample.point_world = light.position;
  sample.distance = std::sqrt(squared);
  sample.w_next_world = to_light * (1 / sample.distance);
  sample.radiance = light.radiance * (1 / squared);
  if (light.kind == LightKind::spot) sample.radiance = sample.radiance * spot_falloff(light, -sample.w_next_world);
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

Float3 to_light_frame(const Light& light, Float3 w) { return {dot(light.position, w), dot(light.edge1, w), dot(light.edge2, w)}; }

Float3 uniform_direction(Float2 u) {
  const float z = 1 - 2 * u.x;
  const float r = std::sqrt(std::max(0.0f, 1 - z * z));
  const SinCos phi = sin_cos_turn(u.y);
  return {r * phi.cos, r * phi.sin, z};
}

Float3 direction_of_image(const LightTable& table, const Light& light, Float2 u) {
  const Float3 w = sample_environment(table.environment, u);
  return normalize(light.position * w.x + light.edge1 * w.y + light.edge2 * w.z);
}

// A direction from one of them, weighed by all.
LightSample sample_infinite(const LightTable& table, const Light& light, Float2 u) {
  LightSample sample;
  sample.distance = INFINITY;
  sample.w_next_world = light.has_image ? direction_of_image(table, light, u) : uniform_direction(u);
  sample.radiance = infinite_radiance(table, sample.w_next_world);
  sample.pdf_solid_angle = infinite_pdf_solid_angle(table, sample.w_next_world);
  return sample;
}

}  // namespace

float light_power(const Light& light, float scene_radius_world, float mean_of_image) {
  const float l = std::max(0.0f, luminance(light.radiance)) * (light.has_image ? mean_of_image : 1);
  const float disk = kPi * scene_radius_world * scene_radius_world;
  switch (light.kind) {
    case LightKind::triangle:
      return l * kPi * 0.5f * length(cross(light.edge1, light.edge2)) * (light.two_sided ? 2.0f : 1.0f);
    case LightKind::point: return 4 * kPi * l;
    case LightKind::spot: return 2 * kPi * l * (1 - 0.5f * (light.cos_total + light.cos_falloff));
    case LightKind::distant: return l * disk;
    case LightKind::infinite: return l * kPi * disk;
  }
  return 0;
}

LightSample sample_light(const LightTable& table, Float3 receiver_world, float u_select, Float2 u) {
  if (table.lights.empty()) return {};
  const auto after = std::upper_bound(table.cdf.begin() + 1, table.cdf.end() - 1, u_select);
  const auto index = static_cast<uint32_t>(after - table.cdf.begin()) - 1;
  const Light& light = table.lights[index];
  const float chance = pmf(table, index);
  switch (light.kind) {
    case LightKind::triangle: return sample_triangle(light, chance, receiver_world, u);
    case LightKind::point:
    case LightKind::spot: return sample_point(light, chance, receiver_world);
    case LightKind::distant: return sample_distant(light, chance);
    case LightKind::infinite: return sample_infinite(table, light, u);
  }
  return {};
}

Rgb triangle_radiance(const Light& light, Float3 w_world) {
  const float facing = -light.normal_sign * dot(cross(light.edge1, light.edge2), w_world);
  return light.two_sided || facing > 0 ? light.radiance : Rgb{0, 0, 0};
}

float triangle_pdf_solid_angle(const LightTable& table, uint32_t index, Float3 receiver_world, Float3 point_world) {
  return pdf_from_area(table.lights[index], pmf(table, index), receiver_world, point_world);
}

bool has_infinite_light(const LightTable& table) { return table.first_infinite < table.lights.size(); }

Rgb infinite_radiance(const LightTable& table, Float3 w_world) {
  Rgb sum{0, 0, 0};
  for (size_t i = table.first_infinite; i < table.lights.size(); ++i) {
    const Light& light = table.lights[i];
    sum += light.has_image ? light.radiance * environment_radiance(table.environment, to_light_frame(light, w_world)) : light.radiance;
  }
  return sum;
}

float infinite_pdf_solid_angle(const LightTable& table, Float3 w_world) {
  float sum = 0;
  for (uint32_t i = table.first_infinite; i < table.lights.size(); ++i) {
    const Light& light = table.lights[i];
    sum += pmf(table, i) * (light.has_image ? environment_pdf(table.environment, to_light_frame(light, w_world)) : 0.25f / kPi);
  }
  return sum;
}

}  // namespace spillway::shading
