#pragma once

// Checksums of bytes (XXH3, 64 bit) and mixing of small integers for keyed random numbers.

#include <cstddef>
#include <cstdint>

namespace spillway {

[[nodiscard]] uint64_t checksum(const void* bytes, size_t size_bytes, uint64_t seed = 0);

// A bijection of 64 bits with good avalanche (Stafford's variant 13 of MurmurHash3's finaliser).
constexpr uint64_t mix64(uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

constexpr uint64_t hash_combine(uint64_t a, uint64_t b) { return mix64(a * 0x9e3779b97f4a7c15ull + b); }

// Uniform in [0, 1) from the upper 24 bits of a 32-bit word.
constexpr float unit_float(uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }

}  // namespace spillway
