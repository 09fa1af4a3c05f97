#include "tools/city/facade.h"

#include <algorithm>

#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

// A rectangle of the wall: x0..x1, z0..z1.
struct Opening {
  double x0, x1, z0, z1;
};

void wall_quad(Geometry& g, Surface surface, const Frame& f, const Opening& o, double y) {
  g.quad(surface, f, {o.x0, y, o.z0}, {o.x1, y, o.z0}, {o.x1, y, o.z1}, {o.x0, y, o.z1});
}

void reveals(Geometry& g, Surface surface, const Frame& f, const Opening& o, double depth) {
  g.quad(surface, f, {o.x0, 0, o.z0}, {o.x1, 0, o.z0}, {o.x1, depth, o.z0}, {o.x0, depth, o.z0});
  g.quad(surface, f, {o.x0, depth, o.z1}, {o.x1, depth, o.z1}, {o.x1, 0, o.z1}, {o.x0, 0, o.z1});
  g.quad(surface, f, {o.x0, 0, o.z0}, {o.x0, depth, o.z0}, {o.x0, depth, o.z1}, {o.x0, 0, o.z1});
  g.quad(surface, f, {o.x1, depth, o.z0}, {o.x1, 0, o.z0}, {o.x1, 0, o.z1}, {o.x1, depth, o.z1});
}

void sill(Geometry& g, Surface surface, const Frame& f, const Opening& o) {
  box(g, surface, f, {o.x0 - 0.08, -0.1, o.z0 - 0.12}, {o.x1 + 0.08, 0.02, o.z0},
      kFront | kTop | kBottom | kLeft | kRight);
}

void lintel(Geometry& g, Surface surface, const Frame& f, const Opening& o) {
  box(g, surface, f, {o.x0 - 0.12, -0.05, o.z1}, {o.x1 + 0.12, 0.02, o.z1 + 0.2}, kFront | kTop | kBottom);
}

// The same of bars: they stand out, and there are more of them.
void deep_sash(Geometry& g, Surface surface, const Frame& f, const Opening& o, double depth, int level) {
  const double w = std::min(0.06, (o.x1 - o.x0) / 8), y = depth - 0.07;
  const auto bar = [&](double x0, double x1, double z0, double z1, double front) {
    box(g, surface, f, {x0, front, z0}, {x1, depth, z1}, kAllFaces & ~kBack);
  };
  bar(o.x0, o.x0 + w, o.z0, o.z1, y), bar(o.x1 - w, o.x1, o.z0, o.z1, y);
  bar(o.x0 + w, o.x1 - w, o.z0, o.z0 + w, y), bar(o.x0 + w, o.x1 - w, o.z1 - w, o.z1, y);
  const int rows = level >= 5 ? 4 : 2, columns = std::max(level >= 5 ? 2 : 1, static_cast<int>((o.x1 - o.x0) / 0.8));
  for (int i = 1; i < rows; ++i) {
    const double z = o.z0 + (o.z1 - o.z0) * i / rows;
    bar(o.x0 + w, o.x1 - w, z - w / 3, z + w / 3, y + 0.02);
  }
  for (int i = 1; i < columns; ++i) {
    const double x = o.x0 + (o.x1 - o.x0) * i / columns;
    bar(x - w / 3, x + w / 3, o.z0 + w, o.z1 - w, y + 0.025);
  }
}

