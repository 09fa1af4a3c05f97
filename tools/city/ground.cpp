#include "tools/city/ground.h"

#include <algorithm>

#include "tools/city/random.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

constexpr double kStep_m = 14;  // of ground that is not flat
constexpr double kTurn = 6.283185307179586;

class Layer {
 public:
  Layer(Geometry& g, const Terrain& terrain, double above_m) : g_(g), terrain_(terrain), above_m_(above_m) {}

  [[nodiscard]] Float3 point(Vec2 at) const {
    return {static_cast<float>(at.x), static_cast<float>(at.y), static_cast<float>(terrain_.height(at) + above_m_)};
  }
  void fan(Surface surface, const Polygon& polygon) {
    for (size_t i = 1; i + 1 < polygon.size(); ++i)
      g_.triangle(surface, point(polygon[0].at), point(polygon[i].at), point(polygon[i + 1].at));
  }
  void quad(Surface surface, Vec2 a, Vec2 b, Vec2 c, Vec2 d) {
    g_.quad(surface, point(a), point(b), point(c), point(d));
  }

 private:
  Geometry& g_;
  const Terrain& terrain_;
  double above_m_;
};

// Calls piece(polygon) for the parts of the polygon in strips of at most `step` across the axis.
template <class Piece>
void strips(const Polygon& polygon, Vec2 axis, double step, const Piece& piece) {
  const Interval reach = extent(polygon, axis);
  const int count = std::max(1, static_cast<int>(std::ceil(reach.size() / step)));
  Polygon rest = polygon;
  for (int i = 1; i < count && !rest.empty(); ++i) {
    const Line line{axis * (reach.low + reach.size() * i / count), left_of(axis)};
    const Polygon part = left_part(rest, line, 0);
    if (!part.empty()) piece(part);
    rest = right_part(rest, line, 0);
  }
  if (!rest.empty()) piece(rest);
}

void kerb_face(Geometry& g, const Polygon& kerb, const Terrain& terrain) {
  const double step = terrain.is_flat(kerb) ? 1e9 : kStep_m;
  const Layer low(g, terrain, -0.05), high(g, terrain, kKerbHeight_m);
  for (size_t i = 0; i < kerb.size(); ++i) {
    const Vec2 a = kerb[i].at, along = next_corner(kerb, i).at - a;
    const int count = std::max(1, static_cast<int>(std::ceil(length(along) / step)));
    for (int k = 0; k < count; ++k) {
      const Vec2 p = a + along * (static_cast<double>(k) / count), q = a + along * (static_cast<double>(k + 1) / count);
      g.quad(Surface::kerb, low.point(p), low.point(q), high.point(q), high.point(p));
    }
  }
}

// The kerb stone's top: a pale rim along the pavement.
void kerb_rim(Geometry& g, const Polygon& kerb, const Terrain& terrain) {
  const Polygon inside = inset_by(kerb, 0.22);
  if (inside.size() != kerb.size()) return;
  Layer top(g, terrain, kKerbHeight_m + 0.012);
  const double step = terrain.is_flat(kerb) ? 1e9 : kStep_m;
  for (size_t i = 0; i < kerb.size(); ++i) {
    const Vec2 a = kerb[i].at, b = next_corner(kerb, i).at, c = next_corner(inside, i).at, d = inside[i].at;
    const int count = std::max(1, static_cast<int>(std::ceil(length(b - a) / step)));
    for (int k = 0; k < count; ++k) {
      const double s = static_cast<double>(k) / count, t = static_cast<double>(k + 1) / count;
      top.quad(Surface::kerb, a + (b - a) * s, a + (b - a) * t, d + (c - d) * t, d + (c - d) * s);
    }
  }
}

