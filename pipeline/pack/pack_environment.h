#pragma once

// The image of an infinite light, as an array of linear RGB.
//
// In:     a packed image. Out: its finest level, row by row.
// Memory: the array, 12 bytes a texel, and the tiles that the cache may hold.
// Fails:  images that are not square, or larger than kMaxEnvironmentSize; texels that are negative or not finite.

#include <string_view>
#include <vector>

#include "cache/texture_cache.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

// `name` is the file's, for messages.
Result<std::vector<Rgb>> pack_environment(uint32_t image, const cache::ImageInfo& info, cache::TextureCache& images,
                                          std::string_view name);

}  // namespace spillway::pipeline
