#include "shading/bsdf.h"

#include <algorithm>
#include <cmath>

#include "shading/frame.h"
#include "shading/microfacet.h"

namespace spillway::shading {
namespace {

constexpr Rgb kWhite{1, 1, 1};

bool is_smooth(float alpha_x, float alpha_y) { return std::max(alpha_x, alpha_y) < kSmoothAlpha; }

// A lobe that is smooth in one direction only is as rough there as the least rough lobe may be.
Ggx ggx(float alpha_x, float alpha_y) { return {std::max(alpha_x, kSmoothAlpha), std::max(alpha_y, kSmoothAlpha)}; }

Float3 mirrored(Float3 w) { return {-w.x, -w.y, w.z}; }
Float3 reflected(Float3 w, Float3 m) { return m * (2 * dot(w, m)) - w; }

Float3 cosine_hemisphere(Float2 u) {
  const Float2 d = concentric_disk(u);
  return {d.x, d.y, std::sqrt(std::max(0.0f, 1 - d.x * d.x - d.y * d.y))};
}

// ---- opaque surfaces: everything happens on the side of w_prev, z > 0 ----

BsdfValue diffuse_value(Rgb albedo, Float3 o) { return {albedo * (o.z / kPi), o.z / kPi}; }

// Reflection of a GGX surface without its Fresnel factor: D G / (4 cos cos) cos, and the pdf of sampling it.
struct Facet {
  float value = 0, pdf = 0, cos_m = 0;
};
Facet facet_reflection(const Ggx& surface, Float3 i, Float3 o) {
  const Float3 sum = i + o;
  if (!(length_squared(sum) > 0)) return {};
  const Float3 m = normalize(sum);
  const float cos_m = dot(i, m);
  if (!(cos_m > 0)) return {};
  return {surface.d(m) * surface.g2(i, o) / (4 * i.z), surface.visible_pdf(i, m) / (4 * cos_m), cos_m};
}

BsdfValue conductor_value(const Ggx& surface, Rgb eta, Rgb k, Float3 i, Float3 o) {
  const Facet f = facet_reflection(surface, i, o);
  return {fresnel_conductor(f.cos_m, eta, k) * f.value, f.pdf};
}

// A coat over a base that reflects on the same side.
struct Coat {
  bool is_smooth;
  Ggx surface;
  float eta;
  [[nodiscard]] float reflectance(Float3 w) const { return fresnel_dielectric(w.z, eta); }
  [[nodiscard]] float both_ways(Float3 i, Float3 o) const { return (1 - reflectance(i)) * (1 - reflectance(o)); }
};
Coat coat_of(const BsdfParams& b) { return {is_smooth(b.alpha_x, b.alpha_y), ggx(b.alpha_x, b.alpha_y), b.eta}; }

bool base_is_smooth(const BsdfParams& b) {
  return b.kind == BsdfKind::coated_conductor && is_smooth(b.base_alpha_x, b.base_alpha_y);
}

// The base as seen through the coat, without the two passages.
Rgb coated_diffuse_albedo(const BsdfParams& b) {
  const Rgb r = b.reflectance;
  const float inside = b.coat_internal_reflectance, scale = 1 / (b.eta * b.eta);
  return {scale * r.r / (1 - r.r * inside), scale * r.g / (1 - r.g * inside), scale * r.b / (1 - r.b * inside)};
}

Rgb below_coat(Rgb x, float eta) { return x * (1 / eta); }

BsdfValue base_value(const BsdfParams& b, const Coat& coat, Float3 i, Float3 o) {
  BsdfValue v = b.kind == BsdfKind::coated_diffuse
                    ? diffuse_value(coated_diffuse_albedo(b), o)
                    : conductor_value(ggx(b.base_alpha_x, b.base_alpha_y), below_coat(b.conductor_eta, b.eta),
                                      below_coat(b.conductor_k, b.eta), i, o);
  v.f_cos = v.f_cos * coat.both_ways(i, o);
  return v;
}

// How often the coat is sampled: its share of what is reflected, kept away from never.
float coat_chance(const BsdfParams& b, const Coat& coat, Float3 i) {
  const float f = coat.reflectance(i);
  const float base = b.kind == BsdfKind::coated_diffuse ? luminance(b.reflectance) : 0.9f;
  return std::clamp(f / (f + (1 - f) * base + 1e-6f), 0.05f, 0.95f);
}

BsdfValue coated_value(const BsdfParams& b, Float3 i, Float3 o) {
  const Coat coat = coat_of(b);
  const float chance = coat_chance(b, coat, i);
  BsdfValue v;
  if (!base_is_smooth(b)) {
    v = base_value(b, coat, i, o);
    v.pdf_solid_angle *= 1 - chance;
  }
  if (!coat.is_smooth) {
    const Facet f = facet_reflection(coat.surface, i, o);
    v.f_cos += kWhite * (f.value * fresnel_dielectric(f.cos_m, b.eta));
    v.pdf_solid_angle += chance * f.pdf;
  }
  return v;
}

BsdfValue opaque_value(const BsdfParams& b, Float3 i, Float3 o) {
  switch (b.kind) {
    case BsdfKind::diffuse: return diffuse_value(b.reflectance, o);
    case BsdfKind::conductor:
      if (is_smooth(b.alpha_x, b.alpha_y)) return {};
      return conductor_value(ggx(b.alpha_x, b.alpha_y), b.conductor_eta, b.conductor_k, i, o);
    case BsdfKind::coated_diffuse:
    case BsdfKind::coated_conductor: return coated_value(b, i, o);
    default: return {};
  }
}

BsdfSample delta_reflection(Float3 i, Rgb weight) {
  BsdfSample s;
  s.w_next_local = mirrored(i), s.weight = weight, s.is_delta = true;
  return s;
}

// A direction from one lobe, weighed by all of them.
BsdfSample weighed(const BsdfParams& b, Float3 i, Float3 o) {
  BsdfSample s;
  s.w_next_local = o;
  if (!(o.z > 0)) return s;
  const BsdfValue v = opaque_value(b, i, o);
  if (!(v.pdf_solid_angle > 0)) return s;
  s.pdf_solid_angle = v.pdf_solid_angle;
  s.weight = v.f_cos * (1 / v.pdf_solid_angle);
  return s;
}

BsdfSample sample_conductor(const BsdfParams& b, Float3 i, Float2 u) {
  if (is_smooth(b.alpha_x, b.alpha_y))
    return delta_reflection(i, fresnel_conductor(i.z, b.conductor_eta, b.conductor_k));
  return weighed(b, i, reflected(i, ggx(b.alpha_x, b.alpha_y).sample_visible(i, u)));
}

BsdfSample sample_coated(const BsdfParams& b, Float3 i, Float2 u, float u_lobe) {
  const Coat coat = coat_of(b);
  const float chance = coat_chance(b, coat, i);
  if (u_lobe < chance) {
    if (coat.is_smooth) return delta_reflection(i, kWhite * (coat.reflectance(i) / chance));
    return weighed(b, i, reflected(i, coat.surface.sample_visible(i, u)));
  }
  if (b.kind == BsdfKind::coated_diffuse) return weighed(b, i, cosine_hemisphere(u));
  if (base_is_smooth(b)) {
    const Rgb f = fresnel_conductor(i.z, below_coat(b.conductor_eta, b.eta), below_coat(b.conductor_k, b.eta));
    const float passed = 1 - coat.reflectance(i);
    return delta_reflection(i, f * (passed * passed / (1 - chance)));
  }
  return weighed(b, i, reflected(i, ggx(b.base_alpha_x, b.base_alpha_y).sample_visible(i, u)));
}

// ---- dielectrics: w_prev may come from either side; eta below is relative, of the far side over that of w_prev ----

float relative_eta(const BsdfParams& b, Float3 w_prev) { return w_prev.z > 0 ? b.eta : 1 / b.eta; }

// The refraction of i (on the side of m) into the medium of relative index eta; false: total reflection.
bool refract(Float3 i, Float3 m, float eta, Float3& o) {
  const float cos_i = dot(i, m);
  const float sin2_t = std::max(0.0f, 1 - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1) return false;
  o = m * (cos_i / eta - std::sqrt(1 - sin2_t)) - i * (1 / eta);
  return true;
}

// i.z > 0. Walter et al. 2007, section 5; f_cos of transmission is for radiance: divided by eta^2.
BsdfValue dielectric_value(const Ggx& surface, float eta, Float3 i, Float3 o) {
  const bool reflects = o.z > 0;
  if (reflects) {
    const Facet f = facet_reflection(surface, i, o);
    const float r = fresnel_dielectric(f.cos_m, eta);
    return {kWhite * (f.value * r), f.pdf * r};
  }
  Float3 m = i + o * eta;
  if (!(length_squared(m) > 0)) return {};
  m = normalize(m);
  if (m.z < 0) m = -m;
  const float cos_i = dot(i, m), cos_o = dot(o, m);
  if (!(cos_i > 0) || !(cos_o < 0)) return {};
  const float t = 1 - fresnel_dielectric(cos_i, eta);
  const float root = cos_i / eta + cos_o;  // the half-vector's Jacobian, section 4.2 there, over eta
  const float jacobian = -cos_o / (root * root);
  const float value = surface.d(m) * surface.g2(i, o) * t * cos_i * jacobian / (i.z * eta * eta);
  return {kWhite * value, t * surface.visible_pdf(i, m) * jacobian};
}

BsdfSample smooth_dielectric(float eta, Float3 i, float u_lobe) {
  const float r = fresnel_dielectric(i.z, eta);
  if (u_lobe < r) return delta_reflection(i, kWhite);
  BsdfSample s;
  if (!refract(i, {0, 0, 1}, eta, s.w_next_local)) return {};
  s.weight = kWhite * (1 / (eta * eta));
  s.eta_scale = eta * eta;
  s.is_delta = s.is_transmission = true;
  return s;
}

BsdfSample rough_dielectric(const Ggx& surface, float eta, Float3 i, Float2 u, float u_lobe) {
  const Float3 m = surface.sample_visible(i, u);
  const float r = fresnel_dielectric(dot(i, m), eta);
  BsdfSample s;
  s.is_transmission = u_lobe >= r;
  if (!s.is_transmission) {
    s.w_next_local = reflected(i, m);
  } else {
    if (!refract(i, m, eta, s.w_next_local)) return {};
    s.eta_scale = eta * eta;
  }
  if (s.w_next_local.z == 0 || (s.w_next_local.z < 0) != s.is_transmission) return {};
  const BsdfValue v = dielectric_value(surface, eta, i, s.w_next_local);
  if (!(v.pdf_solid_angle > 0)) return {};
  s.pdf_solid_angle = v.pdf_solid_angle;
  s.weight = v.f_cos * (1 / v.pdf_solid_angle);
  return s;
}

// All orders of reflection inside the slab together (pbrt-v4, section 9.4.3).
BsdfSample sample_thin(float eta, Float3 i, float u_lobe) {
  float r = fresnel_dielectric(i.z, eta);
  if (r < 1) r += (1 - r) * (1 - r) * r / (1 - r * r);
  if (u_lobe < r) return delta_reflection(i, kWhite);
  BsdfSample s;
  s.w_next_local = -i;
  s.weight = kWhite;
  s.is_delta = s.is_transmission = true;
  return s;
}

Float3 flipped(Float3 w) { return {w.x, w.y, -w.z}; }

// Which side, by its share (pbrt-v4, DiffuseTransmissionBxDF).
float reflection_chance(const BsdfParams& b) {
  const float r = max_component(b.reflectance), t = max_component(b.transmittance);
  return r + t > 0 ? r / (r + t) : 0;
}

BsdfValue diffuse_transmission_value(const BsdfParams& b, Float3 o) {
  const float chance = reflection_chance(b), cosine = std::fabs(o.z) / kPi;
  if (o.z > 0) return {b.reflectance * cosine, chance * cosine};
  return {b.transmittance * cosine, (1 - chance) * cosine};
}

BsdfSample sample_diffuse_transmission(const BsdfParams& b, Float2 u, float u_lobe) {
  BsdfSample s;
  s.is_transmission = u_lobe >= reflection_chance(b);
  const Float3 o = cosine_hemisphere(u);
  s.w_next_local = s.is_transmission ? flipped(o) : o;
  if (!(o.z > 0)) return s;
  const BsdfValue v = diffuse_transmission_value(b, s.w_next_local);
  if (!(v.pdf_solid_angle > 0)) return s;
  s.pdf_solid_angle = v.pdf_solid_angle;
  s.weight = v.f_cos * (1 / v.pdf_solid_angle);
  return s;
}

}  // namespace

float internal_diffuse_reflectance(float eta) {
  if (!(eta > 1.0001f)) return 0;
  const double n = eta, n2 = n * n, n4 = n2 * n2;
  const double external =
      0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) * (n + 1)) +
      n2 * (n2 - 1) * (n2 - 1) / ((n2 + 1) * (n2 + 1) * (n2 + 1)) * std::log((n - 1) / (n + 1)) -
      2 * n * n2 * (n2 + 2 * n - 1) / ((n2 + 1) * (n4 - 1)) +
      8 * n4 * (n4 + 1) / ((n2 + 1) * (n4 - 1) * (n4 - 1)) * std::log(n);
  return static_cast<float>(1 - (1 - external) / n2);
}

