#include "tools/city/massing.h"

#include <algorithm>
#include <array>

#include "tools/city/mason.h"

namespace spillway::tools::city {
namespace {

constexpr std::array<void (*)(Mason&), kKindCount> kBuilders = {
    build_glass_tower,  build_setback_tower, build_art_deco,  build_podium_tower, build_slab,
    build_office_block, build_walk_up,       build_loft,      build_corner_shop,  build_row_house,
    build_villa,        build_cottage,       build_warehouse, build_factory,      build_parking_garage,
    build_church,       build_domed_hall,    build_pagoda};

// Levels around the wanted detail; the many windows of tall buildings are kept simpler.
int level_of(const Building& b, double detail, Random& random) {
  const int drawn = static_cast<int>(std::floor(detail + random.unit()));
  return std::clamp(b.floors > 10 ? drawn - 1 : drawn, 0, b.floors > 10 ? 3 : 5);
}

bool has_offices(Kind kind) {
  return kind == Kind::glass_tower || kind == Kind::setback_tower || kind == Kind::art_deco ||
         kind == Kind::office_block || kind == Kind::podium_tower;
}

Lighting lighting_of(const Building& b, TimeOfDay time, Random& random) {
  Lighting lighting;
  lighting.on = time != TimeOfDay::day;
  const double share = time == TimeOfDay::night ? 1 : 0.7;
  lighting.by_floor = has_offices(b.kind);
  lighting.share = share * (lighting.by_floor ? random.between(0.08, 0.42) : random.between(0.10, 0.38));
  const double tint = random.unit();
  if (lighting.by_floor)
    lighting.usual = tint < 0.5 ? Surface::lit_neutral : tint < 0.8 ? Surface::lit_cool : Surface::lit_warm;
  else
    lighting.usual = tint < 0.7 ? Surface::lit_warm : tint < 0.9 ? Surface::lit_amber : Surface::lit_neutral;
  return lighting;
}

}  // namespace

void build(Geometry& g, const Building& b, const Ground& ground, const BuildOptions& options) {
  Random random(key_of(b.key, 0xb01d));
  FacadeStyle style;
  style.wall = b.wall, style.trim = b.trim, style.glass = b.glass;
  style.level = level_of(b, options.detail, random);
  style.recess_m = random.between(0.12, 0.26);
  style.lighting = lighting_of(b, options.time, random);
  WallGrid wall;  // of all that is no wall
  wall.key = static_cast<uint32_t>(key_of(b.key, 0x9a17)), wall.base_z = ground.floor_z;
  wall.frame = {{b.footprint[0].at.x, b.footprint[0].at.y, ground.floor_z},
                normalize(b.footprint[1].at - b.footprint[0].at)};
  const uint32_t before = g.begin_wall(wall);
  if (ground.floor_z > ground.foot_z)
    prism_sides(g, Surface::concrete_dark, b.footprint, ground.foot_z, ground.floor_z);
  Mason mason{g, b, style, random, ground.floor_z};
  kBuilders[static_cast<size_t>(b.kind)](mason);
  g.back_to_wall(before);
}

}  // namespace spillway::tools::city
