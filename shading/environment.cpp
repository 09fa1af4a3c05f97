#include "shading/environment.h"

#include <algorithm>
#include <cmath>

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

struct Texel {
  uint32_t x, y;
};
Texel texel_at(const EnvironmentMap& map, Float3 w) {
  const Float2 square = equal_area_square(w);
  const auto index = [&](float s) {
    return std::min(static_cast<uint32_t>(s * static_cast<float>(map.size)), map.size - 1);
  };
  return {index(square.x), index(square.y)};
}

std::span<const float> row_of(const EnvironmentMap& map, uint32_t y) {
  return map.texel_cdf.subspan(size_t{y} * (map.size + 1), map.size + 1);
}

// The place of u in a distribution, in items: which one, and how far through it.
float invert(std::span<const float> cdf, float u) {
  const auto after = std::upper_bound(cdf.begin() + 1, cdf.end() - 1, u);
  const auto i = after - cdf.begin() - 1;
  const float width = cdf[static_cast<size_t>(i) + 1] - cdf[static_cast<size_t>(i)];
  const float inside = width > 0 ? (u - cdf[static_cast<size_t>(i)]) / width : 0.5f;
  return static_cast<float>(i) + std::min(inside, 0x1.fffffep-1f);
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
  const float eighth = r == 0 ? 1 : (vp - up) / r + 1;  // of a quarter turn, two of them
  const SinCos phi = sin_cos_turn(eighth / 8);
  const float planar = r * std::sqrt(std::max(0.0f, 2 - r * r));
  return {std::copysign(phi.cos * planar, u), std::copysign(phi.sin * planar, v),
          std::copysign(1 - r * r, signed_distance)};
}

Float2 equal_area_square(Float3 w) {
  const float x = std::fabs(w.x), y = std::fabs(w.y), z = std::fabs(w.z);
  const float r = std::sqrt(std::max(0.0f, 1 - z));
  const float larger = std::max(x, y), smaller = std::min(x, y);
  float phi = larger == 0 ? 0 : atan_of_ratio(smaller, larger) * (2 / kPi);  // of a quarter turn
  if (x < y) phi = 1 - phi;
  float v = phi * r, u = r - v;
  if (w.z < 0) {
    std::swap(u, v);
    u = 1 - u, v = 1 - v;
  }
  return {(std::copysign(u, w.x) + 1) / 2, (std::copysign(v, w.y) + 1) / 2};
}

Rgb environment_radiance(const EnvironmentMap& map, Float3 w) {
  const Texel at = texel_at(map, w);
  return map.texels[size_t{at.y} * map.size + at.x];
}

Float3 sample_environment(const EnvironmentMap& map, Float2 u) {
  const float y = invert(map.row_cdf, u.y);
  const float x = invert(row_of(map, static_cast<uint32_t>(y)), u.x);
  const float scale = 1 / static_cast<float>(map.size);
  return equal_area_direction({x * scale, y * scale});
}

float environment_pdf(const EnvironmentMap& map, Float3 w) {
  const Texel at = texel_at(map, w);
  const std::span<const float> row = row_of(map, at.y);
  const auto size = static_cast<float>(map.size);
  return (map.row_cdf[at.y + 1] - map.row_cdf[at.y]) * (row[at.x + 1] - row[at.x]) * (size * size * (0.25f / kPi));
}

}  // namespace spillway::shading
