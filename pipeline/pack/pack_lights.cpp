#include "pipeline/pack/pack_lights.h"

#include <algorithm>
#include <cmath>

#include "pipeline/evaluate_texture.h"
#include "pipeline/store.h"

namespace spillway::pipeline {
namespace {

using shading::has_place;

float mean_luminance(std::span<const Rgb> texels) {
  double sum = 0;
  for (const Rgb texel : texels) sum += luminance(texel);
  return texels.empty() ? 0 : static_cast<float>(sum / static_cast<double>(texels.size()));
}

// The emitters of one object, and where they are.
struct EmittingObject {
  std::vector<std::pair<size_t, size_t>> ranges;  // of emitters, one a mesh
  Bounds3 box;
};

class LightPacker {
 public:
  LightPacker(SpooledScene& scene, const PackLightsInput& input)
      : scene_(scene),
        in_(input),
        objects_(scene.object_count),
        mean_of_image_(mean_luminance(input.environment)),
        radius_(scene_sphere(input.bounds_world).radius) {}

  Result<PackedLights> pack() {
    SPILLWAY_TRY(add_emitters());
    add_lights();
    SPILLWAY_TRY(add_powers());
    if (has_tree()) SPILLWAY_TRY(build_trees());
    if (has_tree() && out_.trees.nodes.empty()) drop_dark_emitters();
    make_cdf();
    return std::move(out_);
  }

 private:
  Status add_emitters() {
    SpoolReader reader(*scene_.spool);
    for (SpooledMesh& mesh : scene_.meshes) {
      if (!mesh.emits) continue;
      const size_t first = out_.emitters.size();
      mesh.row.light_base = static_cast<uint32_t>(first);
      SPILLWAY_ASSIGN(const shading::Emission emission, emission_of(mesh));
      out_.emissions.push_back(emission);
      for (const MeshChunk& chunk : mesh.chunks) SPILLWAY_TRY(add_chunk(mesh, chunk, reader));
      objects_[mesh.row.object].ranges.emplace_back(first, out_.emitters.size());
    }
    return {};
  }

  // One given by what it comes to on the mean is divided by its image's, as pbrt-v4 does with "power".
  [[nodiscard]] Result<shading::Emission> emission_of(const SpooledMesh& mesh) const {
    shading::Emission emission{.radiance = mesh.emission};
    emission.two_sided = mesh.emits_two_sided ? 1 : 0;
    if (mesh.emission_texture == TextureId::kNone) return emission;
    emission.texture = mesh.emission_texture & shading::kNoEmissionTexture;
    const cache::ImageInfo& image = in_.images[in_.textures[mesh.emission_texture].image];
    if (const uint64_t at = image.not_finite; at != 0)
      return error("{}: texel ({}, {}) of the image it emits is infinite or no number; light must be finite", mesh.name,
                   (at - 1) % image.width, (at - 1) / image.width);
    if (!mesh.emission_is_mean) return emission;
    const float mean = luminance(mean_texel(mesh.emission_texture));
    if (!(mean > 0)) return error("{}: emits a black image, which cannot have the light's \"power\"", mesh.name);
    emission.radiance = emission.radiance * (1 / mean);
    if (!is_finite(emission.radiance))
      return error("{}: the image it emits is too dark for the light's \"power\"", mesh.name);
    return emission;
  }

  [[nodiscard]] Rgb mean_texel(uint32_t texture) const {
    const cache::ImageInfo& image = in_.images[in_.textures[texture].image];
    cache::Texel mean;
    for (uint32_t c = 0; c < 4; ++c) mean.value[c] = image.mean[image.channels < 3 ? 0 : c];
    return positive(image_value(in_.textures[texture], mean));
  }

  static Rgb positive(const cache::Texel& t) {
    return {std::max(0.0f, t.value[0]), std::max(0.0f, t.value[1]), std::max(0.0f, t.value[2])};
  }

