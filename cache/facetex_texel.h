#pragma once

// Texels of face textures as linear numbers, and back. Alpha is linear already.

#include <cstdint>
#include <memory>
#include <vector>

#include "cache/facetex_file.h"

namespace spillway::cache {

// Numbers of a format decoded: by table where there are 256 or 65536 of them.
class FaceTexDecoder {
 public:
  explicit FaceTexDecoder(const FaceTexFormat& format);

  // Channel `c` of the texel at `texel`.
  [[nodiscard]] float value(const std::byte* texel, uint32_t c) const {
    const bool is_alpha = static_cast<int32_t>(c) == format_.alpha_channel;
    switch (format_.type) {
      case FaceTexelType::uint8:
        return (is_alpha ? plain_ : table_)[static_cast<uint8_t>(texel[c])];
      case FaceTexelType::uint16:
      case FaceTexelType::half: {
        uint16_t bits;
        __builtin_memcpy(&bits, texel + 2 * c, sizeof bits);
        return (is_alpha ? plain_ : table_)[bits];
      }
      case FaceTexelType::float32:
        break;
    }
    float number;
    __builtin_memcpy(&number, texel + 4 * c, sizeof number);
    return number;
  }
  // Of 256 numbers, the values of channel `c`; null of larger types.
  [[nodiscard]] const float* byte_table(uint32_t c) const {
    if (format_.type != FaceTexelType::uint8) return nullptr;
    return static_cast<int32_t>(c) == format_.alpha_channel ? plain_ : table_;
  }
  // The nearest that the format has, at channel `c`.
  void put(float linear, std::byte* texel, uint32_t c) const;
  [[nodiscard]] uint64_t bytes() const { return storage_.size() * sizeof(float); }

 private:
  [[nodiscard]] float decoded(float encoded) const;
  [[nodiscard]] uint32_t nearest(const float* table, uint32_t count, float linear) const;

  FaceTexFormat format_;
  std::vector<float> storage_;
  const float* table_ = nullptr;  // by the encoding
  const float* plain_ = nullptr;  // linear
};

// The next coarser level of a face: means of two or four texels in linear light (of a triangle's four), rounded to the
// nearest. An axis of one texel keeps it.
std::vector<std::byte> halved_face(const FaceTexDecoder& decoder, const FaceTexFormat& format, FaceShape shape,
                                   std::span<const std::byte> texels, uint32_t ulog2, uint32_t vlog2);

}  // namespace spillway::cache
