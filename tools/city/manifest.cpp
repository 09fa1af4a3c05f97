#include "tools/city/manifest.h"

#include <fmt/format.h>

#include "pipeline/json_text.h"

namespace spillway::tools::city {

std::string manifest_json(const City& city, const CityOptions& options) {
  const CityCounts& c = city.counts();
  nlohmann::ordered_json kinds, districts;
  for (size_t i = 0; i < kKindCount; ++i) kinds[name(static_cast<Kind>(i))] = c.kinds[i];
  for (size_t i = 0; i < c.districts.size(); ++i) districts[name(static_cast<District>(i))] = c.districts[i];
  nlohmann::ordered_json json = {
      {"kind", "spillway city"},
      {"seed", options.seed},
      {"buildings", c.buildings},
      {"buildings_instanced", c.instanced_buildings},
      {"blocks", c.blocks},
      {"lots", c.lots},
      {"floors", c.floors},
      {"street_lights", c.street_lights},
      {"trees", c.trees},
      {"cars", c.cars},
      {"lanterns", c.lanterns},
      {"boats", c.boats},
      {"sea_tiles", c.sea_tiles},
      {"radius_m", city.radius_m()},
      {"buildings_by_kind", kinds},
      {"buildings_by_district", districts},
      {"triangles",
       {{"unique", c.unique_triangles()},
        {"buildings", c.building_triangles},
        {"ground", c.ground_triangles},
        {"prototypes", c.prototype_triangles},
        {"emitting", c.light_triangles},
        {"instanced", c.instanced_triangles}}},
      {"cages", c.cages},
      {"cage_faces", c.cage_faces},
      {"instances", c.instances},
      {"predicted_store_bytes", city.predicted_store_bytes()},
      {"texels_per_metre", city.texels_per_metre()},
      {"painted_faces", city.painted().faces},
      {"texels", city.painted().texels},
      {"predicted_texture_bytes", city.predicted_texture_bytes()},
  };
  if (city.has_air())
    json["air"] = {{"fog", options.air.fog}, {"cloud", options.air.cloud}, {"media", c.media}, {"smoke_plumes", c.plumes}};
  return pipeline::json_text(json) + "\n";
}

std::string describe(const City& city) {
  const CityCounts& c = city.counts();
  const uint64_t own = c.buildings - c.instanced_buildings;
  const double mean = own == 0 ? 0 : static_cast<double>(c.building_triangles) / static_cast<double>(own);
  return fmt::format(
      "{} buildings on {} blocks within {:.1f} km, {:.0f} triangles each; {} street lights, {} trees, {} cars\n"
      "{} unique triangles, {} more by {} instances, {} that emit light\n"
      "as a store: about {:.2f} GiB of geometry, {:.2f} GiB of textures ({} painted faces, {:.2f} texels a metre)\n",
      c.buildings, c.blocks, city.radius_m() / 1000, mean, c.street_lights, c.trees, c.cars, c.unique_triangles(),
      c.instanced_triangles, c.instances, c.light_triangles,
      static_cast<double>(city.predicted_store_bytes()) / 0x1p30,
      static_cast<double>(city.predicted_texture_bytes()) / 0x1p30, city.painted().faces, city.texels_per_metre());
}

}  // namespace spillway::tools::city
