#pragma once

// Pixel filters by importance sampling with signed weights; perspective and orthographic cameras with a thin lens.

#include <cstdint>

#include "cache/base/vec.h"

namespace spillway::shading {

enum class FilterKind : uint32_t { box, triangle, gaussian, mitchell, sinc };

// Radii in pixels. Parameters: gaussian sigma; mitchell B, C; sinc tau (as in pbrt-v4).
struct Filter {
  FilterKind kind = FilterKind::gaussian;
  Float2 radius_px{1.5f, 1.5f};
  float a = 0.5f, b = 0;
};

struct FilterSample {
  Float2 offset_px{0, 0};  // from the pixel's centre
  float weight = 1;        // signed; mean of many is one
};
// Samples |filter| exactly (box, triangle) or through a tabulated inverse; deterministic.
class FilterSampler {
 public:
  explicit FilterSampler(const Filter& filter);
  [[nodiscard]] FilterSample sample(Float2 u) const;

 private:
  struct AxisSample {
    float offset, sign;
  };
  [[nodiscard]] AxisSample sample_axis(int axis, float u) const;

  static constexpr int kCells = 128;
  Filter filter_;
  float cdf_[2][kCells + 1] = {};  // of |f| along x and y (all kinds are separable)
  float sign_[2][kCells] = {};
  uint8_t first_cell_[2][kCells] = {};  // the last that begins at or before i / kCells
  float scale_ = 1;                // integral |f| / integral f, over both axes
};

// pbrt conventions: camera space is left-handed (x right, y up, z forward), fov of the shorter axis, screen window from
// the aspect ratio unless given.
struct Camera {
  Affine3 world_from_camera;  // of a camera that moves: its first key
  float tan_half_fov_x = 1, tan_half_fov_y = 1;  // of the screen window's half extents at z = 1; orthographic: these
  float screen_center_x = 0, screen_center_y = 0;
  float lens_radius = 0;
  float focal_distance = 1e6f;
  float shutter_open = 0, shutter_close = 1;
  uint32_t resolution_x_px = 1280, resolution_y_px = 720;
  uint32_t is_orthographic = 0;
  uint32_t motion = 0;  // 0: stands still; else one more than its place among the scene's motions
};

struct CameraRay {
  Float3 origin_world{0, 0, 0};
  Float3 direction_world{0, 0, 1};  // unit
  float cone_width = 0;             // world units at the origin
  float cone_spread = 0;            // growth of the cone's width per unit length: a pixel's angle
};
// p_raster_px: continuous, (0,0) the upper left corner of the full frame; u_lens in [0,1)^2.
[[nodiscard]] CameraRay camera_ray(const Camera& camera, Float2 p_raster_px, Float2 u_lens);
// The same with the camera where it is at the time of the ray.
[[nodiscard]] CameraRay camera_ray(const Camera& camera, const Affine3& world_from_camera, Float2 p_raster_px, Float2 u_lens);

}  // namespace spillway::shading
