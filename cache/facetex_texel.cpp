#include "cache/facetex_texel.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "cache/texture_cache.h"

namespace spillway::cache {
namespace {

float number_of(FaceTexelType type, uint32_t bits) {
  if (type == FaceTexelType::uint8) return static_cast<float>(bits) / 255.0f;
  if (type == FaceTexelType::uint16) return static_cast<float>(bits) / 65535.0f;
  return _cvtsh_ss(static_cast<uint16_t>(bits));
}

}  // namespace

FaceTexDecoder::FaceTexDecoder(const FaceTexFormat& format) : format_(format) {
  if (format.type == FaceTexelType::float32) return;
  const uint32_t count = format.type == FaceTexelType::uint8 ? 256 : 65536;
  const bool needs_both = format.encoding != FaceTexEncoding::linear;
  storage_.resize(needs_both ? 2 * count : count);
  for (uint32_t i = 0; i < count; ++i) {
    storage_[i] = number_of(format.type, i);
    if (needs_both) storage_[count + i] = decoded(storage_[i]);
  }
  plain_ = storage_.data();
  table_ = needs_both ? plain_ + count : plain_;
}

float FaceTexDecoder::decoded(float encoded) const {
  switch (format_.encoding) {
    case FaceTexEncoding::linear:
      return encoded;
    case FaceTexEncoding::srgb:
      return linear_from_srgb(encoded);
    case FaceTexEncoding::gamma:
      break;
  }
  return encoded <= 0 ? 0
                      : static_cast<float>(std::pow(static_cast<double>(encoded), static_cast<double>(format_.gamma)));
}

// Tables of integers ascend.
uint32_t FaceTexDecoder::nearest(const float* table, uint32_t count, float linear) const {
  const auto after = static_cast<uint32_t>(std::upper_bound(table, table + count, linear) - table);
  if (after == 0) return 0;
  if (after == count) return count - 1;
  return linear - table[after - 1] <= table[after] - linear ? after - 1 : after;
}

void FaceTexDecoder::put(float linear, std::byte* texel, uint32_t c) const {
  const float* table = static_cast<int32_t>(c) == format_.alpha_channel ? plain_ : table_;
  if (format_.type == FaceTexelType::uint8) {
    texel[c] = static_cast<std::byte>(nearest(table, 256, linear));
  } else if (format_.type == FaceTexelType::uint16) {
    const auto bits = static_cast<uint16_t>(nearest(table, 65536, linear));
    std::memcpy(texel + 2 * c, &bits, sizeof bits);
  } else if (format_.type == FaceTexelType::half) {
    const __m128i halves = _mm_cvtps_ph(_mm_set_ss(linear), _MM_FROUND_TO_NEAREST_INT);
    const auto bits = static_cast<uint16_t>(_mm_cvtsi128_si32(halves));
    std::memcpy(texel + 2 * c, &bits, sizeof bits);
  } else {
    std::memcpy(texel + 4 * c, &linear, sizeof linear);
  }
}

std::vector<std::byte> halved_face(const FaceTexDecoder& decoder, const FaceTexFormat& format, FaceShape shape,
                                   std::span<const std::byte> texels, uint32_t ulog2, uint32_t vlog2) {
  const uint32_t width = 1u << ulog2, last = width - 1;
  const uint32_t out_width = std::max(1u, width / 2), out_height = std::max(1u, (1u << vlog2) / 2);
  const uint32_t dx = ulog2 > 0 ? 1 : 0, dy = vlog2 > 0 ? 1 : 0;
  const size_t size = format.texel_bytes();
  std::vector<std::byte> out(size_t{out_width} * out_height * size);
  const auto at = [&](uint32_t x, uint32_t y) { return texels.data() + (size_t{y} * width + x) * size; };
  std::byte* to = out.data();
  for (uint32_t oy = 0; oy < out_height; ++oy)
    for (uint32_t ox = 0; ox < out_width; ++ox, to += size) {
      const uint32_t x = ox << dx, y = oy << dy;
      const bool is_triangle = shape == FaceShape::triangle && dx != 0;
      // Of a triangle: the three that stand as it does, and the one upside down between them.
      const std::byte* parts[4] = {at(x, y), at(x + dx, y), at(x, y + dy),
                                   is_triangle ? at(last - y, last - x) : at(x + dx, y + dy)};
      for (uint32_t c = 0; c < format.channels; ++c) {
        float sum = 0;
        for (const std::byte* part : parts) sum += decoder.value(part, c);
        decoder.put(sum * 0.25f, to, c);
      }
    }
  return out;
}

}  // namespace spillway::cache
