// Houses: walk-ups, lofts, shops, row houses, villas, cottages.

#include <algorithm>

#include "tools/city/mason.h"

namespace spillway::tools::city {
namespace {

// Landings before every other bay, stairs between them, a ladder to the pavement.
void fire_escape(Mason& m, double z0, int floors, double x, double run) {
  const Frame f = m.front_frame(z0);
  constexpr double kOut = 1.15;
  const double h = m.b.floor_m;
  for (int floor = 0; floor < floors; ++floor) {
    const double z = h * floor + 0.15;
    box(m.g, Surface::metal_dark, f, {x, -kOut, z - 0.06}, {x + run, -0.02, z}, kAllFaces & ~kBack);
    box(m.g, Surface::metal_dark, f, {x, -kOut, z + 0.95}, {x + run, -kOut + 0.05, z + 1.0}, kAllFaces);
    const int posts = m.style.level >= 3 ? 10 : m.style.level == 2 ? 5 : 2;
    for (int i = 0; i <= posts; ++i) {
      const double px = x + (run - 0.05) * i / posts;
      box(m.g, Surface::metal_dark, f, {px, -kOut, z}, {px + 0.05, -kOut + 0.05, z + 0.95}, kSides);
    }
    if (floor + 1 == floors) break;
    const bool up = floor % 2 == 0;
    const Vec3 from{up ? x + 0.3 : x + run - 0.3, -0.65, z}, to{up ? x + run - 0.6 : x + 0.6, -0.65, z + h};
    for (const double side : {-0.25, 0.25})
      beam(m.g, Surface::metal_dark, f, {from.x, from.y + side, from.z}, {to.x, to.y + side, to.z}, 0.07);
    const int steps = m.style.level >= 2 ? 8 : 0;
    for (int i = 1; i < steps; ++i) {
      const Vec3 at = from + (to - from) * (static_cast<double>(i) / steps);
      box(m.g, Surface::metal_dark, f, {at.x - 0.12, at.y - 0.25, at.z}, {at.x + 0.12, at.y + 0.25, at.z + 0.03},
          kTop | kFront);
    }
  }
  beam(m.g, Surface::metal_dark, f, {x + run - 0.3, -kOut + 0.1, -1.6}, {x + run - 0.3, -kOut + 0.1, 0.1}, 0.06);
}

void chimney(Mason& m, const Frame& f, double x, double y, double z0, double z1) {
  box(m.g, Surface::brick_brown, f, {x - 0.35, y - 0.35, z0}, {x + 0.35, y + 0.35, z1});
  box(m.g, Surface::brick_dark, f, {x - 0.42, y - 0.42, z1 - 0.25}, {x + 0.42, y + 0.42, z1}, kStanding | kBottom);
  for (const double dx : {-0.15, 0.15}) cone(m.g, Surface::tile_red, f.at({x + dx, y, z1}), 6, 0.11, 0, 0.09, 0.4);
}

// A sign that stands out from the front, letters one below the other.
void blade_sign(Mason& m, double z0, double height_m) {
  static constexpr Surface kSigns[] = {Surface::sign_pink, Surface::sign_cyan, Surface::sign_amber,
                                       Surface::sign_green};
  const Frame f = m.front_frame(z0);
  const double x = m.random.between(0.4, m.b.width_m() - 0.4);
  const bool lit = m.style.lighting.on && m.random.chance(0.8);
  const Surface board = m.random.chance(0.5) ? Surface::awning_navy : Surface::awning_red;
  box(m.g, board, f, {x - 0.12, -1.1, 0}, {x + 0.12, -0.15, height_m}, kAllFaces);
  const Surface letters = lit ? kSigns[m.random.below(4)] : Surface::trim_white;
  const int count = std::max(2, static_cast<int>(height_m / 0.9));
  for (int i = 0; i < count; ++i) {
    const double z = height_m * (i + 0.18) / count, top = height_m * (i + 0.82) / count;
    m.g.quad(letters, f, {x - 0.14, -0.3, z}, {x - 0.14, -0.95, z}, {x - 0.14, -0.95, top}, {x - 0.14, -0.3, top});
    m.g.quad(letters, f, {x + 0.14, -0.95, z}, {x + 0.14, -0.3, z}, {x + 0.14, -0.3, top}, {x + 0.14, -0.95, top});
  }
}

// A bay that stands out over the upper floors, windows on three sides.
void bay_window(Mason& m, double z0, int floors, double x0, double x1) {
  constexpr double kOut = 0.8, kSlant = 0.5;
  const Frame f = m.front_frame(z0);
  const Vec2 plan[4] = {{x0, 0}, {x0 + kSlant, -kOut}, {x1 - kSlant, -kOut}, {x1, 0}};
  FacadeStyle style = m.style;
  style.bay_m = 1.3, style.window_share = 0.72, style.shutters = false;
  for (int side = 0; side < 3; ++side) {
    const Vec2 a = plan[side], along = plan[side + 1] - a;
    const Vec2 world = normalize(f.x_axis * along.x + left_of(f.x_axis) * along.y);
    punched_facade(m.g, {{f.world({a.x, a.y, 0}), world}, length(along), m.b.floor_m, floors}, style,
                   Random(m.random.next()));
  }
  const double top = floors * m.b.floor_m;
  for (const double z : {0.0, top}) {
    const auto p = [&](int i, double dz) { return f.point({plan[i].x, plan[i].y, z + dz}); };
    m.g.quad(m.style.trim, p(0, 0), p(1, 0), p(2, 0), p(3, 0));
  }
  const Float3 peak0 = f.point({x0 + 0.4, 0, top + 0.7}), peak1 = f.point({x1 - 0.4, 0, top + 0.7});
  const auto eave = [&](int i) { return f.point({plan[i].x, plan[i].y, top}); };
  m.g.triangle(m.b.roof, eave(0), eave(1), peak0);
  m.g.quad(m.b.roof, eave(1), eave(2), peak1, peak0);
  m.g.triangle(m.b.roof, eave(2), eave(3), peak1);
}

}  // namespace

void build_walk_up(Mason& m) {
  m.style.bay_m = m.random.between(1.8, 2.5), m.style.window_share = 0.46, m.style.sill_share = 0.26;
  const bool shop = m.random.chance(0.45);
  double z = m.storeys(m.b.footprint, m.z, 1, m.b.floor_m * 1.15, shop ? Facade::shop : Facade::punched, true);
  m.cornice(m.b.footprint, z - 0.2, 0.15, 0.2, false);
  const double upper = z;
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, Facade::punched, true);
  m.cornice(m.b.footprint, z, 0.55, 0.55, false);
  m.flat_roof(m.b.footprint, z, 0.9, 0.8);
  const double w = m.b.width_m(), run = std::min(3.6, w * 0.45);
  if (m.random.chance(0.65)) fire_escape(m, upper, m.b.floors - 1, m.random.between(0.4, w - run - 0.4), run);
  const Vec2 middle = centroid(m.b.footprint);
  m.block(m.b.wall, middle + m.front_axis() * (w * 0.2), 2.4, 3.2, z, z + 2.5);
  if (m.random.chance(0.35)) m.water_tower(middle - m.front_axis() * (w * 0.2), z);
}

