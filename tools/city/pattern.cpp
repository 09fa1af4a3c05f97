// What each surface is made of: courses, joints, boards, tiles; rooms behind panes.

#include <algorithm>
#include <cmath>

#include "tools/city/paint.h"

namespace spillway::tools::city {
namespace {

Rgb base_of(Surface surface) { return material_of(surface).reflectance.constant; }

// Rows of pieces, every second row shifted by half a piece.
struct Courses {
  double length_m, height_m;
  double joint;   // share of the height; of the length in proportion
  float variety;  // of the pieces' shades
  Rgb joint_colour;
};

Rgb coursed(Rgb base, const Courses& c, const PaintSpot& spot, uint32_t key) {
  const double row = spot.t / c.height_m, rows = std::floor(row);
  const double across = spot.s / c.length_m + 0.5 * (static_cast<int64_t>(rows) & 1);
  const float flat = line_cover(row, spot.texel_m / c.height_m, c.joint);
  const float upright = line_cover(across, spot.texel_m / c.length_m, c.joint * c.height_m / c.length_m);
  const float joint = 1 - (1 - flat) * (1 - upright);
  // Pieces smaller than texels have the mean shade.
  const float seen = static_cast<float>(std::clamp(1.6 - spot.texel_m / c.length_m, 0.0, 1.0));
  const float shade = cell_noise(static_cast<int64_t>(std::floor(across)), static_cast<int64_t>(rows), key) - 0.5f;
  const Rgb piece = base * (1 + 2 * c.variety * seen * shade);
  return piece * (1 - joint) + c.joint_colour * joint;
}

Rgb brick(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const Rgb mortar = base * 0.35f + Rgb{0.30f, 0.28f, 0.25f} * 0.65f;
  const float bond = 1 + 0.16f * (smooth_noise(spot.s / 1.7, spot.t / 1.3, wall.key + 11) - 0.5f);
  return coursed(base * bond, {0.24, 0.08, 0.15, 0.26f, mortar}, spot, wall.key);
}

Rgb stone(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const double height = 0.36 + 0.24 * static_cast<double>(cell_noise(3, 4, wall.key));
  return coursed(base, {height * 2.1, height, 0.045, 0.11f, base * 0.45f}, spot, wall.key);
}

Rgb cast_concrete(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const float cloud = smooth_noise(spot.s / 1.9, spot.t / 1.6, wall.key + 21) - 0.5f;
  return coursed(base * (1 + 0.18f * cloud), {2.4, 1.25, 0.018, 0.06f, base * 0.5f}, spot, wall.key);
}

// Plaster; where it has come off, low on the walls of neglected houses, the bricks below.
Rgb plaster(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const Rgb brushed = base * (1 + 0.10f * (smooth_noise(spot.s / 0.7, spot.t / 0.9, wall.key + 31) - 0.5f));
  if (cell_noise(7, 8, wall.key) > 0.3f || !spot.is_upright) return brushed;
  const float gone = smooth_noise(spot.s / 1.4, spot.t / 1.1, wall.key + 32) * 0.7f +
                     smooth_noise(spot.s * 2.6, spot.t * 2.3, wall.key + 33) * 0.3f;
  const float limit = 0.72f + 0.05f * static_cast<float>(std::min(4.0, std::max(0.0, spot.above_m)));
  if (gone < limit - 0.02f) return brushed;
  return gone < limit ? base * 0.55f : brick({0.27f, 0.12f, 0.08f}, spot, wall);
}

Rgb boards(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const double row = spot.t / 0.17;
  const float lip = line_cover(row, spot.texel_m / 0.17, 0.12);
  const float shade = cell_noise(0, static_cast<int64_t>(std::floor(row)), wall.key) - 0.5f;
  const float peeled = smooth_noise(spot.s * 1.9, row * 0.8, wall.key + 41) > 0.86f ? 0.3f : 0;
  return (base * (1 - peeled) + Rgb{0.24f, 0.19f, 0.14f} * peeled) * ((1 + 0.10f * shade) * (1 - 0.5f * lip));
}

Rgb panels(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  return coursed(base, {1.5, 0.9, 0.02, 0.05f, base * 0.35f}, spot, wall.key);
}

// ---- roofs ----

Rgb tar(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const double strip = spot.s / 1.05;
  const float seam = line_cover(strip, spot.texel_m / 1.05, 0.06);
  const float shade = cell_noise(static_cast<int64_t>(std::floor(strip)), 0, wall.key) - 0.5f;
  const float patch = cell_noise(static_cast<int64_t>(std::floor(spot.s / 2.7)),
                                 static_cast<int64_t>(std::floor(spot.t / 2.2)), wall.key + 51) > 0.9f
                          ? 0.7f
                          : 1.0f;
  const float puddle = smooth_noise(spot.s / 2.6, spot.t / 2.9, wall.key + 52);
  const Rgb dust = puddle > 0.66f ? Rgb{0.14f, 0.135f, 0.12f} * ((puddle - 0.66f) * 2) : Rgb{0, 0, 0};
  return base * ((1 + 0.3f * shade) * patch * (1 - 0.5f * seam)) + dust;
}

Rgb gravel(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const float grain = cell_noise(static_cast<int64_t>(std::floor(spot.s * 14)),
                                 static_cast<int64_t>(std::floor(spot.t * 14)), wall.key) -
                      0.5f;
  const float drift = smooth_noise(spot.s / 1.8, spot.t / 2.1, wall.key + 53) - 0.5f;
  return base * (1 + 0.28f * grain + 0.35f * drift);
}

Rgb tiles(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const Rgb laid = coursed(base, {0.25, 0.30, 0.14, 0.22f, base * 0.4f}, spot, wall.key);
  const float moss = smooth_noise(spot.s / 1.1, spot.t / 0.8, wall.key + 61);
  return moss > 0.74f ? laid * 0.7f + Rgb{0.05f, 0.07f, 0.025f} * 0.5f : laid;
}

Rgb sheet_copper(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const float seam = line_cover(spot.s / 0.6, spot.texel_m / 0.6, 0.08);
  const float worn = smooth_noise(spot.s / 0.9, spot.t / 2.2, wall.key + 62);
  const float brown = std::max(0.0f, worn - 0.6f) * 1.6f;
  return (base * (1 - brown) + Rgb{0.17f, 0.09f, 0.05f} * brown) * (1 - 0.35f * seam);
}

Rgb stripes(Rgb base, const PaintSpot& spot) {
  const float white = line_cover(spot.s / 0.7, spot.texel_m / 0.7, 0.5);
  return base * (1 - white) + Rgb{0.62f, 0.60f, 0.55f} * white;
}

// ---- streets ----

Rgb road(Rgb base, const PaintSpot& spot, const WallGrid& wall) {
  const float wear = smooth_noise(spot.s / 3.3, spot.t / 3.7, wall.key + 71) - 0.5f;
  const float grain = cell_noise(static_cast<int64_t>(std::floor(spot.s * 11)),
                                 static_cast<int64_t>(std::floor(spot.t * 11)), wall.key) -
                      0.5f;
  const auto cell_s = static_cast<int64_t>(std::floor(spot.s / 4.3)),
             cell_t = static_cast<int64_t>(std::floor(spot.t / 3.1));
  const float mended = cell_noise(cell_s, cell_t, wall.key + 72) > 0.93f ? 0.62f : 1.0f;
  const float crack = std::fabs(smooth_noise(spot.s / 1.9, spot.t / 2.3, wall.key + 73) - 0.5f) < 0.012f ? 0.6f : 1.0f;
  return base * ((1 + 0.5f * wear + 0.22f * grain) * mended * crack);
}

Rgb slabs(Rgb base, const PaintSpot& spot, const WallGrid& wall, double size_m) {
  const float gum = cell_noise(static_cast<int64_t>(std::floor(spot.s * 7)),
                               static_cast<int64_t>(std::floor(spot.t * 7)), wall.key + 75) > 0.985f
                        ? 0.7f
                        : 1.0f;
  return coursed(base, {size_m, size_m, 0.03, 0.11f, base * 0.5f}, spot, wall.key) * gum;
}

// ---- panes ----

// A room behind a pane: dark, brighter towards the sill; blinds or curtains in most.
Rgb window(Rgb base, const PaintSpot& spot) {
  const uint32_t key = spot.face_key;
  const float what = cell_noise(1, 1, key), drawn = cell_noise(2, 1, key), tint = cell_noise(3, 1, key);
  Rgb room = base * (0.5f + 1.5f * cell_noise(4, 1, key) * static_cast<float>(1 - spot.v));
  const Rgb cloth = tint < 0.6f   ? Rgb{0.33f, 0.31f, 0.27f}
                    : tint < 0.8f ? Rgb{0.26f, 0.20f, 0.13f}
                                  : Rgb{0.17f, 0.20f, 0.24f};
  const float grime = 0.012f * smooth_noise(spot.s * 3, spot.t * 3, key + 7);
  if (what < 0.30f && spot.v > 1 - 0.75 * static_cast<double>(drawn)) {  // blinds, as far down as they are let
    const float slat = line_cover(spot.t / 0.12, spot.texel_m / 0.12, 0.3);
    room = cloth * (0.8f * (1 - 0.4f * slat));
  } else if (what >= 0.30f && what < 0.68f) {  // curtains to the left and right
    const double open = 0.12 + 0.35 * static_cast<double>(drawn), side = std::min(spot.u, 1 - spot.u);
    if (side < open) {
      const auto fold = static_cast<float>(0.5 + 0.5 * std::fabs(std::fmod(side * 17, 2.0) - 1));
      room = cloth * (0.75f * fold);
    }
  }
  return room + Rgb{grime, grime, grime};
}

// Coated glass of towers: shades from pane to pane, rain on the lower edge.
Rgb mirror(Rgb base, const PaintSpot& spot) {
  const float shade = cell_noise(1, 2, spot.face_key) - 0.5f;
  const float rain = smooth_noise(spot.s * 2.5, spot.t * 0.7, spot.face_key + 3);
  const float low = static_cast<float>(std::max(0.0, 0.35 - spot.v));
  return base * ((1 + 0.34f * shade) * (1 - 0.10f * rain - 0.35f * low));
}

}  // namespace

Rgb pattern(Surface surface, const PaintSpot& spot, const WallGrid& wall) {
  using enum Surface;
  const Rgb base = base_of(surface);
  if (surface <= brick_cream) return brick(base, spot, wall);
  if (surface <= limestone) return stone(base, spot, wall);
  if (surface <= concrete_dark) return cast_concrete(base, spot, wall);
  if (surface <= plaster_lavender) return plaster(base, spot, wall);
  if (surface <= panel_blue) return panels(base, spot, wall);
  if (surface <= wood_red) return boards(base, spot, wall);
  if (surface == roof_tar) return tar(base, spot, wall);
  if (surface == roof_gravel) return gravel(base, spot, wall);
  if (surface == roof_light) return panels(base, spot, wall);
  if (surface >= tile_red && surface <= tile_brown) return tiles(base, spot, wall);
  if (surface == Surface::copper) return sheet_copper(base, spot, wall);
  if (surface >= awning_red && surface <= awning_navy) return stripes(base, spot);
  if (surface == glass_dark) return window(base, spot);
  if (surface >= glass_blue && surface <= glass_silver) return mirror(base, spot);
  if (surface == Surface::asphalt) return road(base, spot, wall);
  if (surface == pavement) return slabs(base, spot, wall, 0.95);
  if (surface == plaza) return slabs(base, spot, wall, 0.6);
  return base;
}

}  // namespace spillway::tools::city
