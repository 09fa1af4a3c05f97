#include "pipeline/pack/pack_environment.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace spillway::pipeline {
namespace {

constexpr size_t kMaxLightTexels = size_t{1} << 28;  // of all images together

// The finest level, row 0 at the top.
Result<std::vector<Rgb>> light_texels(uint32_t image, const cache::ImageInfo& info, cache::TextureCache& images,
                                      std::string_view name) {
  if (const uint64_t at = info.not_finite; at != 0)
    return error("{}: texel ({}, {}) is infinite or no number; light must be finite and not negative", name,
                 (at - 1) % info.width, (at - 1) / info.width);
  std::vector<Rgb> texels(size_t{info.width} * info.height);
  std::vector<cache::TextureRequest> requests(info.width);
  std::vector<cache::Texel> row(info.width);
  const auto place = [](uint32_t i, uint32_t size) {
    return (static_cast<float>(i) + 0.5f) / static_cast<float>(size);
  };
  for (uint32_t y = 0; y < info.height; ++y) {
    for (uint32_t x = 0; x < info.width; ++x)
      requests[x] = {
          image, cache::WrapMode::clamp, cache::TexelFilter::point, place(x, info.width), 1 - place(y, info.height), 0};
    SPILLWAY_TRY(images.look_up(requests, row));
    for (uint32_t x = 0; x < info.width; ++x) {
      const Rgb texel{row[x].value[0], row[x].value[1], row[x].value[2]};
      if (std::min({texel.r, texel.g, texel.b}) < 0)
        return error("{}: texel ({}, {}) is ({}, {}, {}); light must be finite and not negative", name, x, y, texel.r,
                     texel.g, texel.b);
      texels[size_t{y} * info.width + x] = texel;
    }
  }
  return texels;
}

// pbrt-v4 takes the mean of a goniometric image's channels; its colour is the light's.
void make_grey(std::span<Rgb> texels) {
  for (Rgb& texel : texels) {
    const float mean = (texel.r + texel.g + texel.b) / 3;
    texel = {mean, mean, mean};
  }
}

class LightImagePacker {
 public:
  LightImagePacker(std::span<const cache::ImageInfo> infos, std::span<const std::string> names,
                   cache::TextureCache* images)
      : infos_(infos), names_(names), images_(images) {}

  Status add(ImageLightInput& light) {
    const std::string name = light.name + ": " + names_[light.image.value];
    const cache::ImageInfo& info = infos_[light.image.value];
    SPILLWAY_TRY(check_size(light, info, name));
    shading::LightImage row{};
    std::copy(std::begin(light.axis), std::end(light.axis), row.axis);
    row.width = info.width, row.height = info.height;
    if (light.light.kind == shading::LightKind::projection) {
      const Float2 half = shading::projected_half_size(info.width, info.height, light.tangent);
      row.half_width = half.x, row.half_height = half.y;
    }
    SPILLWAY_ASSIGN(row.first_texel, first_texel(light, info, name));
    const double integral = shading::light_image_integral({{}, out_.texels}, row);
    row.integral = static_cast<float>(integral);
    if (!std::isfinite(row.integral)) return error("{}: is too bright", name);
    if (light.is_power) SPILLWAY_TRY(divide(light.light.radiance, integral, name));
    out_.images.push_back(row);
    return {};
  }

  PackedLightImages take() { return std::move(out_); }

 private:
  static Status check_size(const ImageLightInput& light, const cache::ImageInfo& info, const std::string& name) {
    if (info.width > kMaxLightImageSize || info.height > kMaxLightImageSize)
      return error("{}: has {} x {} texels; the image of a light has at most {} an edge: scale it down", name,
                   info.width, info.height, kMaxLightImageSize);
    if (light.light.kind == shading::LightKind::goniometric && info.width != info.height)
      return error("{}: has {} x {} texels; the image of a goniometric light is a square, equal-area octahedral", name,
                   info.width, info.height);
    return {};
  }

  Result<uint32_t> first_texel(const ImageLightInput& light, const cache::ImageInfo& info, const std::string& name) {
    const bool is_grey = light.light.kind == shading::LightKind::goniometric;
    const auto [found, is_new] =
        first_texels_.try_emplace({light.image.value, is_grey}, static_cast<uint32_t>(out_.texels.size()));
    if (!is_new) return found->second;
    if (size_t{info.width} * info.height > kMaxLightTexels - out_.texels.size())
      return error("{}: the images of lights have more than {} texels together: scale them down", name,
                   kMaxLightTexels);
    SPILLWAY_ASSIGN(std::vector<Rgb> texels, light_texels(light.image.value, info, *images_, name));
    if (is_grey) make_grey(texels);
    out_.texels.insert(out_.texels.end(), texels.begin(), texels.end());
    return found->second;
  }

  static Status divide(Rgb& radiance, double integral, const std::string& name) {
    if (!(integral > 0)) return error("{}: is black, and cannot emit the light's \"power\"", name);
    radiance = radiance * static_cast<float>(1 / integral);
    return is_finite(radiance) ? Status{} : Status(error("{}: is too dark for the light's \"power\"", name));
  }

  std::span<const cache::ImageInfo> infos_;
  std::span<const std::string> names_;
  cache::TextureCache* images_;
  std::map<std::pair<uint32_t, bool>, uint32_t> first_texels_;  // by image, and whether its colour is left out
  PackedLightImages out_;
};

}  // namespace

Result<std::vector<Rgb>> pack_environment(uint32_t image, const cache::ImageInfo& info, cache::TextureCache& images,
                                          std::string_view name) {
  if (info.width != info.height || info.width > kMaxEnvironmentSize)
    return error(
        "{}: has {} x {} texels; the image of an infinite light is a square of at most {}, equal-area octahedral: "
        "convert it (pbrt's imgtool makeequiarea does)",
        name, info.width, info.height, kMaxEnvironmentSize);
  return light_texels(image, info, images, name);
}

Result<PackedLightImages> pack_light_images(std::span<ImageLightInput> lights, std::span<const cache::ImageInfo> infos,
                                            std::span<const std::string> names, cache::TextureCache* images) {
  LightImagePacker packer(infos, names, images);
  for (ImageLightInput& light : lights) SPILLWAY_TRY(packer.add(light));
  return packer.take();
}

}  // namespace spillway::pipeline
