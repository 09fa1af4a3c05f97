#include "pipeline/pack/pack_lights.h"

#include <algorithm>
#include <cmath>

#include "pipeline/store.h"

namespace spillway::pipeline {
namespace {

Status add_chunk_lights(const SpooledMesh& mesh, const MeshChunk& chunk, SpoolReader& reader,
                        std::vector<shading::Light>& lights) {
  SPILLWAY_ASSIGN(const cache::AttributeSegmentData data, reader.read(chunk, false));
  for (size_t i = 0; i < data.indices.size(); i += 3) {
    const Float3 p0 = data.positions[data.indices[i]];
    shading::Light light{};
    light.kind = shading::LightKind::triangle;
    light.two_sided = mesh.emits_two_sided ? 1 : 0;
    light.radiance = mesh.emission;
    light.position = p0;
    light.edge1 = data.positions[data.indices[i + 1]] - p0;
    light.edge2 = data.positions[data.indices[i + 2]] - p0;
    light.normal_sign = (mesh.row.flags & kMeshFlipNormals) != 0 ? -1.0f : 1.0f;
    if (!std::isfinite(length_squared(cross(light.edge1, light.edge2))))
      return error("{}: emits light from a triangle too large for its area to be computed; scale the scene down",
                   mesh.name);
    lights.push_back(light);
  }
  return {};
}

bool has_place(const shading::Light& light) {
  return light.kind != shading::LightKind::distant && light.kind != shading::LightKind::infinite;
}

// The power of sun and sky is what the scene's whole sphere catches, and a room sees little of it: beside lights that
// have a place they get at most half of the samples.
void limit_unbounded(std::span<const shading::Light> lights, std::span<double> power) {
  double with_place = 0, without = 0;
  for (size_t i = 0; i < lights.size(); ++i) (has_place(lights[i]) ? with_place : without) += power[i];
  if (with_place == 0 || without <= with_place) return;
  for (size_t i = 0; i < lights.size(); ++i)
    if (!has_place(lights[i])) power[i] *= with_place / without;
}

float mean_luminance(std::span<const Rgb> texels) {
  double sum = 0;
  for (const Rgb texel : texels) sum += luminance(texel);
  return texels.empty() ? 0 : static_cast<float>(sum / static_cast<double>(texels.size()));
}

Result<std::vector<float>> power_cdf(std::span<const shading::Light> lights, float mean_of_image, float scene_radius_world) {
  std::vector<double> power;
  for (const shading::Light& light : lights) {
    power.push_back(shading::light_power(light, scene_radius_world, mean_of_image));
    if (!std::isfinite(power.back()) || power.back() < 0)
      return error("light {}: has a power of {}; scale its emission or the scene down", power.size() - 1, power.back());
  }
  limit_unbounded(lights, power);
  std::vector<double> sum{0};
  for (const double p : power) sum.push_back(sum.back() + p);
  // Without any power each light is as good as the others.
  if (sum.back() == 0)
    for (size_t i = 0; i < sum.size(); ++i) sum[i] = static_cast<double>(i);
  std::vector<float> cdf(sum.size(), 0);
  for (size_t i = 1; i < sum.size(); ++i) cdf[i] = static_cast<float>(sum[i] / sum.back());
  return cdf;
}

}  // namespace

Result<PackedLights> pack_lights(SpooledScene& scene, std::span<const shading::Light> other_lights,
                                 std::span<const Rgb> environment, const Bounds3& bounds_world) {
  PackedLights packed;
  SpoolReader reader(*scene.spool);
  for (SpooledMesh& mesh : scene.meshes) {
    if (!mesh.emits) continue;
    mesh.row.light_base = static_cast<uint32_t>(packed.lights.size());
    for (const MeshChunk& chunk : mesh.chunks) SPILLWAY_TRY(add_chunk_lights(mesh, chunk, reader, packed.lights));
  }
  packed.lights.insert(packed.lights.end(), other_lights.begin(), other_lights.end());
  std::stable_partition(packed.lights.begin(), packed.lights.end(),
                        [](const shading::Light& light) { return light.kind != shading::LightKind::infinite; });
  SPILLWAY_ASSIGN(packed.cdf, power_cdf(packed.lights, mean_luminance(environment), scene_sphere(bounds_world).radius));
  return packed;
}

}  // namespace spillway::pipeline
