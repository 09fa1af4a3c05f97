#pragma once

// What spillway_write_volume reads: files of these, one a leaf of the grid that holds anything.

#include <cstdint>

namespace spillway::tools::city {

inline constexpr int32_t kLeafSide = 8;

struct LeafRecord {
  int32_t origin[3];                                  // multiples of kLeafSide
  float samples[kLeafSide * kLeafSide * kLeafSide];   // z fastest, as the library has them
};
static_assert(sizeof(LeafRecord) == 12 + 4 * 512);

}  // namespace spillway::tools::city
