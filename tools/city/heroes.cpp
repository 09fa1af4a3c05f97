// Buildings one looks up to: churches, domed halls, pagodas.

#include <algorithm>

#include "tools/city/cage.h"
#include "tools/city/mason.h"

namespace spillway::tools::city {
namespace {

constexpr double kTurn = 6.283185307179586;

void buttresses(Mason& m, const Frame& f, double length_m, double width_m, double height_m) {
  const int count = std::max(2, static_cast<int>(length_m / 4.5));
  for (int i = 0; i <= count; ++i) {
    const double y = std::clamp(length_m * i / count, 0.4, length_m - 0.4);
    box(m.g, m.style.trim, f, {-0.7, y - 0.35, -0.5}, {0, y + 0.35, height_m * 0.8}, kStanding);
    box(m.g, m.style.trim, f, {width_m, y - 0.35, -0.5}, {width_m + 0.7, y + 0.35, height_m * 0.8}, kStanding);
  }
}

void rose_window(Mason& m, const Frame& f, double x, double z, double radius) {
  constexpr int kSides = 16;
  Vec3 ring[kSides];
  for (int i = 0; i < kSides; ++i) {
    const double a = kTurn * i / kSides;
    ring[i] = {x + radius * std::cos(a), -0.06, z + radius * std::sin(a)};
  }
  for (int i = 0; i < kSides; ++i) {
    const Surface pane = pane_surface(m.b.glass, m.style.lighting, m.random);
    m.g.triangle(pane, f.point({x, -0.06, z}), f.point(ring[i]), f.point(ring[(i + 1) % kSides]));
    beam(m.g, m.style.trim, f, ring[i], ring[(i + 1) % kSides], 0.22);
    if (i % 2 == 0) beam(m.g, m.style.trim, f, {x, -0.06, z}, ring[i], 0.08);
  }
}

void column(Mason& m, const Frame& f, double radius, double height_m) {
  const int sides = m.style.level >= 2 ? 16 : 8;
  box(m.g, m.style.trim, f, {-radius * 1.3, -radius * 1.3, 0}, {radius * 1.3, radius * 1.3, 0.3}, kStanding);
  cone(m.g, m.style.trim, f, sides, radius, 0.3, radius * 0.84, height_m - 0.5);
  cone(m.g, m.style.trim, f, sides, radius * 0.84, height_m - 0.5, radius * 1.2, height_m - 0.2);
  box(m.g, m.style.trim, f, {-radius * 1.3, -radius * 1.3, height_m - 0.2}, {radius * 1.3, radius * 1.3, height_m},
      kSides | kBottom);
}

// Columns, entablature and gable before the front; steps below.
void portico(Mason& m, double width_m, double height_m) {
  const Frame f = m.front_frame(m.z);
  const double w = m.b.width_m(), x0 = (w - width_m) / 2;
  constexpr double kOut = 2.4;
  for (int i = 0; i < 6; ++i)
    column(m, f.at({x0 + width_m * (i + 0.5) / 6, -kOut + 0.6, 0}), height_m * 0.055, height_m);
  for (int step = 0; step < 4; ++step)
    box(m.g, m.style.trim, f, {x0 - 0.3 * step, -kOut - 0.3 * step, -0.6 - 0.15 * step},
        {x0 + width_m + 0.3 * step, 0, -0.15 * step}, kStanding);
  box(m.g, m.style.trim, f, {x0, -kOut, height_m}, {x0 + width_m, 0, height_m + 0.9}, kSides | kBottom);
  const Frame gable{f.world({x0 + width_m, -kOut, height_m + 0.9}), left_of(f.x_axis)};
  gable_roof(m.g, m.b.roof, m.style.trim, gable, kOut, width_m, 0, width_m * 0.16, 0.2);
}

}  // namespace

void build_church(Mason& m) {
  m.style.bay_m = 4.5, m.style.window_share = 0.32, m.style.sill_share = 0.2, m.style.head_share = 0.9,
  m.style.recess_m = 0.35;
  const double w = m.b.width_m(), d = m.b.depth_m(), h = m.b.height_m() * 0.85;
  const double tower = std::min(6.0, w * 0.4);
  const Vec2 x = m.front_axis(), y = left_of(x), origin = m.b.footprint[0].at;
  const Polygon nave = rectangle(origin + y * (tower * 0.5), x, w, d - tower * 0.5);
  m.storeys(nave, m.z, 1, h, Facade::punched, false);
  const Frame ridge{{(origin + x * w + y * (tower * 0.5)).x, (origin + x * w + y * (tower * 0.5)).y, m.z + h}, y};
  gable_roof(m.g, m.b.roof, m.b.wall, ridge, d - tower * 0.5, w, 0, w * 0.55, 0.3);
  const Frame nave_frame{{nave[0].at.x, nave[0].at.y, m.z}, x};
  buttresses(m, nave_frame, d - tower * 0.5, w, h);
  rose_window(m, nave_frame, w * 0.5, h + w * 0.12, w * 0.09);
  // The tower stands before the nave, in the middle or at a side.
  const double tx = m.random.chance(0.5) ? (w - tower) / 2 : 0;
  const Polygon shaft = rectangle(origin + x * tx, x, tower, tower);
  m.style.bay_m = tower, m.style.window_share = 0.3;
  double z = m.storeys(shaft, m.z, 1, h * 0.55, Facade::shop, false);
  z = m.storeys(shaft, z, 3, h * 0.45, Facade::punched, false);
  m.cornice(shaft, z, 0.4, 0.5, true);
  const Vec2 top = centroid(shaft);
  const Frame f{{top.x, top.y, z + 0.5}, x};
  for (int corner = 0; corner < 4; ++corner) {
    const Vec2 at = shaft[static_cast<size_t>(corner)].at + (top - shaft[static_cast<size_t>(corner)].at) * 0.18;
    cone(m.g, m.style.trim, {{at.x, at.y, z}, x}, 6, tower * 0.1, 0, 0, tower * 0.7);
  }
  cone(m.g, m.random.chance(0.5) ? Surface::copper : Surface::tile_slate, f.turned(kTurn / 16), 8, tower * 0.52, 0, 0,
       tower * 2.4);
  beam(m.g, Surface::gold, f, {0, 0, tower * 2.4}, {0, 0, tower * 2.4 + 1.8}, 0.16);
  beam(m.g, Surface::gold, f, {-0.5, 0, tower * 2.4 + 1.2}, {0.5, 0, tower * 2.4 + 1.2}, 0.16);
}

void build_domed_hall(Mason& m) {
  m.style.bay_m = 3.4, m.style.window_share = 0.4, m.style.recess_m = 0.3;
  const double w = m.b.width_m(), d = m.b.depth_m();
  const double z = m.storeys(m.b.footprint, m.z, m.b.floors, m.b.floor_m, Facade::punched, false);
  m.cornice(m.b.footprint, z, 0.6, 0.7, true);
  m.flat_roof(m.b.footprint, z, 1.2, 0);
  portico(m, w * 0.6, m.b.height_m() * 0.9);
  const Vec2 middle = centroid(m.b.footprint);
  const Frame f{{middle.x, middle.y, z}, m.front_axis()};
  const double r = std::min(w, d) * 0.30;
  const int sides = m.style.level >= 2 ? 40 : 24;
  m.block(m.b.wall, middle, 2.3 * r, 2.3 * r, z, z + r * 0.3);
  cone(m.g, m.b.wall, f, sides, r * 0.9, r * 0.3, r * 0.9, r * 1.0);
  for (int i = 0; i < 16; ++i) {
    const double a = kTurn * i / 16;
    column(m, f.at({r * 1.04 * std::cos(a), r * 1.04 * std::sin(a), r * 0.3}), r * 0.06, r * 0.7);
  }
  cone(m.g, m.style.trim, f, sides, r * 1.12, r * 1.0, r * 1.12, r * 1.1);
  disk(m.g, m.style.trim, f, sides, r * 1.12, r * 1.1);
  dome_cage(m.g, m.b.roof, f, r * 1.02, r * 1.1, r * 1.1, m.random.chance(0.6));
  cone(m.g, m.style.trim, f, 12, r * 0.2, r * 2.1, r * 0.18, r * 2.5);
  dome_cage(m.g, m.b.roof, f, r * 0.23, r * 2.5, r * 0.27, false);
  cone(m.g, Surface::gold, f, 8, r * 0.03, r * 2.7, 0, r * 3.2);
}

namespace {

// A roof that flares: steep above, nearly level at the eaves, corners drawn up. Hips and eaves are creases.
void flared_roof(Mason& m, const Frame& f, double half, double out, double z, double rise, Surface roof) {
  const double eave = half + out, mid = half + out * 0.4, up = out * 0.42;
  constexpr Vec2 kAround[8] = {{-1, -1}, {0, -1}, {1, -1}, {1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}};
  const auto ring = [&](double r, double corner_z, double middle_z) {
    std::vector<Vec3> points;
    for (int i = 0; i < 8; ++i)
      points.push_back({kAround[i].x * r, kAround[i].y * r, z + (i % 2 == 0 ? corner_z : middle_z)});
    return points;
  };
  RingStack stack;
  stack.rings = {ring(half * 0.98, 0.05, 0.05), ring(eave, up - 0.12, -0.12), ring(eave, up, 0),
                 ring(mid, rise * 0.34, rise * 0.22), ring(half * 0.70, rise, rise)};
  Cage cage = ring_cage(roof, f, stack);
  crease_ring(cage, stack, 1, 10);
  crease_ring(cage, stack, 2, 10);
  for (size_t corner = 0; corner < 8; corner += 2) crease_column(cage, stack, corner, 0, 4, 10);
  m.g.add_cage(std::move(cage));
  for (int i = 0; i < 8; i += 2) {
    const Vec3 tip{kAround[i].x * eave, kAround[i].y * eave, z + up},
        heart{kAround[i].x * half * 0.7, kAround[i].y * half * 0.7, z + rise};
    beam(m.g, m.style.trim, f, heart, Vec3{kAround[i].x * mid, kAround[i].y * mid, z + rise * 0.34}, 0.2);
    octahedron(m.g, m.style.lighting.on ? Surface::sign_amber : Surface::awning_red, f.at(tip + Vec3{0, 0, -0.55}),
               0.22, 0.32);
  }
}

}  // namespace

void build_pagoda(Mason& m) {
  m.style.bay_m = 1.9, m.style.window_share = 0.62, m.style.sill_share = 0.18, m.style.wall = Surface::wood_red;
  m.style.trim = Surface::vermilion;
  m.style.lighting.share = 0.7;
  const Vec2 middle = centroid(m.b.footprint), x = m.front_axis();
  double half = std::min(m.b.width_m(), m.b.depth_m()) / 2 * 0.72, z = m.z + 0.8;
  m.block(Surface::stone_grey, middle, half * 2.6, half * 2.6, m.z - 0.5, z);
  for (int tier = 0; tier < m.b.floors; ++tier) {
    const Polygon body = rectangle(middle - x * half - left_of(x) * half, x, 2 * half, 2 * half);
    const double h = m.b.floor_m * (tier == 0 ? 1.2 : 0.85);
    z = m.storeys(body, z, 1, h, Facade::punched, false);
    const Frame f{{middle.x, middle.y, z}, x};
    flared_roof(m, f, half, half * 0.42, -0.1, half * 0.45, m.b.roof);
    z += half * 0.45 - 0.1;
    half *= 0.86;
  }
  const Frame f{{middle.x, middle.y, z}, x};
  cone(m.g, m.b.roof, f.turned(kTurn / 8), 4, half * 1.1, 0, 0, half * 0.9);
  cone(m.g, Surface::gold, f, 8, 0.2, half * 0.7, 0.06, half * 0.7 + 4);
  for (int ring = 0; ring < 5; ++ring)
    cone(m.g, Surface::gold, f, 10, 0.5 - 0.06 * ring, half * 0.9 + 0.5 * ring, 0.4 - 0.06 * ring,
         half * 0.9 + 0.5 * ring + 0.18);
}

}  // namespace spillway::tools::city
