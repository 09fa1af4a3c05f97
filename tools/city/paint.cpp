#include "tools/city/paint.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "cache/texture_cache.h"
#include "tools/city/frame.h"
#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

constexpr size_t kEncoded = 4096;

// sRGB of numbers in [0, 1], by steps of 1 / 4095.
const std::array<uint8_t, kEncoded>& encoded() {
  static const std::array<uint8_t, kEncoded> table = [] {
    std::array<uint8_t, kEncoded> made{};
    for (size_t i = 0; i < kEncoded; ++i)
      made[i] = static_cast<uint8_t>(
          std::lround(255 * cache::srgb_from_linear(static_cast<float>(i) / static_cast<float>(kEncoded - 1))));
    return made;
  }();
  return table;
}

std::byte byte_of(float linear) {
  const float at = std::clamp(linear, 0.0f, 1.0f) * static_cast<float>(kEncoded - 1) + 0.5f;
  return static_cast<std::byte>(encoded()[static_cast<size_t>(at)]);
}

// Two numbers of each corner that vary as the face's patch does.
struct Patch {
  double s[4], t[4], z[4];
  bool is_upright = true;
};

Vec3 of(Float3 p) { return {p.x, p.y, p.z}; }

Patch patch_of(std::span<const Float3, 4> corners, const WallGrid& wall) {
  const Vec3 a = of(corners[0]), normal = cross(of(corners[2]) - a, of(corners[3]) - of(corners[1]));
  const double flat = std::hypot(normal.x, normal.y), size = std::sqrt(dot(normal, normal));
  Patch patch;
  patch.is_upright = flat > 0.35 * size;
  Vec2 along = wall.frame.x_axis;
  // On a wall s begins at its corner; elsewhere it is a place in the world, turned as the surface is.
  const Vec2 tangent = flat > 1e-9 ? Vec2{-normal.y / flat, normal.x / flat} : along;
  const bool on_wall = wall.width_m > 0 && patch.is_upright && dot(tangent, along) > 0.99;
  if (patch.is_upright && !on_wall) along = tangent;
  const Vec3 origin = wall.frame.origin;
  const double slope = size > 0 ? std::max(0.35, flat / size) : 1;  // of tilted roofs t runs along them
  for (size_t k = 0; k < 4; ++k) {
    const Vec3 p = of(corners[k]) - origin;
    patch.s[k] = p.x * along.x + p.y * along.y;
    patch.t[k] = patch.is_upright ? p.z / slope : dot(Vec2{p.x, p.y}, left_of(along));
    patch.z[k] = of(corners[k]).z - wall.base_z;
  }
  return patch;
}

double blend(const double (&at)[4], double u, double v) {
  return (at[0] * (1 - u) + at[1] * u) * (1 - v) + (at[3] * (1 - u) + at[2] * u) * v;
}

uint32_t key_of_face(const Patch& patch, const WallGrid& wall) {
  const auto cell = [](double x) { return static_cast<uint64_t>(static_cast<int64_t>(std::floor(x * 8))); };
  return static_cast<uint32_t>(
      key_of(wall.key, key_of(cell(blend(patch.s, 0.5, 0.5)), cell(blend(patch.t, 0.5, 0.5)))));
}

}  // namespace

std::vector<std::byte> painted_texels(const PaintedFace& face, std::span<const Float3, 4> corners,
                                      const WallGrid& wall) {
  const uint32_t width = 1u << face.size.ulog2, height = 1u << face.size.vlog2;
  const Patch patch = patch_of(corners, wall);
  PaintSpot spot{};
  spot.is_upright = patch.is_upright, spot.face_key = key_of_face(patch, wall);
  spot.texel_m = static_cast<double>(length(corners[1] - corners[0])) / width;
  const bool is_glass =
      paint_group(face.surface) == PaintGroup::window || paint_group(face.surface) == PaintGroup::mirror;
  std::vector<std::byte> texels(size_t{width} * height * 3);
  std::byte* to = texels.data();
  for (uint32_t row = 0; row < height; ++row)
    for (uint32_t column = 0; column < width; ++column, to += 3) {
      spot.u = (column + 0.5) / width, spot.v = (row + 0.5) / height;
      spot.s = blend(patch.s, spot.u, spot.v), spot.t = blend(patch.t, spot.u, spot.v);
      spot.above_m = blend(patch.z, spot.u, spot.v);
      Rgb colour = pattern(face.surface, spot, wall);
      if (!is_glass) colour = colour * cleanness(spot, wall);
      to[0] = byte_of(colour.r), to[1] = byte_of(colour.g), to[2] = byte_of(colour.b);
    }
  return texels;
}