// Dashes in the middle of the street. Of the two cells beside it, the one whose edge runs eastwards paints.
void centre_line(Geometry& g, const Polygon& cell, const Terrain& terrain) {
  Layer paint(g, terrain, 0.025);
  for (size_t i = 0; i < cell.size(); ++i) {
    const Vec2 a = cell[i].at, whole = next_corner(cell, i).at - a;
    const double size = length(whole);
    if (cell[i].street < 5.5 || size < 40 || whole.x < 0 || (whole.x == 0 && whole.y < 0)) continue;
    const Vec2 along = whole * (1 / size), side = left_of(along) * 0.08;
    const bool is_avenue = cell[i].street > 9;
    for (double at = 15; at + 3 < size - 15; at += is_avenue ? 6 : 9) {
      const Vec2 p = a + along * at, q = p + along * (is_avenue ? 6 : 3);
      if (!is_avenue) paint.quad(Surface::marking_white, p - side, q - side, q + side, p + side);
      for (const double offset : {-0.25, 0.25})
        if (is_avenue)
          paint.quad(Surface::marking_yellow, p + left_of(along) * offset - side, q + left_of(along) * offset - side,
                     q + left_of(along) * offset + side, p + left_of(along) * offset + side);
    }
  }
}

// Stripes from the kerb to the middle of the street at both ends of each edge.
void crossings(Geometry& g, const Block& block, const Terrain& terrain) {
  Layer paint(g, terrain, 0.022);
  const Polygon kerb = inset(block.cell, [](const Corner& c) { return c.street; });
  for (size_t i = 0; i < kerb.size(); ++i) {
    const Vec2 a = kerb[i].at, b = next_corner(kerb, i).at;
    const double size = length(b - a), street = kerb[i].street;
    if (size < 26 || street < 4) continue;
    const Vec2 along = (b - a) * (1 / size), out = left_of(along) * -1;
    for (const double at : {3.5, size - 6.5})
      for (double away = 0.6; away + 0.55 < street; away += 1.1) {
        const Vec2 p = a + along * at + out * away;
        paint.quad(Surface::marking_white, p, p + out * 0.55, p + out * 0.55 + along * 3, p + along * 3);
      }
  }
}

bool has_lawns(District district) {
  return district == District::suburb || district == District::hillside || district == District::rowhouses;
}

// Paths across a park, from the middles of its sides.
void park(Geometry& g, const Polygon& lawn, const Terrain& terrain) {
  lay(g, Surface::grass, lawn, terrain, kKerbHeight_m + 0.03);
  const Vec2 middle = centroid(lawn);
  for (size_t i = 0; i < lawn.size(); ++i) {
    const Vec2 a = lawn[i].at, b = next_corner(lawn, i).at, from = (a + b) * 0.5;
    if (length(b - a) < 12) continue;
    const Vec2 to = middle - from;
    const Polygon path = left_part(right_part(lawn, {from + left_of(normalize(to)) * 1.3, to}, 0),
                                   {from - left_of(normalize(to)) * 1.3, to}, 0);
    const Polygon half = path.empty() ? path : left_part(path, {middle, left_of(to)}, 0);
    if (!half.empty()) lay(g, Surface::plaza, half, terrain, kKerbHeight_m + 0.06);
  }
}

}  // namespace

void lay(Geometry& g, Surface surface, const Polygon& polygon, const Terrain& terrain, double above_m) {
  Layer layer(g, terrain, above_m);
  if (terrain.is_flat(polygon)) return layer.fan(surface, polygon);
  const Vec2 along = normalize(next_corner(polygon, longest_edge(polygon)).at - polygon[longest_edge(polygon)].at);
  strips(polygon, along, kStep_m, [&](const Polygon& strip) {
    strips(strip, left_of(along), kStep_m, [&](const Polygon& piece) { layer.fan(surface, piece); });
  });
}

void block_ground(Geometry& g, const Block& block, const std::vector<Lot>& lots, const Terrain& terrain) {
  lay(g, Surface::asphalt, block.cell, terrain, 0);
  centre_line(g, block.cell, terrain);
  crossings(g, block, terrain);
  if (block.kerb.empty()) return;
  kerb_face(g, block.kerb, terrain);
  const Polygon inner = inset_by(block.kerb, kPavement_m);
  lay(g, block.use == BlockUse::plaza ? Surface::plaza : Surface::pavement, block.kerb, terrain, kKerbHeight_m);
  kerb_rim(g, block.kerb, terrain);
  if (block.use == BlockUse::park && !inner.empty()) park(g, inner, terrain);
  if (block.use != BlockUse::built || !has_lawns(block.district)) return;
  for (const Lot& lot : lots) {
    const Polygon lawn = inset_by(lot.polygon, 0.15);
    if (!lawn.empty()) lay(g, Surface::grass, lawn, terrain, kKerbHeight_m + 0.02);
  }
}

