#pragma once

// Opacity micromaps of triangles with an alpha texture (cache/trace_page.h): what the kernel may decide by itself.
//
// Conservative: a micro-triangle is opaque (clear) only if every texel of the finest level that bilinear filtering could
// touch inside it is at least one (zero); everything else is unknown and left to shade_hits.
// Based on: Gruen, Benthin, Woop 2020, Sub-Triangle Opacity Masks for Faster Ray Tracing.

#include <cstddef>
#include <span>
#include <vector>

#include "cache/base/result.h"
#include "cache/texture_cache.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

// Bytes of an OpacityMicromap; empty when the whole triangle is opaque. `images` may be null without image nodes.
Result<std::vector<std::byte>> bake_micromap(const Float2 uv[3], uint32_t alpha_texture,
                                             std::span<const TextureNode> textures,
                                             std::span<const cache::ImageInfo> image_infos,
                                             cache::TextureCache* images);

// Of a triangle that never stops a ray, but must be told of it: an interface between media.
[[nodiscard]] std::vector<std::byte> unknown_micromap();

}  // namespace spillway::pipeline
