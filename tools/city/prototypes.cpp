#include "tools/city/prototypes.h"

#include <algorithm>

#include "tools/city/random.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

constexpr double kTurn = 6.283185307179586;

struct CarShape {
  double length, width, height, hood_z, belt_z, hood, windscreen, roof_end, tail;  // metres; the last four from the front
};
CarShape shape_of(CarKind kind) {
  switch (kind) {
    case CarKind::hatchback: return {3.9, 1.74, 1.50, 0.88, 0.96, 1.0, 1.75, 3.25, 3.82};
    case CarKind::van: return {5.2, 1.98, 2.25, 1.05, 1.25, 0.75, 1.45, 5.0, 5.14};
    case CarKind::pickup: return {5.4, 1.95, 1.80, 1.05, 1.12, 1.3, 2.0, 3.4, 3.75};
    default: return {4.6, 1.82, 1.44, 0.82, 0.94, 1.25, 2.0, 3.35, 4.05};
  }
}

Vec3 random_direction(Random& random) {
  const double z = random.between(-1, 1), a = random.between(0, kTurn), r = std::sqrt(1 - z * z);
  return {r * std::cos(a), r * std::sin(a), z};
}

// A leaf is a rhombus, turned anyhow.
void leaf(Geometry& g, Surface surface, Vec3 at, double size, Random& random) {
  const Vec3 along = random_direction(random), helper = random_direction(random);
  const Vec3 x = along * size, y = normalize(cross(along, helper)) * (size * 0.55);
  const Frame world;
  g.quad(surface, world, at - x, at + y * -1, at + x, at + y);
}

// Leaves in clumps on an ellipsoid, so that the crown has light and dark places.
void crown(Geometry& g, Surface surface, Vec3 middle, Vec3 radii, int clumps, int leaves, double size, Random& random) {
  for (int c = 0; c < clumps; ++c) {
    const Vec3 d = random_direction(random);
    const double out = random.between(0.45, 0.92);
    const Vec3 heart{middle.x + radii.x * d.x * out, middle.y + radii.y * d.y * out, middle.z + radii.z * d.z * out};
    const double clump = random.between(0.28, 0.5) * std::min({radii.x, radii.y, radii.z});
    for (int i = 0; i < leaves; ++i) {
      const Vec3 e = random_direction(random);
      leaf(g, surface, heart + e * (clump * std::cbrt(random.between(0.15, 1))), size * random.between(0.7, 1.3), random);
    }
  }
}

void trunk(Geometry& g, double height, double radius, int branches, double reach, Random& random) {
  const Frame f;
  cone(g, Surface::bark, f, 9, radius * 1.4, -0.2, radius, 0.4);
  cone(g, Surface::bark, f, 9, radius, 0.4, radius * 0.6, height);
  for (int i = 0; i < branches; ++i) {
    const double a = kTurn * (i + random.between(0, 0.7)) / branches, z = height * random.between(0.75, 1.0);
    const Vec3 tip{reach * std::cos(a), reach * std::sin(a), z + reach * random.between(0.6, 1.2)};
    beam(g, Surface::bark, f, {0, 0, z}, tip, radius * 0.6);
    beam(g, Surface::bark, f, tip, tip + random_direction(random) * (reach * 0.6), radius * 0.35);
  }
}

}  // namespace

void lamp_post(Geometry& g, LampKind kind) {
  const Frame f;
  const double top = kind == LampKind::arm ? 8.2 : 4.0;
  cone(g, Surface::metal_dark, f, 8, 0.22, -0.2, 0.18, 0.9);
  cone(g, Surface::metal_dark, f, 8, 0.10, 0.9, 0.06, top);
  if (kind == LampKind::arm) {
    beam(g, Surface::metal_dark, f, {0, 0, top - 0.6}, {0.9, 0, top}, 0.08);
    beam(g, Surface::metal_dark, f, {0.9, 0, top}, {2.0, 0, top + 0.1}, 0.08);
    box(g, Surface::metal_dark, f, {1.6, -0.16, top + 0.08}, {2.4, 0.16, top + 0.24}, kAllFaces);
    return;
  }
  cone(g, Surface::metal_dark, f, 8, 0.12, top, 0.24, top + 0.12);
  for (int i = 0; i < 4; ++i) {
    const Vec2 d = direction_of(kTurn * (i + 0.5) / 4);
    beam(g, Surface::metal_dark, f, {d.x * 0.2, d.y * 0.2, top + 0.1}, {d.x * 0.26, d.y * 0.26, top + 0.68}, 0.035);
  }
  cone(g, Surface::metal_dark, f, 8, 0.36, top + 0.68, 0, top + 0.98);
}

void lamp_head(Geometry& g, LampKind kind, const Frame& frame) {
  if (kind == LampKind::arm) return octahedron(g, Surface::lamp_head, frame.at({2.0, 0, 8.2}), 0.26, 0.13);
  octahedron(g, Surface::lamp_head, frame.at({0, 0, 4.4}), 0.17, 0.24);
}

