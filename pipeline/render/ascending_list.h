#pragma once

// Numbers in LEB128 (seven bits a byte, lowest first, the top bit: more follow), as logs hold their ascending lists.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace spillway::pipeline {

inline void put_number(std::vector<std::byte>& bytes, uint64_t value) {
  for (; value >= 0x80; value >>= 7) bytes.push_back(static_cast<std::byte>(value | 0x80));
  bytes.push_back(static_cast<std::byte>(value));
}

// Reads what put_number() wrote; `ok` turns false at the first thing that cannot be.
struct NumberReader {
  const std::byte* at;
  const std::byte* end;
  bool ok = true;

  uint64_t number() {
    uint64_t value = 0;
    for (int shift = 0; shift < 63; shift += 7) {
      if (at == end) break;
      const auto byte = static_cast<uint64_t>(*at++);
      value |= (byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    ok = false;
    return 0;
  }
  // How many items follow, of at least a byte each.
  uint64_t count(uint64_t limit) {
    const uint64_t items = number();
    if (items > limit || items > static_cast<uint64_t>(end - at)) ok = false;
    return ok ? items : 0;
  }
  // The next of ascending items below `limit`, given the one before.
  uint64_t next(uint64_t before, bool is_first, uint64_t limit) {
    const uint64_t step = number();
    if ((!is_first && step == 0) || step >= limit || before + step >= limit) ok = false;
    return ok ? before + step : 0;
  }
};

}  // namespace spillway::pipeline
