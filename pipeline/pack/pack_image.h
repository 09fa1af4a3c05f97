#pragma once

// Turns any image OpenImageIO reads into a tiled, MIP-mapped TIFF of a store.
//
// 8-bit images stay 8-bit, all others become 32-bit floats; tiles of 64 x 64, uncompressed. Levels are box filtered in
// linear light with exact area weights, down to 1 x 1.
// Decoders of image formats are not ours and not hardened: the work is done in a child process with limits on memory and
// time, whose crash, or end by a limit, is an error that names the file. The child is forked without exec: it uses only
// its one thread, and leaves through _exit, so that nothing of the parent's is run or flushed twice.
// Fails: unreadable, damaged or absurd images; a full disk. Nothing half-written keeps its final name.

#include <cstdint>
#include <filesystem>

#include "cache/base/result.h"
#include "cache/texture_cache.h"

namespace spillway::pipeline {

struct PackImageOptions {
  uint64_t memory_limit_bytes = 8ull << 30;  // of the child's address space
  uint32_t time_limit_seconds = 600;         // of its processor time
};

// Writes textures_directory / "<image_index, five digits>.tif".
Result<cache::ImageInfo> pack_image(const std::filesystem::path& source, cache::TexelEncoding encoding,
                                    const std::filesystem::path& textures_directory, uint32_t image_index,
                                    const PackImageOptions& options);

}  // namespace spillway::pipeline
