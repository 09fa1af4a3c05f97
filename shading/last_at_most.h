#pragma once

// The search in a distribution.

#include <cstddef>
#include <span>

namespace spillway::shading {

// The last of ascending numbers that is at most u; the first where none is. Without branches on what is looked for,
// which could not be foretold.
inline size_t last_at_most(std::span<const float> ascending, float u) {
  size_t first = 0;
  for (size_t count = ascending.size(); count > 1;) {
    const size_t half = count / 2;
    first = ascending[first + half] <= u ? first + half : first;
    count -= half;
  }
  return first;
}

}  // namespace spillway::shading