BsdfSample sample_bsdf(const BsdfParams& b, Float3 w_prev_local, Float2 u, float u_lobe) {
  const bool below = w_prev_local.z < 0;
  const Float3 i = below ? flipped(w_prev_local) : w_prev_local;
  if (!(i.z > 0)) return {};
  BsdfSample s;
  switch (b.kind) {
    case BsdfKind::none: return {};
    case BsdfKind::diffuse: s = weighed(b, i, cosine_hemisphere(u)); break;
    case BsdfKind::conductor: s = sample_conductor(b, i, u); break;
    case BsdfKind::dielectric: {
      const float eta = relative_eta(b, w_prev_local);
      s = is_smooth(b.alpha_x, b.alpha_y) ? smooth_dielectric(eta, i, u_lobe)
                                          : rough_dielectric(ggx(b.alpha_x, b.alpha_y), eta, i, u, u_lobe);
      break;
    }
    case BsdfKind::thin_dielectric: s = sample_thin(b.eta, i, u_lobe); break;
    case BsdfKind::coated_diffuse:
    case BsdfKind::coated_conductor: s = sample_coated(b, i, u, u_lobe); break;
    case BsdfKind::diffuse_transmission: s = sample_diffuse_transmission(b, u, u_lobe); break;
  }
  if (below) s.w_next_local = flipped(s.w_next_local);
  return s;
}

