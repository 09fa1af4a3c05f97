#pragma once

// Makes the light table.
//
// In:     the spooled scene (emissive meshes), the other lights in the order of the scene, the environment's texels, the
//         bounds of the world.
// Out:    one light a face of an emissive mesh, by ascending prim, then the others, infinite ones last; light_base of
//         the meshes set; the cumulative distribution in proportion to power.
// Memory: tag pack: one chunk; the table itself.
// Order:  serial; sums in double, in the order of the table.

#include <span>
#include <vector>

#include "pipeline/pack/mesh_spool.h"
#include "shading/light.h"

namespace spillway::pipeline {

struct PackedLights {
  std::vector<shading::Light> lights;
  std::vector<float> cdf;  // one more than lights; {0} without lights
};

Result<PackedLights> pack_lights(SpooledScene& scene, std::span<const shading::Light> other_lights,
                                 std::span<const Rgb> environment, const Bounds3& bounds_world);

}  // namespace spillway::pipeline