  // What the texture is on each face of a chunk: the mean of footprints that cover its four quarters.
  Status add_texels(uint32_t texture, const cache::AttributeSegmentData& data) {
    static constexpr Float2 kWhole[3] = {{0, 0}, {1, 0}, {1, 1}};  // as shading_point, without uvs
    static constexpr Float2 kQuarters[4] = {
        {1.0f / 3, 1.0f / 3}, {2.0f / 3, 1.0f / 6}, {1.0f / 6, 2.0f / 3}, {1.0f / 6, 1.0f / 6}};
    std::vector<TextureQuery> queries;
    for (size_t i = 0; i < data.indices.size(); i += 3) {
      Float2 uv[3];
      for (size_t k = 0; k < 3; ++k) uv[k] = data.uvs.empty() ? kWhole[k] : data.uvs[data.indices[i + k]];
      const Float2 a = uv[1] - uv[0], b = uv[2] - uv[0];
      const float width = std::sqrt(std::fabs(a.x * b.y - a.y * b.x) / 8);  // of a quarter of its area
      for (const Float2 q : kQuarters)
        queries.push_back({texture, uv[0] + a * q.x + b * q.y, std::isfinite(width) ? width : 0});
    }
    std::vector<cache::Texel> values(queries.size());
    TextureEvaluator::Scratch scratch;
    SPILLWAY_TRY(TextureEvaluator(in_.textures, in_.image_cache).evaluate(queries, values, scratch));
    const Rgb least = mean_texel(texture) * kLeastOfMeanTexel;
    for (size_t f = 0; f < values.size(); f += 4) {
      Rgb sum{0, 0, 0};
      for (size_t k = 0; k < 4; ++k) sum += positive(values[f + k]) * 0.25f;
      texels_.push_back({std::max(sum.r, least.r), std::max(sum.g, least.g), std::max(sum.b, least.b)});
    }
    return {};
  }

  // As selection sees it.
  [[nodiscard]] shading::Emission mean_emission(size_t emitter) const {
    shading::Emission emission = out_.emissions[out_.emitters[emitter].emission];
    if (emission.texture != shading::kNoEmissionTexture) emission.radiance *= texels_[emitter];
    return emission;
  }

  Status add_chunk(const SpooledMesh& mesh, const MeshChunk& chunk, SpoolReader& reader) {
    const bool is_textured = mesh.emission_texture != TextureId::kNone;
    SPILLWAY_ASSIGN(const cache::AttributeSegmentData data, reader.read(chunk, is_textured));
    if (is_textured) {
      texels_.resize(out_.emitters.size(), Rgb{1, 1, 1});
      SPILLWAY_TRY(add_texels(mesh.emission_texture, data));
    }
    const bool flip = (mesh.row.flags & kMeshFlipNormals) != 0;
    Bounds3& box = objects_[mesh.row.object].box;
    for (size_t i = 0; i < data.indices.size(); i += 3) {
      Float3 corner[3];
      for (size_t k = 0; k < 3; ++k) corner[k] = data.positions[data.indices[i + k]], box.grow(corner[k]);
      shading::Emitter emitter{{corner[0], corner[1] - corner[0], corner[2] - corner[0]},
                               static_cast<uint32_t>(out_.emissions.size() - 1)};
      if (!std::isfinite(length_squared(cross(emitter.shape.edge1, emitter.shape.edge2))))
        return error("{}: emits light from a triangle too large for its area to be computed; scale the scene down",
                     mesh.name);
      if (flip) std::swap(emitter.shape.edge1, emitter.shape.edge2);
      out_.emitters.push_back(emitter);
    }
    if (out_.emitters.size() > shading::kMaxLightIndex)
      return error("{}: the scene has more than {} triangles that emit; make instances of them", mesh.name,
                   shading::kMaxLightIndex);
    return {};
  }

  void add_lights() {
    out_.lights.assign(in_.other_lights.begin(), in_.other_lights.end());
    std::stable_partition(out_.lights.begin(), out_.lights.end(),
                          [](const shading::Light& light) { return light.kind != shading::LightKind::infinite; });
    for (const shading::Light& light : out_.lights) {
      if (has_place(light)) objects_[0].box.grow(light.position);
    }
  }

  Status add_powers() {
    const auto check = [](const char* what, size_t index, double power) -> Status {
      if (std::isfinite(power) && power >= 0) return {};
      return error("{} {}: has a power of {}; scale its emission or the scene down", what, index, power);
    };
    for (size_t i = 0; i < out_.emitters.size(); ++i) {
      const shading::Emitter& emitter = out_.emitters[i];
      emitter_power_.push_back(shading::emitter_power(emitter.shape, mean_emission(i)));
      SPILLWAY_TRY(check("emitting triangle", i, emitter_power_.back()));
      if (emitter_power_.back() == 0) ++out_.dark_count;
    }
    for (size_t i = 0; i < out_.lights.size(); ++i) {
      light_power_.push_back(shading::light_power(out_.lights[i], radius_, of_image(out_.lights[i])));
      SPILLWAY_TRY(check("light", i, light_power_.back()));
      if (light_power_.back() == 0) ++out_.dark_count;
    }
    return {};
  }

  [[nodiscard]] float of_image(const shading::Light& light) const {
    return shading::throws_image(light) ? in_.light_images[light.image - 1].integral : mean_of_image_;
  }

  [[nodiscard]] bool has_tree() const {
    const auto with_place = static_cast<size_t>(std::count_if(out_.lights.begin(), out_.lights.end(), has_place));
    return in_.emitting_instance_count > 0 || out_.emitters.size() + with_place > kFewLights;
  }

