#pragma once

// What hangs in the air of a city: fog over bay and streets, a bank of low cloud, smoke from chimneys.
//
// Densities are extinction per metre, functions of place and seed alone. Where fog, cloud and smoke meet they add up: the
// grid of a plume holds all three, so that it can be nested in the grid of the whole.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/medium.h"
#include "tools/city/geometry.h"
#include "tools/city/terrain.h"

namespace spillway::tools::city {

struct AirKinds {
  bool fog = false, cloud = false, smoke = false;
  [[nodiscard]] bool any() const { return fog || cloud || smoke; }
  // Whether there is a grid of the whole city, beside those of plumes.
  [[nodiscard]] bool spreads() const { return fog || cloud; }
};

// A box along the axes of the world.
struct Box {
  Vec3 lower, upper;
};
[[nodiscard]] bool overlap(const Box& a, const Box& b);

// A regular grid of samples: world = origin + step * lattice point, for lattice points in [0, count).
struct AirGrid {
  std::string name;
  Vec3 origin, step;
  std::array<int32_t, 3> count{0, 0, 0};  // multiples of 8
  [[nodiscard]] Affine3 world_from_lattice() const;
  // All places where its density may be above zero.
  [[nodiscard]] Box box() const;
};

// Smoke that rises from a chimney and drifts with the wind.
struct Plume {
  Chimney chimney;
  AirGrid grid;
};

inline constexpr size_t kMostPlumes = 8;
inline constexpr uint32_t kAirCells = 160;  // of the grid of the whole city, along its radius

class Air {
 public:
  // cells: finer, larger files.
  Air(const Terrain& terrain, uint64_t seed, AirKinds kinds, uint32_t cells = kAirCells);

  // The chimneys nearest to the centre whose plumes keep apart and away from the places given.
  [[nodiscard]] std::vector<Plume> plumes(std::vector<Chimney> chimneys, std::span<const Vec3> kept_free) const;
  [[nodiscard]] AirGrid grid() const;
  // The samples of one column of a grid, upwards; plume: null for the grid of the whole.
  void fill_column(const AirGrid& grid, const Plume* plume, int32_t x, int32_t y, std::span<float> samples) const;

 private:
  struct Ground {
    double height, fog, top;
  };
  [[nodiscard]] Ground ground(Vec2 at) const;
  [[nodiscard]] double fog(const Ground& ground, Vec3 p) const;
  [[nodiscard]] double cloud(Vec3 p) const;
  [[nodiscard]] double smoke(const Chimney& chimney, Vec3 p) const;
  [[nodiscard]] AirGrid plume_grid(const Chimney& chimney) const;

  const Terrain& terrain_;
  AirKinds kinds_;
  uint32_t cells_;
  double r_;       // the city's radius
  Vec3 noise_at_;  // where in the noise the city lies
  Vec2 wind_;
};

// What droplets, or soot, do to light at density one. The grid is to be set.
[[nodiscard]] pipeline::Medium mist_medium();
[[nodiscard]] pipeline::Medium smoke_medium();

}  // namespace spillway::tools::city
