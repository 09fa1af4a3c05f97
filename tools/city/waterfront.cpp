#include "tools/city/waterfront.h"

#include <algorithm>

#include "tools/city/facade.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

constexpr double kTurn = 6.283185307179586;
constexpr double kDeck_m = 3.5;  // of piers, above the sea

struct Pier {
  Frame frame;  // at the quay, x out over the water
  double length, width;
};

void piles(Geometry& g, const Pier& pier) {
  for (double x = 4; x < pier.length; x += 8)
    for (const double y : {-pier.width / 2 + 1, pier.width / 2 - 1})
      cone(g, Surface::tile_brown, pier.frame.at({x, y, 0}), 6, 0.35, -9, 0.35, kDeck_m - 0.6);
}

void shed(Geometry& g, const Pier& pier, FacadeStyle style, Random& random) {
  const double w = pier.width - 8, length = pier.length - 14, high = random.between(6, 8.5);
  const Frame corner = pier.frame.at({6, -w / 2, kDeck_m});
  const Wall sides[] = {{corner, length, high, 1},
                        {corner.at({length, 0, 0}).turned(kTurn / 4), w, high, 1},
                        {corner.at({length, w, 0}).turned(kTurn / 2), length, high, 1},
                        {corner.at({0, w, 0}).turned(-kTurn / 4), w, high, 1}};
  for (const Wall& wall : sides) punched_facade(g, wall, style, Random(random.next()));
  gable_roof(g, style.trim == Surface::trim_white ? Surface::tile_slate : Surface::roof_light, style.wall, corner,
             length, w, high, w * 0.22, 0.8);
  // The head house at the quay: higher, with a flagpole.
  const double head = high + 3.5;
  box(g, style.wall, pier.frame, {1.5, -w / 2 - 1, kDeck_m}, {6, w / 2 + 1, kDeck_m + head}, kStanding);
  box(g, Surface::trim_dark, pier.frame, {1.3, -3.5, kDeck_m}, {1.5, 3.5, kDeck_m + 5}, kAllFaces);
  box(g, style.lighting.on ? Surface::lit_warm : Surface::trim_white, pier.frame, {1.3, -w / 4, kDeck_m + 6},
      {1.5, w / 4, kDeck_m + 7.4}, kAllFaces);
  cone(g, Surface::metal_light, pier.frame.at({4, 0, kDeck_m + head}), 6, 0.12, 0, 0.05, 8);
}

void build_pier(Geometry& g, const Pier& pier, TimeOfDay time, uint64_t key) {
  Random random(key);
  box(g, Surface::concrete_dark, pier.frame, {-4, -pier.width / 2, kDeck_m - 0.6},
      {pier.length, pier.width / 2, kDeck_m}, kAllFaces);
  piles(g, pier);
  FacadeStyle style;
  static constexpr Surface kWalls[] = {Surface::plaster_cream, Surface::wood_white, Surface::brick_red,
                                       Surface::wood_green, Surface::panel_blue};
  style.wall = kWalls[random.below(5)], style.trim = random.chance(0.5) ? Surface::trim_white : Surface::trim_dark;
  style.level = 2, style.bay_m = 5, style.window_share = 0.5, style.sill_share = 0.45, style.head_share = 0.8;
  style.lighting = {time != TimeOfDay::day, 0.4, false, Surface::lit_warm};
  shed(g, pier, style, random);
}

// ---- the bridge ----

struct Bridge {
  Frame frame;  // at the near end, x along the deck
  double length, deck_z, tower_z, width, shore_z, island_z;

  [[nodiscard]] double deck(double t) const {
    const double up = smoothstep(0, 0.17, t), down = smoothstep(0.88, 1.0, t);
    return shore_z + (deck_z - shore_z) * up + (island_z - deck_z) * down;
  }
  // The main cables: a parabola between the towers, nearly straight beyond them.
  [[nodiscard]] double cable(double t) const {
    constexpr double kNear = 0.22, kFar = 0.78;
    if (t < kNear) return deck(0.03) + 2 + (tower_z - deck(0.03) - 2) * std::pow((t - 0.03) / (kNear - 0.03), 1.25);
    if (t > kFar) return deck(0.97) + 2 + (tower_z - deck(0.97) - 2) * std::pow((0.97 - t) / (0.97 - kFar), 1.25);
    const double u = (t - 0.5) / (kFar - 0.5);
    return deck_z + 3 + (tower_z - deck_z - 3) * u * u;
  }
  [[nodiscard]] Vec3 at(double t, double y, double z) const { return {t * length, y, z}; }
};