  // Prototypes first: the world's tree needs their bounds.
  Status build_trees() {
    LightTreeBuilder builder(scene_.object_count, out_.emitters.size(), in_.emitting_instance_count, in_.tree);
    std::vector<LightTreeBuilder::Object> built(scene_.object_count);
    for (uint32_t o = 1; o < scene_.object_count; ++o) {
      builder.begin(o, objects_[o].box);
      SPILLWAY_TRY(add_triangles(o, builder));
      SPILLWAY_ASSIGN(built[o], builder.end());
    }
    for (size_t i = 1; i <= in_.emitting_instance_count; ++i)
      objects_[0].box.grow(instance(built, static_cast<uint32_t>(i)).box);
    builder.begin(0, objects_[0].box);
    SPILLWAY_TRY(add_triangles(0, builder));
    for (uint32_t i = 0; i < out_.lights.size(); ++i)
      if (has_place(out_.lights[i])) SPILLWAY_TRY(builder.add(light_item(out_.lights[i], i, of_image(out_.lights[i]))));
    for (uint32_t i = 1; i <= in_.emitting_instance_count; ++i) {
      const LightItem item = instance(built, i);
      if (!std::isfinite(item.energy))
        return error("instance {}: its transform makes its light too strong; scale its emission or the scene down", i);
      SPILLWAY_TRY(builder.add(item));
    }
    SPILLWAY_ASSIGN(const LightTreeBuilder::Object world, builder.end());
    tree_power_ = static_cast<double>(world.bounds.energy) * M_PI;
    if (!std::isfinite(tree_power_)) return error("the lights of the scene are too strong together: scale them down");
    out_.trees = builder.take();
    return {};
  }

  Status add_triangles(uint32_t object, LightTreeBuilder& builder) const {
    for (const auto& [first, last] : objects_[object].ranges)
      for (size_t i = first; i < last; ++i) {
        SPILLWAY_TRY(builder.add(emitter_item(out_.emitters[i].shape, mean_emission(i), static_cast<uint32_t>(i))));
      }
    return {};
  }

  [[nodiscard]] LightItem instance(const std::vector<LightTreeBuilder::Object>& built, uint32_t i) const {
    const cache::Instance& instance = in_.instances[i];
    const LightTreeBuilder::Object& object = built[instance.object];
    if (object.bounds.energy == 0) return {};
    return instance_item(object.bounds, object.moments, instance.world_from_object, i);
  }

  // Nothing that would be in the tree shines; without it, instances have no place among the choices.
  void drop_dark_emitters() {
    for (SpooledMesh& mesh : scene_.meshes) mesh.row.light_base = LightId::kNone;
    out_.emitters.clear(), out_.emissions.clear(), out_.trees = {};
    emitter_power_.clear();
  }

  void make_cdf() {
    const bool tree = !out_.trees.nodes.empty();
    std::vector<double> power;
    if (tree)
      power.push_back(tree_power_);
    else
      power.assign(emitter_power_.begin(), emitter_power_.end());
    const size_t first_light = power.size();
    for (size_t i = 0; i < out_.lights.size(); ++i)
      power.push_back(tree && has_place(out_.lights[i]) ? 0 : light_power_[i]);
    limit_unbounded(std::span(power).first(first_light), std::span(power).subspan(first_light));
    std::vector<double> sum{0};
    for (const double p : power) sum.push_back(sum.back() + p);
    // Without any power each light is as good as the others.
    if (sum.back() == 0)
      for (size_t i = 0; i < sum.size(); ++i) sum[i] = static_cast<double>(i);
    out_.cdf.assign(sum.size(), 0);
    for (size_t i = 1; i < sum.size(); ++i) out_.cdf[i] = static_cast<float>(sum[i] / sum.back());
  }

  void limit_unbounded(std::span<const double> emitters, std::span<double> lights) const {
    double with_place = 0, without = 0;
    for (const double p : emitters) with_place += p;
    for (size_t i = 0; i < lights.size(); ++i) (has_place(out_.lights[i]) ? with_place : without) += lights[i];
    if (with_place == 0 || without <= with_place) return;
    for (size_t i = 0; i < lights.size(); ++i)
      if (!has_place(out_.lights[i])) lights[i] *= with_place / without;
  }

  SpooledScene& scene_;
  const PackLightsInput& in_;
  std::vector<EmittingObject> objects_;
  float mean_of_image_, radius_;
  std::vector<Rgb> texels_;  // by emitter, as far as the last textured one
  std::vector<float> emitter_power_, light_power_;
  double tree_power_ = 0;
  PackedLights out_;
};

}  // namespace

Result<PackedLights> pack_lights(SpooledScene& scene, const PackLightsInput& input) {
  return LightPacker(scene, input).pack();
}

}  // namespace spillway::pipeline
