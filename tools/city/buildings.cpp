#include "tools/city/buildings.h"

#include <algorithm>
#include <array>
#include <span>

#include "tools/city/prototype_buildings.h"
#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

using enum Surface;

struct Choice {
  Kind kind;
  double weight;
};

// Kinds by district. Heroes (church, hall, pagoda) are rare everywhere.
std::span<const Choice> choices(District district) {
  static constexpr Choice kDowntown[] = {{Kind::glass_tower, 28},   {Kind::setback_tower, 20}, {Kind::art_deco, 16},
                                         {Kind::podium_tower, 18},  {Kind::office_block, 12},  {Kind::slab, 4},
                                         {Kind::parking_garage, 4}, {Kind::domed_hall, 1},     {Kind::church, 0.7}};
  static constexpr Choice kMidtown[] = {{Kind::walk_up, 26},     {Kind::loft, 18},          {Kind::office_block, 18},
                                        {Kind::slab, 12},        {Kind::corner_shop, 12},   {Kind::setback_tower, 7},
                                        {Kind::podium_tower, 3}, {Kind::parking_garage, 3}, {Kind::church, 1},
                                        {Kind::domed_hall, 1}};
  static constexpr Choice kOldTown[] = {{Kind::corner_shop, 46}, {Kind::walk_up, 30},  {Kind::loft, 8},
                                        {Kind::pagoda, 5},       {Kind::row_house, 8}, {Kind::church, 1}};
  static constexpr Choice kRowhouses[] = {
      {Kind::row_house, 80}, {Kind::walk_up, 11}, {Kind::corner_shop, 8}, {Kind::church, 0.8}};
  static constexpr Choice kSuburb[] = {
      {Kind::cottage, 52}, {Kind::villa, 40}, {Kind::corner_shop, 3}, {Kind::church, 0.8}, {Kind::slab, 2}};
  static constexpr Choice kHillside[] = {
      {Kind::villa, 62}, {Kind::cottage, 26}, {Kind::row_house, 6}, {Kind::pagoda, 0.6}};
  static constexpr Choice kIndustry[] = {
      {Kind::warehouse, 46}, {Kind::factory, 30}, {Kind::loft, 12}, {Kind::office_block, 8}, {Kind::parking_garage, 4}};
  static constexpr Choice kHarbour[] = {
      {Kind::warehouse, 60}, {Kind::factory, 14}, {Kind::loft, 20}, {Kind::office_block, 6}};
  switch (district) {
    case District::downtown:
      return kDowntown;
    case District::midtown:
      return kMidtown;
    case District::old_town:
      return kOldTown;
    case District::rowhouses:
      return kRowhouses;
    case District::suburb:
      return kSuburb;
    case District::hillside:
      return kHillside;
    case District::industry:
      return kIndustry;
    default:
      return kHarbour;
  }
}

struct Traits {
  const char* name;
  double least_width_m, least_depth_m, most_depth_m;
  int least_floors, most_floors;
  double floor_m;
  double setback_m, margin_m;
  bool fills_lot;  // the footprint is the lot less a margin, whatever its shape; else a rectangle
  std::array<Surface, 8> walls;
  std::array<Surface, 3> trims, roofs;
  std::array<Surface, 4> glass;
};

constexpr std::array<Surface, 4> kDark = {glass_dark, glass_dark, glass_dark, glass_dark};
constexpr std::array<Surface, 4> kCurtain = {glass_blue, glass_green, glass_bronze, glass_silver};
constexpr std::array<Surface, 3> kFlat = {roof_tar, roof_gravel, roof_light};
constexpr std::array<Surface, 3> kStone = {trim_stone, limestone, concrete_light};
constexpr std::array<Surface, 3> kPale = {trim_white, trim_stone, trim_dark};
constexpr std::array<Surface, 3> kTiles = {tile_red, tile_slate, tile_brown};
constexpr std::array<Surface, 8> kBricks = {brick_red,  brick_brown, brick_dark,    brick_cream,
                                            stone_grey, brick_red,   plaster_ochre, limestone};
