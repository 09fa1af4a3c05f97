#include "shading/noise.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "shading/exponential.h"
#include "shading/smoothstep.h"
#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

// The permutation that Perlin published with his improved noise (2002), and pbrt uses too.
constexpr std::array<uint8_t, 256> kPermutation = {
    151, 160, 137, 91,  90,  15,  131, 13,  201, 95,  96,  53,  194, 233, 7,   225, 140, 36,  103, 30,  69,  142,
    8,   99,  37,  240, 21,  10,  23,  190, 6,   148, 247, 120, 234, 75,  0,   26,  197, 62,  94,  252, 219, 203,
    117, 35,  11,  32,  57,  177, 33,  88,  237, 149, 56,  87,  174, 20,  125, 136, 171, 168, 68,  175, 74,  165,
    71,  134, 139, 48,  27,  166, 77,  146, 158, 231, 83,  111, 229, 122, 60,  211, 133, 230, 220, 105, 92,  41,
    55,  46,  245, 40,  244, 102, 143, 54,  65,  25,  63,  161, 1,   216, 80,  73,  209, 76,  132, 187, 208, 89,
    18,  169, 200, 196, 135, 130, 116, 188, 159, 86,  164, 100, 109, 198, 173, 186, 3,   64,  52,  217, 226, 250,
    124, 123, 5,   202, 38,  147, 118, 126, 255, 82,  85,  212, 207, 206, 59,  227, 47,  16,  58,  17,  182, 189,
    28,  42,  223, 183, 170, 213, 119, 248, 152, 2,   44,  154, 163, 70,  221, 153, 101, 155, 167, 43,  172, 9,
    129, 22,  39,  253, 19,  98,  108, 110, 79,  113, 224, 232, 178, 185, 112, 104, 218, 246, 97,  228, 251, 34,
    242, 193, 238, 210, 144, 12,  191, 179, 162, 241, 81,  51,  145, 235, 249, 14,  239, 107, 49,  192, 214, 31,
    181, 199, 106, 157, 184, 84,  204, 176, 115, 121, 50,  45,  127, 4,   150, 254, 138, 236, 205, 93,  222, 114,
    67,  29,  24,  72,  243, 141, 128, 195, 78,  66,  215, 61,  156, 180,
};
uint32_t permuted(uint32_t i) { return kPermutation[i & 255]; }

// Towards the middles of a cube's twelve edges, four of them twice; the last four as pbrt numbers them, not as Perlin.
constexpr std::array<Float3, 16> kGradients = {{{1, 1, 0},
                                                {-1, 1, 0},
                                                {1, -1, 0},
                                                {-1, -1, 0},
                                                {1, 0, 1},
                                                {-1, 0, 1},
                                                {1, 0, -1},
                                                {-1, 0, -1},
                                                {0, 1, 1},
                                                {0, -1, 1},
                                                {0, 1, -1},
                                                {0, -1, -1},
                                                {1, 1, 0},
                                                {-1, 1, 0},
                                                {0, 1, -1},
                                                {0, -1, -1}}};

// A coordinate as the lattice point below, modulo the period, and what is left.
struct Cell {
  uint32_t index;
  float inside, weight;  // the fifth-degree fade of Perlin 2002
};
Cell cell_of(float x) {
  const float below = std::floor(x), inside = x - below;
  const auto index = static_cast<uint32_t>(below - 256 * std::floor(below / 256));
  return {index, inside, inside * inside * inside * (inside * (inside * 6 - 15) + 10)};
}

float lerp(float t, float a, float b) { return (1 - t) * a + t * b; }

constexpr float kLacunarity = 1.99f;    // not 2: lattices of octaves must not coincide (pbrt-v4)
constexpr float kMeanMagnitude = 0.2f;  // of |noise|: what octaves that are left out add to turbulence

// Octaves that the footprint resolves: half the finest wavelength. The last of them fades in.
struct Octaves {
  uint32_t whole;
  float faded;  // weight of the one after
};
Octaves visible_octaves(float width, uint32_t most) {
  if (!(width > 0)) return {most, 0};
  if (width > 1) return {0, 0};
  const float count = std::min(std::max(-1 - static_cast<float>(log2_of(width)), 0.0f), static_cast<float>(most));
  const auto whole = static_cast<uint32_t>(count);
  return {whole, smoothstep(0.3f, 0.7f, count - static_cast<float>(whole))};
}

// pbrt's colours of marble along its vein, control points of cubic Bezier segments that share three points each.
constexpr std::array<Rgb, 9> kMarble = {{{0.58f, 0.58f, 0.6f},
                                         {0.58f, 0.58f, 0.6f},
                                         {0.58f, 0.58f, 0.6f},
                                         {0.5f, 0.5f, 0.5f},
                                         {0.6f, 0.59f, 0.58f},
                                         {0.58f, 0.58f, 0.6f},
                                         {0.58f, 0.58f, 0.6f},
                                         {0.2f, 0.2f, 0.33f},
                                         {0.58f, 0.58f, 0.6f}}};

// Differences over a hundredth, as pbrt's, not derivatives: the cloud is to be the same one.
Float3 noise_slope(Float3 p) {
  constexpr float kStep = 0.01f;
  const float here = gradient_noise(p);
  Float3 slope;
  for (int a = 0; a < 3; ++a) {
    Float3 beside = p;
    beside[a] += kStep;
    slope[a] = (gradient_noise(beside) - here) / kStep;
  }
  return slope;
}

}  // namespace

