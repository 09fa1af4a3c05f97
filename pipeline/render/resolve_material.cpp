#include "pipeline/render/resolve_material.h"

#include "cache/base/clamp_unit.h"

#include <cmath>

namespace spillway::pipeline {
namespace {

// Half a footprint, as pbrt-v4 section 10.5.3 displaces; where there is none, its fixed step.
constexpr float kBumpStepWithoutFootprint = 0.0005f;

// Keeps mix decisions apart from alpha decisions, whose third number is an event (even or odd, small).
constexpr uint32_t kMixDecision = 0xffffffffu;

// A leaf's parameters by number, so that lookups and their use walk them in the same order.
enum ParamSlot { kReflectance, kTransmittance, kURoughness, kVRoughness, kBaseURoughness, kBaseVRoughness, kEta, kK, kParamSlots };
using LeafParams = Rgb[kParamSlots];

const Param& param(const Material& m, int slot) {
  switch (slot) {
    case kReflectance: return m.reflectance;
    case kTransmittance: return m.transmittance;
    case kURoughness: return m.u_roughness;
    case kVRoughness: return m.v_roughness;
    case kBaseURoughness: return m.base_u_roughness;
    case kBaseVRoughness: return m.base_v_roughness;
    case kEta: return m.conductor_eta;
    default: return m.conductor_k;
  }
}

float alpha_of(const Material& m, Rgb roughness) {
  const float r = std::max(0.0f, roughness.r);
  return m.remap_roughness ? std::sqrt(r) : r;
}

Rgb clamp_unit(Rgb c) {
  return {spillway::clamp_unit(c.r), spillway::clamp_unit(c.g), spillway::clamp_unit(c.b)};
}

// eta = 1 and the k that reflects r at normal incidence (pbrt-v4, ConductorMaterial).
float k_for_reflectance(float r) {
  const float capped = std::min(std::max(r, 0.0f), 0.9999f);
  return 2 * std::sqrt(capped) / std::sqrt(1 - capped);
}

shading::BsdfKind bsdf_kind(MaterialKind kind) {
  switch (kind) {
    case MaterialKind::diffuse: return shading::BsdfKind::diffuse;
    case MaterialKind::conductor: return shading::BsdfKind::conductor;
    case MaterialKind::dielectric: return shading::BsdfKind::dielectric;
    case MaterialKind::thin_dielectric: return shading::BsdfKind::thin_dielectric;
    case MaterialKind::coated_diffuse: return shading::BsdfKind::coated_diffuse;
    case MaterialKind::coated_conductor: return shading::BsdfKind::coated_conductor;
    case MaterialKind::diffuse_transmission: return shading::BsdfKind::diffuse_transmission;
    case MaterialKind::mix: break;
  }
  return shading::BsdfKind::none;
}

shading::BsdfParams leaf_bsdf(const Material& m, const LeafParams& p) {
  shading::BsdfParams b;
  b.kind = bsdf_kind(m.kind);
  b.alpha_x = alpha_of(m, p[kURoughness]), b.alpha_y = alpha_of(m, p[kVRoughness]);
  b.base_alpha_x = alpha_of(m, p[kBaseURoughness]), b.base_alpha_y = alpha_of(m, p[kBaseVRoughness]);
  b.eta = m.eta;
  if (b.kind == shading::BsdfKind::coated_diffuse) b.coat_internal_reflectance = m.coat_internal_reflectance;
  b.reflectance = clamp_unit(p[kReflectance]);
  b.transmittance = clamp_unit(p[kTransmittance]);
  b.conductor_eta = p[kEta], b.conductor_k = p[kK];
  if (m.uses_reflectance) {
    b.conductor_eta = {1, 1, 1};
    b.conductor_k = {k_for_reflectance(b.reflectance.r), k_for_reflectance(b.reflectance.g),
                     k_for_reflectance(b.reflectance.b)};
  }
  return b;
}

bool is_textured(const Material& m) {
  for (int slot = 0; slot < kParamSlots; ++slot)
    if (param(m, slot).texture != TextureId::kNone) return true;
  return m.displacement != TextureId::kNone || m.normal_map != TextureId::kNone;
}

float bump_step(const ShadingPoint& point) {
  return point.width_uv > 0 ? 0.5f * point.width_uv : kBumpStepWithoutFootprint;
}

// Three lookups of the displacement: here, one step along u, one along v.
void add_bump_queries(uint32_t texture, const ShadingPoint& point, std::vector<TextureQuery>& queries) {
  const float step = bump_step(point);
  queries.push_back({texture, point.uv, point.width_uv, &point});
  queries.push_back({texture, {point.uv.x + step, point.uv.y}, point.width_uv, &point});
  queries.push_back({texture, {point.uv.x, point.uv.y + step}, point.width_uv, &point});
}

// Tilts the shading normal by the surface gradient of the displacement (Mikkelsen 2010, Bump Mapping Unparametrized
// Surfaces on the GPU, section 2).
Float3 bumped_normal(const ShadingPoint& point, const cache::Texel* displacement) {
  const float step = bump_step(point);
  const float d_du = (displacement[1].value[0] - displacement[0].value[0]) / step;
  const float d_dv = (displacement[2].value[0] - displacement[0].value[0]) / step;
  const Float3 n = point.normal_shading;
  const float determinant = dot(n, cross(point.dpdu, point.dpdv));
  const Float3 gradient = cross(point.dpdv, n) * d_du + cross(n, point.dpdu) * d_dv;
  const Float3 tilted = n * std::fabs(determinant) - gradient * (determinant < 0 ? -1.0f : 1.0f);
  const float squared = length_squared(tilted);
  return squared > 0 && std::isfinite(squared) ? tilted * (1 / std::sqrt(squared)) : n;
}

// The map's normal in the frame of the shading normal and dp/du (pbrt-v4, NormalMap); one that points nowhere is none.
Float3 mapped_normal(const ShadingPoint& point, const cache::Texel& map) {
  const Float3 local{2 * map.value[0] - 1, 2 * map.value[1] - 1, 2 * map.value[2] - 1};
  const Float3 n = shading::frame_from_z_and_tangent(point.normal_shading, point.dpdu).world_from_local(local);
  const float squared = length_squared(n);
  return squared > 0 && std::isfinite(squared) ? n * (1 / std::sqrt(squared)) : point.normal_shading;
}

}  // namespace

MaterialResolver::MaterialResolver(const MaterialTables& tables, uint32_t seed) : tables_(tables), seed_(seed) {
  for (const Material& m : tables.materials) {
    LeafParams p;
    for (int slot = 0; slot < kParamSlots; ++slot) p[slot] = param(m, slot).constant;
    constants_.push_back(leaf_bsdf(m, p));
    is_textured_.push_back(is_textured(m));
    std::vector<uint32_t> faces;
    if (tables.textures != nullptr) faces = face_texture_params(m, tables.textures->nodes());
    if (m.kind == MaterialKind::mix)
      for (const uint32_t part : m.mix_material)
        faces.insert(faces.end(), face_textures_[part].begin(), face_textures_[part].end());
    face_textures_.push_back(std::move(faces));
  }
}

Status MaterialResolver::resolve(std::span<SurfaceQuery> block, Scratch& scratch) const {
  SPILLWAY_TRY(decide_alpha(block, scratch));
  SPILLWAY_TRY(decide_mixes(block, scratch));
  if (!tables_.emissions.empty()) SPILLWAY_TRY(look_up_emission(block, scratch));
  return resolve_leaves(block, scratch);
}

void MaterialResolver::append_face_requests(const SurfaceQuery& q,
                                            std::vector<cache::FaceTextureRequest>& requests) const {
  if (q.point->face == nullptr) return;
  const Mesh& mesh = tables_.meshes[q.mesh];
  const bool has_arrived = q.hit->is_shadow == kShadowArrived && mesh.alpha_texture != TextureId::kNone;
  if ((q.hit->hit.flags & cache::kHitAlphaUnknown) || has_arrived)
    tables_.textures->append_face_requests({mesh.alpha_texture, q.point->uv, 0, q.point}, requests);
  if (q.hit->is_shadow) return;
  for (const uint32_t texture : face_textures_[mesh.material])
    tables_.textures->append_face_requests({texture, q.point->uv, q.point->width_uv, q.point}, requests);
}

Status MaterialResolver::decide_alpha(std::span<SurfaceQuery> block, Scratch& scratch) const {
  scratch.queries.clear();
  const auto is_interface = [&](const SurfaceQuery& q) { return (tables_.meshes[q.mesh].flags & kMeshIsInterface) != 0; };
  for (SurfaceQuery& q : block) {
    q.stopped = !(q.hit->hit.flags & cache::kHitAlphaUnknown);
    q.material = tables_.meshes[q.mesh].material;
    if (is_interface(q)) continue;
    // The finest level, as the micromap saw it: a coarser one could be opaque where the map says it is clear.
    if (!q.stopped) scratch.queries.push_back({tables_.meshes[q.mesh].alpha_texture, q.point->uv, 0, q.point});
  }
  if (scratch.queries.empty()) return {};
  scratch.values.resize(scratch.queries.size());
  SPILLWAY_TRY(tables_.textures->evaluate(scratch.queries, scratch.values, scratch.evaluator));
  size_t next = 0;
  for (SurfaceQuery& q : block)
    if (!q.stopped && !is_interface(q)) q.stopped = stopped_by_alpha(*q.hit, seed_, scratch.values[next++].value[0]);
  return {};
}

// A level of mixes a turn; a mix of mixes takes another. The depth is bounded: materials come after their parts.
Status MaterialResolver::decide_mixes(std::span<SurfaceQuery> block, Scratch& scratch) const {
  for (uint32_t level = 0;; ++level) {
    scratch.queries.clear();
    scratch.pending.clear();
    for (uint32_t i = 0; i < block.size(); ++i) {
      const SurfaceQuery& q = block[i];
      const Material& m = tables_.materials[q.material];
      if (!q.stopped || q.hit->is_shadow || m.kind != MaterialKind::mix) continue;
      scratch.pending.push_back(i);
      if (m.mix_amount.texture != TextureId::kNone)
        scratch.queries.push_back({m.mix_amount.texture, q.point->uv, q.point->width_uv, q.point});
    }
    if (scratch.pending.empty()) return {};
    scratch.values.resize(scratch.queries.size());
    if (!scratch.queries.empty())
      SPILLWAY_TRY(tables_.textures->evaluate(scratch.queries, scratch.values, scratch.evaluator));
    size_t next = 0;
    for (const uint32_t i : scratch.pending) {
      SurfaceQuery& q = block[i];
      const Material& m = tables_.materials[q.material];
      const float amount =
          m.mix_amount.texture != TextureId::kNone ? scratch.values[next++].value[0] : m.mix_amount.constant.r;
      const float u = shading::hashed_1d(sample_key(q.hit->path, seed_), shading::SampleStream::decisions,
                                         q.hit->path.bounce, level, kMixDecision);
      q.material = m.mix_material[u < amount ? 1 : 0];
    }
  }
}

// The finest level, as alpha: both ways of meeting a light must find the same. A path is stopped by an opacity with
// that chance, a light sample weighed by it.
Status MaterialResolver::look_up_emission(std::span<SurfaceQuery> block, Scratch& scratch) const {
  struct Textures {
    uint32_t radiance = TextureId::kNone, opacity = TextureId::kNone;
  };
  const auto textures_of = [&](const SurfaceQuery& q) -> Textures {
    const Mesh& mesh = tables_.meshes[q.mesh];
    const bool has_arrived = q.hit->is_shadow == kShadowArrived;
    if (mesh.light_base == LightId::kNone || !q.stopped || (q.hit->is_shadow && !has_arrived)) return {};
    const uint32_t texture = tables_.emissions[tables_.emitters[mesh.light_base].emission].texture;
    return {texture == shading::kNoEmissionTexture ? TextureId::kNone : texture,
            has_arrived ? mesh.alpha_texture : TextureId::kNone};
  };
  scratch.queries.clear();
  for (const SurfaceQuery& q : block) {
    const Textures textures = textures_of(q);
    for (const uint32_t texture : {textures.radiance, textures.opacity})
      if (texture != TextureId::kNone) scratch.queries.push_back({texture, q.point->uv, 0, q.point});
  }
  if (scratch.queries.empty()) return {};
  scratch.values.resize(scratch.queries.size());
  SPILLWAY_TRY(tables_.textures->evaluate(scratch.queries, scratch.values, scratch.evaluator));
  const cache::Texel* next = scratch.values.data();
  for (SurfaceQuery& q : block) {
    const Textures textures = textures_of(q);
    if (textures.radiance != TextureId::kNone) {
      const cache::Texel& texel = *next++;
      q.values.emitted = {std::max(0.0f, texel.value[0]), std::max(0.0f, texel.value[1]),
                          std::max(0.0f, texel.value[2])};
    }
    if (textures.opacity != TextureId::kNone) q.values.emitted = q.values.emitted * spillway::clamp_unit((next++)->value[0]);
  }
  return {};
}

Status MaterialResolver::resolve_leaves(std::span<SurfaceQuery> block, Scratch& scratch) const {
  scratch.queries.clear();
  scratch.pending.clear();
  for (uint32_t i = 0; i < block.size(); ++i) {
    SurfaceQuery& q = block[i];
    if (!q.stopped || q.hit->is_shadow) continue;
    const Mesh& mesh = tables_.meshes[q.mesh];
    q.values.bsdf = constants_[q.material];
    q.values.normal_shading = q.point->normal_shading;
    q.values.light = mesh.light_base == LightId::kNone ? LightId::kNone : mesh.light_base + (q.hit->hit.prim - mesh.prim_base);
    if (!is_textured_[q.material]) continue;
    scratch.pending.push_back(i);
    const Material& m = tables_.materials[q.material];
    for (int slot = 0; slot < kParamSlots; ++slot)
      if (param(m, slot).texture != TextureId::kNone)
        scratch.queries.push_back({param(m, slot).texture, q.point->uv, q.point->width_uv, q.point});
    if (m.displacement != TextureId::kNone) add_bump_queries(m.displacement, *q.point, scratch.queries);
    if (m.normal_map != TextureId::kNone)
      scratch.queries.push_back({m.normal_map, q.point->uv, q.point->width_uv, q.point});
  }
  if (scratch.pending.empty()) return {};
  scratch.values.resize(scratch.queries.size());
  SPILLWAY_TRY(tables_.textures->evaluate(scratch.queries, scratch.values, scratch.evaluator));
  const cache::Texel* next = scratch.values.data();
  for (const uint32_t i : scratch.pending) {
    SurfaceQuery& q = block[i];
    const Material& m = tables_.materials[q.material];
    LeafParams p;
    for (int slot = 0; slot < kParamSlots; ++slot) {
      const bool textured = param(m, slot).texture != TextureId::kNone;
      p[slot] = textured ? Rgb{next->value[0], next->value[1], next->value[2]} : param(m, slot).constant;
      if (textured) ++next;
    }
    q.values.bsdf = leaf_bsdf(m, p);
    if (m.displacement != TextureId::kNone) {
      q.values.normal_shading = bumped_normal(*q.point, next);
      next += 3;
    }
    if (m.normal_map != TextureId::kNone) q.values.normal_shading = mapped_normal(*q.point, *next++);
  }
  return {};
}

}  // namespace spillway::pipeline
