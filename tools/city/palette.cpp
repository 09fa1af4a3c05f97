#include "tools/city/palette.h"

#include <array>

#include "cache/base/check.h"

namespace spillway::tools::city {
namespace {

enum class Finish : uint8_t { matte, gloss, mirror, leaf };

struct Row {
  std::string_view name;
  Finish finish;
  Rgb colour;             // reflectance
  float roughness;        // gloss, mirror
  Rgb emission{0, 0, 0};  // at night
};

using enum Finish;
constexpr std::array kRows = {
    Row{"brick_red", matte, {0.30f, 0.105f, 0.07f}, 0},
    Row{"brick_brown", matte, {0.20f, 0.11f, 0.075f}, 0},
    Row{"brick_dark", matte, {0.12f, 0.065f, 0.055f}, 0},
    Row{"brick_cream", matte, {0.46f, 0.37f, 0.25f}, 0},
    Row{"stone_grey", matte, {0.34f, 0.33f, 0.31f}, 0},
    Row{"stone_sand", matte, {0.50f, 0.42f, 0.30f}, 0},
    Row{"limestone", matte, {0.60f, 0.55f, 0.46f}, 0},
    Row{"concrete_light", matte, {0.52f, 0.51f, 0.48f}, 0},
    Row{"concrete", matte, {0.36f, 0.355f, 0.34f}, 0},
    Row{"concrete_dark", matte, {0.20f, 0.20f, 0.205f}, 0},
    Row{"plaster_white", matte, {0.72f, 0.70f, 0.66f}, 0},
    Row{"plaster_cream", matte, {0.68f, 0.58f, 0.42f}, 0},
    Row{"plaster_ochre", matte, {0.58f, 0.38f, 0.16f}, 0},
    Row{"plaster_terracotta", matte, {0.52f, 0.22f, 0.12f}, 0},
    Row{"plaster_rose", matte, {0.60f, 0.33f, 0.30f}, 0},
    Row{"plaster_mint", matte, {0.36f, 0.52f, 0.42f}, 0},
    Row{"plaster_sky", matte, {0.32f, 0.45f, 0.58f}, 0},
    Row{"plaster_lavender", matte, {0.44f, 0.37f, 0.55f}, 0},
    Row{"panel_silver", gloss, {0.42f, 0.44f, 0.46f}, 0.3f},
    Row{"panel_bronze", gloss, {0.22f, 0.15f, 0.09f}, 0.3f},
    Row{"panel_blue", gloss, {0.10f, 0.17f, 0.27f}, 0.3f},
    Row{"wood_white", matte, {0.66f, 0.65f, 0.60f}, 0},
    Row{"wood_green", matte, {0.19f, 0.30f, 0.20f}, 0},
    Row{"wood_red", matte, {0.36f, 0.09f, 0.07f}, 0},
    Row{"trim_white", matte, {0.74f, 0.72f, 0.68f}, 0},
    Row{"trim_stone", matte, {0.48f, 0.44f, 0.37f}, 0},
    Row{"trim_dark", matte, {0.07f, 0.07f, 0.075f}, 0},
    Row{"metal_dark", matte, {0.05f, 0.05f, 0.055f}, 0},
    Row{"metal_light", gloss, {0.44f, 0.44f, 0.44f}, 0.35f},
    Row{"roof_tar", matte, {0.075f, 0.073f, 0.072f}, 0},
    Row{"roof_gravel", matte, {0.25f, 0.24f, 0.22f}, 0},
    Row{"roof_light", matte, {0.50f, 0.50f, 0.49f}, 0},
    Row{"tile_red", matte, {0.40f, 0.14f, 0.08f}, 0},
    Row{"tile_slate", matte, {0.13f, 0.14f, 0.165f}, 0},
    Row{"tile_brown", matte, {0.22f, 0.13f, 0.085f}, 0},
    Row{"copper", matte, {0.22f, 0.42f, 0.34f}, 0},
    Row{"gold", mirror, {0.85f, 0.60f, 0.22f}, 0.12f},
    Row{"vermilion", matte, {0.55f, 0.085f, 0.035f}, 0},
    Row{"door", gloss, {0.13f, 0.07f, 0.04f}, 0.2f},
    Row{"awning_red", matte, {0.45f, 0.05f, 0.04f}, 0},
    Row{"awning_green", matte, {0.06f, 0.22f, 0.11f}, 0},
    Row{"awning_navy", matte, {0.05f, 0.08f, 0.20f}, 0},
    Row{"glass_dark", gloss, {0.025f, 0.03f, 0.035f}, 0},
    Row{"glass_blue", mirror, {0.26f, 0.35f, 0.44f}, 0.01f},
    Row{"glass_green", mirror, {0.22f, 0.34f, 0.30f}, 0.01f},
    Row{"glass_bronze", mirror, {0.36f, 0.27f, 0.18f}, 0.01f},
    Row{"glass_silver", mirror, {0.46f, 0.48f, 0.50f}, 0.01f},
    Row{"lit_warm", matte, {0.05f, 0.05f, 0.05f}, 0, {1.55f, 0.88f, 0.36f}},
    Row{"lit_amber", matte, {0.05f, 0.05f, 0.05f}, 0, {1.05f, 0.46f, 0.13f}},
    Row{"lit_neutral", matte, {0.05f, 0.05f, 0.05f}, 0, {1.25f, 1.02f, 0.72f}},
    Row{"lit_cool", matte, {0.05f, 0.05f, 0.05f}, 0, {0.75f, 0.95f, 1.12f}},
    Row{"sign_pink", matte, {0.05f, 0.05f, 0.05f}, 0, {4.2f, 0.35f, 1.7f}},
    Row{"sign_cyan", matte, {0.05f, 0.05f, 0.05f}, 0, {0.25f, 2.6f, 3.6f}},
    Row{"sign_amber", matte, {0.05f, 0.05f, 0.05f}, 0, {4.2f, 1.8f, 0.25f}},
    Row{"sign_green", matte, {0.05f, 0.05f, 0.05f}, 0, {0.4f, 2.8f, 1.0f}},
    Row{"beacon", matte, {0.4f, 0.03f, 0.02f}, 0, {60.0f, 3.0f, 1.5f}},
    Row{"lantern", matte, {0.55f, 0.06f, 0.03f}, 0, {1.5f, 0.26f, 0.06f}},
    Row{"lamp_head", matte, {0.7f, 0.68f, 0.6f}, 0, {900.0f, 580.0f, 260.0f}},
    Row{"asphalt", matte, {0.075f, 0.075f, 0.08f}, 0},
    Row{"marking_white", matte, {0.60f, 0.60f, 0.58f}, 0},
    Row{"marking_yellow", matte, {0.58f, 0.40f, 0.08f}, 0},
    Row{"pavement", matte, {0.33f, 0.32f, 0.30f}, 0},
    Row{"kerb", matte, {0.42f, 0.41f, 0.39f}, 0},
    Row{"plaza", matte, {0.40f, 0.36f, 0.31f}, 0},
    Row{"grass", matte, {0.15f, 0.19f, 0.075f}, 0},
    Row{"sand", matte, {0.45f, 0.37f, 0.25f}, 0},
    Row{"soil", matte, {0.24f, 0.21f, 0.12f}, 0},
    Row{"rock", matte, {0.22f, 0.20f, 0.17f}, 0},
    Row{"water", gloss, {0.012f, 0.035f, 0.042f}, 0},
    Row{"bark", matte, {0.12f, 0.085f, 0.055f}, 0},
    Row{"leaf", leaf, {0.10f, 0.21f, 0.04f}, 0},
    Row{"leaf_dark", leaf, {0.055f, 0.125f, 0.035f}, 0},
    Row{"leaf_blossom", leaf, {0.62f, 0.33f, 0.38f}, 0},
    Row{"paint_white", gloss, {0.66f, 0.66f, 0.64f}, 0.03f},
    Row{"paint_black", gloss, {0.02f, 0.02f, 0.022f}, 0.03f},
    Row{"paint_grey", gloss, {0.24f, 0.25f, 0.26f}, 0.03f},
    Row{"paint_red", gloss, {0.42f, 0.035f, 0.03f}, 0.03f},
    Row{"paint_blue", gloss, {0.04f, 0.10f, 0.30f}, 0.03f},
    Row{"paint_yellow", gloss, {0.62f, 0.40f, 0.03f}, 0.03f},
    Row{"paint_green", gloss, {0.05f, 0.20f, 0.13f}, 0.03f},
    Row{"car_glass", gloss, {0.015f, 0.017f, 0.02f}, 0},
    Row{"tyre", matte, {0.03f, 0.03f, 0.03f}, 0},
    Row{"headlight", gloss, {0.55f, 0.55f, 0.52f}, 0},
};
static_assert(kRows.size() == kSurfaceCount);
static_assert(kRows[static_cast<size_t>(Surface::lamp_head)].name == "lamp_head");
static_assert(kRows[static_cast<size_t>(Surface::headlight)].name == "headlight");

const Row& row_of(Surface surface) { return kRows[static_cast<size_t>(surface)]; }

pipeline::Param rough(float roughness) {
  pipeline::Param param;
  param.constant = {roughness, roughness, roughness};
  return param;
}

}  // namespace

std::string_view name(Surface surface) { return row_of(surface).name; }

pipeline::Material material_of(Surface surface) {
  const Row& row = row_of(surface);
  pipeline::Material material;
  material.reflectance.constant = row.colour;
  material.u_roughness = material.v_roughness = rough(row.roughness);
  switch (row.finish) {
    case matte:
      material.kind = pipeline::MaterialKind::diffuse;
      break;
    case gloss:
      material.kind = pipeline::MaterialKind::coated_diffuse;
      break;
    case mirror:
      material.kind = pipeline::MaterialKind::conductor;
      material.uses_reflectance = 1;
      break;
    case leaf:
      material.kind = pipeline::MaterialKind::diffuse_transmission;
      material.transmittance.constant = row.colour * 0.6f;
      break;
  }
  return material;
}

Rgb emission_of(Surface surface, TimeOfDay time) {
  if (time == TimeOfDay::day) return {0, 0, 0};
  return row_of(surface).emission;
}

}  // namespace spillway::tools::city
