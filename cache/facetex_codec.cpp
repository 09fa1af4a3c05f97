#include "cache/facetex_codec.h"

#include <lz4.h>
#include <lz4hc.h>
#include <zstd.h>

#include <algorithm>

#include "cache/base/check.h"

namespace spillway::cache {
namespace {

constexpr int kLz4Level = 9, kZstdLevel = 1;

char* chars(std::byte* bytes) { return reinterpret_cast<char*>(bytes); }
const char* chars(const std::byte* bytes) { return reinterpret_cast<const char*>(bytes); }

}  // namespace

size_t most_packed_bytes(FaceTexCodec codec, size_t tile_bytes) {
  switch (codec) {
    case FaceTexCodec::none:
      return tile_bytes;
    case FaceTexCodec::lz4:
      return static_cast<size_t>(LZ4_compressBound(static_cast<int>(tile_bytes)));
    case FaceTexCodec::zstd:
      return ZSTD_compressBound(tile_bytes);
  }
  return tile_bytes;
}

std::vector<std::byte> compress_tile(FaceTexCodec codec, std::span<const std::byte> tile) {
  if (codec == FaceTexCodec::none) return {tile.begin(), tile.end()};
  std::vector<std::byte> packed(most_packed_bytes(codec, tile.size()));
  size_t size;
  if (codec == FaceTexCodec::lz4) {
    size = static_cast<size_t>(LZ4_compress_HC(chars(tile.data()), chars(packed.data()), static_cast<int>(tile.size()),
                                               static_cast<int>(packed.size()), kLz4Level));
  } else {
    size = ZSTD_compress(packed.data(), packed.size(), tile.data(), tile.size(), kZstdLevel);
    SPILLWAY_CHECK(ZSTD_isError(size), ==, 0u);
  }
  SPILLWAY_CHECK(size, >, 0u);
  packed.resize(size);
  return packed;
}

bool decompress_tile(FaceTexCodec codec, std::span<const std::byte> packed, std::span<std::byte> tile) {
  switch (codec) {
    case FaceTexCodec::none:
      if (packed.size() != tile.size()) return false;
      std::copy(packed.begin(), packed.end(), tile.begin());
      return true;
    case FaceTexCodec::lz4:
      return LZ4_decompress_safe(chars(packed.data()), chars(tile.data()), static_cast<int>(packed.size()),
                                 static_cast<int>(tile.size())) == static_cast<int>(tile.size());
    case FaceTexCodec::zstd:
      return ZSTD_decompress(tile.data(), tile.size(), packed.data(), packed.size()) == tile.size();
  }
  return false;
}

}  // namespace spillway::cache
