#include "shading/image_light.h"

#include <algorithm>
#include <cmath>

#include "shading/environment.h"
#include "shading/trigonometry.h"

namespace spillway::shading {
namespace {

bool is_projection(const LightImage& image) { return image.half_width > 0; }

Rgb texel_at(const LightImages& images, const LightImage& image, Float2 square) {
  const auto index = [](float s, uint32_t size) {
    return std::min(static_cast<uint32_t>(std::max(0.0f, s) * static_cast<float>(size)), size - 1);
  };
  const size_t row = index(square.y, image.height);
  return images.texels[image.first_texel + row * image.width + index(square.x, image.width)];
}

// The solid angle of the rectangle from the axis to (x, y), in the plane at distance 1.
double solid_angle_to(double x, double y) { return std::atan(x * y / std::sqrt(1 + x * x + y * y)); }

double solid_angle_of_texel(const LightImage& image, uint32_t x, uint32_t y) {
  if (!is_projection(image)) return 4 * M_PI / (static_cast<double>(image.width) * image.height);
  const auto at = [](uint32_t i, uint32_t size, double half) { return half * (2.0 * i / size - 1); };
  const double x0 = at(x, image.width, image.half_width), x1 = at(x + 1, image.width, image.half_width);
  const double y0 = at(y, image.height, image.half_height), y1 = at(y + 1, image.height, image.half_height);
  return solid_angle_to(x1, y1) - solid_angle_to(x0, y1) - solid_angle_to(x1, y0) + solid_angle_to(x0, y0);
}

}  // namespace

Float2 projected_half_size(uint32_t width, uint32_t height, float tangent) {
  const float aspect = static_cast<float>(width) / static_cast<float>(height);
  return {tangent * std::max(aspect, 1.0f), tangent * std::max(1 / aspect, 1.0f)};
}

Rgb light_image_value(const LightImages& images, const LightImage& image, Float3 w_world) {
  const Float3 w{dot(image.axis[0], w_world), dot(image.axis[1], w_world), dot(image.axis[2], w_world)};
  if (!is_projection(image)) return texel_at(images, image, equal_area_square(w));
  if (!(w.z > 0)) return {0, 0, 0};
  const Float2 square{0.5f + 0.5f * w.x / (w.z * image.half_width), 0.5f + 0.5f * w.y / (w.z * image.half_height)};
  const bool is_inside = square.x >= 0 && square.x <= 1 && square.y >= 0 && square.y <= 1;
  return is_inside ? texel_at(images, image, square) : Rgb{0, 0, 0};
}

double light_image_integral(const LightImages& images, const LightImage& image) {
  double sum = 0;
  for (uint32_t y = 0; y < image.height; ++y)
    for (uint32_t x = 0; x < image.width; ++x) {
      const Rgb texel = images.texels[image.first_texel + size_t{y} * image.width + x];
      sum += static_cast<double>(luminance(texel)) * solid_angle_of_texel(image, x, y);
    }
  return sum;
}

}  // namespace spillway::shading