void bridge_deck(Geometry& g, const Bridge& b, TimeOfDay time) {
  const int pieces = std::max(40, static_cast<int>(b.length / 12));
  const double h = b.width / 2;
  for (int i = 0; i < pieces; ++i) {
    const double s = static_cast<double>(i) / pieces, t = static_cast<double>(i + 1) / pieces, z0 = b.deck(s),
                 z1 = b.deck(t);
    g.quad(Surface::asphalt, b.frame, b.at(s, -h, z0), b.at(t, -h, z1), b.at(t, h, z1), b.at(s, h, z0));
    g.quad(Surface::marking_yellow, b.frame, b.at(s, -0.1, z0 + 0.03), b.at(t, -0.1, z1 + 0.03),
           b.at(t, 0.1, z1 + 0.03), b.at(s, 0.1, z0 + 0.03));
    for (const double y : {-h, h}) {
      beam(g, Surface::vermilion, b.frame, b.at(s, y, z0 + 1), b.at(t, y, z1 + 1), 0.25);
      beam(g, Surface::vermilion, b.frame, b.at(s, y, z0 - 0.3), b.at(t, y, z1 - 0.3), 0.9);
      beam(g, Surface::vermilion, b.frame, b.at(s, y, z0 - 4.5), b.at(t, y, z1 - 4.5), 0.7);
      beam(g, Surface::vermilion, b.frame, b.at(s, y, i % 2 ? z0 - 4.5 : z0), b.at(t, y, i % 2 ? z1 : z1 - 4.5), 0.4);
      if (i % 3 != 0) continue;
      beam(g, Surface::metal_dark, b.frame, b.at(s, y, z0), b.at(s, y, z0 + 6), 0.2);
      octahedron(g, time == TimeOfDay::day ? Surface::trim_white : Surface::lamp_head, b.frame.at(b.at(s, y, z0 + 6.2)),
                 0.3, 0.3);
    }
  }
}

void bridge_tower(Geometry& g, const Bridge& b, double t, TimeOfDay time) {
  const double h = b.width / 2 + 0.8, leg = 0.045 * (b.tower_z + 20);
  for (const double y : {-h, h}) {
    const double side = y < 0 ? -leg : 0;
    box(g, Surface::concrete, b.frame.at(b.at(t, y, -16)), {-leg * 1.4, side * 1.4, 0},
        {leg * 1.4, side * 1.4 + leg * 1.4, 22}, kStanding);
    double z = 5, part = 1;
    for (int stage = 0; stage < 4; ++stage, part *= 0.86) {
      const double next = z + (b.tower_z - 4) / 4;
      box(g, Surface::vermilion, b.frame.at(b.at(t, y, 0)), {-leg * part, side * part, z},
          {leg * part, (side + leg) * part, next}, kStanding);
      z = next;
    }
    octahedron(g, time == TimeOfDay::day ? Surface::awning_red : Surface::beacon, b.frame.at(b.at(t, y, b.tower_z + 2)),
               0.7, 0.9);
  }
  for (const double part : {0.42, 0.62, 0.8, 0.97}) {
    const double z = part * b.tower_z;
    if (z < b.deck_z + 6 && z > b.deck_z - 6) continue;
    box(g, Surface::vermilion, b.frame.at(b.at(t, 0, 0)), {-leg * 0.6, -h, z - leg}, {leg * 0.6, h, z}, kAllFaces);
  }
}

void bridge_cables(Geometry& g, const Bridge& b) {
  constexpr int kPieces = 96;
  for (const double y : {-b.width / 2 - 0.4, b.width / 2 + 0.4})
    for (int i = 3; i < kPieces - 3; ++i) {
      const double s = static_cast<double>(i) / kPieces, t = static_cast<double>(i + 1) / kPieces;
      beam(g, Surface::vermilion, b.frame, b.at(s, y, b.cable(s)), b.at(t, y, b.cable(t)), 0.8);
      if (b.cable(s) > b.deck(s) + 1.5)
        beam(g, Surface::vermilion, b.frame, b.at(s, y, b.deck(s)), b.at(s, y, b.cable(s)), 0.16);
    }
}

void bridge(Geometry& g, const Terrain& terrain, TimeOfDay time) {
  const double r = terrain.radius_m();
  const Vec2 from = terrain.shore_line(0.24 * r, 8).point, to{0.92 * r, -1.22 * r};
  Bridge b{};
  b.frame = {{from.x, from.y, 0}, normalize(to - from)};
  b.length = length(to - from);
  b.deck_z = std::clamp(0.045 * r, 20.0, 67.0);
  b.tower_z = b.deck_z + std::clamp(0.10 * r, 40.0, 160.0);
  b.width = r > 1500 ? 26 : 16;
  b.shore_z = terrain.height(from) + 0.2, b.island_z = std::max(terrain.height(to) + 0.5, 3.0);
  bridge_deck(g, b, time);
  bridge_cables(g, b);
  for (const double t : {0.22, 0.78}) bridge_tower(g, b, t, time);
}

}  // namespace

void waterfront(Geometry& g, const Terrain& terrain, uint64_t seed, TimeOfDay time, int part, int parts) {
  if (!terrain.has_bay()) return;
  const double r = terrain.radius_m(), spacing = std::clamp(0.16 * r, 90.0, 150.0);
  const auto count = static_cast<int>(1.05 * r / spacing);
  for (int i = part; i < count; i += parts) {
    Random random(key_of(seed, 0x91e5 + static_cast<uint64_t>(i)));
    const Line line = terrain.shore_line(-0.3 * r + spacing * (i + random.between(-0.15, 0.15)), 0);
    const Pier pier{{{line.point.x, line.point.y, 0}, left_of(line.direction) * -1},
                    std::min(150.0, 0.13 * r) * random.between(0.6, 1.2),
                    random.between(22, 34)};
    if (random.chance(0.85)) build_pier(g, pier, time, random.next());
  }
  if (part == 0) bridge(g, terrain, time);
}

}  // namespace spillway::tools::city