// A frame around the pane and bars across it, just before it.
void sash(Geometry& g, Surface surface, const Frame& f, const Opening& o, double depth) {
  const double y = depth - 0.03, w = std::min(0.06, (o.x1 - o.x0) / 8), zm = (o.z0 + o.z1) / 2, xm = (o.x0 + o.x1) / 2;
  wall_quad(g, surface, f, {o.x0, o.x0 + w, o.z0, o.z1}, y);
  wall_quad(g, surface, f, {o.x1 - w, o.x1, o.z0, o.z1}, y);
  wall_quad(g, surface, f, {o.x0 + w, o.x1 - w, o.z0, o.z0 + w}, y);
  wall_quad(g, surface, f, {o.x0 + w, o.x1 - w, o.z1 - w, o.z1}, y);
  wall_quad(g, surface, f, {o.x0 + w, o.x1 - w, zm - w / 2, zm + w / 2}, y - 0.01);
  if (o.x1 - o.x0 > 1.3) wall_quad(g, surface, f, {xm - w / 2, xm + w / 2, o.z0 + w, o.z1 - w}, y - 0.005);
}

void shutters(Geometry& g, Surface surface, const Frame& f, const Opening& o) {
  const double w = (o.x1 - o.x0) * 0.42;
  box(g, surface, f, {o.x0 - w, -0.05, o.z0}, {o.x0 - 0.02, 0, o.z1}, kFront | kLeft | kRight);
  box(g, surface, f, {o.x1 + 0.02, -0.05, o.z0}, {o.x1 + w, 0, o.z1}, kFront | kLeft | kRight);
}

void window(Geometry& g, const Frame& f, const Opening& o, const FacadeStyle& style, Surface pane) {
  if (style.level == 0) {
    wall_quad(g, style.trim, f, {o.x0 - 0.1, o.x1 + 0.1, o.z0 - 0.1, o.z1 + 0.1}, -0.03);
    return wall_quad(g, pane, f, o, -0.05);
  }
  reveals(g, style.wall, f, o, style.recess_m);
  wall_quad(g, pane, f, o, style.recess_m);
  if (style.level >= 2) sill(g, style.trim, f, o);
  if (style.shutters && style.level >= 2) shutters(g, style.trim, f, o);
  if (style.level < 3) return;
  lintel(g, style.trim, f, o);
  if (style.bars && style.level >= 4) return deep_sash(g, style.trim, f, o, style.recess_m, style.level);
  if (style.bars) sash(g, style.trim, f, o, style.recess_m);
}

void balcony(Geometry& g, const FacadeStyle& style, const Frame& f, double x0, double x1, double z) {
  constexpr double kOut = 1.25, kRail = 1.05;
  box(g, style.trim, f, {x0, -kOut, z - 0.16}, {x1, 0, z}, kFront | kLeft | kRight | kTop | kBottom);
  box(g, Surface::metal_dark, f, {x0, -kOut, z + kRail - 0.06}, {x1, -kOut + 0.06, z + kRail}, kFront | kTop | kBack);
  const int bars = style.level >= 3 ? 9 : style.level == 2 ? 5 : 2;
  for (int i = 0; i <= bars; ++i) {
    const double x = x0 + (x1 - x0 - 0.05) * i / bars;
    box(g, Surface::metal_dark, f, {x, -kOut, z}, {x + 0.05, -kOut + 0.05, z + kRail - 0.06}, kSides);
  }
}

struct Bays {
  int count;
  double width;
};
Bays bays_of(const Wall& wall, double wanted) {
  const int count = std::max(1, static_cast<int>(std::lround(wall.width_m / wanted)));
  return {count, wall.width_m / count};
}

// The share of lit panes of one floor: whole floors of offices, single rooms of homes.
Lighting floor_lighting(const Lighting& lighting, Random& random) {
  Lighting floor = lighting;
  if (lighting.by_floor) floor.share = random.chance(lighting.share) ? 0.8 : 0.03;
  return floor;
}

}  // namespace

Surface pane_surface(Surface glass, const Lighting& lighting, Random& random) {
  const double lit = random.unit(), tint = random.unit();
  if (!lighting.on || lit >= lighting.share) return glass;
  if (tint < 0.7) return lighting.usual;
  return tint < 0.82 ? Surface::lit_amber : tint < 0.93 ? Surface::lit_neutral : Surface::lit_cool;
}

