#pragma once

// How tiles of face textures are compressed. Threads: any number at once.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace spillway::cache {

enum class FaceTexCodec : uint32_t { none, lz4, zstd };

// The same bytes for the same tile with one set of libraries. LZ4 searches long (level 9 of its high-compression mode),
// zstd short (level 1): both unpack fast, which is what counts.
[[nodiscard]] std::vector<std::byte> compress_tile(FaceTexCodec codec, std::span<const std::byte> tile);

// False when `packed` does not unpack to exactly tile.size() bytes.
[[nodiscard]] bool decompress_tile(FaceTexCodec codec, std::span<const std::byte> packed, std::span<std::byte> tile);

// What compress_tile never exceeds.
[[nodiscard]] size_t most_packed_bytes(FaceTexCodec codec, size_t tile_bytes);

}  // namespace spillway::cache
