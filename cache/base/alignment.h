#pragma once

// Rounding up.

#include <cstdint>

namespace spillway {

// The least multiple of `alignment` that is no less than n.
[[nodiscard]] constexpr uint64_t aligned(uint64_t n, uint64_t alignment) {
  return (n + alignment - 1) / alignment * alignment;
}

}  // namespace spillway
