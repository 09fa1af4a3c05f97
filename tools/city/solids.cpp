#include "tools/city/solids.h"

#include <algorithm>

namespace spillway::tools::city {
namespace {

constexpr double kTurn = 6.283185307179586;

Vec3 on_circle(int i, int sides, double radius, double z) {
  const double angle = kTurn * (i % sides) / sides;
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

// Between two rings of the same sides; a ring of radius 0 is a point.
void band(Geometry& g, Surface surface, const Frame& frame, int sides, double r0, double z0, double r1, double z1) {
  for (int i = 0; i < sides; ++i) {
    const Float3 a = frame.point(on_circle(i, sides, r0, z0)), b = frame.point(on_circle(i + 1, sides, r0, z0));
    const Float3 c = frame.point(on_circle(i + 1, sides, r1, z1)), d = frame.point(on_circle(i, sides, r1, z1));
    if (r0 <= 0)
      g.triangle(surface, a, c, d);
    else if (r1 <= 0)
      g.triangle(surface, a, b, c);
    else
      g.quad(surface, a, b, c, d);
  }
}

}  // namespace

void box(Geometry& g, Surface surface, const Frame& frame, Vec3 low, Vec3 high, unsigned faces) {
  const auto corner = [&](int x, int y, int z) {
    return frame.point({x ? high.x : low.x, y ? high.y : low.y, z ? high.z : low.z});
  };
  if (faces & kFront) g.quad(surface, corner(0, 0, 0), corner(1, 0, 0), corner(1, 0, 1), corner(0, 0, 1));
  if (faces & kBack) g.quad(surface, corner(1, 1, 0), corner(0, 1, 0), corner(0, 1, 1), corner(1, 1, 1));
  if (faces & kLeft) g.quad(surface, corner(0, 1, 0), corner(0, 0, 0), corner(0, 0, 1), corner(0, 1, 1));
  if (faces & kRight) g.quad(surface, corner(1, 0, 0), corner(1, 1, 0), corner(1, 1, 1), corner(1, 0, 1));
  if (faces & kTop) g.quad(surface, corner(0, 0, 1), corner(1, 0, 1), corner(1, 1, 1), corner(0, 1, 1));
  if (faces & kBottom) g.quad(surface, corner(0, 1, 0), corner(1, 1, 0), corner(1, 0, 0), corner(0, 0, 0));
}

void prism_sides(Geometry& g, Surface surface, const Polygon& polygon, double z0, double z1) {
  const Frame world;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec2 a = polygon[i].at, b = next_corner(polygon, i).at;
    g.quad(surface, world, {a.x, a.y, z0}, {b.x, b.y, z0}, {b.x, b.y, z1}, {a.x, a.y, z1});
  }
}

void cap(Geometry& g, Surface surface, const Polygon& polygon, double z) {
  const Frame world;
  const auto point = [&](size_t i) { return world.point({polygon[i].at.x, polygon[i].at.y, z}); };
  for (size_t i = 1; i + 1 < polygon.size(); ++i) g.triangle(surface, point(0), point(i), point(i + 1));
}

void cone(Geometry& g, Surface surface, const Frame& frame, int sides, double r0, double z0, double r1, double z1) {
  band(g, surface, frame, sides, r0, z0, r1, z1);
}

void disk(Geometry& g, Surface surface, const Frame& frame, int sides, double radius, double z) {
  for (int i = 1; i + 1 < sides; ++i)
    g.triangle(surface, frame.point(on_circle(0, sides, radius, z)), frame.point(on_circle(i, sides, radius, z)),
               frame.point(on_circle(i + 1, sides, radius, z)));
}

void octahedron(Geometry& g, Surface surface, const Frame& frame, double radius, double half_height) {
  band(g, surface, frame, 4, 0, -half_height, radius, 0);
  band(g, surface, frame, 4, radius, 0, 0, half_height);
}

void beam(Geometry& g, Surface surface, const Frame& frame, Vec3 from, Vec3 to, double thickness) {
  const Vec3 along = normalize(to - from);
  const Vec3 helper = std::fabs(along.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
  const Vec3 x = normalize(cross(helper, along)) * (thickness / 2), y = cross(along, x);
  const Vec3 ring[4] = {x * -1 - y, x - y, x + y, y - x};
  for (int i = 0; i < 4; ++i) {
    const Vec3 a = ring[i], b = ring[(i + 1) % 4];
    g.quad(surface, frame, from + a, from + b, to + b, to + a);
  }
}

void gable_roof(Geometry& g, Surface roof, Surface wall, const Frame& frame, double width, double depth, double z,
                double rise, double eaves) {
  const double drop = rise * eaves / (depth / 2), x0 = -eaves, x1 = width + eaves, y0 = -eaves, y1 = depth + eaves;
  const Vec3 ridge0{x0, depth / 2, z + rise}, ridge1{x1, depth / 2, z + rise};
  g.quad(roof, frame, {x0, y0, z - drop}, {x1, y0, z - drop}, ridge1, ridge0);
  g.quad(roof, frame, {x1, y1, z - drop}, {x0, y1, z - drop}, ridge0, ridge1);
  g.triangle(wall, frame.point({0, depth, z}), frame.point({0, 0, z}), frame.point({0, depth / 2, z + rise}));
  g.triangle(wall, frame.point({width, 0, z}), frame.point({width, depth, z}),
             frame.point({width, depth / 2, z + rise}));
}

void hip_roof(Geometry& g, Surface roof, const Frame& frame, double width, double depth, double z, double rise,
              double eaves) {
  const double x0 = -eaves, x1 = width + eaves, y0 = -eaves, y1 = depth + eaves;
  const double run = std::min(width, depth) / 2;  // of the sloping ends
  const bool along_x = width >= depth;
  const Vec3 r0 = along_x ? Vec3{run, depth / 2, z + rise} : Vec3{width / 2, run, z + rise};
  const Vec3 r1 = along_x ? Vec3{width - run, depth / 2, z + rise} : Vec3{width / 2, depth - run, z + rise};
  const Vec3 a{x0, y0, z}, b{x1, y0, z}, c{x1, y1, z}, d{x0, y1, z};
  if (along_x) {
    g.quad(roof, frame, a, b, r1, r0), g.quad(roof, frame, c, d, r0, r1);
    g.triangle(roof, frame.point(d), frame.point(a), frame.point(r0));
    g.triangle(roof, frame.point(b), frame.point(c), frame.point(r1));
  } else {
    g.quad(roof, frame, b, c, r1, r0), g.quad(roof, frame, d, a, r0, r1);
    g.triangle(roof, frame.point(a), frame.point(b), frame.point(r0));
    g.triangle(roof, frame.point(c), frame.point(d), frame.point(r1));
  }
}

}  // namespace spillway::tools::city
