#pragma once

// Which levels of a face a lookup reads, and where their texels lie. For face_lookup.cpp and face_lookup_block.cpp.

#include <algorithm>
#include <cstdint>

#include "cache/face_lookup.h"
#include "cache/texture_cache.h"

namespace spillway::cache {

// Levels of a face that a footprint asks for: one, or two of which the coarser weighs `blend`.
struct FaceLevels {
  uint32_t fine = 0;
  float blend = 0;
};

[[nodiscard]] inline FaceLevels levels_of(const FaceInfo& face, const FaceTextureRequest& request) {
  const float texels = std::max(request.width_u * static_cast<float>(1u << face.ulog2),
                                request.width_v * static_cast<float>(1u << face.vlog2));
  if (!(texels > 1)) return {};
  const float level = std::min(approximate_log2(texels), static_cast<float>(std::max(face.ulog2, face.vlog2)));
  const auto fine = static_cast<uint32_t>(level);
  const float blend = level - static_cast<float>(fine);
  if (request.choice == FaceLevelChoice::stochastic) return {fine + (request.random < blend ? 1u : 0u), 0};
  return {fine, blend};
}

// A face at a level: how many texels it has there, and where they lie.
struct FaceLevel {
  const FaceTexImage* image;
  uint32_t image_index;
  uint32_t x0, y0;
  uint32_t ulog2, vlog2;
  bool is_constant;  // one texel is all of them
};

[[nodiscard]] inline FaceLevel face_level(const FaceTexture& t, uint32_t face, uint32_t level) {
  const FaceInfo& info = t.faces[face];
  const bool is_constant = (info.flags & kFaceIsConstant) != 0;
  const uint32_t index = t.file->first_image(info) + (is_constant ? 0 : level);
  const FaceTexImage& image = t.file->images()[index];
  const uint32_t number = t.numbers[face];
  return {&image,
          index,
          image.x_of(number),
          image.y_of(number),
          reduced_log2(info.ulog2, level),
          reduced_log2(info.vlog2, level),
          is_constant};
}

}  // namespace spillway::cache
