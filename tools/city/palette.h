#pragma once

// What surfaces of the city are made of: some tens of materials, shared by everything.

#include <cstdint>
#include <span>
#include <string_view>

#include "pipeline/scene.h"

namespace spillway::tools::city {

enum class TimeOfDay : uint8_t { day, dusk, night };

enum class Surface : uint8_t {
  // walls
  brick_red,
  brick_brown,
  brick_dark,
  brick_cream,
  stone_grey,
  stone_sand,
  limestone,
  concrete_light,
  concrete,
  concrete_dark,
  plaster_white,
  plaster_cream,
  plaster_ochre,
  plaster_terracotta,
  plaster_rose,
  plaster_mint,
  plaster_sky,
  plaster_lavender,
  panel_silver,
  panel_bronze,
  panel_blue,
  wood_white,
  wood_green,
  wood_red,
  // parts of buildings
  trim_white,
  trim_stone,
  trim_dark,
  metal_dark,
  metal_light,
  roof_tar,
  roof_gravel,
  roof_light,
  tile_red,
  tile_slate,
  tile_brown,
  copper,
  gold,
  vermilion,
  door,
  awning_red,
  awning_green,
  awning_navy,
  glass_dark,
  glass_blue,
  glass_green,
  glass_bronze,
  glass_silver,
  // light
  lit_warm,
  lit_amber,
  lit_neutral,
  lit_cool,
  sign_pink,
  sign_cyan,
  sign_amber,
  sign_green,
  beacon, lantern,
  lamp_head,
  // ground
  asphalt,
  marking_white,
  marking_yellow,
  pavement,
  kerb,
  plaza,
  grass,
  sand,
  soil,
  rock,
  water,
  // street furniture
  bark,
  leaf,
  leaf_dark,
  leaf_blossom,
  paint_white,
  paint_black,
  paint_grey,
  paint_red,
  paint_blue,
  paint_yellow,
  paint_green,
  car_glass,
  tyre,
  headlight,
  count
};
inline constexpr size_t kSurfaceCount = static_cast<size_t>(Surface::count);

[[nodiscard]] std::string_view name(Surface surface);
[[nodiscard]] pipeline::Material material_of(Surface surface);
// Radiance; black by day, and of surfaces that do not shine.
[[nodiscard]] Rgb emission_of(Surface surface, TimeOfDay time);

}  // namespace spillway::tools::city
