#pragma once

// GGX in the local frame: anisotropic, height-correlated Smith masking (Heitz 2014), sampling of visible normals
// (Heitz 2018). Directions unit, z the shading normal.

#include <algorithm>
#include <cmath>

#include "cache/base/vec.h"
#include "shading/trigonometry.h"

namespace spillway::shading {

struct Ggx {
  float alpha_x, alpha_y;

  // Density of normals over solid angle, times cos at the normal.
  [[nodiscard]] float d(Float3 m) const {
    const float x = m.x / alpha_x, y = m.y / alpha_y;
    const float s = x * x + y * y + m.z * m.z;
    return 1 / (kPi * alpha_x * alpha_y * s * s);
  }
  [[nodiscard]] float lambda(Float3 w) const {
    const float x = alpha_x * w.x, y = alpha_y * w.y;
    return 0.5f * (std::sqrt(1 + (x * x + y * y) / (w.z * w.z)) - 1);
  }
  [[nodiscard]] float g1(Float3 w) const { return 1 / (1 + lambda(w)); }
  // Both sides of the surface: |z| decides masking.
  [[nodiscard]] float g2(Float3 a, Float3 b) const { return 1 / (1 + lambda(a) + lambda(b)); }
  // Density of the normals that w sees, w.z > 0.
  [[nodiscard]] float visible_pdf(Float3 w, Float3 m) const {
    return g1(w) * std::max(0.0f, dot(w, m)) * d(m) / std::fabs(w.z);
  }
  [[nodiscard]] Float3 sample_visible(Float3 w, Float2 u) const {
    const Float3 v = normalize(Float3{alpha_x * w.x, alpha_y * w.y, w.z});
    const float squared = v.x * v.x + v.y * v.y;
    const Float3 t1 = squared > 0 ? Float3{-v.y, v.x, 0} * (1 / std::sqrt(squared)) : Float3{1, 0, 0};
    const Float3 t2 = cross(v, t1);
    const float r = std::sqrt(u.x);
    const SinCos phi = sin_cos_turn(u.y);
    const float p1 = r * phi.cos, s = 0.5f * (1 + v.z);
    const float p2 = (1 - s) * std::sqrt(std::max(0.0f, 1 - p1 * p1)) + s * r * phi.sin;
    const Float3 n = t1 * p1 + t2 * p2 + v * std::sqrt(std::max(0.0f, 1 - p1 * p1 - p2 * p2));
    return normalize(Float3{alpha_x * n.x, alpha_y * n.y, std::max(1e-6f, n.z)});
  }
};

// Fresnel reflectance of a dielectric; cos_i >= 0 on the side of index 1, eta the index of the other side.
inline float fresnel_dielectric(float cos_i, float eta) {
  const float sin2_t = std::max(0.0f, 1 - cos_i * cos_i) / (eta * eta);
  if (sin2_t >= 1) return 1;
  const float cos_t = std::sqrt(1 - sin2_t);
  const float parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return 0.5f * (parallel * parallel + perpendicular * perpendicular);
}

// Exact unpolarised reflectance of a conductor of index eta + i k (Born and Wolf, section 14.2), in real arithmetic.
inline float fresnel_conductor(float cos_i, float eta, float k) {
  const float cos2 = cos_i * cos_i, sin2 = 1 - cos2;
  const float eta2 = eta * eta, k2 = k * k;
  const float t0 = eta2 - k2 - sin2;
  const float a2_plus_b2 = std::sqrt(t0 * t0 + 4 * eta2 * k2);
  const float t1 = a2_plus_b2 + cos2;
  const float a = std::sqrt(std::max(0.0f, 0.5f * (a2_plus_b2 + t0)));
  const float t2 = 2 * cos_i * a;
  const float rs = (t1 - t2) / (t1 + t2);
  const float t3 = cos2 * a2_plus_b2 + sin2 * sin2;
  const float t4 = t2 * sin2;
  return 0.5f * rs * (1 + (t3 - t4) / (t3 + t4));
}

inline Rgb fresnel_conductor(float cos_i, Rgb eta, Rgb k) {
  return {fresnel_conductor(cos_i, eta.r, k.r), fresnel_conductor(cos_i, eta.g, k.g),
          fresnel_conductor(cos_i, eta.b, k.b)};
}

}  // namespace spillway::shading
