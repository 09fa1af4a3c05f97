#include "tools/city/lanterns.h"

#include "tools/city/random.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

constexpr double kSpacing_m = 11, kFreeEnds_m = 15, kHeight_m = 5.9;
constexpr int kLanterns = 6;

}  // namespace

Vec3 LanternString::at(double t) const {
  Vec3 point = from + (to - from) * t;
  point.z -= 4 * sag_m * t * (1 - t);
  return point;
}

std::vector<LanternString> lantern_strings(const Block& block, const Terrain& terrain) {
  std::vector<LanternString> strings;
  if (block.district != District::old_town) return strings;
  Random random(key_of(block.key, 0x1a7e));
  for (size_t i = 0; i < block.cell.size(); ++i) {
    const Vec2 a = block.cell[i].at, whole = next_corner(block.cell, i).at - a;
    const double size = length(whole), street = block.cell[i].street;
    const bool is_ours = whole.x > 0 || (whole.x == 0 && whole.y > 0);
    if (!is_ours || street < 3 || street > 6.9) continue;
    const Vec2 along = whole * (1 / size), across = left_of(along) * (street + kPavement_m - 0.1);
    for (double at = kFreeEnds_m; at < size - kFreeEnds_m; at += kSpacing_m) {
      const Vec2 middle = a + along * at, skew = along * random.between(-1.5, 1.5);
      const double z = terrain.height(middle) + kHeight_m + random.between(-0.3, 0.5);
      const Vec2 from = middle + across + skew, to = middle - across - skew;
      strings.push_back({{from.x, from.y, z}, {to.x, to.y, z + random.between(-0.4, 0.4)}, random.between(0.7, 1.1)});
    }
  }
  return strings;
}

void string_cable(Geometry& g, const LanternString& string) {
  constexpr int kPieces = 10;
  const Frame world;
  for (int i = 0; i < kPieces; ++i)
    beam(g, Surface::metal_dark, world, string.at(static_cast<double>(i) / kPieces), string.at(static_cast<double>(i + 1) / kPieces), 0.03);
}

std::vector<Standing> lanterns_on(const LanternString& string, uint64_t key) {
  std::vector<Standing> hanging;
  Random random(key);
  for (int i = 0; i < kLanterns; ++i)
    hanging.push_back({{string.at((i + 0.7) / (kLanterns + 0.4)), direction_of(random.between(0, 6.28))}, random.between(0.8, 1.15), kLanternPrototype});
  return hanging;
}

void lantern(Geometry& g) {
  const Frame f;
  constexpr int kSides = 10;
  const double radii[] = {0.13, 0.25, 0.30, 0.25, 0.13};
  for (int i = 0; i < 4; ++i)
    cone(g, Surface::lantern, f, kSides, radii[i], -0.62 + 0.13 * i, radii[i + 1], -0.49 + 0.13 * i);
  cone(g, Surface::metal_dark, f, kSides, 0.14, -0.66, 0.14, -0.62);
  cone(g, Surface::metal_dark, f, kSides, 0.14, -0.10, 0.05, -0.04);
  beam(g, Surface::gold, f, {0, 0, -0.66}, {0, 0, -0.95}, 0.04);
  beam(g, Surface::metal_dark, f, {0, 0, -0.04}, {0, 0, 0.02}, 0.02);
}

}  // namespace spillway::tools::city