BsdfValue evaluate_bsdf(const BsdfParams& b, Float3 w_prev_local, Float3 w_next_local) {
  const bool below = w_prev_local.z < 0;
  const Float3 i = below ? flipped(w_prev_local) : w_prev_local;
  const Float3 o = below ? flipped(w_next_local) : w_next_local;
  if (!(i.z > 0) || o.z == 0) return {};
  if (b.kind == BsdfKind::dielectric && !is_smooth(b.alpha_x, b.alpha_y))
    return dielectric_value(ggx(b.alpha_x, b.alpha_y), relative_eta(b, w_prev_local), i, o);
  if (b.kind == BsdfKind::diffuse_transmission) return diffuse_transmission_value(b, o);
  return o.z > 0 ? opaque_value(b, i, o) : BsdfValue{};
}

bool transmits(const BsdfParams& bsdf) {
  return bsdf.kind == BsdfKind::dielectric || bsdf.kind == BsdfKind::thin_dielectric ||
         bsdf.kind == BsdfKind::diffuse_transmission;
}

BsdfSample sample_evenly(const BsdfParams& b, Float3 w_prev_local, Float2 u, float u_lobe) {
  if (!has_continuous_lobe(b)) return sample_bsdf(b, w_prev_local, u, u_lobe);
  float pdf = transmits(b) ? 0.25f / kPi : 0.5f / kPi;
  if (has_delta_lobe(b)) {
    if (u_lobe >= 0.5f) {
      BsdfSample s = sample_bsdf(b, w_prev_local, u, 2 * u_lobe - 1);
      s.weight = s.is_delta ? s.weight * 2 : Rgb{0, 0, 0};
      return s;
    }
    pdf *= 0.5f;
  }
  BsdfSample s;
  s.w_next_local = uniform_direction({transmits(b) ? u.x : 0.5f * u.x, u.y});
  if (w_prev_local.z < 0) s.w_next_local = flipped(s.w_next_local);
  s.is_transmission = s.w_next_local.z * w_prev_local.z < 0;
  if (s.is_transmission && b.kind == BsdfKind::dielectric) {
    const float eta = relative_eta(b, w_prev_local);
    s.eta_scale = eta * eta;
  }
  s.pdf_solid_angle = pdf;
  s.weight = evaluate_bsdf(b, w_prev_local, s.w_next_local).f_cos * (1 / pdf);
  return s;
}

