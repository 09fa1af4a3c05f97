#pragma once

// What is painted on faces: courses of brick and stone, boards, tiles, seams, curtains behind panes, and the dirt that
// rain, soot and feet leave. A texel is a function of the face's place in the world, its wall and its building alone:
// faces that continue each other are painted on continuously, and nothing depends on the order in which they are made.

#include <cstddef>
#include <span>
#include <vector>

#include "tools/city/painted_mesh.h"

namespace spillway::tools::city {

// 8-bit sRGB, three channels, 2^(ulog2 + vlog2) texels row by row from v = 0. Corners: a, b, c, d of the face.
[[nodiscard]] std::vector<std::byte> painted_texels(const PaintedFace& face, std::span<const Float3, 4> corners,
                                                    const WallGrid& wall);

// ---- pattern.h's view of a texel ----

struct PaintSpot {
  double s, t;        // metres along the surface: across and up; of roofs east and north
  double u, v;        // on the face
  double above_m;     // above the ground before the building
  double texel_m;     // how wide a texel is
  uint32_t face_key;  // differs from pane to pane
  bool is_upright;
};

// Reflectance of a surface there, in linear light, before dirt.
[[nodiscard]] Rgb pattern(Surface surface, const PaintSpot& spot, const WallGrid& wall);
// Rain, soot and splashes: a factor.
[[nodiscard]] float cleanness(const PaintSpot& spot, const WallGrid& wall);

// Smooth noise in [0, 1] about points of a lattice.
[[nodiscard]] float smooth_noise(double x, double y, uint32_t key);
// The same number for all of a cell, in [0, 1).
[[nodiscard]] float cell_noise(int64_t x, int64_t y, uint32_t key);
// Of lines `share` of the period wide at every integer: how much of [x - w/2, x + w/2] they cover.
[[nodiscard]] float line_cover(double x, double width, double share);

}  // namespace spillway::tools::city
