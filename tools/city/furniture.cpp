#include "tools/city/furniture.h"

#include <algorithm>

#include "tools/city/ground.h"
#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

constexpr double kTreeSpacing_m = 8.5, kParkTree_m2 = 46, kGardenTree_m2 = 260;
constexpr double kCarPlace_m = 6.3, kCarFromKerb_m = 1.2, kFreeCorner_m = 10.5;
constexpr double kTurn = 6.283185307179586;

// A point of a closed line, and the direction the line has there.
struct Waypoint {
  Vec2 at, along;
};

double perimeter(const Polygon& polygon) {
  double sum = 0;
  for (size_t i = 0; i < polygon.size(); ++i) sum += length(next_corner(polygon, i).at - polygon[i].at);
  return sum;
}

Waypoint walk(const Polygon& polygon, double distance) {
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec2 edge = next_corner(polygon, i).at - polygon[i].at;
    const double size = length(edge);
    if (distance <= size || i + 1 == polygon.size())
      return {polygon[i].at + edge * std::min(distance / size, 1.0), normalize(edge)};
    distance -= size;
  }
  return {};
}

Vec3 on_ground(const Terrain& terrain, Vec2 at, double above_m) { return {at.x, at.y, terrain.height(at) + above_m}; }

bool has_gardens(const Block& block) {
  return block.use == BlockUse::built && (block.district == District::suburb || block.district == District::hillside);
}
bool has_street_trees(const Block& block) {
  return block.district != District::industry && block.district != District::harbour;
}

Vec2 random_point(const Polygon& polygon, Random& random) {
  const Interval x = extent(polygon, {1, 0}), y = extent(polygon, {0, 1});
  for (int i = 0; i < 40; ++i) {
    const Vec2 at{random.between(x.low, x.high), random.between(y.low, y.high)};
    if (contains(polygon, at)) return at;
  }
  return centroid(polygon);
}

TreeKind tree_kind(const Block& block, Random& random) {
  const double drawn = random.unit();
  switch (block.district) {
    case District::old_town:
      return drawn < 0.75 ? TreeKind::blossom : TreeKind::round;
    case District::hillside:
      return drawn < 0.4 ? TreeKind::conifer : drawn < 0.8 ? TreeKind::round : TreeKind::tall;
    case District::suburb:
      return drawn < 0.5    ? TreeKind::round
             : drawn < 0.7  ? TreeKind::conifer
             : drawn < 0.85 ? TreeKind::tall
                            : TreeKind::blossom;
    default:
      break;
  }
  if (block.use == BlockUse::park)
    return drawn < 0.45   ? TreeKind::round
           : drawn < 0.7  ? TreeKind::tall
           : drawn < 0.85 ? TreeKind::blossom
                          : TreeKind::conifer;
  return Random(block.key).unit() < 0.25 ? TreeKind::blossom : drawn < 0.75 ? TreeKind::round : TreeKind::tall;
}

Standing tree_at(const Block& block, Vec2 at, const Terrain& terrain, Random& random) {
  Standing tree;
  tree.frame = {on_ground(terrain, at, kKerbHeight_m), direction_of(random.between(0, kTurn))};
  tree.scale = random.between(0.75, 1.2);
  const TreeKind kind = tree_kind(block, random);
  tree.prototype = tree_prototype(kind, random.below(kTreeVariants));
  return tree;
}

// In front of doors is better than in a house.
bool is_free(Vec2 at, const std::vector<Building>& buildings) {
  return std::none_of(buildings.begin(), buildings.end(), [&](const Building& b) {
    return contains(b.footprint, at) || distance_to_boundary(b.footprint, at) < 1.8;
  });
}

}  // namespace

Room room_of(const Block& block, const std::vector<Lot>& lots) {
  Room room;
  if (block.kerb.empty()) return room;
  const double kerb = perimeter(block.kerb);
  room.kerb_cm = static_cast<uint64_t>(kerb * 100);
  if (has_street_trees(block)) room.tree_count = static_cast<uint64_t>(kerb / kTreeSpacing_m);
  if (block.use == BlockUse::park) room.tree_count += static_cast<uint64_t>(area(block.kerb) / kParkTree_m2);
  if (has_gardens(block))
    for (const Lot& lot : lots) room.tree_count += static_cast<uint64_t>(area(lot.polygon) / kGardenTree_m2);
  for (size_t i = 0; i < block.kerb.size(); ++i) {
    const double edge = length(next_corner(block.kerb, i).at - block.kerb[i].at);
    if (block.kerb[i].street >= 4.5 && edge > 2 * kFreeCorner_m)
      room.car_count += static_cast<uint64_t>((edge - 2 * kFreeCorner_m) / kCarPlace_m);
  }
  return room;
}