void punched_facade(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random) {
  const Bays bays = bays_of(wall, style.bay_m);
  const double h = wall.floor_m, half = bays.width * style.window_share / 2;
  std::vector<bool> has_balcony;
  for (int i = 0; i < bays.count; ++i) has_balcony.push_back(random.chance(style.balcony_chance));
  const bool openings = style.level > 0;
  if (!openings) wall_quad(g, style.wall, wall.frame, {0, wall.width_m, 0, h * wall.floors}, 0);
  if (openings) wall_quad(g, style.wall, wall.frame, {0, wall.width_m, 0, h * style.sill_share}, 0);
  for (int floor = 0; floor < wall.floors; ++floor) {
    const double z = h * floor, z0 = z + h * style.sill_share, z1 = z + h * style.head_share;
    const double next = floor + 1 < wall.floors ? z + h + h * style.sill_share : h * wall.floors;
    const Lighting lighting = floor_lighting(style.lighting, random);
    if (openings) wall_quad(g, style.wall, wall.frame, {0, wall.width_m, z1, next}, 0);
    double x = 0;
    for (int i = 0; i < bays.count; ++i) {
      const double middle = bays.width * (i + 0.5);
      if (openings) wall_quad(g, style.wall, wall.frame, {x, middle - half, z0, z1}, 0);
      window(g, wall.frame, {middle - half, middle + half, z0, z1}, style, pane_surface(style.glass, lighting, random));
      if (has_balcony[static_cast<size_t>(i)] && floor > 0)
        balcony(g, style, wall.frame, middle - half - 0.3, middle + half + 0.3, z + 0.02);
      x = middle + half;
    }
    if (openings) wall_quad(g, style.wall, wall.frame, {x, wall.width_m, z0, z1}, 0);
  }
}

void ribbon_facade(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random) {
  const Bays bays = bays_of(wall, style.bay_m);
  const double h = wall.floor_m;
  for (int floor = 0; floor < wall.floors; ++floor) {
    const double z0 = h * floor, z1 = z0 + h * 0.36, z2 = z0 + h;
    const Lighting lighting = floor_lighting(style.lighting, random);
    box(g, style.wall, wall.frame, {0, -0.12, z0}, {wall.width_m, 0.1, z1}, kFront | kTop | kBottom | kLeft | kRight);
    for (int i = 0; i < bays.count; ++i)
      wall_quad(g, pane_surface(style.glass, lighting, random), wall.frame,
                {bays.width * i, bays.width * (i + 1), z1, z2}, 0.06);
    if (style.level == 0) continue;
    for (int i = 0; i <= bays.count; ++i) {
      const double x = std::clamp(bays.width * i, 0.06, wall.width_m - 0.06);
      box(g, style.trim, wall.frame, {x - 0.06, -0.02, z1}, {x + 0.06, 0.06, z2}, kFront | kLeft | kRight);
    }
    if (style.level >= 2) sill(g, style.trim, wall.frame, {0.1, wall.width_m - 0.1, z1 + 0.02, z2});
  }
}

void curtain_facade(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random) {
  const Bays bays = bays_of(wall, style.bay_m);
  const double h = wall.floor_m, top = h * wall.floors;
  for (int floor = 0; floor < wall.floors; ++floor) {
    const double z0 = h * floor, z1 = z0 + h * 0.2, z2 = z0 + h;
    const Lighting lighting = floor_lighting(style.lighting, random);
    box(g, style.wall, wall.frame, {0, -0.04, z0}, {wall.width_m, 0, z1}, kFront | kTop | kBottom);
    for (int i = 0; i < bays.count; ++i) {
      const double x0 = bays.width * i, x1 = x0 + bays.width;
      const double a = random.between(-0.012, 0.012), b = random.between(-0.008, 0.008);
      g.quad(pane_surface(style.glass, lighting, random), wall.frame, {x0, 0.03 + a, z1 + b}, {x1, 0.03 - a, z1 + b},
             {x1, 0.03 - a + b, z2}, {x0, 0.03 + a + b, z2});
    }
    if (style.level >= 3)
      box(g, style.trim, wall.frame, {0, -0.03, z1 + (z2 - z1) * 0.72}, {wall.width_m, 0.03, z1 + (z2 - z1) * 0.74},
          kFront | kTop | kBottom);
  }
  if (style.level == 0) return;
  const int every = style.level >= 2 ? 1 : 2;
  for (int i = 0; i <= bays.count; i += every) {
    const double x = std::clamp(bays.width * i, 0.05, wall.width_m - 0.05);
    box(g, style.trim, wall.frame, {x - 0.05, -0.16, 0}, {x + 0.05, 0, top}, kFront | kLeft | kRight | kTop);
  }
}

