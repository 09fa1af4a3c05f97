#include "shading/medium.h"

#include "cache/base/hash.h"
#include "shading/frame.h"
#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

// Below this the distribution cannot be told from an even one, and its inverse divides by g.
constexpr float kIsotropic = 1e-3f;

float component(Rgb c, int i) { return i == 0 ? c.r : i == 1 ? c.g : c.b; }

}  // namespace

float henyey_greenstein(float g, float cosine) {
  const float base = 1 + g * g - 2 * g * cosine;
  return (1 - g * g) / (4 * kPi * base * std::sqrt(base));
}

Float3 sample_henyey_greenstein(float g, Float3 w_flight, Float2 u) {
  float cosine = 1 - 2 * u.x;
  if (std::fabs(g) > kIsotropic) {
    const float s = (1 - g * g) / (1 + g - 2 * g * u.x);
    cosine = std::clamp((1 + g * g - s * s) / (2 * g), -1.0f, 1.0f);
  }
  const float sine = std::sqrt(std::max(0.0f, 1 - cosine * cosine));
  const SinCos phi = sin_cos_turn(u.y);
  return normalize(frame_from_z(w_flight).world_from_local({sine * phi.cos, sine * phi.sin, cosine}));
}

FreePath sample_free_path(Rgb sigma_t, Rgb shares, float distance_max, Float2 u) {
  const float sum = shares.r + shares.g + shares.b;
  const Rgb share = shares * (1 / sum);
  int channel = u.x < share.r ? 0 : u.x < share.r + share.g ? 1 : 2;
  while (channel > 0 && !(component(share, channel) > 0)) --channel;  // shares may add up to a rounding less than one
  const float sigma = component(sigma_t, channel);
  FreePath path;
  path.distance = sigma > 0 ? -log_of(1 - u.y) / sigma : INFINITY;
  if (sigma_t.r == sigma_t.g && sigma_t.g == sigma_t.b) {  // weights are one, without the rounding of their quotients
    if (!(path.distance < distance_max)) path.distance = INFINITY;
    return path;
  }
  if (path.distance < distance_max) {
    const Rgb through = transmittance(sigma_t, path.distance) * sigma_t;
    path.weight = through * (1 / (share.r * through.r + share.g * through.g + share.b * through.b));
    return path;
  }
  path.distance = INFINITY;
  const Rgb through = transmittance(sigma_t, distance_max);
  const float probability = share.r * through.r + share.g * through.g + share.b * through.b;
  path.weight = probability > 0 ? through * (1 / probability) : Rgb{0, 0, 0};
  return path;
}

SegmentKey segment_key(SampleKey sample, uint32_t bounce, bool is_shadow, Float3 origin_world) {
  const auto bits = [](float x) { return uint64_t{std::bit_cast<uint32_t>(x)}; };
  uint64_t h = hash_combine(bits(origin_world.x) << 32 | bits(origin_world.y), bits(origin_world.z) << 32 | bounce);
  h = hash_combine(h, is_shadow ? 1 : 0);
  return {sample, static_cast<uint32_t>(h >> 32)};
}

}  // namespace spillway::shading
