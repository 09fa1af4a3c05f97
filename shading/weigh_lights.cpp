#include "shading/weigh_lights.h"

#include <immintrin.h>

#include <cmath>

namespace spillway::shading {
namespace {

// Packed normals are off by at most 0.0164 rad; a test looks for worse.
constexpr float kNormalError = 0.0175f;
// Mean of 1 / d^2 over a box, against the squared distance of its centre: 1 / (d^2 + this * half diagonal^2). Of 0 to
// 0.4 the best at street receivers (light_bench); what is near is looked into, so that it matters little.
constexpr float kSpreadOfDistance = 0.05f;
// A cluster around the receiver, or with normals to all sides, always has a part that may shine here.
constexpr float kLeastOfWide = 1.0f / 64;
constexpr float kLargestWeight = 1e30f;
constexpr float kSmallestSquare = 1e-30f;

// Eight numbers, one a child.
using Lanes = __m256;
Lanes all(float x) { return _mm256_set1_ps(x); }
// Of a pair with one that is no number, the second.
Lanes larger(Lanes a, Lanes b) { return _mm256_max_ps(a, b); }
Lanes smaller(Lanes a, Lanes b) { return _mm256_min_ps(a, b); }
Lanes root(Lanes x) { return _mm256_sqrt_ps(x); }
Lanes select(Lanes condition, Lanes yes, Lanes no) { return _mm256_blendv_ps(no, yes, condition); }

Lanes lanes_of(const uint8_t (&v)[8]) {
  return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(v))));
}
Lanes lanes_of(const int8_t (&v)[8]) {
  return _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(v))));
}
Lanes lanes_of(const uint16_t (&v)[8]) {
  return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(v))));
}

float sum_of(Lanes x) {
  const __m128 four = _mm_add_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps(x, 1));
  const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
  return _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)));
}

// The mean of max(0, c + s x) over x in [-1, 1]; quarter: 1 / (4 s).
Lanes mean_positive(Lanes c, Lanes s, Lanes quarter) {
  const Lanes t = larger(c + s, all(0));
  return select(_mm256_cmp_ps(c, s, _CMP_GE_OQ), c, t * t * quarter);
}

// How each child lies to the receiver.
struct Relations {
  Lanes squared, spread_squared;  // distance of the centre, half diagonal
  Lanes sine, cosine;             // of half the angle that the bounding sphere fills
  Lanes emitted, received;        // cosines of the centre's direction; within the sphere less, towards its centre
};

inline Relations relate(const LightNode& node, const LocalLightReceiver& receiver) {
  Lanes center[3], spread = all(0);
  for (int a = 0; a < 3; ++a) {
    const Lanes lower = lanes_of(node.lower[a]), upper = lanes_of(node.upper[a]);
    const Lanes half_scale = all(0.5f * node.scale[a]);
    const Lanes half = half_scale * (upper - lower);
    center[a] = all(node.origin[a] - receiver.position[a]) + half_scale * (lower + upper);
    spread = spread + half * half;
  }
  const auto along = [&](Lanes x, Lanes y, Lanes z) { return x * center[0] + y * center[1] + z * center[2]; };
  Relations r;
  r.squared = larger(all(kSmallestSquare), along(center[0], center[1], center[2]));
  r.spread_squared = spread;
  const Lanes radius = root(spread);
  const Lanes inverse = all(1) / larger(root(r.squared), radius);
  r.sine = radius * inverse;
  r.cosine = root(larger(all(1) - r.sine * r.sine, all(0)));
  const Lanes ax = lanes_of(node.axis[0]), ay = lanes_of(node.axis[1]), az = lanes_of(node.axis[2]);
  r.emitted = all(0) - along(ax, ay, az) * inverse / root(larger(ax * ax + ay * ay + az * az, all(1)));
  r.received = along(all(receiver.normal.x), all(receiver.normal.y), all(receiver.normal.z)) * inverse;
  return r;
}

Lanes is_two_sided(const LightNode& node) {
  const __m256i bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  return _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(node.two_sided), bits), bits));
}

