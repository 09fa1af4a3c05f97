// Buffers: what they hold, what is zero, what is counted.

#include "cache/base/memory.h"

#include <gtest/gtest.h>

#include <numeric>

namespace spillway {
namespace {

constexpr MemoryTag kTag = MemoryTag::volumes;
constexpr size_t kLargePage = 2 << 20;

uint64_t counted() { return memory_use(kTag).current_bytes; }

TEST(Buffer, what_it_holds_stays_when_it_grows_and_what_is_new_is_zero) {
  Buffer<uint64_t> numbers;
  size_t held = 0;
  // Below a system page, across one, up to a large page, and beyond several.
  for (const size_t count : {1ull, 100ull, 511ull, 513ull, 100000ull, 262144ull, 262145ull, 3000000ull}) {
    numbers.grow(kTag, count);
    ASSERT_EQ(numbers.size(), count);
    ASSERT_EQ(numbers.capacity(), count);
    for (size_t i = 0; i < count; ++i) ASSERT_EQ(numbers[i], i < held ? i + 7 : 0) << i << " of " << count;
    std::iota(numbers.begin(), numbers.end(), uint64_t{7});
    held = count;
    EXPECT_EQ(counted(), count * sizeof(uint64_t));
    EXPECT_EQ(reinterpret_cast<uintptr_t>(numbers.data()) % (numbers.size_bytes() < kLargePage ? 4096 : kLargePage), 0u);
  }
  numbers = {};
  EXPECT_EQ(counted(), 0u);
}

TEST(Buffer, with_room_enough_it_stays_where_it_is) {
  Buffer<uint32_t> numbers(kTag, 5000);
  std::iota(numbers.begin(), numbers.end(), 0u);
  const uint32_t* const place = numbers.data();
  numbers.set_size(10);
  numbers.grow(kTag, 5000);
  EXPECT_EQ(numbers.data(), place);
  EXPECT_EQ(numbers.size(), 10u);
  EXPECT_EQ(numbers[4999], 4999u);
}

TEST(Buffer, one_that_was_moved_grows_from_nothing) {
  Buffer<uint32_t> numbers(kTag, 3000), taken = std::move(numbers);
  numbers.grow(MemoryTag::film, 10);
  EXPECT_EQ(numbers[9], 0u);
  EXPECT_EQ(counted(), 3000 * sizeof(uint32_t));
  taken.grow(kTag, 4000);
  EXPECT_EQ(counted(), 4000 * sizeof(uint32_t));
}

}  // namespace
}  // namespace spillway
