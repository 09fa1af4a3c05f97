#include "tools/city/catalogue.h"

#include "cache/base/check.h"
#include "tools/city/ground.h"
#include "tools/city/lanterns.h"

namespace spillway::tools::city {
namespace {

constexpr double kFoundation_m = -7;  // of designs, which stand on slopes of any kind

}  // namespace

std::vector<Prototype> catalogue(const std::vector<Building>& designs, const BuildOptions& options) {
  std::vector<Prototype> all;
  for (uint32_t k = 0; k < kLampPrototypes; ++k)
    all.push_back({fmt::format("lamp{}", k), [k](Geometry& g) { lamp(g, static_cast<LampKind>(k)); }});
  for (uint32_t i = 0; i < kTreePrototypes; ++i)
    all.push_back({fmt::format("tree{}", i), [i](Geometry& g) {
                     tree(g, static_cast<TreeKind>(i / kTreeVariants), static_cast<int>(i % kTreeVariants));
                   }});
  for (uint32_t i = 0; i < kCarPrototypes; ++i)
    all.push_back({fmt::format("car{}", i), [i](Geometry& g) {
                     car(g, static_cast<CarKind>(i / kCarPaints), static_cast<int>(i % kCarPaints));
                   }});
  for (uint32_t k = 0; k < static_cast<uint32_t>(BoatKind::count); ++k)
    all.push_back({fmt::format("boat{}", k), [k, time = options.time](Geometry& g) { boat(g, static_cast<BoatKind>(k), time); }});
  all.push_back({"lantern", lantern});
  all.push_back({"sea", sea_tile});
  SPILLWAY_CHECK(all.size(), ==, size_t{kFirstDesign});
  for (const Building& design : designs)
    all.push_back({fmt::format("{}{}", name(design.kind), all.size()),
                   [&design, options](Geometry& g) { build(g, design, {0, kFoundation_m}, options); }});
  return all;
}

}  // namespace spillway::tools::city
