// Sheds, factories and garages.

#include <algorithm>

#include "tools/city/cage.h"
#include "tools/city/mason.h"

namespace spillway::tools::city {
namespace {

// Teeth along the depth: glass upright to the back, roof sloping to the front.
void sawtooth(Mason& m, double z) {
  const double w = m.b.width_m(), d = m.b.depth_m();
  const int teeth = std::max(2, static_cast<int>(std::lround(d / 7)));
  const double run = d / teeth, rise = std::min(3.2, run * 0.45);
  const Frame f = m.front_frame(z);
  for (int i = 0; i < teeth; ++i) {
    const double y0 = run * i, y1 = y0 + run;
    m.g.quad(m.b.roof, f, {0, y0, 0}, {w, y0, 0}, {w, y1, rise}, {0, y1, rise});
    const int panes = std::max(2, static_cast<int>(w / 4));
    for (int k = 0; k < panes; ++k) {
      const double x0 = w * k / panes, x1 = w * (k + 1) / panes;
      m.g.quad(pane_surface(m.b.glass, m.style.lighting, m.random), f, {x1, y1, 0.3}, {x0, y1, 0.3}, {x0, y1, rise},
               {x1, y1, rise});
      box(m.g, Surface::metal_dark, f, {x0 - 0.05, y1, 0}, {x0 + 0.05, y1 + 0.08, rise}, kBack | kLeft | kRight);
    }
    m.g.quad(m.b.wall, f, {w, y1, 0}, {0, y1, 0}, {0, y1, 0.3}, {w, y1, 0.3});
    m.g.triangle(m.b.wall, f.point({w, y0, 0}), f.point({w, y1, 0}), f.point({w, y1, rise}));
    m.g.triangle(m.b.wall, f.point({0, y1, 0}), f.point({0, y0, 0}), f.point({0, y1, rise}));
  }
}

void loading_docks(Mason& m) {
  const Frame f = m.front_frame(m.z);
  const double w = m.b.width_m();
  const int docks = std::max(1, static_cast<int>(w / 7));
  for (int i = 0; i < docks; ++i) {
    const double x0 = w * (i + 0.5) / docks - 1.8, x1 = x0 + 3.6;
    box(m.g, Surface::metal_light, f, {x0, -0.08, 0.9}, {x1, 0, 4.1}, kFront | kLeft | kRight | kTop);
    for (int slat = 1; slat < 8; ++slat)
      box(m.g, Surface::metal_dark, f, {x0, -0.1, 0.9 + 0.4 * slat}, {x1, -0.08, 0.94 + 0.4 * slat},
          kFront | kTop | kBottom);
    box(m.g, Surface::concrete, f, {x0 - 0.3, -1.4, -0.5}, {x1 + 0.3, -0.02, 0.9}, kStanding);
    box(m.g, m.style.trim, f, {x0 - 0.4, -1.6, 4.4}, {x1 + 0.4, -0.02, 4.55}, kAllFaces);
  }
}

void smokestack(Mason& m, Vec2 at, double z0, double height) {
  const Frame f{{at.x, at.y, z0}, m.front_axis()};
  const double r = height * 0.045 + 0.5;
  const int sides = m.style.level >= 2 ? 20 : 12;
  cone(m.g, Surface::brick_red, f, sides, r, 0, r * 0.62, height);
  for (const double part : {0.8, 0.9}) {
    const double at_r = r * (1 - 0.38 * part) * 1.02;
    cone(m.g, Surface::trim_white, f, sides, at_r, height * part, at_r * 0.98, height * (part + 0.04));
  }
  cone(m.g, Surface::brick_dark, f, sides, r * 0.72, height - 0.8, r * 0.72, height);
  disk(m.g, Surface::trim_dark, f, sides, r * 0.66, height - 0.4);
  m.g.add_chimney({{at.x, at.y, z0 + height}, r * 0.62});
}

void tank(Mason& m, Vec2 at, double z0) {
  const Frame f{{at.x, at.y, z0}, m.front_axis()};
  const double r = m.random.between(1.4, 2.6), h = m.random.between(3, 6);
  const int sides = m.style.level >= 2 ? 24 : 12;
  cone(m.g, Surface::metal_light, f, sides, r, 0, r, h);
  dome_cage(m.g, Surface::metal_light, f, r, h, r * 0.4, false);
  beam(m.g, Surface::metal_dark, f, {r + 0.1, 0, 0}, {r + 0.1, 0, h + 0.4}, 0.08);
}

}  // namespace

void build_warehouse(Mason& m) {
  m.style.bay_m = m.random.between(3.5, 5), m.style.window_share = 0.55, m.style.sill_share = 0.62,
  m.style.head_share = 0.86;
  const double z = m.storeys(m.b.footprint, m.z, m.b.floors, m.b.floor_m, Facade::punched, false);
  loading_docks(m);
  sawtooth(m, z);
}

void build_factory(Mason& m) {
  m.style.bay_m = 4, m.style.window_share = 0.7, m.style.sill_share = 0.3, m.style.head_share = 0.85;
  const double w = m.b.width_m(), d = m.b.depth_m();
  const double hall = d * m.random.between(0.5, 0.65);
  const Vec2 x = m.front_axis(), origin = m.b.footprint[0].at;
  const Polygon front = rectangle(origin, x, w, hall);
  double z = m.storeys(front, m.z, m.b.floors, m.b.floor_m, Facade::punched, false);
  m.cornice(front, z, 0.2, 0.4, true);
  m.flat_roof(front, z, 0.8, 1.2);
  loading_docks(m);
  const Polygon back = rectangle(origin + left_of(x) * (hall + 0.1), x, w * 0.55, d - hall - 0.1);
  z = m.storeys(back, m.z, 1, m.b.floor_m * 1.5, Facade::punched, false);
  m.flat_roof(back, z, 0.4, 1.4);
  const double yard = m.z - 0.2;
  smokestack(m, origin + x * (w * 0.68) + left_of(x) * (hall + (d - hall) * 0.35), yard, m.random.between(18, 38));
  for (int i = 0; i < 2; ++i)
    tank(m, origin + x * (w * (0.72 + 0.17 * i)) + left_of(x) * (hall + (d - hall) * 0.7), yard);
}

void build_parking_garage(Mason& m) {
  m.storeys(m.b.footprint, m.z, m.b.floors, m.b.floor_m, Facade::garage, false);
  const Polygon deck = inset_by(m.b.footprint, 0.1);
  for (int floor = 0; floor <= m.b.floors; ++floor) cap(m.g, Surface::concrete, deck, m.z + floor * m.b.floor_m);
  const double top = m.z + m.b.floors * m.b.floor_m;
  m.cornice(m.b.footprint, top, 0.1, 1.0, true);
  const Vec2 middle = centroid(m.b.footprint);
  m.block(m.b.wall, middle, 5, 6, m.z, top + 3);
  m.block(Surface::sign_cyan, middle, 1.6, 6.3, top + 1, top + 2.6);
}

}  // namespace spillway::tools::city