// The mean of the cosine at the emitters, for each child.
inline Lanes emission(const LightNode& node, const Relations& r) {
  const Lanes cos_cone = lanes_of(node.cone) * all(1.0f / 32767) - all(1);
  const Lanes sin_cone = root(larger(all(1) - cos_cone * cos_cone, all(0)));
  // The angle by which directions and normals may be off, together.
  const Lanes cos_off = cos_cone * r.cosine - sin_cone * r.sine;
  const Lanes sin_off = sin_cone * r.cosine + cos_cone * r.sine;
  const Lanes wide = _mm256_cmp_ps(cos_off, all(0), _CMP_LE_OQ);
  const Lanes spread = select(wide, all(1), larger(sin_off, all(1e-4f)));
  const Lanes c = select(wide, r.emitted * larger(sin_off, all(0)), r.emitted);
  const Lanes quarter = all(0.25f) / spread;
  const Lanes one = mean_positive(c, spread, quarter), other = mean_positive(all(0) - c, spread, quarter);
  const Lanes mean = select(is_two_sided(node), all(0.5f) * (one + other), one);
  return select(wide, larger(mean, all(kLeastOfWide)), mean);
}

Lanes has_below(const LightNode& node) {
  const __m256i kind = _mm256_srli_epi32(_mm256_load_si256(reinterpret_cast<const __m256i*>(node.child)), 30);
  const auto is = [&](LightChild k) { return _mm256_cmpeq_epi32(kind, _mm256_set1_epi32(static_cast<int>(k))); };
  return _mm256_castsi256_ps(_mm256_or_si256(is(LightChild::node), is(LightChild::instance)));
}

// Returns what would arrive without the cosines.
inline Lanes weigh(const LightNode& node, const LocalLightReceiver& receiver, const Relations& r, LightWeights& w) {
  Lanes cosines = emission(node, r);
  if (!(receiver.normal == Float3{0, 0, 0})) {
    const Lanes s = smaller(all(1), r.sine + all(kNormalError));
    cosines = cosines * mean_positive(r.received, s, all(0.25f) / s);
  }
  const Lanes open =
      _mm256_load_ps(node.energy) * all(receiver.scale) / (r.squared + all(kSpreadOfDistance) * r.spread_squared);
  const Lanes weight = smaller(all(kLargestWeight), open * cosines);
  _mm256_store_ps(w.of, weight);
  w.sum = sum_of(weight);
  return open;
}

}  // namespace

LocalLightReceiver receiver_in_world(const LightReceiver& receiver) {
  return {receiver.position_world,
          receiver.packed_normal == 0 ? Float3{0, 0, 0} : unpack_receiver_normal(receiver.packed_normal)};
}

LocalLightReceiver receiver_in_object(const LocalLightReceiver& world, const LightInstance& instance) {
  LocalLightReceiver local{instance.object_from_world.point(world.position), {0, 0, 0}};
  const Float3 n = instance.world_from_object.transposed_vector(world.normal);
  const float squared = length_squared(n);
  if (squared > 0 && std::isfinite(squared)) local.normal = n * (1 / std::sqrt(squared));
  return local;
}

void weigh_lights(const LightNode& node, const LocalLightReceiver& receiver, LightWeights& weights) {
  weigh(node, receiver, relate(node, receiver), weights);
}

void weigh_lights(const LightNode& node, const LocalLightReceiver& receiver, LightWeights& weights,
                  float (&urgency)[kLightNodeWidth]) {
  const Relations r = relate(node, receiver);
  const Lanes open = weigh(node, receiver, r, weights);
  _mm256_storeu_ps(urgency, _mm256_and_ps(open * (r.spread_squared / r.squared), has_below(node)));
}

void weigh_lights_by_energy(const LightNode& node, LightWeights& weights) {
  const Lanes energy = _mm256_load_ps(node.energy);
  _mm256_store_ps(weights.of, energy);
  weights.sum = sum_of(energy);
}

}  // namespace spillway::shading
