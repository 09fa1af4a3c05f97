#pragma once

// Stable parallel radix sort of (key, index) pairs, least significant digit first.
//
// Memory: the caller's two arrays of n pairs (8 bytes a pair with 32-bit keys, 16 with 64-bit ones).
// Threads: those of the current arena; blocks are cut by count alone. Order: by key; equal keys keep their order.
// Passes over digits that are equal in all keys are skipped: a sort costs as much as its keys differ.

#include <cstdint>
#include <span>

namespace spillway::cache {

template <class Key>
struct KeyIndex {
  Key key;
  uint32_t index;
};

// Sorts `items`; `scratch` is as long. The sorted pairs end up in `items`.
void radix_sort(std::span<KeyIndex<uint32_t>> items, std::span<KeyIndex<uint32_t>> scratch);
void radix_sort(std::span<KeyIndex<uint64_t>> items, std::span<KeyIndex<uint64_t>> scratch);

}  // namespace spillway::cache