namespace {

Surface land_surface(const Terrain& terrain, uint64_t seed, Vec2 at, double z) {
  const double r = terrain.radius_m();
  if (z < 1.5) return z < -2 ? Surface::sand : Surface::rock;
  const double wild = value_noise(seed + 22, at * (7 / r)) + 0.6 * value_noise(seed + 23, at * (29 / r));
  if (z > 0.07 * r + 60 + 60 * wild) return Surface::rock;
  return wild > 0.1 ? Surface::soil : Surface::grass;
}

constexpr double kShoreBand_m = 90;  // inland, where the shore's own strips end

// From the seabed over rocks to a quay wall and its coping, in the city; to a beach outside of it.
void shore_strip(Geometry& g, const Terrain& terrain, uint64_t seed, double x0, double x1) {
  const bool is_quay = std::fabs((x0 + x1) / 2) < 1.02 * terrain.radius_m();
  const auto at = [&](double x, double inland, double above) {
    const Vec2 p{x, terrain.shore_y(x) + inland};
    return Float3{static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(terrain.height(p) + above)};
  };
  const auto level = [&](double x, double inland, double z) {
    return Float3{static_cast<float>(x), static_cast<float>(terrain.shore_y(x) + inland), static_cast<float>(z)};
  };
  const auto strip = [&](Surface surface, Float3 a, Float3 b, Float3 c, Float3 d) { g.quad(surface, a, b, c, d); };
  const double quay_z = 3.6;
  if (is_quay) {
    strip(Surface::rock, level(x0, -14, -9), level(x1, -14, -9), level(x1, -3.5, -0.6), level(x0, -3.5, -0.6));
    strip(Surface::rock, level(x0, -3.5, -0.6), level(x1, -3.5, -0.6), level(x1, 0, 0.7), level(x0, 0, 0.7));
    strip(Surface::concrete, level(x0, 0, 0.2), level(x1, 0, 0.2), level(x1, 0.3, quay_z), level(x0, 0.3, quay_z));
    strip(Surface::kerb, level(x0, 0.3, quay_z), level(x1, 0.3, quay_z), level(x1, 1.1, quay_z),
          level(x0, 1.1, quay_z));
    strip(Surface::plaza, level(x0, 1.1, quay_z - 0.1), level(x1, 1.1, quay_z - 0.1), at(x1, 16, -0.05),
          at(x0, 16, -0.05));
  } else {
    strip(Surface::sand, at(x0, -30, 0), at(x1, -30, 0), at(x1, -14, 0), at(x0, -14, 0));
    strip(Surface::sand, at(x0, -14, 0), at(x1, -14, 0), at(x1, 0, 0), at(x0, 0, 0));
    strip(Surface::sand, at(x0, 0, 0), at(x1, 0, 0), at(x1, 16, -0.05), at(x0, 16, -0.05));
  }
  double last = 16;
  for (const double next : {32.0, 60.0, kShoreBand_m}) {
    const Vec2 middle{(x0 + x1) / 2, terrain.shore_y((x0 + x1) / 2) + next};
    strip(land_surface(terrain, seed, middle, 4), at(x0, last, last < 20 ? -0.05 : -0.5),
          at(x1, last, last < 20 ? -0.05 : -0.5), at(x1, next, -0.5), at(x0, next, -0.5));
    last = next;
  }
}

void shore(Geometry& g, const Terrain& terrain, uint64_t seed, int part, int parts) {
  if (!terrain.has_bay()) return;
  const double reach = 2.6 * terrain.radius_m();
  const int count = std::max(64, static_cast<int>(2 * reach / 9));
  for (int i = count * part / parts; i < count * (part + 1) / parts; ++i)
    shore_strip(g, terrain, seed, reach * (2.0 * i / count - 1), reach * (2.0 * (i + 1) / count - 1));
}

// Coordinates from -reach to reach: even inside of `dense`, growing beyond.
std::vector<double> grid_lines(double dense, double reach, int inner, int outer) {
  std::vector<double> at;
  for (int i = outer; i >= 1; --i) at.push_back(-dense * std::pow(reach / dense, static_cast<double>(i) / outer));
  for (int i = 0; i <= inner; ++i) at.push_back(dense * (2.0 * i / inner - 1));
  for (int i = 1; i <= outer; ++i) at.push_back(dense * std::pow(reach / dense, static_cast<double>(i) / outer));
  return at;
}

}  // namespace

