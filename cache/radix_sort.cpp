#include "cache/radix_sort.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>
#include <vector>

#include "cache/base/check.h"
#include "cache/base/parallel.h"

namespace spillway::cache {
namespace {

constexpr int kDigitBits = 8;
constexpr size_t kDigits = size_t{1} << kDigitBits;
// Large enough that a block's scatter outweighs its histogram, small enough that two threads share a small wave.
constexpr size_t kBlock = 1 << 15;

using Histogram = std::array<uint32_t, kDigits>;

template <class Key>
size_t digit(Key key, int shift) {
  return static_cast<size_t>(key >> shift) & (kDigits - 1);
}

// Bits in which not all keys agree.
template <class Key>
Key differing_bits(std::span<const KeyIndex<Key>> items) {
  std::vector<Key> differing(block_count(items.size(), kBlock), 0);
  parallel_blocks(items.size(), kBlock, [&](size_t b, size_t first, size_t last) {
    Key bits = 0;
    for (size_t i = first; i < last; ++i) bits |= items[i].key ^ items[0].key;
    differing[b] = bits;
  });
  Key all = 0;
  for (const Key bits : differing) all |= bits;
  return all;
}

// Counts digits by block, then turns counts into the first place of each (digit, block), digits first.
template <class Key>
void find_places(std::span<const KeyIndex<Key>> from, int shift, std::vector<Histogram>& places) {
  parallel_blocks(from.size(), kBlock, [&](size_t b, size_t first, size_t last) {
    Histogram& h = places[b];
    h.fill(0);
    for (size_t i = first; i < last; ++i) ++h[digit(from[i].key, shift)];
  });
  uint32_t next = 0;
  for (size_t d = 0; d < kDigits; ++d)
    for (Histogram& h : places) next += std::exchange(h[d], next);
}

template <class Key>
void sort_pairs(std::span<KeyIndex<Key>> items, std::span<KeyIndex<Key>> scratch) {
  SPILLWAY_CHECK(scratch.size(), >=, items.size());
  if (items.size() < 2) return;
  const Key differing = differing_bits<Key>(items);
  std::vector<Histogram> places(block_count(items.size(), kBlock));
  std::span<KeyIndex<Key>> from = items, to = scratch.first(items.size());
  for (int shift = 0; shift < static_cast<int>(8 * sizeof(Key)); shift += kDigitBits) {
    if (digit(differing, shift) == 0) continue;
    find_places<Key>(from, shift, places);
    parallel_blocks(from.size(), kBlock, [&](size_t b, size_t first, size_t last) {
      Histogram& h = places[b];
      for (size_t i = first; i < last; ++i) to[h[digit(from[i].key, shift)]++] = from[i];
    });
    std::swap(from, to);
  }
  if (from.data() != items.data()) std::memcpy(static_cast<void*>(items.data()), from.data(), items.size_bytes());
}

}  // namespace

void radix_sort(std::span<KeyIndex<uint32_t>> items, std::span<KeyIndex<uint32_t>> scratch) {
  sort_pairs<uint32_t>(items, scratch);
}

void radix_sort(std::span<KeyIndex<uint64_t>> items, std::span<KeyIndex<uint64_t>> scratch) {
  sort_pairs<uint64_t>(items, scratch);
}

}  // namespace spillway::cache