// ---- noise ----

float cell_noise(int64_t x, int64_t y, uint32_t key) {
  const uint64_t mixed = mix64(static_cast<uint64_t>(x) * 0x9e3779b97f4a7c15ull ^
                               static_cast<uint64_t>(y) * 0xc2b2ae3d27d4eb4full ^ uint64_t{key} << 20);
  return static_cast<float>(mixed >> 40) * 0x1p-24f;
}

float smooth_noise(double x, double y, uint32_t key) {
  const double fx = std::floor(x), fy = std::floor(y);
  const auto ix = static_cast<int64_t>(fx), iy = static_cast<int64_t>(fy);
  const auto ease = [](double a) { return static_cast<float>(a * a * (3 - 2 * a)); };
  const float u = ease(x - fx), v = ease(y - fy);
  const float low = cell_noise(ix, iy, key) * (1 - u) + cell_noise(ix + 1, iy, key) * u;
  const float high = cell_noise(ix, iy + 1, key) * (1 - u) + cell_noise(ix + 1, iy + 1, key) * u;
  return low * (1 - v) + high * v;
}

float line_cover(double x, double width, double share) {
  const auto until = [share](double at) {
    const double whole = std::floor(at);
    return whole * share + std::min(at - whole, share);
  };
  const double w = std::max(width, 1e-6);
  return static_cast<float>((until(x + w / 2) - until(x - w / 2)) / w);
}

// ---- dirt ----

namespace {

// Streaks that rain draws below the ends of sills, and soot above windows.
float below_windows(const PaintSpot& spot, const WallGrid& wall) {
  if (wall.bay_m <= 0 || wall.width_m <= 0) return 1;
  const double x = spot.s - wall.bay_m * (std::floor(spot.s / wall.bay_m) + 0.5);
  const double floor = std::floor((spot.t - wall.sill_m) / wall.floor_m);
  const double below = wall.sill_m + wall.floor_m * (floor + 1) - spot.t;  // of the next sill up
  const double above = spot.t - (wall.head_m + wall.floor_m * floor);      // of the window below it
  float clean = 1;
  if (below < 1.3 && std::fabs(x) < wall.half_window_m + 0.12) {
    const float fall = static_cast<float>(1 - below / 1.3);
    const float ends = static_cast<float>(std::clamp(std::fabs(x) / (wall.half_window_m + 0.05), 0.0, 1.0));
    clean -= 0.34f * fall * (0.25f + 0.75f * ends * ends * ends) * smooth_noise(spot.s * 7, spot.t * 0.4, wall.key + 5);
  }
  if (above >= 0 && above < 0.5 && std::fabs(x) < wall.half_window_m)
    clean -= 0.10f * static_cast<float>(1 - above / 0.5);
  return clean;
}

}  // namespace

float cleanness(const PaintSpot& spot, const WallGrid& wall) {
  const float age = 0.35f + 0.65f * cell_noise(1, 2, wall.key);  // of the building: how dirty it is
  float clean = 1 - 0.30f * age * smooth_noise(spot.s / 3.1, spot.t / 4.7, wall.key + 1) *
                        (0.4f + 0.6f * smooth_noise(spot.s * 1.3, spot.t * 1.1, wall.key + 2));
  if (!spot.is_upright) return clean;
  if (wall.width_m > 0) {
    clean *= 1 - age * (1 - below_windows(spot, wall));
    const double from_top = wall.top_m - spot.t;  // what runs down from the edge
    if (from_top >= 0 && from_top < 3.5)
      clean *= 1 - 0.4f * age * static_cast<float>(1 - from_top / 3.5) *
                       smooth_noise(spot.s * 2.3, spot.t * 0.15, wall.key + 3);
  }
  if (spot.above_m < 1.2)  // splashes of the street
    clean *= 1 - 0.35f * static_cast<float>(1.2 - std::max(0.0, spot.above_m)) / 1.2f *
                     (0.5f + 0.5f * smooth_noise(spot.s * 1.7, spot.t * 2.9, wall.key + 4));
  return std::max(clean, 0.1f);
}

}  // namespace spillway::tools::city