void land(Geometry& g, const Terrain& terrain, uint64_t seed, int part, int parts) {
  const double r = terrain.radius_m();
  const std::vector<double> at = grid_lines(1.4 * r, 9 * r, std::clamp(static_cast<int>(r / 6), 60, 360), 44);
  const Layer layer(g, terrain, -0.55);
  const size_t rows = at.size() - 1, first = rows * static_cast<size_t>(part) / static_cast<size_t>(parts);
  const size_t last = rows * static_cast<size_t>(part + 1) / static_cast<size_t>(parts);
  shore(g, terrain, seed, part, parts);
  for (size_t j = first; j < last; ++j)
    for (size_t i = 0; i + 1 < at.size(); ++i) {
      const Vec2 a{at[i], at[j]}, c{at[i + 1], at[j + 1]};
      const Vec2 middle = (a + c) * 0.5;
      const double z = terrain.height(middle);
      if (z < -13.5) continue;  // deep below the water
      const bool is_shore =
          terrain.has_bay() && std::fabs(middle.x) < 2.5 * r && std::fabs(terrain.inland(middle)) < 40;
      if (is_shore) continue;
      g.quad(land_surface(terrain, seed, middle, z), layer.point(a), layer.point({c.x, a.y}), layer.point(c),
             layer.point({a.x, c.y}));
    }
}

void sea_tile(Geometry& g) {
  constexpr int kCells = 112;
  struct Wave {
    int x, y;
    double rise_m, phase;
  };
  std::vector<Wave> waves;
  Random random(0x5ea);
  for (int i = 0; i < 22; ++i) {
    const int x = static_cast<int>(random.between(-26, 26)), y = static_cast<int>(random.between(3, 30));
    waves.push_back({x, y, 0.9 / (9 + std::hypot(x, y)) * random.between(0.5, 1.2), random.between(0, kTurn)});
  }
  const auto point = [&](int i, int j) {
    double z = 0;
    for (const Wave& w : waves)
      z += w.rise_m * std::sin(kTurn * ((i % kCells) * w.x + (j % kCells) * w.y) / kCells + w.phase);
    const double x = kSeaTile_m * (static_cast<double>(i) / kCells - 0.5),
                 y = kSeaTile_m * (static_cast<double>(j) / kCells - 0.5);
    return Float3{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
  };
  for (int j = 0; j < kCells; ++j)
    for (int i = 0; i < kCells; ++i)
      g.quad(Surface::water, point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
  g.weld();
  g.smooth(Surface::water);
}

std::vector<Vec2> sea_places(const Terrain& terrain) {
  std::vector<Vec2> places;
  if (!terrain.has_bay()) return places;
  const double r = terrain.radius_m(), reach = std::max(5 * r, 3000.0);
  const auto half = static_cast<int>(std::ceil(reach / kSeaTile_m));
  for (int j = -half; j <= half; ++j)
    for (int i = -half; i <= half; ++i) {
      const Vec2 at{i * kSeaTile_m, j * kSeaTile_m};
      bool wet = false;
      for (const double dx : {-0.5, -0.25, 0.0, 0.25, 0.5})
        wet = wet || terrain.inland({at.x + dx * kSeaTile_m, at.y - kSeaTile_m / 2}) < 0;
      if (wet) places.push_back(at);
    }
  return places;
}

std::vector<Frame> boat_places(const Terrain& terrain, uint64_t seed) {
  std::vector<Frame> places;
  if (!terrain.has_bay()) return places;
  const double r = terrain.radius_m();
  const int count = std::clamp(static_cast<int>(r / 40), 8, 150);
  for (int i = 0; i < count; ++i) {
    Random random(key_of(seed, 0xb0a7 + static_cast<uint64_t>(i)));
    const double x = r * random.between(-0.75, 0.8), out = random.unit();
    const Vec2 at{x, terrain.shore_y(x) - r * (0.21 + 0.7 * out * out)};
    if (terrain.height(at) < -6) places.push_back({{at.x, at.y, 0}, direction_of(random.between(0, kTurn))});
  }
  return places;
}

}  // namespace spillway::tools::city