bool has_delta_lobe(const BsdfParams& b) {
  switch (b.kind) {
    case BsdfKind::none:
    case BsdfKind::diffuse:
    case BsdfKind::diffuse_transmission: return false;
    case BsdfKind::thin_dielectric: return true;
    case BsdfKind::conductor:
    case BsdfKind::dielectric:
    case BsdfKind::coated_diffuse: return is_smooth(b.alpha_x, b.alpha_y);
    case BsdfKind::coated_conductor: return is_smooth(b.alpha_x, b.alpha_y) || base_is_smooth(b);
  }
  return false;
}

bool has_continuous_lobe(const BsdfParams& b) {
  switch (b.kind) {
    case BsdfKind::none:
    case BsdfKind::thin_dielectric: return false;
    case BsdfKind::diffuse:
    case BsdfKind::diffuse_transmission:
    case BsdfKind::coated_diffuse: return true;
    case BsdfKind::conductor:
    case BsdfKind::dielectric: return !is_smooth(b.alpha_x, b.alpha_y);
    case BsdfKind::coated_conductor: return !is_smooth(b.alpha_x, b.alpha_y) || !base_is_smooth(b);
  }
  return false;
}

Rgb albedo_estimate(const BsdfParams& b, Float3 w_prev_local) {
  const float cosine = std::fabs(w_prev_local.z);
  switch (b.kind) {
    case BsdfKind::none: return {0, 0, 0};
    case BsdfKind::diffuse: return b.reflectance;
    case BsdfKind::diffuse_transmission: return b.reflectance + b.transmittance;
    case BsdfKind::conductor: return fresnel_conductor(cosine, b.conductor_eta, b.conductor_k);
    case BsdfKind::dielectric:
    case BsdfKind::thin_dielectric: return kWhite;
    case BsdfKind::coated_diffuse: {
      const float f = fresnel_dielectric(cosine, b.eta);
      const Rgb base = coated_diffuse_albedo(b) * (b.eta * b.eta * (1 - b.coat_internal_reflectance));
      return kWhite * f + base * (1 - f);
    }
    case BsdfKind::coated_conductor: {
      const float f = fresnel_dielectric(cosine, b.eta);
      return kWhite * f + fresnel_conductor(cosine, below_coat(b.conductor_eta, b.eta),
                                            below_coat(b.conductor_k, b.eta)) * ((1 - f) * (1 - f));
    }
  }
  return {0, 0, 0};
}

}  // namespace spillway::shading
