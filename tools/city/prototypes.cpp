#include "tools/city/prototypes.h"

#include <algorithm>

#include "tools/city/cage.h"
#include "tools/city/random.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

constexpr double kTurn = 6.283185307179586;

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
      leaf(g, surface, heart + e * (clump * std::cbrt(random.between(0.15, 1))), size * random.between(0.7, 1.3),
           random);
    }
  }
}

// Roots that spread, a stem that leans; branches are beams.
void trunk(Geometry& g, double height, double radius, int branches, double reach, Random& random) {
  const Frame f;
  RingStack stack;
  const Vec2 lean = direction_of(random.between(0, kTurn)) * (0.05 * height);
  const std::pair<double, double> rings[] = {
      {-0.25, 2.1}, {0.05, 1.45}, {0.5, 1.1}, {height * 0.55, 0.95}, {height, 0.62}};
  for (const auto& [z, wide] : rings) {
    stack.rings.push_back(circle_ring(8, radius * wide, z));
    const double part = std::max(0.0, z / height) * (1 - std::max(0.0, z / height));
    for (Vec3& p : stack.rings.back()) p.x += 4 * lean.x * part, p.y += 4 * lean.y * part;
  }
  for (size_t i = 0; i < 8; i += 2)
    for (size_t ring = 0; ring < 2; ++ring) stack.rings[ring][i].x *= 1.25, stack.rings[ring][i].y *= 1.25;
  stack.closed_high = true, stack.high_bulge = 0.05;
  g.add_cage(ring_cage(Surface::bark, f, stack));
  for (int i = 0; i < branches; ++i) {
    const double a = kTurn * (i + random.between(0, 0.7)) / branches, z = height * random.between(0.75, 0.98);
    const Vec3 tip{reach * std::cos(a), reach * std::sin(a), z + reach * random.between(0.6, 1.2)};
    beam(g, Surface::bark, f, {0, 0, z}, tip, radius * 0.6);
    beam(g, Surface::bark, f, tip, tip + random_direction(random) * (reach * 0.6), radius * 0.35);
  }
}

}  // namespace

void lamp(Geometry& g, LampKind kind) {
  const Frame f;
  const double top = kind == LampKind::arm ? 8.2 : 4.0;
  cone(g, Surface::metal_dark, f, 8, 0.22, -0.2, 0.18, 0.9);
  cone(g, Surface::metal_dark, f, 8, 0.10, 0.9, 0.06, top);
  if (kind == LampKind::arm) {
    beam(g, Surface::metal_dark, f, {0, 0, top - 0.6}, {0.9, 0, top}, 0.08);
    beam(g, Surface::metal_dark, f, {0.9, 0, top}, {2.0, 0, top + 0.1}, 0.08);
    box(g, Surface::metal_dark, f, {1.6, -0.16, top + 0.08}, {2.4, 0.16, top + 0.24}, kAllFaces);
    octahedron(g, Surface::lamp_head, f.at({2.0, 0, top}), 0.26, 0.13);
    return;
  }
  cone(g, Surface::metal_dark, f, 8, 0.12, top, 0.24, top + 0.12);
  for (int i = 0; i < 4; ++i) {
    const Vec2 d = direction_of(kTurn * (i + 0.5) / 4);
    beam(g, Surface::metal_dark, f, {d.x * 0.2, d.y * 0.2, top + 0.1}, {d.x * 0.26, d.y * 0.26, top + 0.68}, 0.035);
  }
  cone(g, Surface::metal_dark, f, 8, 0.36, top + 0.68, 0, top + 0.98);
  octahedron(g, Surface::lamp_head, f.at({0, 0, top + 0.4}), 0.17, 0.24);
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
    default:
      break;
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

}  // namespace spillway::tools::city
