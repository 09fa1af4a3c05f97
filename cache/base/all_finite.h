#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace spillway {

// Exact for any input: an exponent of all ones is an infinity or a NaN.
inline bool all_finite(const float* values, size_t count) {
  uint32_t bad = 0;
  for (size_t i = 0; i < count; ++i) {
    uint32_t bits;
    std::memcpy(&bits, values + i, sizeof bits);
    bad |= static_cast<uint32_t>((bits & 0x7f800000u) == 0x7f800000u);
  }
  return bad == 0;
}

}  // namespace spillway
