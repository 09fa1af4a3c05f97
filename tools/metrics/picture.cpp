#include "tools/metrics/picture.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>

namespace spillway::tools {
namespace {

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

// IEC 61966-2-1.
float linear_from_srgb(float v) {
  return v <= 0.04045f ? v / 12.92f : static_cast<float>(std::pow((double{v} + 0.055) / 1.055, 2.4));
}

// Channels named prefix + R, G, B as pixels; empty when one of them is not there.
std::vector<Rgb> gather(const std::vector<float>& values, const ImageSpec& spec, const std::string& prefix) {
  const int r = spec.channelindex(prefix + "R"), g = spec.channelindex(prefix + "G");
  const int b = spec.channelindex(prefix + "B");
  if (r < 0 || g < 0 || b < 0) return {};
  const auto stride = static_cast<size_t>(spec.nchannels);
  std::vector<Rgb> pixels(values.size() / stride);
  for (size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = {values[i * stride + r], values[i * stride + g], values[i * stride + b]};
  return pixels;
}

std::vector<Rgb> gather_grey(const std::vector<float>& values, const ImageSpec& spec) {
  const auto stride = static_cast<size_t>(spec.nchannels);
  std::vector<Rgb> pixels(values.size() / stride);
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] = {values[i * stride], values[i * stride], values[i * stride]};
  return pixels;
}

Picture picture_from(const std::vector<float>& values, const ImageSpec& spec) {
  Picture picture;
  picture.width = spec.width, picture.height = spec.height;
  picture.pixels = gather(values, spec, "");
  if (picture.pixels.empty()) picture.pixels = gather_grey(values, spec);
  if (spec.format.basetype == TypeDesc::UINT8)
    for (Rgb& c : picture.pixels) c = {linear_from_srgb(c.r), linear_from_srgb(c.g), linear_from_srgb(c.b)};
  picture.half_a = gather(values, spec, "halfA."), picture.half_b = gather(values, spec, "halfB.");
  if (picture.half_a.empty() || picture.half_b.empty()) picture.half_a.clear(), picture.half_b.clear();
  const int a = spec.get_int_attribute("spillway:half_a_spp"), b = spec.get_int_attribute("spillway:half_b_spp");
  if (a > 0 && b > 0) picture.weight_a = static_cast<double>(a) / (static_cast<double>(a) + b);
  picture.image_hash = spec.get_string_attribute("spillway:image_hash");
  return picture;
}

bool all_finite(const Picture& p, size_t i) {
  return is_finite(p.pixels[i]) && (!p.has_halves() || (is_finite(p.half_a[i]) && is_finite(p.half_b[i])));
}

}  // namespace

Result<Picture> read_picture(const std::filesystem::path& path) {
  const auto input = ImageInput::open(path.string());
  if (!input) return error("{}: cannot be read: {}", path.string(), OIIO::geterror());
  const ImageSpec& spec = input->spec();
  if (spec.width <= 0 || spec.height <= 0 || spec.nchannels <= 0 || spec.depth > 1)
    return error("{}: is no flat image with pixels", path.string());
  std::vector<float> values(spec.image_pixels() * static_cast<size_t>(spec.nchannels));
  if (!input->read_image(0, 0, 0, spec.nchannels, TypeDesc::FLOAT, values.data()))
    return error("{}: cannot be read: {}", path.string(), input->geterror());
  return picture_from(values, spec);
}

std::vector<uint8_t> metric_mask(const Picture& a, const Picture& b, std::span<const Rectangle> excluded) {
  std::vector<uint8_t> mask(a.pixels.size(), 1);
  for (size_t i = 0; i < mask.size(); ++i) mask[i] = all_finite(a, i) && all_finite(b, i);
  for (const Rectangle& r : excluded)
    for (int y = std::max(r.y0, 0); y < std::min(r.y1, a.height); ++y)
      for (int x = std::max(r.x0, 0); x < std::min(r.x1, a.width); ++x) mask[a.index(x, y)] = 0;
  return mask;
}

Status write_heat_png(const std::filesystem::path& path, int width, int height, std::span<const float> values) {
  std::vector<uint8_t> bytes;
  bytes.reserve(3 * values.size());
  for (const float v : values)
    for (int c = 0; c < 3; ++c)  // red, then green, then blue fill up, a third of the range each
      bytes.push_back(static_cast<uint8_t>(255 * std::clamp(3 * v - static_cast<float>(c), 0.0f, 1.0f) + 0.5f));
  const auto output = ImageOutput::create("png");
  if (!output || !output->open(path.string(), ImageSpec(width, height, 3, TypeDesc::UINT8)) ||
      !output->write_image(TypeDesc::UINT8, bytes.data()) || !output->close())
    return error("{}: cannot be written: {}", path.string(), output ? output->geterror() : OIIO::geterror());
  return {};
}

}  // namespace spillway::tools
