#pragma once

// Packs the images of a scene into the store's textures directory.
//
// In:     image files with their encodings, in the order of their ids.
// Out:    one file and one ImageInfo an image.
// Memory: in child processes, beside the limit: several only when the limit leaves half a GiB for each.
// Order:  an image's file depends on its source alone.

#include <filesystem>
#include <span>
#include <vector>

#include "cache/base/result.h"
#include "cache/texture_cache.h"

namespace spillway::pipeline {

struct ImageSource {
  std::filesystem::path file;
  cache::TexelEncoding encoding;
};

Result<std::vector<cache::ImageInfo>> pack_images(std::span<const ImageSource> sources,
                                                  const std::filesystem::path& textures_directory,
                                                  uint64_t memory_limit_bytes);

// Removes packed images that are none of `keep`, and the directory when it is empty then.
void remove_packed_images(const std::filesystem::path& textures_directory, std::span<const cache::ImageInfo> keep,
                          std::span<const cache::FaceContainerInfo> keep_faces);

}  // namespace spillway::pipeline