namespace {

void awning(Geometry& g, Surface surface, const Frame& f, double x0, double x1, double z) {
  constexpr double kOut = 1.3, kDrop = 0.7;
  g.quad(surface, f, {x0, -kOut, z - kDrop}, {x1, -kOut, z - kDrop}, {x1, 0, z}, {x0, 0, z});
  g.quad(surface, f, {x0, -kOut, z - kDrop - 0.25}, {x1, -kOut, z - kDrop - 0.25}, {x1, -kOut, z - kDrop},
         {x0, -kOut, z - kDrop});
  g.triangle(surface, f.point({x0, 0, z}), f.point({x0, 0, z - kDrop}), f.point({x0, -kOut, z - kDrop}));
  g.triangle(surface, f.point({x1, 0, z}), f.point({x1, -kOut, z - kDrop}), f.point({x1, 0, z - kDrop}));
}

void door(Geometry& g, const Frame& f, const Opening& o, double depth, Surface frame_surface) {
  reveals(g, frame_surface, f, o, depth);
  wall_quad(g, Surface::door, f, {o.x0, o.x1, o.z0, o.z1 - 0.45}, depth);
  wall_quad(g, Surface::glass_dark, f, {o.x0, o.x1, o.z1 - 0.45, o.z1}, depth);
  wall_quad(g, Surface::glass_dark, f, {o.x0 + 0.2, o.x1 - 0.2, o.z0 + 1, o.z1 - 0.65}, depth - 0.02);
}

// The board over the shop: a dark box by day, letters of light by night.
void sign_board(Geometry& g, const Frame& f, const Opening& o, const FacadeStyle& style, Random& random) {
  static constexpr Surface kSigns[] = {Surface::sign_pink,  Surface::sign_cyan, Surface::sign_amber,
                                       Surface::sign_green, Surface::lit_warm,  Surface::lit_neutral};
  static constexpr Surface kBoards[] = {Surface::trim_dark, Surface::awning_red, Surface::awning_green,
                                        Surface::awning_navy, Surface::trim_white};
  box(g, kBoards[random.below(5)], f, {o.x0, -0.12, o.z0}, {o.x1, 0, o.z1}, kFront | kTop | kBottom | kLeft | kRight);
  const Surface letters = kSigns[random.below(6)];
  const int count = 3 + static_cast<int>(random.below(6));
  const double size = (o.z1 - o.z0) * 0.62, room = (o.x1 - o.x0) / count, mid = (o.z0 + o.z1) / 2;
  const bool lit = style.lighting.on && random.chance(0.75);
  for (int i = 0; i < count && size < room; ++i) {
    const double x = o.x0 + room * (i + 0.5), w = size * random.between(0.25, 0.42);
    wall_quad(g, lit ? letters : Surface::trim_white, f, {x - w, x + w, mid - size / 2, mid + size / 2}, -0.15);
  }
}

}  // namespace

