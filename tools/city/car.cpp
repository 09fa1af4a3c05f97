// Cars: a body and windows on one limit surface, wheels and lamps beside it.

#include <algorithm>

#include "tools/city/cage.h"
#include "tools/city/prototypes.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

constexpr double kTurn = 6.283185307179586;
constexpr size_t kRing = 8;  // points of a section: bottom, sill, belt, roof on the right, then on the left

struct CarShape {
  double length, width, height, hood_z, belt_z, hood, windscreen, roof_end,
      tail;  // metres; the last four from the front
};
CarShape shape_of(CarKind kind) {
  switch (kind) {
    case CarKind::hatchback:
      return {3.9, 1.74, 1.50, 0.88, 0.96, 1.0, 1.75, 3.25, 3.72};
    case CarKind::van:
      return {5.2, 1.98, 2.25, 1.05, 1.25, 0.75, 1.45, 4.95, 5.06};
    case CarKind::pickup:
      return {5.4, 1.95, 1.80, 1.05, 1.12, 1.3, 2.0, 3.4, 3.75};
    default:
      return {4.6, 1.82, 1.44, 0.82, 0.94, 1.25, 2.0, 3.35, 4.05};
  }
}

struct Section {
  double from_front, low, belt, top, top_part;  // of the half width
};

std::vector<Vec3> section_ring(const CarShape& s, const Section& c) {
  const double x = s.length / 2 - c.from_front, w = s.width / 2, roof = w * c.top_part;
  return {{x, w * 0.8, 0.22}, {x, w, c.low},   {x, w, c.belt}, {x, roof, c.top},
          {x, -roof, c.top},  {x, -w, c.belt}, {x, -w, c.low}, {x, -w * 0.8, 0.22}};
}

// From the tail to the nose.
RingStack sections(const CarShape& s) {
  const Section all[] = {{s.length, 0.42, s.belt_z - 0.22, s.belt_z - 0.16, 0.72},
                         {s.length - 0.12, 0.40, s.belt_z - 0.05, s.belt_z + 0.01, 0.84},
                         {s.tail, 0.38, s.belt_z, s.belt_z + 0.04, 0.88},
                         {s.roof_end, 0.38, s.belt_z + 0.01, s.height + 0.05, 0.80},
                         {s.windscreen, 0.38, s.belt_z, s.height + 0.04, 0.80},
                         {s.hood, 0.38, s.belt_z - 0.02, s.belt_z + 0.03, 0.88},
                         {0.3, 0.40, s.hood_z - 0.10, s.hood_z - 0.02, 0.84},
                         {0.0, 0.42, s.hood_z - 0.30, s.hood_z - 0.22, 0.72}};
  RingStack stack;
  for (const Section& c : all) stack.rings.push_back(section_ring(s, c));
  stack.closed_low = stack.closed_high = true;
  stack.low_bulge = 0.03, stack.high_bulge = 0.06;
  return stack;
}

// Faces of the cage that are windows: right, top and left between two sections.
std::vector<uint32_t> window_faces(CarKind kind) {
  const auto face = [](uint32_t section, uint32_t side) { return section * static_cast<uint32_t>(kRing) + side; };
  if (kind == CarKind::van) return {face(4, 2), face(4, 3), face(4, 4)};
  return {face(2, 3), face(3, 2), face(3, 4), face(4, 2), face(4, 3), face(4, 4)};
}

void body(Geometry& g, CarKind kind, Surface paint) {
  const RingStack stack = sections(shape_of(kind));
  Cage shell = ring_cage(paint, {}, stack);
  for (const size_t point : {size_t{0}, kRing - 1}) crease_column(shell, stack, point, 0, 7, 3);
  for (const size_t point : {size_t{2}, size_t{5}}) crease_column(shell, stack, point, 1, 6, 2);
  for (const size_t ring : {size_t{2}, size_t{5}}) crease_ring(shell, stack, ring, 1);
  Cage windows = shell;
  windows.surface = Surface::car_glass;
  const std::vector<uint32_t> glass = window_faces(kind);
  shell.holes = glass;
  const auto faces = static_cast<uint32_t>(windows.indices.size() / 4);
  for (uint32_t f = 0; f < faces; ++f)
    if (std::find(glass.begin(), glass.end(), f) == glass.end()) windows.holes.push_back(f);
  g.add_cage(std::move(shell));
  g.add_cage(std::move(windows));
}

void wheel(Geometry& g, double x, double y0, double y1) {
  constexpr double kRadius = 0.33;
  constexpr int kSides = 18;
  const double rim = y1 + (y1 > 0 ? 0.01 : -0.01);
  const auto at = [&](int i, double y, double r) {
    const double a = kTurn * (i % kSides) / kSides;
    return Float3{static_cast<float>(x + r * std::cos(a)), static_cast<float>(y),
                  static_cast<float>(kRadius + r * std::sin(a))};
  };
  for (int i = 0; i < kSides; ++i) {
    g.quad(Surface::tyre, at(i, y0, kRadius), at(i + 1, y0, kRadius), at(i + 1, y1, kRadius), at(i, y1, kRadius));
    g.triangle(Surface::tyre, at(0, y1, 0), at(i, y1, kRadius), at(i + 1, y1, kRadius));
    if (i % 3 != 2) g.triangle(Surface::metal_light, at(0, rim, 0), at(i, rim, 0.2), at(i + 1, rim, 0.2));
  }
}

void lamps_and_mirrors(Geometry& g, const CarShape& s, Surface paint) {
  const Frame f;
  const double w = s.width / 2, front = s.length / 2;
  for (const double side : {-1.0, 1.0}) {
    const double y = side * w * 0.66;
    box(g, Surface::headlight, f, {front - 0.2, y - 0.17, 0.54}, {front - 0.03, y + 0.17, 0.68}, kAllFaces);
    box(g, Surface::awning_red, f, {-front + 0.03, y - 0.15, 0.60}, {-front + 0.2, y + 0.15, 0.75}, kAllFaces);
    const double x = front - s.hood - 0.2, mirror = side * (w + 0.08);
    box(g, paint, f, {x - 0.08, mirror - 0.09, s.belt_z + 0.02}, {x + 0.05, mirror + 0.09, s.belt_z + 0.16}, kAllFaces);
  }
}

}  // namespace

double car_length_m(CarKind kind) { return shape_of(kind).length; }

void car(Geometry& g, CarKind kind, int paint) {
  const CarShape s = shape_of(kind);
  const auto surface = static_cast<Surface>(static_cast<int>(Surface::paint_white) + paint);
  body(g, kind, surface);
  for (const double from_front : {s.length * 0.19, s.length * 0.80})
    for (const double side : {-1.0, 1.0})
      wheel(g, s.length / 2 - from_front, side * (s.width / 2 - 0.24), side * (s.width / 2 - 0.01));
  lamps_and_mirrors(g, s, surface);
}

}  // namespace spillway::tools::city