LampKind lamp_kind(District district) {
  const bool old = district == District::old_town || district == District::rowhouses || district == District::suburb ||
                   district == District::hillside;
  return old ? LampKind::lantern : LampKind::arm;
}

std::vector<Standing> lamps(const Block& block, uint64_t count, const Terrain& terrain) {
  std::vector<Standing> standing;
  const Polygon line = inset_by(block.kerb, kLampFromKerb_m);
  const double whole = perimeter(line);
  for (uint64_t i = 0; i < count; ++i) {
    const Waypoint way = walk(line, whole * (static_cast<double>(i) + 0.5) / static_cast<double>(count));
    const Vec2 outwards = left_of(way.along) * -1;
    standing.push_back({{on_ground(terrain, way.at, kKerbHeight_m), outwards},
                        1,
                        static_cast<uint32_t>(lamp_kind(block.district))});
  }
  return standing;
}

std::vector<Standing> trees(const Block& block, const std::vector<Lot>& lots, const std::vector<Building>& buildings,
                            uint64_t count, const Terrain& terrain) {
  std::vector<Standing> standing;
  Random random(key_of(block.key, 0x7ee));
  const Polygon line = inset_by(block.kerb, 1.35);
  const double whole = perimeter(line);
  const uint64_t street = has_street_trees(block) ? static_cast<uint64_t>(perimeter(block.kerb) / kTreeSpacing_m) : 0;
  for (uint64_t i = 0; i < count; ++i) {
    const bool in_street = line.size() >= 3 && (i < street || (block.use != BlockUse::park && !has_gardens(block)));
    const double row = static_cast<double>(std::min(count, std::max<uint64_t>(street, 1)));
    Vec2 at = in_street
                  ? walk(line, std::fmod(whole * (static_cast<double>(i) + 0.1 + 0.2 * random.unit()) / row, whole)).at
                  : random_point(block.kerb, random);
    if (!in_street && has_gardens(block) && !lots.empty())
      for (int attempt = 0; attempt < 12; ++attempt) {
        at = random_point(lots[random.below(static_cast<uint32_t>(lots.size()))].polygon, random);
        if (is_free(at, buildings)) break;
      }
    if (!in_street && !is_free(at, buildings) && line.size() >= 3) at = walk(line, whole * random.unit()).at;
    standing.push_back(tree_at(block, at, terrain, random));
  }
  return standing;
}

std::vector<Standing> cars(const Block& block, uint64_t count, const Terrain& terrain) {
  std::vector<Standing> standing;
  const uint64_t places = room_of(block, {}).car_count;
  Random random(key_of(block.key, 0xca5));
  uint64_t place = 0;
  for (size_t i = 0; i < block.kerb.size(); ++i) {
    const Vec2 a = block.kerb[i].at, edge = next_corner(block.kerb, i).at - a;
    const double size = length(edge);
    if (block.kerb[i].street < 4.5 || size <= 2 * kFreeCorner_m) continue;
    const Vec2 along = edge * (1 / size), out = left_of(along) * -1;
    const auto here = static_cast<uint64_t>((size - 2 * kFreeCorner_m) / kCarPlace_m);
    for (uint64_t k = 0; k < here; ++k, ++place) {
      // Of all places, as many as there are cars, evenly chosen.
      if ((place + 1) * count / places == place * count / places) continue;
      const Vec2 at =
          a + along * (kFreeCorner_m + kCarPlace_m * (static_cast<double>(k) + 0.5) + random.between(-0.25, 0.25)) +
          out * kCarFromKerb_m;
      const double drawn = random.unit();
      const CarKind kind = drawn < 0.45   ? CarKind::sedan
                           : drawn < 0.8  ? CarKind::hatchback
                           : drawn < 0.92 ? CarKind::van
                                          : CarKind::pickup;
      // Traffic keeps to the right: the kerb is at the car's right hand.
      standing.push_back(
          {{on_ground(terrain, at, 0.01), along}, 1, car_prototype(kind, random.below(kCarPaints))});
    }
  }
  return standing;
}

}  // namespace spillway::tools::city
