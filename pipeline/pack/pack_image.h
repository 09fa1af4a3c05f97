#pragma once

// Turns any image OpenImageIO reads into a tiled, MIP-mapped TIFF of a store.
//
// 8-bit images stay 8-bit, all others become 32-bit floats; tiles of 64 x 64, uncompressed. Levels are box filtered in
// linear light with exact area weights, down to 1 x 1.
// Fails: unreadable, damaged or absurd images; a full disk. Nothing half-written keeps its final name.
// Decoders of image formats are not ours and not hardened: an ImageDecoder calls this in a process of its own.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "cache/base/result.h"
#include "cache/texture_cache.h"

namespace spillway::pipeline {

// Writes textures_directory / packed_image_name(image_index).
Result<cache::ImageInfo> pack_image(const std::filesystem::path& source, cache::TexelEncoding encoding,
                                    const std::filesystem::path& textures_directory, uint32_t image_index,
                                    uint64_t memory_limit_bytes);

[[nodiscard]] std::string packed_image_name(uint32_t image_index);
// What the file is called before it is whole.
[[nodiscard]] std::string unfinished_image_name(uint32_t image_index);
// Whether pack_image gives files such names, finished or not.
[[nodiscard]] bool is_packed_image_name(std::string_view name);

}  // namespace spillway::pipeline
