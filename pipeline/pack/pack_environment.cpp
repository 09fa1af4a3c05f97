#include "pipeline/pack/pack_environment.h"

#include <algorithm>

namespace spillway::pipeline {

Result<std::vector<Rgb>> pack_environment(uint32_t image, const cache::ImageInfo& info, cache::TextureCache& images,
                                          std::string_view name) {
  const uint32_t size = info.width;
  if (info.width != info.height || size > kMaxEnvironmentSize)
    return error(
        "{}: has {} x {} texels; the image of an infinite light is a square of at most {}, equal-area octahedral: "
        "convert it (pbrt's imgtool makeequiarea does)",
        name, info.width, info.height, kMaxEnvironmentSize);
  if (const uint64_t at = info.not_finite; at != 0)
    return error("{}: texel ({}, {}) is infinite or no number; light must be finite and not negative", name,
                 (at - 1) % size, (at - 1) / size);
  std::vector<Rgb> texels(size_t{size} * size);
  std::vector<cache::TextureRequest> requests(size);
  std::vector<cache::Texel> row(size);
  const auto place = [&](uint32_t i) { return (static_cast<float>(i) + 0.5f) / static_cast<float>(size); };
  for (uint32_t y = 0; y < size; ++y) {
    for (uint32_t x = 0; x < size; ++x)
      requests[x] = {image, cache::WrapMode::clamp, cache::TexelFilter::point, place(x), 1 - place(y), 0};
    SPILLWAY_TRY(images.look_up(requests, row));
    for (uint32_t x = 0; x < size; ++x) {
      const Rgb texel{row[x].value[0], row[x].value[1], row[x].value[2]};
      if (std::min({texel.r, texel.g, texel.b}) < 0)
        return error("{}: texel ({}, {}) is ({}, {}, {}); light must be finite and not negative", name, x, y, texel.r,
                     texel.g, texel.b);
      texels[size_t{y} * size + x] = texel;
    }
  }
  return texels;
}

}  // namespace spillway::pipeline
