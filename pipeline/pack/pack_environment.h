#pragma once

// The images of lights, as arrays of linear RGB: of the infinite one, and of goniometric lights and projections.
//
// In:     packed images. Out: their finest levels, row by row, an image once however many lights throw it.
// Memory: the arrays, 12 bytes a texel, and the tiles that the cache may hold.
// Fails:  images of the wrong shape, or larger than allowed; texels that are negative or not finite; a light without
//         light that is to have a power. Messages begin with the light's name, or the file's.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cache/texture_cache.h"
#include "pipeline/pack/scene_sink.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

// `name` is the file's, for messages.
Result<std::vector<Rgb>> pack_environment(uint32_t image, const cache::ImageInfo& info, cache::TextureCache& images,
                                          std::string_view name);

struct PackedLightImages {
  std::vector<shading::LightImage> images;  // one a light
  std::vector<Rgb> texels;
};

// infos, names: of all packed images. Lights that were given by their power get their radiance.
Result<PackedLightImages> pack_light_images(std::span<ImageLightInput> lights, std::span<const cache::ImageInfo> infos,
                                            std::span<const std::string> names, cache::TextureCache* images);

}  // namespace spillway::pipeline
