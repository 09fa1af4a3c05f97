#include "shading/camera.h"

#include <cmath>

#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

// Filters in one dimension, |x| <= radius; as in pbrt-v4 section 8.8.
double mitchell_1d(double x, double b, double c) {
  x = std::fabs(2 * x);
  if (x <= 1) return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + (6 - 2 * b)) / 6;
  if (x <= 2) return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x + (8 * b + 24 * c)) / 6;
  return 0;
}

double sinc(double x) {
  x = std::fabs(x) * kPi;
  return x < 1e-5 ? 1 : std::sin(x) / x;
}

double filter_1d(const Filter& f, double x, double radius) {
  switch (f.kind) {
    case FilterKind::box: return 1;
    case FilterKind::triangle: return std::max(0.0, radius - std::fabs(x));
    case FilterKind::gaussian: {
      const auto g = [&](double d) { return std::exp(-d * d / (2.0 * f.a * f.a)); };
      return std::max(0.0, g(x) - g(radius));
    }
    case FilterKind::mitchell: return mitchell_1d(x / radius, f.a, f.b);
    case FilterKind::sinc: return sinc(x) * sinc(x / f.a);
  }
  return 0;
}

}  // namespace

// |f| is tabulated at the midpoints of 128 cells over the filter's diameter; the filter that is applied is that step
// function, which differs from the continuous one by less than 2 % of its peak at any offset.
FilterSampler::FilterSampler(const Filter& filter) : filter_(filter) {
  double scale = 1;
  for (int axis = 0; axis < 2; ++axis) {
    const double radius = axis == 0 ? filter.radius_px.x : filter.radius_px.y;
    double magnitude = 0, sum = 0;
    for (int i = 0; i < kCells; ++i) {
      const double value = filter_1d(filter, radius * (2.0 * (i + 0.5) / kCells - 1), radius);
      magnitude += std::fabs(value), sum += value;
      cdf_[axis][i + 1] = static_cast<float>(magnitude);
      sign_[axis][i] = value < 0 ? -1.0f : 1.0f;
    }
    for (int i = 1; i <= kCells; ++i) cdf_[axis][i] = static_cast<float>(cdf_[axis][i] / magnitude);
    cdf_[axis][kCells] = 1;
    for (int i = 0, cell = 0; i < kCells; ++i) {
      while (cell + 1 < kCells && cdf_[axis][cell + 1] <= static_cast<float>(i) / kCells) ++cell;
      first_cell_[axis][i] = static_cast<uint8_t>(cell);
    }
    scale *= magnitude / sum;
  }
  scale_ = static_cast<float>(scale);
}

// Cells up to a 128th of the way are skipped: the rest is a step or two.
FilterSampler::AxisSample FilterSampler::sample_axis(int axis, float u) const {
  const float* const cdf = cdf_[axis];
  int cell = first_cell_[axis][static_cast<int>(u * kCells)];
  while (cdf[cell + 1] <= u) ++cell;
  const float width = cdf[cell + 1] - cdf[cell];
  const float inside = width > 0 ? (u - cdf[cell]) / width : 0.5f;
  const float radius = axis == 0 ? filter_.radius_px.x : filter_.radius_px.y;
  return {radius * (2 * (static_cast<float>(cell) + inside) / kCells - 1), sign_[axis][cell]};
}

FilterSample FilterSampler::sample(Float2 u) const {
  if (filter_.kind == FilterKind::box)
    return {{filter_.radius_px.x * (2 * u.x - 1), filter_.radius_px.y * (2 * u.y - 1)}, 1};
  const AxisSample x = sample_axis(0, u.x);
  const AxisSample y = sample_axis(1, u.y);
  return {{x.offset, y.offset}, x.sign * y.sign * scale_};
}

CameraRay camera_ray(const Camera& camera, Float2 p_raster_px, Float2 u_lens) {
  return camera_ray(camera, camera.world_from_camera, p_raster_px, u_lens);
}

CameraRay camera_ray(const Camera& camera, const Affine3& world_from_camera, Float2 p_raster_px, Float2 u_lens) {
  const auto width = static_cast<float>(camera.resolution_x_px), height = static_cast<float>(camera.resolution_y_px);
  const float x = camera.screen_center_x + camera.tan_half_fov_x * (2 * p_raster_px.x / width - 1);
  const float y = camera.screen_center_y + camera.tan_half_fov_y * (1 - 2 * p_raster_px.y / height);
  const bool parallel = camera.is_orthographic != 0;
  Float3 origin = parallel ? Float3{x, y, 0} : Float3{0, 0, 0}, direction = parallel ? Float3{0, 0, 1} : Float3{x, y, 1};
  if (camera.lens_radius > 0) {
    const Float2 disk = concentric_disk(u_lens) * camera.lens_radius;
    const Float3 lens{disk.x, disk.y, 0};
    origin += lens;
    direction = direction * camera.focal_distance - lens;
  }
  const float pixel = 2 * camera.tan_half_fov_y / height;  // its size, or its angle at the image's centre
  CameraRay ray;
  ray.origin_world = world_from_camera.point(origin);
  ray.direction_world = normalize(world_from_camera.vector(direction));
  ray.cone_width = parallel ? pixel : 0;
  ray.cone_spread = parallel ? 0 : pixel;
  return ray;
}

}  // namespace spillway::shading