constexpr std::array<Surface, 8> kStones = {limestone,      stone_sand,  stone_grey,         brick_brown,
                                            concrete_light, brick_cream, plaster_terracotta, brick_red};
constexpr std::array<Surface, 8> kPastels = {plaster_white, plaster_cream,    plaster_rose,  plaster_mint,
                                             plaster_sky,   plaster_lavender, plaster_ochre, plaster_terracotta};
constexpr std::array<Surface, 8> kPanels = {panel_silver,  panel_bronze, panel_blue, concrete_light,
                                            concrete_dark, metal_light,  concrete,   limestone};
constexpr std::array<Surface, 8> kPlain = {concrete_light, concrete,   plaster_white, plaster_cream,
                                           panel_silver,   stone_sand, brick_cream,   plaster_sky};
constexpr std::array<Surface, 8> kWood = {wood_white,  wood_green,  wood_red,      plaster_cream,
                                          plaster_sky, brick_brown, plaster_white, plaster_ochre};
constexpr std::array<Surface, 8> kSheds = {brick_brown,  brick_red,  concrete,       panel_blue,
                                           panel_silver, brick_dark, concrete_light, stone_grey};

const Traits& traits(Kind kind) {
  static constexpr std::array<Traits, kKindCount> kTraits = {{
      {"glass_tower", 18, 18, 60, 12, 80, 3.9, 0.5, 0.6, true, kPanels, kStone, kFlat, kCurtain},
      {"setback_tower", 14, 14, 50, 9, 60, 3.5, 0.0, 0.2, true, kStones, kStone, kFlat, kDark},
      {"art_deco", 16, 16, 40, 10, 60, 3.5, 0.0, 0.3, false, kStones, kStone, kFlat, kDark},
      {"podium_tower", 20, 18, 50, 12, 70, 3.6, 0.0, 0.3, true, kPanels, kStone, kFlat, kCurtain},
      {"slab", 14, 9, 17, 6, 24, 2.9, 2.5, 1.0, false, kPlain, kPale, kFlat, kDark},
      {"office_block", 12, 10, 40, 4, 14, 3.5, 0.0, 0.2, true, kPlain, kPale, kFlat, kDark},
      {"walk_up", 6, 8, 20, 4, 7, 3.1, 0.0, 0.08, false, kBricks, kStone, kFlat, kDark},
      {"loft", 10, 10, 32, 4, 9, 3.9, 0.0, 0.12, true, kBricks, kStone, kFlat, kDark},
      {"corner_shop", 5.5, 7, 18, 2, 4, 3.2, 0.0, 0.08, false, kPastels, kPale, kFlat, kDark},
      {"row_house", 5.2, 8, 12.5, 2, 4, 3.0, 1.6, 0.06, false, kPastels, kPale, kTiles, kDark},
      {"villa", 9, 8, 13, 2, 3, 3.0, 5.0, 1.8, false, kPastels, kPale, kTiles, kDark},
      {"cottage", 8, 7, 11, 1, 2, 2.8, 5.5, 1.6, false, kWood, kPale, kTiles, kDark},
      {"warehouse", 14, 14, 48, 1, 3, 5.0, 3.0, 1.5, false, kSheds, kPale, kFlat, kDark},
      {"factory", 14, 14, 40, 2, 4, 4.5, 3.0, 2.0, false, kSheds, kPale, kFlat, kDark},
      {"parking_garage", 16, 16, 50, 4, 8, 3.0, 0.3, 0.3, true, kPlain, kPale, kFlat, kDark},
      {"church", 10, 14, 36, 2, 3, 4.5, 1.5, 1.0, false, kStones, kStone, kTiles, kDark},
      {"domed_hall", 16, 16, 40, 2, 4, 4.6, 3.0, 1.5, false, kStones, kStone, {copper, gold, tile_slate}, kDark},
      {"pagoda", 8, 8, 14, 3, 7, 3.2, 1.0, 0.8, false, kWood, {vermilion, trim_dark, wood_red}, kTiles, kDark},
  }};
  return kTraits[static_cast<size_t>(kind)];
}

