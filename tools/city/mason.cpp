#include "tools/city/mason.h"

#include <algorithm>

namespace spillway::tools::city {

Vec2 Mason::front_axis() const { return normalize(b.footprint[1].at - b.footprint[0].at); }

Frame Mason::front_frame(double at_z) const { return {{b.footprint[0].at.x, b.footprint[0].at.y, at_z}, front_axis()}; }

bool Mason::is_party_wall(const Polygon& footprint, size_t edge) const {
  const bool filled = std::any_of(footprint.begin(), footprint.end(), [](const Corner& c) { return c.street > 0; });
  if (filled) return footprint[edge].street <= 0;
  return edge == 1 || edge == 3;  // of a rectangle with a front and a yard
}

namespace {

// Where windows are on such a facade, as facade.cpp puts them.
WallGrid grid_of(const Wall& wall, Facade facade, const FacadeStyle& style, const WallGrid& building) {
  WallGrid grid = building;
  grid.frame = wall.frame, grid.width_m = wall.width_m, grid.floor_m = wall.floor_m;
  grid.top_m = wall.floor_m * wall.floors;
  const double bay = wall.width_m / std::max(1.0, std::round(wall.width_m / style.bay_m));
  if (facade == Facade::punched)
    grid.bay_m = bay, grid.half_window_m = bay * style.window_share / 2, grid.sill_m = wall.floor_m * style.sill_share,
    grid.head_m = wall.floor_m * style.head_share;
  if (facade == Facade::ribbon)
    grid.bay_m = bay, grid.half_window_m = bay / 2, grid.sill_m = wall.floor_m * 0.36, grid.head_m = wall.floor_m;
  return grid;
}

}  // namespace

void Mason::facade(const Wall& wall, Facade facade) {
  const uint32_t before = g.begin_wall(grid_of(wall, facade, style, g.wall()));
  facade_on(wall, facade);
  g.back_to_wall(before);
}

void Mason::facade_on(const Wall& wall, Facade facade) {
  const Random own(random.next());
  switch (facade) {
    case Facade::punched:
      return punched_facade(g, wall, style, own);
    case Facade::ribbon:
      return ribbon_facade(g, wall, style, own);
    case Facade::curtain:
      return curtain_facade(g, wall, style, own);
    case Facade::shop:
      return shop_front(g, wall, style, own);
    case Facade::house:
      return house_front(g, wall, style, own);
    case Facade::garage:
      return garage_facade(g, wall, style);
    case Facade::blank:
      return blank_facade(g, wall, style.wall);
  }
}

double Mason::storeys(const Polygon& footprint, double z0, int floors, double floor_m, Facade kind, bool party_walls) {
  for (size_t i = 0; i < footprint.size(); ++i) {
    const Vec2 a = footprint[i].at, along = next_corner(footprint, i).at - a;
    const Wall wall{{{a.x, a.y, z0}, normalize(along)}, length(along), floor_m, floors};
    const bool blank = (party_walls && is_party_wall(footprint, i)) || wall.width_m < 1.2;
    facade(wall, blank ? Facade::blank : kind);
  }
  return z0 + floors * floor_m;
}

void Mason::cornice(const Polygon& footprint, double z0, double out_m, double height_m, bool all_edges) {
  for (size_t i = 0; i < footprint.size(); ++i) {
    if (!all_edges && is_party_wall(footprint, i)) continue;
    const Vec2 a = footprint[i].at, along = next_corner(footprint, i).at - a;
    const Frame f{{a.x, a.y, z0}, normalize(along)};
    const double w = length(along);
    box(g, style.trim, f, {0, -out_m, 0}, {w, 0.05, height_m}, kAllFaces & ~kBack);
    if (style.level >= 2)
      box(g, style.trim, f, {0, -out_m * 0.55, -height_m * 0.6}, {w, 0, 0}, kFront | kBottom | kLeft | kRight);
    if (style.level < 3) continue;
    const int brackets = std::max(2, static_cast<int>(w / 1.1));
    for (int k = 0; k <= brackets; ++k) {
      const double x = std::clamp(w * k / brackets, 0.1, w - 0.1);
      box(g, style.trim, f, {x - 0.1, -out_m * 0.9, -height_m * 0.9}, {x + 0.1, 0, 0},
          kFront | kLeft | kRight | kBottom);
    }
  }
}

void Mason::flat_roof(const Polygon& footprint, double z0, double parapet_m, double amount) {
  const Polygon inside = inset_by(footprint, 0.28);
  if (parapet_m <= 0 || inside.size() != footprint.size()) {
    cap(g, b.roof, footprint, z0);
    return clutter(footprint, z0, amount);
  }
  prism_sides(g, style.wall, footprint, z0, z0 + parapet_m);
  const Frame world;
  for (size_t i = 0; i < footprint.size(); ++i) {
    const Vec2 a = footprint[i].at, c = next_corner(footprint, i).at, d = inside[i].at, e = next_corner(inside, i).at;
    const double top = z0 + parapet_m;
    g.quad(style.trim, world, {a.x, a.y, top}, {c.x, c.y, top}, {e.x, e.y, top}, {d.x, d.y, top});
    g.quad(style.wall, world, {e.x, e.y, z0}, {d.x, d.y, z0}, {d.x, d.y, top}, {e.x, e.y, top});
  }
  cap(g, b.roof, inside, z0);
  clutter(inside, z0, amount);
}

void Mason::block(Surface surface, Vec2 at, double width, double depth, double z0, double z1) {
  const Frame f{{at.x, at.y, z0}, front_axis()};
  box(g, surface, f, {-width / 2, -depth / 2, 0}, {width / 2, depth / 2, z1 - z0});
}

void Mason::spire(Vec2 at, double z0, double height_m) {
  const Frame f{{at.x, at.y, z0}};
  cone(g, Surface::metal_light, f, 6, 0.35, 0, 0.08, height_m);
  for (int i = 1; i < 4; ++i)
    box(g, Surface::metal_light, f, {-1.2 / i, -0.05, height_m * 0.22 * i}, {1.2 / i, 0.05, height_m * 0.22 * i + 0.1},
        kAllFaces);
  octahedron(g, style.lighting.on ? Surface::beacon : Surface::trim_white, f.at({0, 0, height_m}), 0.3, 0.4);
}

void Mason::water_tower(Vec2 at, double z0) {
  const double radius = random.between(1.3, 1.9), legs = random.between(2.2, 4.0),
               tall = radius * random.between(1.7, 2.2);
  const Frame f{{at.x, at.y, z0}, front_axis()};
  const double s = radius * 0.66;
  for (const double x : {-s, s})
    for (const double y : {-s, s}) beam(g, Surface::metal_dark, f, {x, y, 0}, {x, y, legs}, 0.2);
  for (const double side : {-s, s}) {
    beam(g, Surface::metal_dark, f, {-s, side, 0.2}, {s, side, legs}, 0.1);
    beam(g, Surface::metal_dark, f, {side, -s, 0.2}, {side, s, legs}, 0.1);
  }
  const int sides = style.level >= 2 ? 16 : 10;
  disk(g, Surface::wood_red, f, sides, radius, legs);
  cone(g, Surface::tile_brown, f, sides, radius, legs, radius * 0.97, legs + tall);
  cone(g, Surface::metal_dark, f, sides, radius * 1.02, legs + tall * 0.3, radius * 1.02, legs + tall * 0.36);
  cone(g, Surface::metal_dark, f, sides, radius * 1.02, legs + tall * 0.7, radius * 1.02, legs + tall * 0.76);
  cone(g, Surface::tile_slate, f, sides, radius * 1.15, legs + tall, 0, legs + tall + radius * 0.8);
}

namespace {

void air_conditioner(Mason& m, Vec2 at, double z) {
  const double w = m.random.between(1.2, 2.6), d = m.random.between(1.0, 1.8), h = m.random.between(0.9, 1.7);
  m.block(Surface::metal_light, at, w, d, z + 0.15, z + h);
  m.block(Surface::metal_dark, at, w * 0.8, d * 0.8, z, z + 0.15);
  if (m.style.level < 2) return;
  const Frame f{{at.x, at.y, z + h}, m.front_axis()};
  cone(m.g, Surface::metal_dark, f, 10, d * 0.36, 0, d * 0.36, 0.14);
  disk(m.g, Surface::trim_dark, f, 10, d * 0.33, 0.05);
}

void vent(Mason& m, Vec2 at, double z) {
  const Frame f{{at.x, at.y, z}, m.front_axis()};
  const double r = m.random.between(0.12, 0.3), h = m.random.between(0.6, 1.4);
  cone(m.g, Surface::metal_light, f, 8, r, 0, r, h);
  cone(m.g, Surface::metal_light, f, 8, r * 1.7, h, 0, h + r);
}

void skylight(Mason& m, Vec2 at, double z) {
  const double w = m.random.between(1.5, 3.5);
  m.block(Surface::metal_dark, at, w, 1.4, z, z + 0.35);
  const Frame f{{at.x, at.y, z + 0.35}, m.front_axis()};
  gable_roof(m.g, pane_surface(Surface::glass_dark, m.style.lighting, m.random), Surface::metal_dark,
             f.at({-w / 2, -0.7, 0}), w, 1.4, 0, 0.5, 0);
}

void duct(Mason& m, Vec2 at, double z, double run) {
  const Frame f{{at.x, at.y, z}, m.front_axis()};
  box(m.g, Surface::metal_light, f, {-run / 2, -0.35, 0.3}, {run / 2, 0.35, 1.0}, kAllFaces);
  for (const double x : {-run / 2 + 0.4, run / 2 - 0.4})
    box(m.g, Surface::metal_dark, f, {x - 0.06, -0.3, 0}, {x + 0.06, 0.3, 0.3}, kSides);
  box(m.g, Surface::metal_light, f, {run / 2 - 0.7, -0.35, 0}, {run / 2, 0.35, 0.3}, kSides);
}

void dish(Mason& m, Vec2 at, double z) {
  const Frame f = Frame{{at.x, at.y, z}, m.front_axis()}.turned(m.random.between(0, 6.28));
  beam(m.g, Surface::metal_light, f, {0, 0, 0}, {0, 0, 1.1}, 0.08);
  cone(m.g, Surface::trim_white, f.at({0, 0, 1.1}), 10, 0.1, 0, 0.6, 0.25);
}

}  // namespace

void Mason::clutter(const Polygon& roof, double z0, double amount) {
  const Polygon inside = inset_by(roof, 1.6);
  if (inside.empty() || amount <= 0) return;
  const Vec2 x = front_axis(), y = left_of(x);
  const Interval ex = extent(inside, x), ey = extent(inside, y);
  const int count = std::min(16, static_cast<int>(amount * area(inside) / 26) + 1);
  const double step = std::sqrt(area(inside) / count);
  int placed = 0;
  // A loose grid, so that things do not stand in each other.
  for (double v = ey.low + 0.9; v < ey.high && placed < count; v += std::max(step, 3.0))
    for (double u = ex.low + 0.9; u < ex.high && placed < count; u += std::max(step, 3.0)) {
      const Vec2 at = x * (u + random.between(-0.2, 0.2)) + y * (v + random.between(-0.2, 0.2));
      if (!contains(inside, at) || random.chance(0.25)) continue;
      ++placed;
      const double what = random.unit();
      if (what < 0.40)
        air_conditioner(*this, at, z0);
      else if (what < 0.60)
        vent(*this, at, z0);
      else if (what < 0.72)
        skylight(*this, at, z0);
      else if (what < 0.86)
        duct(*this, at, z0, random.between(1.8, 2.6));
      else if (what < 0.95)
        dish(*this, at, z0);
      else
        block(style.wall, at, 2.4, 2.8, z0, z0 + 2.5);
    }
}

}  // namespace spillway::tools::city