void build_loft(Mason& m) {
  m.style.bay_m = m.random.between(3.2, 4.4), m.style.window_share = 0.74, m.style.sill_share = 0.22;
  m.style.head_share = 0.88;
  double z = m.storeys(m.b.footprint, m.z, 1, m.b.floor_m * 1.1, Facade::shop, true);
  m.cornice(m.b.footprint, z - 0.1, 0.25, 0.3, false);
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, Facade::punched, true);
  m.cornice(m.b.footprint, z, 0.7, 0.8, false);
  m.flat_roof(m.b.footprint, z, 1.0, 0.7);
  m.water_tower(centroid(m.b.footprint), z);
}

void build_corner_shop(Mason& m) {
  m.style.bay_m = m.random.between(1.9, 2.8), m.style.window_share = 0.5, m.style.shutters = m.random.chance(0.5);
  double z = m.storeys(m.b.footprint, m.z, 1, m.b.floor_m * 1.2, Facade::shop, true);
  const double upper = z;
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, Facade::punched, true);
  if (m.random.chance(0.7)) blade_sign(m, upper + 0.2, std::max(2.2, (m.b.floors - 1) * m.b.floor_m - 0.8));
  if (m.random.chance(0.3)) {
    const Frame f = m.front_frame(z);
    hip_roof(m.g, Surface::tile_slate, f, m.b.width_m(), m.b.depth_m(), 0, m.b.width_m() * 0.22, 0.04);
    return;
  }
  m.cornice(m.b.footprint, z, 0.35, 0.4, false);
  m.flat_roof(m.b.footprint, z, 0.8, 0.8);
}