// Log-normal about a median that falls from the centre.
int floors_of(District district, double r, Random& random) {
  double median = 2, sigma = 0.25;
  switch (district) {
    case District::downtown:
      median = 11 + 27 * std::exp(-(r / 0.085) * (r / 0.085)), sigma = 0.38;
      break;
    case District::midtown:
      median = 5 + 5 * std::exp(-r / 0.15), sigma = 0.34;
      break;
    case District::old_town:
      median = 3.2, sigma = 0.25;
      break;
    case District::rowhouses:
      median = 2.7;
      break;
    case District::industry:
    case District::harbour:
      median = 2.4, sigma = 0.4;
      break;
    default:
      median = 1.7;
      break;
  }
  return std::max(1, static_cast<int>(std::lround(median * std::exp(sigma * random.normal()))));
}

Polygon footprint_of(const Traits& t, const Lot& lot) {
  if (!t.fills_lot) return front_rectangle(lot.polygon, t.setback_m, t.margin_m, t.most_depth_m);
  return inset(lot.polygon, [&](const Corner& c) { return c.street > 0 ? std::max(0.05, t.setback_m) : t.margin_m; });
}

bool fits(const Traits& t, const Polygon& footprint) {
  if (footprint.size() < 3) return false;
  const Vec2 along = normalize(footprint[1].at - footprint[0].at);
  return length(footprint[1].at - footprint[0].at) >= t.least_width_m &&
         extent(footprint, along).size() >= t.least_width_m &&
         extent(footprint, left_of(along)).size() >= t.least_depth_m &&
         area(footprint) >= 0.6 * t.least_width_m * t.least_depth_m;
}

Kind draw_kind(District district, Random& random) {
  const std::span<const Choice> all = choices(district);
  double sum = 0;
  for (const Choice& c : all) sum += c.weight;
  double at = random.unit() * sum;
  for (const Choice& c : all)
    if ((at -= c.weight) < 0) return c.kind;
  return all.front().kind;
}

// Draws until something fits; in the end what fits anywhere.
Kind kind_for(const Lot& lot, District district, Random& random) {
  for (int i = 0; i < 12; ++i) {
    const Kind kind = draw_kind(district, random);
    if (fits(traits(kind), footprint_of(traits(kind), lot))) return kind;
  }
  const bool is_home =
      district == District::suburb || district == District::hillside || district == District::rowhouses;
  for (const Kind kind : {is_home ? Kind::cottage : Kind::walk_up, Kind::corner_shop})
    if (fits(traits(kind), footprint_of(traits(kind), lot))) return kind;
  return Kind::count;
}

// Where nothing fits as it should: the rectangle that makes it a lot, with a shop on it.
Building small_building(const Lot& lot) {
  Building building;
  building.kind = Kind::corner_shop;
  building.footprint = front_rectangle(lot.polygon, 0, 0.2, 18);
  return building;
}

template <size_t n>
Surface pick(const std::array<Surface, n>& from, Random& random) {
  return from[random.below(n)];
}

// Floors within what the kind and the ground allow, and materials.
void finish_design(Building& building, int floors, Random& random) {
  const Traits& t = traits(building.kind);
  const double slender = std::sqrt(area(building.footprint));  // no towers on kiosks
  const int most = std::min(t.most_floors, static_cast<int>(slender * 7.5 / t.floor_m));
  building.floors = std::clamp(floors, t.least_floors, std::max(most, t.least_floors));
  building.floor_m = t.floor_m * random.between(0.95, 1.08);
  building.wall = pick(t.walls, random), building.trim = pick(t.trims, random);
  building.roof = pick(t.roofs, random), building.glass = pick(t.glass, random);
}

