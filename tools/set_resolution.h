#pragma once

// A picture of another size.

#include <algorithm>

#include "pipeline/scene.h"
#include "tools/sizes.h"

namespace spillway::tools {

// Another resolution sees the same along the shorter axis; all of it, whatever crop there was.
inline void set_resolution(pipeline::SceneSettings& settings, Resolution r) {
  shading::Camera& camera = settings.camera;
  const float shorter = std::min(camera.tan_half_fov_x, camera.tan_half_fov_y);
  const float aspect = static_cast<float>(r.x) / static_cast<float>(r.y);
  camera.tan_half_fov_x = shorter * std::max(1.0f, aspect);
  camera.tan_half_fov_y = shorter * std::max(1.0f, 1 / aspect);
  camera.resolution_x_px = r.x, camera.resolution_y_px = r.y;
  settings.film.crop_x0 = settings.film.crop_x1 = settings.film.crop_y0 = settings.film.crop_y1 = 0;
}

}  // namespace spillway::tools
