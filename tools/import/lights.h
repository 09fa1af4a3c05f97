#pragma once

// LightSource and AreaLightSource: pbrt's parameters as radiance, intensity and irradiance in RGB.

#include <string>

#include "tools/import/params.h"
#include "tools/import/session.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// What an area light says about the shapes that follow it.
struct AreaEmission {
  Rgb radiance{0, 0, 0};
  float power = 0;  // above 0: each triangle is scaled to emit radiance * power / (pi * its emitting area)
  bool two_sided = false;
  TextureId image;  // multiplies the radiance; with power, by its mean
};
Result<AreaEmission> read_area_light(Session& session, const std::string& type, const ParamList& params, Place place);

Status add_light(Session& session, const std::string& type, const ParamList& params, Place place,
                 const Transform& world_from_light);

}  // namespace spillway::tools
