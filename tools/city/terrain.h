#pragma once

// Ground and shore: a height for every place, metres above the sea.

#include <cstdint>
#include <vector>

#include "tools/city/polygon.h"

namespace spillway::tools::city {

// 0 at low, 1 at high, smooth between.
[[nodiscard]] double smoothstep(double low, double high, double x);
// Smooth noise in [-1, 1], one bump a unit.
[[nodiscard]] double value_noise(uint64_t key, Vec2 at);

struct TerrainOptions {
  bool hills = true, bay = true;
  double radius_m = 1000;  // of the city
  uint64_t seed = 0;
};

class Terrain {
 public:
  explicit Terrain(const TerrainOptions& options);

  [[nodiscard]] double height(Vec2 at) const;
  // Metres inland of the water's edge (negative: in the bay), measured northwards; very large where there is no bay.
  [[nodiscard]] double inland(Vec2 at) const;
  [[nodiscard]] double shore_y(double x) const;
  // Along the shore at x, land to its left, moved inland.
  [[nodiscard]] Line shore_line(double x, double inland_m) const;
  // Whether the ground rises or falls by more than some centimetres over the polygon's extent.
  [[nodiscard]] bool is_flat(const Polygon& polygon) const;
  [[nodiscard]] double lowest(const Polygon& polygon) const;
  [[nodiscard]] double highest(const Polygon& polygon) const;
  [[nodiscard]] bool has_bay() const { return options_.bay; }
  [[nodiscard]] double radius_m() const { return options_.radius_m; }

 private:
  struct Hill {
    Vec2 at;
    double width, rise;
  };
  TerrainOptions options_;
  std::vector<Hill> hills_, mountains_, islands_;
};

}  // namespace spillway::tools::city