void shop_front(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random) {
  const Frame& f = wall.frame;
  const double h = wall.floor_m, head = h * 0.72, base = 0.45;
  const Bays bays = bays_of(wall, 4.2);
  Lighting lighting = style.lighting;
  lighting.share = 0.6;
  wall_quad(g, style.wall, f, {0, wall.width_m, head, h}, 0);
  const int door_bay = static_cast<int>(random.below(static_cast<uint32_t>(bays.count)));
  const Surface awning_surface = static_cast<Surface>(static_cast<uint32_t>(Surface::awning_red) + random.below(3));
  double x = 0;
  for (int i = 0; i < bays.count; ++i) {
    const double x0 = bays.width * i + 0.3, x1 = bays.width * (i + 1) - 0.3;
    wall_quad(g, style.trim, f, {x, x0, 0, head}, 0);
    x = x1;
    const bool has_door = i == door_bay;
    const double split = has_door ? std::min(x0 + 1.3, x1) : x0;
    if (has_door) door(g, f, {x0, split, 0, head}, 0.35, style.trim);
    if (x1 - split > 0.3) {
      wall_quad(g, style.trim, f, {split, x1, 0, base}, 0);
      window(g, f, {split, x1, base, head}, style, pane_surface(Surface::glass_dark, lighting, random));
    }
    if (random.chance(0.4))
      awning(g, awning_surface, f, x0 - 0.15, x1 + 0.15, head + 0.25);
    else
      sign_board(g, f, {x0, x1, head + 0.08, h - 0.12}, style, random);
  }
  wall_quad(g, style.trim, f, {x, wall.width_m, 0, head}, 0);
}

void house_front(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random) {
  const Frame& f = wall.frame;
  const double h = wall.floor_m, head = 2.5;
  const bool left = random.chance(0.5);
  const double x0 = left ? wall.width_m * 0.12 : wall.width_m * 0.88 - 1.1, x1 = x0 + 1.1;
  const Wall before{f, x0, h, 1}, behind{f.at({x1, 0, 0}), wall.width_m - x1, h, 1};
  for (const Wall& side : {before, behind}) {
    if (side.width_m > 1.6)
      punched_facade(g, side, style, random);
    else if (side.width_m > 0)
      wall_quad(g, style.wall, side.frame, {0, side.width_m, 0, h}, 0);
  }
  wall_quad(g, style.wall, f, {x0, x1, head, h}, 0);
  door(g, f, {x0, x1, 0.3, head}, 0.2, style.trim);
  box(g, style.trim, f, {x0 - 0.2, -0.9, -0.4}, {x1 + 0.2, 0, 0.3}, kFront | kLeft | kRight | kTop);
  box(g, style.trim, f, {x0 - 0.2, -1.25, -0.4}, {x1 + 0.2, -0.9, 0.1}, kFront | kLeft | kRight | kTop);
  if (style.level >= 2)
    box(g, style.trim, f, {x0 - 0.3, -0.8, head + 0.1}, {x1 + 0.3, 0, head + 0.28}, kAllFaces & ~kBack);
}

void garage_facade(Geometry& g, const Wall& wall, const FacadeStyle& style) {
  const Bays bays = bays_of(wall, 6);
  const double h = wall.floor_m;
  for (int floor = 0; floor < wall.floors; ++floor) {
    const double z = h * floor;
    box(g, style.wall, wall.frame, {0, -0.1, z + (floor == 0 ? 0 : -0.3)}, {wall.width_m, 0.12, z + 1.05},
        kFront | kBack | kTop | kBottom);
    for (int i = 0; i <= bays.count; ++i) {
      const double x = std::clamp(bays.width * i, 0.25, wall.width_m - 0.25);
      box(g, style.wall, wall.frame, {x - 0.25, 0, z + 1.05}, {x + 0.25, 0.5, z + h - 0.3}, kSides);
    }
  }
}

void blank_facade(Geometry& g, const Wall& wall, Surface surface) {
  wall_quad(g, surface, wall.frame, {0, wall.width_m, 0, wall.floor_m * wall.floors}, 0);
}

}  // namespace spillway::tools::city
