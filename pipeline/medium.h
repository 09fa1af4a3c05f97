#pragma once

// The participating media of a packed scene: tables that the store's manifest holds, and what stays in memory of them.

#include <cstdint>
#include <span>

#include "cache/base/vec.h"
#include "cache/volume_table.h"
#include "pipeline/records.h"

namespace spillway::pipeline {

enum class MediumKind : uint32_t {
  homogeneous,
  grid,        // coefficients times a volume's density
  color_grid,  // coefficients of each channel from volumes of their own
};
// Where a medium's emission comes from.
enum class GlowKind : uint32_t {
  none,
  constant,     // Medium::glow everywhere
  scaled,       // Medium::glow times a volume's value
  temperature,  // Medium::glow times the normalised radiance of a black body of a volume's value in kelvin
  colors,       // Medium::glow times a volume's colour; of colour grids
};

// Coefficients are per world unit. Of a grid they are those of density one. Of a colour grid sigma_s is what both of
// its volumes are multiplied by, sigma_a is zero: density_volume holds sigma_a + sigma_s, scatter_volume sigma_s.
struct Medium {
  MediumKind kind = MediumKind::homogeneous;
  float g = 0;  // Henyey-Greenstein; > 0 is forward
  Rgb sigma_a{1, 1, 1}, sigma_s{1, 1, 1};
  Rgb glow{0, 0, 0};  // radiance; emitted is sigma_a times it
  GlowKind glow_kind = GlowKind::none;
  uint32_t density_volume = kNoVolume, glow_volume = kNoVolume;  // numbers of volumes
  float kelvin_scale = 1, kelvin_offset = 0;                     // (value - offset) * scale
  uint32_t scatter_volume = kNoVolume, reserved = 0;             // on the lattice of density_volume
  Affine3 density_from_world, glow_from_world;                   // to the volumes' lattices

  static constexpr uint32_t kNoVolume = 0xffffffffu;
  [[nodiscard]] Rgb sigma_t() const { return sigma_a + sigma_s; }
};
static_assert(sizeof(Medium) == 168);

inline constexpr uint32_t kMaxMedia = kNoMedium;

// Normalised radiance of black bodies: entry i is that of i * kBlackBodyStep_kelvin, linear in between.
inline constexpr float kBlackBodyStep_kelvin = 20;
inline constexpr uint32_t kBlackBodyEntries = 1001;  // up to 20,000 kelvin; hotter ones take the last

struct MediumTables {
  std::span<const Medium> media;
  cache::VolumeTables volumes;
  std::span<const Rgb> black_bodies;  // kBlackBodyEntries, or none where no medium has a temperature
};

[[nodiscard]] Rgb black_body(std::span<const Rgb> table, float kelvin);

}  // namespace spillway::pipeline
