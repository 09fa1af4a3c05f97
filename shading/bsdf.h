#pragma once

// BSDFs as closed sets of numbers. Directions are unit, in the local shading frame (z = shading normal), and point away
// from the surface: w_prev towards where the path came from, w_next towards where it goes.
//
// Every lossless parameter set integrates to one; reciprocal up to the eta^2 of refraction (radiance transport).

#include <cstdint>

#include "cache/base/vec.h"

namespace spillway::shading {

enum class BsdfKind : uint8_t {
  none,              // absorbs everything
  diffuse,           // Lambert, two-sided
  conductor,         // GGX, height-correlated Smith; alpha 0 is a mirror
  dielectric,        // GGX interface, reflects and refracts; alpha 0 is smooth
  thin_dielectric,   // a parallel slab without thickness: delta reflection and straight transmission
  coated_diffuse,    // dielectric coat over Lambert: F + (1-F_i)(1-F_o) rho / (pi eta^2 (1 - rho F_internal))
  coated_conductor,  // dielectric coat over a conductor: F + (1-F_i)(1-F_o) conductor; light lost between is not returned
  diffuse_transmission,  // Lambert to both sides: reflectance where it comes from, transmittance beyond
};

// All numbers resolved: no textures, no handles.
struct BsdfParams {
  BsdfKind kind = BsdfKind::none;
  float alpha_x = 0, alpha_y = 0;            // GGX alpha of the surface (or of the coat of coated_*)
  float base_alpha_x = 0, base_alpha_y = 0;  // of the conductor below a coat
  float eta = 1.5f;                          // relative index, inside over outside, of dielectric or coat
  Rgb reflectance{0, 0, 0};                  // diffuse albedo
  Rgb transmittance{0, 0, 0};                // of diffuse_transmission
  Rgb conductor_eta{0, 0, 0}, conductor_k{0, 0, 0};
  float coat_internal_reflectance = 0;       // of coated_diffuse: internal_diffuse_reflectance(eta)
};

// Share of diffuse light that a smooth boundary of relative index eta > 1 throws back from inside: exact (Walsh 1926,
// in Dunlop 1969), through (1 - internal) = (1 - external) / eta^2.
[[nodiscard]] float internal_diffuse_reflectance(float eta);

// Below this alpha a lobe is treated as a delta.
inline constexpr float kSmoothAlpha = 1e-3f;

struct BsdfSample {
  Float3 w_next_local{0, 0, 1};
  Rgb weight{0, 0, 0};           // f |cos| / pdf, including the choice of lobe; zero ends the path
  float pdf_solid_angle = 0;     // of the continuous part; 0 for a delta
  bool is_delta = false;
  bool is_transmission = false;  // w_next on the other side of the surface than w_prev
  float eta_scale = 1;           // squared relative index of a refraction, for Russian roulette (pbrt-v4 section 13.4)
};

// f(w_prev, w_next) |cos theta_next| and its pdf over solid angle; continuous lobes only, zero for deltas.
struct BsdfValue {
  Rgb f_cos{0, 0, 0};
  float pdf_solid_angle = 0;
};

[[nodiscard]] BsdfSample sample_bsdf(const BsdfParams& bsdf, Float3 w_prev_local, Float2 u, float u_lobe);
[[nodiscard]] BsdfValue evaluate_bsdf(const BsdfParams& bsdf, Float3 w_prev_local, Float3 w_next_local);
// Directions spread evenly over the hemisphere of w_prev, over both where light passes; what is sharper than any of
// them is sampled as above, half of the time. Same mean as sample_bsdf, more variance: to measure it by.
[[nodiscard]] BsdfSample sample_evenly(const BsdfParams& bsdf, Float3 w_prev_local, Float2 u, float u_lobe);
// Whether evaluate_bsdf can return anything but zero: next-event estimation is worth a ray.
[[nodiscard]] bool has_continuous_lobe(const BsdfParams& bsdf);
// Whether sample_bsdf can return a delta.
[[nodiscard]] bool has_delta_lobe(const BsdfParams& bsdf);
// Whether any light passes to the other side: directions on both sides of the normal matter then.
[[nodiscard]] bool transmits(const BsdfParams& bsdf);
// Directional albedo estimate for the albedo AOV (no noise: a closed form, exact for diffuse).
[[nodiscard]] Rgb albedo_estimate(const BsdfParams& bsdf, Float3 w_prev_local);

}  // namespace spillway::shading
