#pragma once

// Everything that stands in the city more than once, by number; and things that stand.

#include <functional>
#include <string>
#include <vector>

#include "tools/city/boats.h"
#include "tools/city/massing.h"
#include "tools/city/prototypes.h"

namespace spillway::tools::city {

struct Standing {
  Frame frame;
  double scale = 1;
  uint32_t prototype = 0;  // its number in the catalogue
};

struct Prototype {
  std::string name;
  std::function<void(Geometry&)> make;
};

inline constexpr uint32_t kLampPrototypes = static_cast<uint32_t>(LampKind::count);
inline constexpr uint32_t kTreePrototypes = static_cast<uint32_t>(TreeKind::count) * kTreeVariants;
inline constexpr uint32_t kCarPrototypes = static_cast<uint32_t>(CarKind::count) * kCarPaints;
inline constexpr uint32_t kFirstTree = kLampPrototypes;
inline constexpr uint32_t kFirstCar = kFirstTree + kTreePrototypes;
inline constexpr uint32_t kFirstBoat = kFirstCar + kCarPrototypes;
inline constexpr uint32_t kLanternPrototype = kFirstBoat + static_cast<uint32_t>(BoatKind::count);
inline constexpr uint32_t kSeaPrototype = kLanternPrototype + 1;
inline constexpr uint32_t kFirstDesign = kSeaPrototype + 1;  // buildings of prototype_buildings.h

[[nodiscard]] constexpr uint32_t tree_prototype(TreeKind kind, uint32_t variant) {
  return kFirstTree + static_cast<uint32_t>(kind) * kTreeVariants + variant;
}
[[nodiscard]] constexpr uint32_t car_prototype(CarKind kind, uint32_t paint) {
  return kFirstCar + static_cast<uint32_t>(kind) * kCarPaints + paint;
}

// In the order of their numbers. The designs must outlive it.
[[nodiscard]] std::vector<Prototype> catalogue(const std::vector<Building>& designs, const BuildOptions& options);

}  // namespace spillway::tools::city
