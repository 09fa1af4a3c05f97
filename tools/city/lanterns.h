#pragma once

// Paper lanterns on strings across the streets of the old town.

#include <vector>

#include "tools/city/furniture.h"

namespace spillway::tools::city {

struct LanternString {
  Vec3 from, to;  // on opposite fronts
  double sag_m = 0;

  [[nodiscard]] Vec3 at(double t) const;  // 0 to 1, along a parabola
};

// Of the two blocks beside a street, the one whose edge runs eastwards has the strings.
[[nodiscard]] std::vector<LanternString> lantern_strings(const Block& block, const Terrain& terrain);
void string_cable(Geometry& g, const LanternString& string);
[[nodiscard]] std::vector<Standing> lanterns_on(const LanternString& string, uint64_t key);
// The prototype, hanging from the origin.
void lantern(Geometry& g);

}  // namespace spillway::tools::city