float gradient_noise(Float3 p) {
  // Beyond this nothing is left of a float behind its point; and infinities have no cell.
  constexpr float kMost = 0x1p24f;
  if (!(std::fabs(p.x) < kMost && std::fabs(p.y) < kMost && std::fabs(p.z) < kMost)) return 0;
  const Cell x = cell_of(p.x), y = cell_of(p.y), z = cell_of(p.z);
  float corner[8];
  for (uint32_t i = 0; i < 8; ++i) {
    const uint32_t right = i & 1, up = i >> 1 & 1, far = i >> 2;
    const uint32_t hash = permuted(permuted(permuted(x.index + right) + y.index + up) + z.index + far);
    const Float3 offset{x.inside - static_cast<float>(right), y.inside - static_cast<float>(up),
                        z.inside - static_cast<float>(far)};
    corner[i] = dot(kGradients[hash & 15], offset);
  }
  const float near = lerp(y.weight, lerp(x.weight, corner[0], corner[1]), lerp(x.weight, corner[2], corner[3]));
  const float far = lerp(y.weight, lerp(x.weight, corner[4], corner[5]), lerp(x.weight, corner[6], corner[7]));
  return lerp(z.weight, near, far);
}

float fractal_noise(Float3 p, float width, float persistence, uint32_t octaves) {
  const Octaves visible = visible_octaves(width, octaves);
  float sum = 0, frequency = 1, amplitude = 1;
  for (uint32_t i = 0; i < visible.whole; ++i) {
    sum += amplitude * gradient_noise(p * frequency);
    frequency *= kLacunarity, amplitude *= persistence;
  }
  return visible.faded > 0 ? sum + amplitude * visible.faded * gradient_noise(p * frequency) : sum;
}

float turbulence(Float3 p, float width, float persistence, uint32_t octaves) {
  const Octaves visible = visible_octaves(width, octaves);
  float sum = 0, frequency = 1, amplitude = 1;
  for (uint32_t i = 0; i < visible.whole; ++i) {
    sum += amplitude * std::fabs(gradient_noise(p * frequency));
    frequency *= kLacunarity, amplitude *= persistence;
  }
  // pbrt counts the octave that fades in beside all that are left out.
  sum += amplitude * lerp(visible.faded, kMeanMagnitude, std::fabs(gradient_noise(p * frequency)));
  for (uint32_t i = visible.whole; i < octaves; ++i) {
    sum += amplitude * kMeanMagnitude;
    amplitude *= persistence;
  }
  return sum;
}

float windy_waves(Float3 p, float width) {
  const float wind = fractal_noise(p * 0.1f, width * 0.1f, 0.5f, 3);
  return std::fabs(wind) * fractal_noise(p, width, 0.5f, 6);
}

bool is_inside_dot(Float2 st) {
  constexpr float kRadius = 0.35f, kMostShift = 0.5f - kRadius;
  const float s = std::floor(st.x + 0.5f), t = std::floor(st.y + 0.5f);
  if (!(gradient_noise({s + 0.5f, t + 0.5f, 0.5f}) > 0)) return false;
  const float dx = st.x - (s + kMostShift * gradient_noise({s + 1.5f, t + 2.8f, 0.5f}));
  const float dy = st.y - (t + kMostShift * gradient_noise({s + 4.5f, t + 9.8f, 0.5f}));
  return dx * dx + dy * dy < kRadius * kRadius;
}

Rgb marble_color(Float3 p, float width, const MarbleParams& m) {
  const Float3 scaled = p * m.scale;
  const float vein =
      scaled.y + m.variation * fractal_noise(scaled, width * std::fabs(m.scale), m.persistence, m.octaves);
  if (!std::isfinite(vein)) return kMarble[0] * 1.5f;
  const float turns = vein / (2 * kPi);
  const float along = (0.5f + 0.5f * sin_cos_turn(turns - std::floor(turns)).sin) * (kMarble.size() - 3);
  const auto first = std::min(static_cast<size_t>(std::max(along, 0.0f)), kMarble.size() - 4);
  const float t = along - static_cast<float>(first), u = 1 - t;
  const Rgb* c = &kMarble[first];  // Bernstein polynomials
  return (c[0] * (u * u * u) + c[1] * (3 * u * u * t) + c[2] * (3 * u * t * t) + c[3] * (t * t * t)) * 1.5f;
}

float cloud_density(Float3 p, const CloudParams& cloud) {
  Float3 place = p * cloud.frequency;
  if (cloud.wispiness > 0) {
    float by = 0.05f * cloud.wispiness, scale = 10;
    for (int i = 0; i < 2; ++i, by *= 0.5f, scale *= kLacunarity) place = place + noise_slope(place * scale) * by;
  }
  constexpr uint32_t kOctaves = 5;
  const float noise = 0.5f * fractal_noise(place, 0, 0.5f, kOctaves);
  const float thinned = std::clamp((1 - p.y) * 4.5f * cloud.density * noise, 0.0f, 1.0f);
  return std::clamp(thinned + 2 * std::max(0.0f, 0.5f - p.y), 0.0f, 1.0f);
}

}  // namespace spillway::shading
