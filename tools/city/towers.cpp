// Tall buildings of downtown and midtown.

#include <algorithm>

#include "tools/city/mason.h"

namespace spillway::tools::city {
namespace {

// A polygon about the same middle, turned into one with cut corners now and then.
Polygon shaft_of(Mason& m, const Polygon& footprint, double inset_m) {
  Polygon shaft = inset_by(footprint, inset_m);
  if (shaft.empty() || area(shaft) < 90) return footprint;
  if (m.random.chance(0.35)) shaft = chamfered(shaft, m.random.between(1.5, 5));
  for (Corner& c : shaft) c.street = 1;  // free on all sides
  return shaft;
}

double lobby(Mason& m, const Polygon& footprint, double height_m) {
  return m.storeys(footprint, m.z, 1, height_m, Facade::shop, true);
}

void plant_room(Mason& m, const Polygon& roof, double z) {
  const Polygon room = inset_by(roof, m.random.between(2.5, 4));
  if (room.empty()) return;
  const double h = m.random.between(3, 6);
  prism_sides(m.g, m.b.wall, room, z, z + h);
  cap(m.g, m.b.roof, room, z + h);
  for (int i = 0; i < 5; ++i) m.cornice(room, z + h * (0.25 + 0.13 * i), 0.1, 0.25, true);  // louvres
  if (m.random.chance(0.45))
    m.spire(centroid(room), z + h, m.random.between(8, 26));
  else
    m.clutter(room, z + h, 0.6);
}

}  // namespace

void build_glass_tower(Mason& m) {
  m.style.bay_m = m.random.between(1.5, 2.4);
  const double base = lobby(m, m.b.footprint, 5.5);
  const int podium = m.random.chance(0.4) ? 2 : 0;
  double z = m.storeys(m.b.footprint, base, podium, m.b.floor_m, Facade::ribbon, true);
  m.flat_roof(m.b.footprint, z, 0.5, 0.2);
  Polygon shaft = shaft_of(m, m.b.footprint, m.random.between(1.2, 3.2));
  int floors = m.b.floors - podium - 1;
  const int tiers = m.random.chance(0.45) ? 2 : 1;
  for (int tier = 0; tier < tiers; ++tier) {
    const int count = tier + 1 == tiers ? floors : static_cast<int>(floors * m.random.between(0.55, 0.75));
    z = m.storeys(shaft, z, count, m.b.floor_m, Facade::curtain, false);
    floors -= count;
    const bool is_top = tier + 1 == tiers;
    m.flat_roof(shaft, z, is_top ? 1.8 : 0.9, is_top ? 0 : 0.4);
    if (is_top)
      plant_room(m, shaft, z);
    else
      shaft = shaft_of(m, shaft, m.random.between(2.5, 5));
  }
}

void build_setback_tower(Mason& m) {
  m.style.bay_m = m.random.between(2.1, 3.0), m.style.window_share = m.random.between(0.42, 0.56);
  double z = lobby(m, m.b.footprint, 5);
  Polygon shaft = m.b.footprint;
  int floors = m.b.floors - 1;
  for (int tier = 0; tier < 4 && floors > 0; ++tier) {
    int count = tier == 3 ? floors : std::max(2, static_cast<int>(floors * m.random.between(0.35, 0.6)));
    if (floors - count < 3) count = floors;
    z = m.storeys(shaft, z, count, m.b.floor_m, Facade::punched, tier == 0);
    floors -= count;
    m.cornice(shaft, z, 0.5, 0.6, tier > 0);
    m.flat_roof(shaft, z, 1.0, floors == 0 ? 0.5 : 0.25);
    if (floors > 0) shaft = shaft_of(m, shaft, m.random.between(2.2, 4.2));
  }
  const Vec2 top = centroid(shaft);
  if (m.random.chance(0.5)) return m.water_tower(top, z);
  const double w = std::sqrt(area(shaft)) * 0.5;
  m.block(m.b.wall, top, w, w, z, z + w * 0.4);
  const Frame f{{top.x, top.y, z + w * 0.4}, m.front_axis()};
  cone(m.g, Surface::copper, f.turned(0.785398), 4, w * 0.72, 0, 0, w * 0.8);
}

namespace {

// Piers between the bays, from bottom to top: what makes a tower look taller.
void piers(Mason& m, const Polygon& shaft, double z0, double z1) {
  for (size_t i = 0; i < shaft.size(); ++i) {
    const Vec2 a = shaft[i].at, along = next_corner(shaft, i).at - a;
    const double w = length(along);
    const int bays = std::max(1, static_cast<int>(std::lround(w / m.style.bay_m)));
    const Frame f{{a.x, a.y, z0}, normalize(along)};
    for (int k = 0; k <= bays; ++k) {
      const double x = std::clamp(w * k / bays, 0.3, w - 0.3);
      box(m.g, m.style.trim, f, {x - 0.3, -0.35, 0}, {x + 0.3, 0, z1 - z0 + 0.8}, kFront | kLeft | kRight | kTop);
    }
  }
}

}  // namespace

void build_art_deco(Mason& m) {
  m.style.bay_m = m.random.between(2.4, 3.2), m.style.window_share = 0.55, m.style.head_share = 0.86;
  double z = lobby(m, m.b.footprint, 6);
  Polygon shaft = m.b.footprint;
  const int crown = 3, body = std::max(4, m.b.floors - 1);
  const int base = std::max(2, body / 4);
  z = m.storeys(shaft, z, base, m.b.floor_m, Facade::punched, true);
  m.cornice(shaft, z, 0.4, 0.8, false);
  m.flat_roof(shaft, z, 1.0, 0.2);
  shaft = inset_by(shaft, 2.2).empty() ? shaft : inset_by(shaft, 2.2);
  for (Corner& c : shaft) c.street = 1;
  const double z_body = z;
  z = m.storeys(shaft, z, body - base, m.b.floor_m, Facade::punched, false);
  piers(m, shaft, z_body, z);
  m.flat_roof(shaft, z, 1.2, 0);
  for (int step = 0; step < crown; ++step) {
    const Polygon next = inset_by(shaft, std::sqrt(area(shaft)) * 0.13);
    if (next.empty() || area(next) < 20) break;
    shaft = next;
    const double z0 = z;
    z = m.storeys(shaft, z, 2 - step / 2, m.b.floor_m, Facade::punched, false);
    piers(m, shaft, z0, z);
    m.flat_roof(shaft, z, 0.8, 0);
  }
  const Vec2 top = centroid(shaft);
  const double r = std::sqrt(area(shaft)) * 0.45;
  const Frame f{{top.x, top.y, z}, m.front_axis()};
  const Surface metal = m.random.chance(0.4) ? Surface::gold : Surface::copper;
  cone(m.g, metal, f.turned(0.785398), 4, r * 1.3, 0.3, r * 0.55, r * 1.2);
  cone(m.g, metal, f.turned(0.785398), 4, r * 0.55, r * 1.2, 0, r * 3.2);
  m.spire(top, z + r * 3.0, r * 2.2);
}

void build_podium_tower(Mason& m) {
  m.style.bay_m = 3.4;
  double z = lobby(m, m.b.footprint, 5);
  const int podium = 2 + static_cast<int>(m.random.below(3));
  z = m.storeys(m.b.footprint, z, podium, m.b.floor_m, m.random.chance(0.5) ? Facade::ribbon : Facade::punched, true);
  m.flat_roof(m.b.footprint, z, 1.1, 0.4);
  Polygon shaft = shaft_of(m, m.b.footprint, std::sqrt(area(m.b.footprint)) * m.random.between(0.12, 0.18));
  m.style.bay_m = m.random.between(1.6, 2.6);
  const bool homes = m.random.chance(0.4);
  if (homes) m.style.bay_m = 3.6, m.style.window_share = 0.7, m.style.sill_share = 0.12, m.style.balcony_chance = 0.45;
  z = m.storeys(shaft, z, m.b.floors - podium - 1, m.b.floor_m, homes ? Facade::punched : Facade::curtain, false);
  m.flat_roof(shaft, z, 1.4, 0.2);
  plant_room(m, shaft, z);
}

void build_slab(Mason& m) {
  m.style.bay_m = m.random.between(3.2, 4.0), m.style.window_share = 0.6, m.style.sill_share = 0.3;
  m.style.balcony_chance = m.random.between(0.3, 0.8);
  double z = m.storeys(m.b.footprint, m.z, 1, m.b.floor_m * 1.15, Facade::shop, true);
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, Facade::punched, true);
  m.cornice(m.b.footprint, z, 0.25, 0.3, true);
  m.flat_roof(m.b.footprint, z, 0.9, 0.5);
  const Vec2 middle = centroid(m.b.footprint);
  m.block(m.b.wall, middle, 4.5, std::min(5.0, m.b.depth_m() * 0.5), z, z + 3.2);
  if (m.random.chance(0.5)) m.spire(middle, z + 3.2, m.random.between(4, 9));
}

void build_office_block(Mason& m) {
  m.style.bay_m = m.random.between(1.8, 3.2);
  double z = lobby(m, m.b.footprint, 4.5);
  const Facade facade = m.random.chance(0.6) ? Facade::ribbon : Facade::punched;
  m.style.window_share = 0.66;
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, facade, true);
  m.flat_roof(m.b.footprint, z, 1.1, 1);
}

}  // namespace spillway::tools::city