void tree(Geometry& g, TreeKind kind, int variant) {
  Random random(key_of(static_cast<uint64_t>(kind) + 40, static_cast<uint64_t>(variant)));
  const double grow = random.between(0.85, 1.2);
  switch (kind) {
    case TreeKind::round:
      trunk(g, 2.6 * grow, 0.17, 6, 1.5, random);
      return crown(g, Surface::leaf, {0, 0, 5.2 * grow}, {2.7, 2.6, 2.4 * grow}, 46, 44, 0.22, random);
    case TreeKind::tall:
      trunk(g, 3.4 * grow, 0.2, 7, 1.3, random);
      return crown(g, Surface::leaf_dark, {0, 0, 7.6 * grow}, {2.1, 2.1, 4.4 * grow}, 60, 42, 0.22, random);
    case TreeKind::blossom:
      trunk(g, 1.9 * grow, 0.15, 7, 1.7, random);
      return crown(g, Surface::leaf_blossom, {0, 0, 4.1 * grow}, {2.8, 2.7, 1.7 * grow}, 48, 48, 0.17, random);
    default: break;
  }
  trunk(g, 7.5 * grow, 0.2, 0, 0, random);
  for (int ring = 0; ring < 13; ++ring) {
    const double z = (1.4 + 0.62 * ring) * grow, reach = 2.4 * (1 - ring / 13.5);
    for (int i = 0; i < 12; ++i) {
      const Vec2 d = direction_of(kTurn * (i + random.unit()) / 12);
      for (int k = 0; k < 12; ++k) {
        const double out = reach * random.between(0.2, 1);
        leaf(g, Surface::leaf_dark, {d.x * out, d.y * out, z - out * 0.25 + random.between(-0.15, 0.15)}, 0.24, random);
      }
    }
  }
}

double car_length_m(CarKind kind) { return shape_of(kind).length; }

namespace {

struct CarSection {
  double x, belt_z, roof_z;  // from the front; where there is no cabin both are equal
};

void wheels(Geometry& g, const CarShape& s) {
  constexpr double kRadius = 0.33;
  for (const double x : {s.length * 0.2, s.length * 0.8})
    for (const double side : {-1.0, 1.0}) {
      const double y0 = side * (s.width / 2 - 0.2), y1 = side * (s.width / 2 + 0.01);
      constexpr int kSides = 14;
      for (int i = 0; i < kSides; ++i) {
        const auto at = [&](int k, double y, double r) {
          const double a = kTurn * k / kSides;
          return Float3{static_cast<float>(s.length / 2 - x + r * std::cos(a)), static_cast<float>(y),
                        static_cast<float>(kRadius + r * std::sin(a))};
        };
        g.quad(Surface::tyre, at(i, y0, kRadius), at(i + 1, y0, kRadius), at(i + 1, y1, kRadius), at(i, y1, kRadius));
        g.triangle(Surface::tyre, at(0, y1, kRadius), at(i, y1, kRadius), at(i + 1, y1, kRadius));
        if (i % 2 == 0) g.triangle(Surface::metal_light, at(0, y1 + side * 0.01, 0.0), at(i, y1 + side * 0.01, 0.2), at(i + 1, y1 + side * 0.01, 0.2));
      }
    }
}

}  // namespace

void car(Geometry& g, CarKind kind, int paint) {
  const CarShape s = shape_of(kind);
  const auto body = static_cast<Surface>(static_cast<int>(Surface::paint_white) + paint);
  const Frame f;
  const double w = s.width / 2, in = w * 0.80, front = s.length / 2;
  const auto x = [&](double from_front) { return front - from_front; };
  // Lower body: a prism along x with a falling nose and tail.
  const Vec2 profile[] = {{x(0.02), 0.25}, {x(0), 0.6}, {x(0.12), s.hood_z - 0.12}, {x(s.hood), s.hood_z},
                          {x(s.hood), s.belt_z}, {x(s.tail), s.belt_z}, {x(s.length - 0.05), s.belt_z - 0.1},
                          {x(s.length), 0.55}, {x(s.length - 0.05), 0.25}};
  const size_t count = std::size(profile);
  for (size_t i = 0; i + 1 < count; ++i) {
    const Vec2 a = profile[i], b = profile[i + 1];
    g.quad(body, f, {a.x, -w, a.y}, {a.x, w, a.y}, {b.x, w, b.y}, {b.x, -w, b.y});
  }
  for (const double side : {-w, w})
    for (size_t i = 1; i + 1 < count; ++i)
      g.triangle(body, f.point({profile[0].x, side, profile[0].y}), f.point({profile[i].x, side, profile[i].y}),
                 f.point({profile[i + 1].x, side, profile[i + 1].y}));
  // The cabin leans inwards: glass all around, a roof of the body's colour, pillars between.
  const double z0 = s.belt_z, z1 = s.height;
  const Vec3 low[4] = {{x(s.hood), -w * 0.97, z0}, {x(s.hood), w * 0.97, z0}, {x(s.tail), w * 0.97, z0}, {x(s.tail), -w * 0.97, z0}};
  const Vec3 top[4] = {{x(s.windscreen), -in, z1}, {x(s.windscreen), in, z1}, {x(s.roof_end), in, z1}, {x(s.roof_end), -in, z1}};
  for (int i = 0; i < 4; ++i) {
    const int j = (i + 1) % 4;
    const bool is_panel = kind == CarKind::van && i != 0;
    g.quad(is_panel ? body : Surface::car_glass, f, low[i], low[j], top[j], top[i]);
    beam(g, body, f, low[i], top[i], 0.09);
  }
  g.quad(body, f, top[0], top[1], top[2], top[3]);
  for (const double side : {-1.0, 1.0}) {
    box(g, Surface::headlight, f, {front - 0.06, side * w * 0.72 - 0.18, 0.55}, {front + 0.02, side * w * 0.72 + 0.18, 0.72}, kAllFaces);
    box(g, Surface::awning_red, f, {-front - 0.02, side * w * 0.76 - 0.16, 0.62}, {-front + 0.05, side * w * 0.76 + 0.16, 0.8}, kAllFaces);
    box(g, body, f, {x(s.hood + 0.25), side * (w + 0.1) - 0.09, z0 + 0.02}, {x(s.hood + 0.1), side * (w + 0.1) + 0.09, z0 + 0.17}, kAllFaces);
  }
  wheels(g, s);
}

}  // namespace spillway::tools::city
