#include "cache/external_sort.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/damage.h"
#include "tests/support/kernel_scene.h"
#include "tests/support/small_scene.h"

namespace spillway::cache {
namespace {

struct Item {
  uint64_t value[3];
  friend bool operator==(const Item&, const Item&) = default;
};

struct Keyed {
  SortKey key;
  Item item;
};

// Few different high keys, so that the low one decides; every (high, low) once: a total order.
std::vector<Keyed> keyed_items(size_t count, uint32_t seed) {
  test::Random random(seed);
  std::vector<Keyed> items;
  for (uint64_t i = 0; i < count; ++i)
    items.push_back({{random.below(50), uint64_t{random.below(1000)} << 32 | i}, {{i, i * 3, i * 7}}});
  return items;
}

class ExternalSortTest : public testing::Test {
 protected:
  StreamOptions options(uint64_t memory, uint64_t scratch_limit = 0) {
    auto scratch = Scratch::create(directory_.path(), scratch_limit);
    EXPECT_TRUE(scratch);
    scratch_ = std::move(*scratch);
    return {.what = "hits", .tag = MemoryTag::hits, .purpose = IoPurpose::hits, .memory_limit_bytes = memory,
            .block_bytes = 1 << 14, .scratch = scratch_.get()};
  }
  static Status append(ExternalSort<Item>& sort, std::span<const Keyed> items, size_t batch) {
    for (size_t first = 0; first < items.size(); first += batch) {
      std::vector<SortKey> keys;
      std::vector<Item> records;
      for (const Keyed& k : items.subspan(first, std::min(batch, items.size() - first)))
        keys.push_back(k.key), records.push_back(k.item);
      SPILLWAY_TRY(sort.append(keys, records));
    }
    return sort.finish();
  }
  static std::vector<Item> drain(ExternalSort<Item>& sort) {
    std::vector<Item> all;
    for (size_t p = 0; p < sort.partition_count(); ++p) {
      const auto part = sort.partition(p);
      EXPECT_TRUE(part) << part.error().message;
      if (!part) continue;
      const size_t before = all.size();
      all.resize(before + part->size());
      part->copy_to(all.data() + before);
    }
    return all;
  }
  static std::vector<Item> expected(std::vector<Keyed> items) {
    std::sort(items.begin(), items.end(), [](const Keyed& a, const Keyed& b) { return a.key < b.key; });
    std::vector<Item> sorted;
    for (const Keyed& k : items) sorted.push_back(k.item);
    return sorted;
  }

  test::TemporaryDirectory directory_;
  std::unique_ptr<Scratch> scratch_;
};

TEST_F(ExternalSortTest, the_order_is_that_of_the_keys_for_any_memory_limit) {
  const auto items = keyed_items(60000, 1);
  const auto wanted = expected(items);
  for (const uint64_t memory : {uint64_t{UINT64_MAX}, uint64_t{2} << 20, uint64_t{400} << 10, uint64_t{150} << 10}) {
    ExternalSort<Item> sort(options(memory));
    const Status appended = append(sort, items, 777);
    ASSERT_TRUE(appended) << appended.error().message;
    EXPECT_EQ(sort.size(), items.size());
    EXPECT_EQ(drain(sort) == wanted, true) << memory;
    if (memory == UINT64_MAX) {
      EXPECT_EQ(sort.spilled_bytes(), 0u);
      EXPECT_EQ(sort.partition_count(), 1u);
    } else {
      EXPECT_GE(sort.spilled_bytes(), items.size() * sizeof(Item) / 2);
      EXPECT_GT(sort.partition_count(), 1u);
    }
  }
}

TEST_F(ExternalSortTest, one_key_for_everything_still_sorts_by_the_low_half) {
  auto items = keyed_items(30000, 2);
  for (Keyed& k : items) k.key.high = 5;
  ExternalSort<Item> sort(options(200 << 10));
  ASSERT_TRUE(append(sort, items, 1000));
  EXPECT_TRUE(drain(sort) == expected(items));
}

TEST_F(ExternalSortTest, cleared_it_sorts_anew_and_gives_its_scratch_back) {
  ExternalSort<Item> sort(options(200 << 10));
  ASSERT_TRUE(append(sort, keyed_items(30000, 3), 1000));
  EXPECT_GT(scratch_->used_bytes(), 0u);
  sort.clear();
  EXPECT_EQ(scratch_->used_bytes(), 0u);
  EXPECT_EQ(sort.size(), 0u);
  const auto items = keyed_items(30000, 4);
  ASSERT_TRUE(append(sort, items, 1000));
  EXPECT_TRUE(drain(sort) == expected(items));
}

TEST_F(ExternalSortTest, nothing_is_no_partition) {
  ExternalSort<Item> sort(options(200 << 10));
  ASSERT_TRUE(sort.finish());
  EXPECT_EQ(sort.partition_count(), 0u);
}

TEST_F(ExternalSortTest, its_memory_stays_within_the_limit) {
  const uint64_t limit = 400 << 10, before = memory_use(MemoryTag::hits).current_bytes;
  memory_reset_peaks();
  ExternalSort<Item> sort(options(limit));
  ASSERT_TRUE(append(sort, keyed_items(100000, 5), 500));
  drain(sort);
  EXPECT_LE(memory_use(MemoryTag::hits).peak_bytes - before, limit);
}

TEST_F(ExternalSortTest, a_disk_that_gives_back_other_bytes_is_an_error) {
  ExternalSort<Item> sort(options(200 << 10));
  ASSERT_TRUE(append(sort, keyed_items(30000, 7), 1000));
  const auto first_error = [&]() -> std::string {
    for (size_t p = 0; p < sort.partition_count(); ++p)
      if (const auto part = sort.partition(p); !part) return part.error().message;
    return {};
  };
  for (const uint64_t offset : {0, 23, 24, 1000}) {  // the header has 24 bytes; keys follow, then records
    ASSERT_TRUE(test::damage_scratch_file(directory_.path(), offset));
    EXPECT_NE(first_error().find("came back damaged"), std::string::npos) << offset;
    ASSERT_TRUE(test::damage_scratch_file(directory_.path(), offset));
    EXPECT_EQ(first_error(), "") << offset;
  }
}

TEST_F(ExternalSortTest, a_full_disk_says_how_much_was_in_use_and_how_much_more_was_needed) {
  ExternalSort<Item> sort(options(200 << 10, 300 << 10));
  const Status status = append(sort, keyed_items(100000, 6), 1000);
  ASSERT_FALSE(status);
  for (const char* part : {"scratch disk is full", "bytes are in use", "hits needs", "--scratch"})
    EXPECT_NE(status.error().message.find(part), std::string::npos) << status.error().message;
}

}  // namespace
}  // namespace spillway::cache
