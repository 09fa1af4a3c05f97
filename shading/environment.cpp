#include "shading/environment.h"

#include <algorithm>
#include <cmath>

#include "shading/last_at_most.h"
#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

// Turns weights, in place after their first, into a distribution that ends in exactly one.
void accumulate(std::span<float> cdf, const auto& weight) {
  const size_t count = cdf.size() - 1;
  double sum = 0;
  for (size_t i = 0; i < count; ++i) sum += weight(i);
  double so_far = 0;
  cdf[0] = 0;
  for (size_t i = 0; i < count; ++i) {
    so_far += sum > 0 ? weight(i) / sum : 1.0 / static_cast<double>(count);
    cdf[i + 1] = static_cast<float>(std::min(so_far, 1.0));
  }
  cdf[count] = 1;
}

double weight_of(Rgb texel) { return std::max(0.0f, luminance(texel)); }

// The place of u in a distribution, in items: which one, and how far through it.
float invert(std::span<const float> cdf, float u) {
  const size_t i = last_at_most(cdf.first(cdf.size() - 1), u);
  const float width = cdf[i + 1] - cdf[i];
  const float inside = width > 0 ? (u - cdf[i]) / width : 0.5f;
  return static_cast<float>(i) + std::min(inside, 0x1.fffffep-1f);
}

// The angle in [0, pi/4] whose tangent is t, in quarter turns: off by less than 1e-7. A minimax polynomial of t^1 to
// t^15.
float quarter_turns_of_tangent(float t) {
  const float s = t * t;
  return t * (0.636619329f +
              s * (-0.212184489f +
                   s * (0.126983777f +
                        s * (-0.0885450840f +
                             s * (0.0613841303f + s * (-0.0355948843f + s * (0.0139183858f + s * -0.00258121639f)))))));
}

}  // namespace

void build_environment_cdfs(uint32_t size, std::span<const Rgb> texels, std::span<float> row_cdf,
                            std::span<float> texel_cdf) {
  for (size_t y = 0; y < size; ++y)
    accumulate(texel_cdf.subspan(y * (size + 1), size + 1), [&](size_t x) { return weight_of(texels[y * size + x]); });
  accumulate(row_cdf, [&](size_t y) {
    double sum = 0;
    for (size_t x = 0; x < size; ++x) sum += weight_of(texels[y * size + x]);
    return sum;
  });
}

Float3 equal_area_direction(Float2 square) {
  const float u = 2 * square.x - 1, v = 2 * square.y - 1;
  const float up = std::fabs(u), vp = std::fabs(v);
  const float signed_distance = 1 - (up + vp);
  const float r = 1 - std::fabs(signed_distance);
  const SinCos from_middle = small_sin_cos(r == 0 ? 0 : (vp - up) / r * (kPi / 4));  // of the quarter turn
  const float planar = r * std::sqrt(std::max(0.0f, 1 - r * r / 2));  // by sqrt(1/2), of which the middle's cosine is
  return {std::copysign((from_middle.cos - from_middle.sin) * planar, u),
          std::copysign((from_middle.cos + from_middle.sin) * planar, v), std::copysign(1 - r * r, signed_distance)};
}

Float2 equal_area_square(Float3 w) {
  const float x = std::fabs(w.x), y = std::fabs(w.y), z = std::fabs(w.z);
  const float r = std::sqrt(std::max(0.0f, 1 - z));
  const float larger = std::max(x, y), smaller = std::min(x, y);
  float phi = larger == 0 ? 0 : quarter_turns_of_tangent(smaller / larger);
  if (x < y) phi = 1 - phi;
  float v = phi * r, u = r - v;
  if (w.z < 0) {
    std::swap(u, v);
    u = 1 - u, v = 1 - v;
  }
  return {(std::copysign(u, w.x) + 1) / 2, (std::copysign(v, w.y) + 1) / 2};
}

Float3 sample_environment(const EnvironmentMap& map, Float2 u) {
  const float y = invert(map.row_cdf, u.y);
  const float x = invert(map.row(static_cast<uint32_t>(y)), u.x);
  const float scale = 1 / static_cast<float>(map.size);
  return equal_area_direction({x * scale, y * scale});
}

}  // namespace spillway::shading