void build_row_house(Mason& m) {
  m.style.bay_m = m.random.between(1.8, 2.3), m.style.window_share = 0.5;
  double z = m.storeys(m.b.footprint, m.z, 1, m.b.floor_m, Facade::house, true);
  const double upper = z, w = m.b.width_m(), d = m.b.depth_m();
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, Facade::punched, true);
  if (w > 5.6 && m.random.chance(0.75)) {
    const double x0 = m.random.between(0.4, w - 3.6);
    bay_window(m, upper, m.b.floors - 1, x0, x0 + 3.0);
  }
  if (m.random.chance(0.35)) {
    m.cornice(m.b.footprint, z, 0.5, 0.6, false);
    return m.flat_roof(m.b.footprint, z, 0.7, 0.6);
  }
  // The gable looks at the street: the ridge runs from front to back.
  const Frame f{m.front_frame(z).world({w, 0, 0}), left_of(m.front_axis())};
  const double rise = w * m.random.between(0.42, 0.6);
  gable_roof(m.g, m.b.roof, m.b.wall, f, d, w, 0, rise, 0.05);
  const double half = w * 0.5, head = rise * 0.45;
  const Frame front = m.front_frame(z);
  if (w > 4)
    m.g.quad(pane_surface(m.b.glass, m.style.lighting, m.random), front, {half - 0.5, -0.03, head * 0.35},
             {half + 0.5, -0.03, head * 0.35}, {half + 0.5, -0.03, head}, {half - 0.5, -0.03, head});
  chimney(m, front, w * 0.25, d * 0.6, 0, rise + 0.9);
}

void build_villa(Mason& m) {
  m.style.bay_m = m.random.between(2.4, 3.2), m.style.shutters = m.random.chance(0.4);
  const double w = m.b.width_m(), d = m.b.depth_m();
  double z = m.storeys(m.b.footprint, m.z, 1, m.b.floor_m, Facade::house, false);
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, Facade::punched, false);
  const Frame f = m.front_frame(z);
  const double rise = std::min(w, d) * m.random.between(0.22, 0.36);
  hip_roof(m.g, m.b.roof, f, w, d, 0, rise, 0.7);
  box(m.g, m.style.trim, f, {-0.7, -0.7, -0.2}, {w + 0.7, d + 0.7, 0}, kSides | kBottom);
  chimney(m, f, w * m.random.between(0.25, 0.75), d * 0.35, 0, rise + 0.8);
  if (m.random.chance(0.6)) {  // a porch on posts
    const Frame porch = m.front_frame(m.z);
    const double x0 = w * 0.15, x1 = w * 0.85;
    for (int i = 0; i < 4; ++i)
      cone(m.g, m.style.trim, porch.at({x0 + (x1 - x0) * i / 3, -1.9, 0}), 8, 0.14, -0.6, 0.11, 2.6);
    box(m.g, m.style.trim, porch, {x0 - 0.3, -2.2, -0.6}, {x1 + 0.3, 0, 0}, kFront | kLeft | kRight | kTop);
    box(m.g, m.b.roof, porch, {x0 - 0.4, -2.3, 2.6}, {x1 + 0.4, 0, 2.8}, kAllFaces & ~kBack);
  }
}

void build_cottage(Mason& m) {
  m.style.bay_m = m.random.between(2.2, 2.9), m.style.shutters = m.random.chance(0.5);
  const double w = m.b.width_m(), d = m.b.depth_m();
  double z = m.storeys(m.b.footprint, m.z, 1, m.b.floor_m, Facade::house, false);
  z = m.storeys(m.b.footprint, z, m.b.floors - 1, m.b.floor_m, Facade::punched, false);
  const double pitch = m.random.between(0.55, 0.9);
  if (m.random.chance(0.5)) {
    gable_roof(m.g, m.b.roof, m.b.wall, m.front_frame(z), w, d, 0, d / 2 * pitch, 0.5);
    chimney(m, m.front_frame(z), w * 0.2, d * 0.5, 0, d / 2 * pitch + 0.9);
  } else {
    const Frame f{m.front_frame(z).world({w, 0, 0}), left_of(m.front_axis())};
    gable_roof(m.g, m.b.roof, m.b.wall, f, d, w, 0, w / 2 * pitch, 0.5);
    chimney(m, m.front_frame(z), w * 0.3, d * 0.5, 0, w / 2 * pitch + 0.7);
  }
}

}  // namespace spillway::tools::city
