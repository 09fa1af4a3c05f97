#include "tools/import/color_space.h"

#include <array>

#include "tools/import/transform.h"

namespace spillway::tools {
namespace {

struct Chromaticity {
  double x, y;
};
struct Primaries {
  std::string_view name;
  Chromaticity red, green, blue, white;
};

constexpr Chromaticity kD65{0.3127, 0.3290};
// By ColorSpace. ITU-R BT.709-6; SMPTE EG 432-1 with the white of D65, as pbrt has it; ITU-R BT.2020-2; SMPTE ST
// 2065-1.
constexpr std::array<Primaries, 4> kSpaces = {{
    {"srgb", {0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, kD65},
    {"dci-p3", {0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, kD65},
    {"rec2020", {0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}, kD65},
    {"aces2065-1", {0.7347, 0.2653}, {0, 1}, {0.0001, -0.0770}, {0.32168, 0.33767}},
}};

Vec3 xyz_of(Chromaticity c) { return {c.x / c.y, 1, (1 - c.x - c.y) / c.y}; }

Transform from_rows(Vec3 a, Vec3 b, Vec3 c) { return {{{a.x, a.y, a.z, 0}, {b.x, b.y, b.z, 0}, {c.x, c.y, c.z, 0}}}; }

// Linear maps as transforms without translation. White (1, 1, 1) has luminance 1 (SMPTE RP 177).
Transform xyz_from_rgb(const Primaries& p) {
  const auto column = [](Chromaticity c) { return Vec3{c.x, c.y, 1 - c.x - c.y}; };
  const Vec3 r = column(p.red), g = column(p.green), b = column(p.blue);
  const Transform unscaled = from_rows({r.x, g.x, b.x}, {r.y, g.y, b.y}, {r.z, g.z, b.z});
  return unscaled * scaling(unscaled.inverse().vector(xyz_of(p.white)));
}

// Lam 1985 (Bradford): cone responses are scaled so that one white becomes the other.
Transform adaptation(Chromaticity from, Chromaticity to) {
  const Transform cones = from_rows({0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296});
  const Vec3 a = cones.vector(xyz_of(from)), b = cones.vector(xyz_of(to));
  return cones.inverse() * scaling({b.x / a.x, b.y / a.y, b.z / a.z}) * cones;
}

Rgb applied(const Transform& t, Rgb c) {
  const Vec3 v = t.vector({c.r, c.g, c.b});
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

}  // namespace

std::optional<ColorSpace> color_space(std::string_view name) {
  for (size_t i = 0; i < kSpaces.size(); ++i)
    if (kSpaces[i].name == name) return static_cast<ColorSpace>(i);
  return std::nullopt;
}

Rgb surface_rec709(ColorSpace space, Rgb rgb) {
  if (space == ColorSpace::srgb) return rgb;
  const Primaries& from = kSpaces[static_cast<size_t>(space)];
  return applied(xyz_from_rgb(kSpaces[0]).inverse() * adaptation(from.white, kD65) * xyz_from_rgb(from), rgb);
}

Rgb light_rec709(ColorSpace space, Rgb rgb) {
  if (space == ColorSpace::srgb) return rgb;
  return applied(xyz_from_rgb(kSpaces[0]).inverse() * xyz_from_rgb(kSpaces[static_cast<size_t>(space)]), rgb);
}

}  // namespace spillway::tools
