#include "cache/radix_sort.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/kernel_scene.h"

namespace spillway::cache {
namespace {

template <class Key>
std::vector<KeyIndex<Key>> items(size_t count, Key mask) {
  test::Random random(count);
  std::vector<KeyIndex<Key>> all(count);
  for (size_t i = 0; i < count; ++i)
    all[i] = {static_cast<Key>((uint64_t{random.below(UINT32_MAX)} << 32 | random.below(UINT32_MAX)) & mask), static_cast<uint32_t>(i)};
  return all;
}

template <class Key>
void expect_stable_sort(size_t count, Key mask) {
  auto sorted = items<Key>(count, mask), wanted = sorted, scratch = sorted;
  std::stable_sort(wanted.begin(), wanted.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
  radix_sort(std::span(sorted), std::span(scratch));
  for (size_t i = 0; i < count; ++i) {
    ASSERT_EQ(sorted[i].key, wanted[i].key) << count << ' ' << i;
    ASSERT_EQ(sorted[i].index, wanted[i].index) << count << ' ' << i;
  }
}

TEST(RadixSort, it_is_a_stable_sort_for_any_count_and_any_bits_in_use) {
  for (const size_t count : {0, 1, 2, 255, 256, 1000, 32768, 32769, 200000}) {
    for (const uint32_t mask : {0xffffffffu, 0xffu, 0xff000000u, 0x00ffff00u, 0u}) expect_stable_sort<uint32_t>(count, mask);
    for (const uint64_t mask : {~uint64_t{0}, uint64_t{0xff} << 56, uint64_t{0xffff}}) expect_stable_sort<uint64_t>(count, mask);
  }
}

}  // namespace
}  // namespace spillway::cache