Building draw_building(const Block& block, const Lot& lot, const StreetPlanOptions& plan, uint64_t key) {
  Random random(key);
  const Kind kind = kind_for(lot, block.district, random);
  Building building = kind == Kind::count ? small_building(lot) : Building{};
  if (kind != Kind::count) building.kind = kind, building.footprint = footprint_of(traits(kind), lot);
  building.district = block.district;
  building.key = key;
  const double r = centrality_radius(plan, centroid(block.cell));
  finish_design(building, floors_of(block.district, r, random), random);
  return building;
}

bool alike(const Building& a, const Building& b) {
  return a.wall == b.wall || (a.kind == b.kind && a.floors == b.floors && a.roof == b.roof && a.trim == b.trim);
}

}  // namespace

const char* name(Kind kind) { return traits(kind).name; }

bool adjacent(const Lot& a, const Lot& b) { return distance_between(a.polygon, b.polygon) < 0.01; }

std::vector<Building> design_buildings(uint64_t seed) {
  std::vector<Building> designs;
  for (size_t k = 0; k < kKindCount; ++k)
    for (size_t i = 0; i < kDesignsOfKind; ++i) {
      Building design;
      design.kind = static_cast<Kind>(k);
      design.key = key_of(key_of(seed, 0xde51), designs.size());
      const Traits& t = traits(design.kind);
      Random random(design.key);
      const double larger = static_cast<double>(i) / kDesignsOfKind;
      const double width = t.least_width_m * (1.02 + 0.8 * larger), depth = t.least_depth_m * (1.02 + 0.8 * larger);
      design.footprint = rectangle({0, 0}, {1, 0}, width, std::min(depth, t.most_depth_m));
      const double tall = random.unit();
      finish_design(design, t.least_floors + static_cast<int>((t.most_floors - t.least_floors) * tall * tall), random);
      designs.push_back(std::move(design));
    }
  return designs;
}

Polygon design_ground(Kind kind, const Lot& lot) {
  const Traits& t = traits(kind);
  return front_rectangle(lot.polygon, t.setback_m, t.margin_m, t.most_depth_m);
}

Building placed(const Building& design, size_t number, const Polygon& ground) {
  Building building = design;
  const Vec2 along = normalize(ground[1].at - ground[0].at);
  const double spare = length(ground[1].at - ground[0].at) - design.width_m();
  building.footprint = rectangle(ground[0].at + along * (spare / 2), along, design.width_m(), design.depth_m());
  building.design = static_cast<uint32_t>(number);
  return building;
}

std::vector<Building> plan_buildings(const Block& block, const std::vector<Lot>& lots, const BuildingPlan& plan) {
  std::vector<Building> buildings;
  for (size_t i = 0; i < lots.size(); ++i) {
    std::vector<size_t> neighbours;
    for (size_t j = 0; j < i; ++j)
      if (adjacent(lots[i], lots[j])) neighbours.push_back(j);
    const auto repeats = [&](const Building& drawn) {
      return std::any_of(neighbours.begin(), neighbours.end(), [&](size_t j) { return alike(drawn, buildings[j]); });
    };
    // Draws again until no neighbour is alike. Eight walls and at most some six neighbours that came before.
    Building drawn = draw_building(block, lots[i], plan.streets, lots[i].key);
    for (uint64_t attempt = 1; repeats(drawn) && attempt < 64; ++attempt)
      drawn = draw_building(block, lots[i], plan.streets, key_of(lots[i].key, attempt));
    if (Random(key_of(lots[i].key, 0x0a1)).unit() >= plan.unique) {
      const std::optional<Building> design = place_design(plan.designs, drawn, lots[i], repeats);
      if (design) drawn = *design;
    }
    buildings.push_back(std::move(drawn));
  }
  return buildings;
}

}  // namespace spillway::tools::city
