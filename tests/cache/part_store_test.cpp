#include "cache/part_store.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <latch>
#include <numeric>
#include <random>
#include <set>
#include <thread>

#include "cache/base/hash.h"

namespace spillway::cache {
namespace {

// A file of parts with known bytes, in a directory that goes with it.
class PartFile {
 public:
  explicit PartFile(const std::vector<uint64_t>& sizes) {
    std::string name = (std::filesystem::temp_directory_path() / "spillway_parts_XXXXXX").string();
    directory_ = mkdtemp(name.data());
    std::vector<std::byte> bytes;
    for (const uint64_t size : sizes) {
      bytes.resize((bytes.size() + 4095) / 4096 * 4096);
      parts.push_back({bytes.size(), size});
      for (uint64_t i = 0; i < size; ++i) bytes.push_back(expected(parts.size() - 1, i));
    }
    std::ofstream(path(), std::ios::binary).write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
  }
  ~PartFile() { std::filesystem::remove_all(directory_); }

  [[nodiscard]] std::filesystem::path path() const { return directory_ / "parts"; }
  static std::byte expected(size_t part, uint64_t i) { return std::byte(mix64(part * 1000003 + i)); }
  [[nodiscard]] std::vector<uint32_t> all() const {
    std::vector<uint32_t> every(parts.size());
    std::iota(every.begin(), every.end(), 0u);
    return every;
  }

  std::vector<Part> parts;

 private:
  std::filesystem::path directory_;
};

Status check_bytes(std::span<const Part> parts, std::span<const std::byte> bytes, std::string_view where, size_t part) {
  if (bytes.size() != parts[part].size_bytes) return error("{}: wrong size", where);
  for (size_t i = 0; i < bytes.size(); ++i)
    if (bytes[i] != PartFile::expected(part, i)) return error("{}: wrong byte {}", where, i);
  return {};
}

// A store whose visits are checked and whose reads are logged.
struct Harness {
  Harness(const PartFile& part_file, PartStore::Options options, PartStore::Validate validate = {}) : file(part_file) {
    options.access_log = [this](uint32_t part, bool read) { log.emplace_back(part, read); };
    auto opened = PartStore::open(file.path(), file.parts, std::move(options), std::move(validate));
    EXPECT_TRUE(opened) << opened.error().message;
    store = std::move(opened).value();
  }
  Status sweep(std::span<const uint32_t> parts) {
    log.clear();
    visited.clear();
    return store->sweep(parts, [&](uint32_t part, std::span<const std::byte> bytes) {
      visited.push_back(part);
      return check_bytes(file.parts, bytes, "visit", part);
    });
  }
  [[nodiscard]] size_t reads() const {
    return static_cast<size_t>(std::ranges::count_if(log, [](const auto& entry) { return entry.second; }));
  }
  [[nodiscard]] size_t resident_count() const {
    size_t count = 0;
    for (uint32_t part = 0; part < store->size(); ++part) count += !store->resident(part).empty();
    return count;
  }

  const PartFile& file;
  std::unique_ptr<PartStore> store;
  std::vector<std::pair<uint32_t, bool>> log;
  std::vector<uint32_t> visited;
};

const std::vector<uint64_t> kTwelve(12, 8192);

TEST(PartStore, what_fits_is_read_once_and_never_again) {
  const PartFile file({5000, 4096, 70000, 1, 12288});
  Harness h(file, {});
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(h.visited, file.all());
  EXPECT_EQ(h.reads(), 5u);
  EXPECT_TRUE(h.store->all_resident());
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(h.reads(), 0u);
  EXPECT_EQ(h.store->counters().parts_read, 5u);
  EXPECT_EQ(h.store->counters().parts_read_again, 0u);
  EXPECT_EQ(h.store->counters().unique_bytes, 5000u + 4096 + 70000 + 1 + 12288);
  for (uint32_t part = 0; part < 5; ++part)
    EXPECT_TRUE(check_bytes(file.parts, h.store->resident(part), "resident", part));
}

TEST(PartStore, what_fits_takes_no_memory_beyond_its_parts) {
  const PartFile file(kTwelve);
  memory_reset_peaks();
  const uint64_t before = memory_use(MemoryTag::pages).current_bytes;
  Harness h(file, {.memory_limit_bytes = 12 * 8192});
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(memory_use(MemoryTag::pages).peak_bytes - before, 12u * 8192);
}

TEST(PartStore, the_limit_holds_and_each_missing_part_is_read_once_a_sweep) {
  const PartFile file(kTwelve);
  for (uint64_t limit = 8192; limit < 12 * 8192; limit += 4096) {
    memory_reset_peaks();
    const uint64_t before = memory_use(MemoryTag::pages).current_bytes;
    Harness h(file, {.memory_limit_bytes = limit, .read_ahead_bytes = 16384});
    for (int wave = 0; wave < 3; ++wave) {
      const size_t resident = h.resident_count();
      ASSERT_TRUE(h.sweep(file.all()));
      EXPECT_EQ(h.visited, file.all());
      EXPECT_EQ(h.reads(), 12 - resident);
    }
    EXPECT_LE(memory_use(MemoryTag::pages).peak_bytes - before, limit);
    const PartStoreCounters counters = h.store->counters();
    const size_t kept = h.resident_count();
    EXPECT_LT(kept, 12u);
    // All but the kept ones leave after each of three visits.
    EXPECT_EQ(counters.parts_evicted, 3 * (12 - kept));
    EXPECT_EQ(counters.parts_read, kept + 3 * (12 - kept));
    EXPECT_EQ(counters.parts_read_again, 2 * (12 - kept));
    EXPECT_EQ(counters.unique_bytes, 12u * 8192);
    EXPECT_EQ(counters.bytes_read, counters.parts_read * 8192);
  }
}

TEST(PartStore, a_sweep_against_the_file_keeps_the_parts_that_one_along_it_keeps) {
  const PartFile file(kTwelve);
  std::vector<uint32_t> backwards = file.all();
  std::ranges::reverse(backwards);
  std::vector<std::vector<uint32_t>> resident(2);
  for (const bool descends : {false, true}) {
    Harness h(file, {.memory_limit_bytes = 5 * 8192, .read_ahead_bytes = 2 * 8192});
    const std::vector<uint32_t> parts = descends ? backwards : file.all();
    for (size_t wave = 0; wave < 2; ++wave) {
      ASSERT_TRUE(h.sweep(parts));
      EXPECT_EQ(h.visited, parts);
      EXPECT_EQ(h.reads(), wave == 0 ? 12u : 12 - h.resident_count());
      h.store->rebalance();
    }
    for (uint32_t part = 0; part < 12; ++part)
      if (!h.store->resident(part).empty()) resident[descends].push_back(part);
  }
  EXPECT_GT(resident[0].size(), 1u);
  EXPECT_EQ(resident[0], resident[1]);
}

TEST(PartStore, the_smallest_limit_is_named_and_would_do) {
  const PartFile file({4096, 20000, 8192});
  const auto refused = PartStore::open(file.path(), file.parts, {.memory_limit_bytes = 20479}, {});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("20480 bytes would do"), std::string::npos) << refused.error().message;
  Harness h(file, {.memory_limit_bytes = 20480});
  EXPECT_TRUE(h.sweep(file.all()));
}

TEST(PartStore, random_sweeps_see_the_right_bytes_within_any_limit) {
  std::mt19937 random(7);
  std::vector<uint64_t> sizes(60);
  for (uint64_t& size : sizes) size = 1 + random() % 40000;
  const PartFile file(sizes);
  const uint64_t least = PartStore::smallest_limit_bytes(file.parts);
  for (int round = 0; round < 24; ++round) {
    memory_reset_peaks();
    const uint64_t before = memory_use(MemoryTag::attributes).current_bytes;
    const uint64_t limit = least + random() % 600000;
    Harness h(file, {.tag = MemoryTag::attributes,
                     .memory_limit_bytes = limit,
                     .read_ahead_bytes = random() % 200000,
                     .reader_threads = 1 + round % 5,
                     .direct = round % 2 == 1});
    uint64_t parts_read = 0;
    std::set<uint32_t> ever;
    for (int wave = 0; wave < 12; ++wave) {
      std::vector<uint32_t> parts;
      std::ranges::copy_if(file.all(), std::back_inserter(parts), [&](uint32_t) { return random() % 3 != 0; });
      std::vector<std::pair<uint32_t, bool>> expected;
      for (const uint32_t part : parts) expected.emplace_back(part, h.store->resident(part).empty());
      ASSERT_TRUE(h.sweep(parts));
      EXPECT_EQ(h.log, expected);
      parts_read += h.reads();
      ever.insert(parts.begin(), parts.end());
      if (wave % 2 == 0) h.store->rebalance();
    }
    EXPECT_LE(memory_use(MemoryTag::attributes).peak_bytes - before, limit);
    EXPECT_EQ(h.store->counters().parts_read, parts_read);
    EXPECT_EQ(h.store->counters().parts_read_again, parts_read - ever.size());
  }
}

TEST(PartStore, reads_are_in_flight_together) {
  // The first part's validation returns only when the second's has begun: with one read at a time this would hang.
  const PartFile file({4096, 4096, 4096});
  std::latch both(2);
  Harness h(file, {.memory_limit_bytes = 8192, .reader_threads = 2},
            [&](std::span<const std::byte>, std::string_view where) -> Status {
              if (where.find("part 2") == std::string_view::npos) both.arrive_and_wait();
              return {};
            });
  EXPECT_TRUE(h.sweep(file.all()));
}

TEST(PartStore, a_part_that_validation_refuses_is_an_error_with_its_place) {
  const PartFile file(kTwelve);
  for (const uint64_t limit : {uint64_t{8192}, uint64_t{40000}, UINT64_MAX}) {
    const uint64_t before = memory_use(MemoryTag::pages).current_bytes;
    {
      Harness h(file, {.memory_limit_bytes = limit}, [](std::span<const std::byte> bytes, std::string_view where) {
        return bytes[77] == PartFile::expected(5, 77) ? Status(error("{}: damaged", where)) : Status();
      });
      const Status status = h.sweep(file.all());
      ASSERT_FALSE(status);
      EXPECT_EQ(status.error().message, file.path().string() + ": part 5 at byte 40960: damaged");
      EXPECT_EQ(h.visited, (std::vector<uint32_t>{0, 1, 2, 3, 4}));
      EXPECT_TRUE(h.store->resident(5).empty());
      // The store goes on without it.
      EXPECT_TRUE(h.sweep(std::vector<uint32_t>{0, 1, 2, 3, 4, 6, 7, 8, 9, 10, 11}));
      EXPECT_LE(memory_use(MemoryTag::pages).current_bytes - before, limit);
    }
    EXPECT_EQ(memory_use(MemoryTag::pages).current_bytes, before);
  }
}

TEST(PartStore, bytes_that_were_valid_are_known_again_and_others_validated) {
  const PartFile file(kTwelve);
  std::atomic<uint64_t> validated = 0;
  Harness h(file, {.memory_limit_bytes = 40000}, [&](std::span<const std::byte> bytes, std::string_view where) {
    ++validated;
    return bytes[77] == std::byte(0xee) ? Status(error("{}: damaged", where)) : Status();
  });
  for (int wave = 0; wave < 3; ++wave) ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(validated, 12u);
  EXPECT_GT(h.store->counters().parts_read, 24u);
  ASSERT_TRUE(h.store->resident(11).empty());
  {
    std::fstream bytes(file.path(), std::ios::binary | std::ios::in | std::ios::out);
    bytes.seekp(static_cast<std::streamoff>(file.parts[11].offset_bytes + 77));
    bytes.put(static_cast<char>(0xee));
  }
  const Status status = h.sweep(file.all());
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("part 11 at byte"), std::string::npos) << status.error().message;
  EXPECT_EQ(validated, 13u);
}

TEST(PartStore, a_file_cut_after_opening_is_an_error_with_its_place) {
  const PartFile file(kTwelve);
  Harness h(file, {.memory_limit_bytes = 20000});
  std::filesystem::resize_file(file.path(), 7 * 8192 + 100);
  const Status status = h.sweep(file.all());
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("part 7 at byte 57344"), std::string::npos) << status.error().message;
  EXPECT_EQ(h.visited.size(), 7u);
}

TEST(PartStore, tables_that_do_not_fit_the_file_are_refused) {
  const PartFile file({4096, 4096});
  for (const Part bad : {Part{100, 50}, Part{4096, 4097}, Part{8192, 1}, Part{0, 0}, Part{4096, UINT64_MAX}}) {
    const auto opened = PartStore::open(file.path(), {{0, 4096}, bad}, {}, {});
    ASSERT_FALSE(opened) << bad.offset_bytes << " " << bad.size_bytes;
    EXPECT_NE(opened.error().message.find("part 1"), std::string::npos);
  }
  EXPECT_FALSE(PartStore::open(file.path().string() + ".not", file.parts, {}, {}));
}

TEST(PartStore, a_visitor_that_fails_ends_the_sweep_and_leaves_nothing_behind) {
  const PartFile file(kTwelve);
  Harness h(file, {.memory_limit_bytes = 50000});
  const Status status = h.store->sweep(file.all(), [](uint32_t part, std::span<const std::byte>) {
    return part == 3 ? Status(error("enough")) : Status();
  });
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().message, "enough");
  EXPECT_LE(h.resident_count(), 3u);
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(h.visited, file.all());
}

TEST(PartStore, rebalance_prefers_parts_that_more_waves_ask_for) {
  const PartFile file(kTwelve);
  // Room for four parts beside a ring of two.
  Harness h(file, {.memory_limit_bytes = 6 * 8192, .read_ahead_bytes = 0});
  std::vector<const std::byte*> views(12, nullptr);
  h.store->on_residency([&](uint32_t part, std::span<const std::byte> bytes) { views[part] = bytes.data(); });
  ASSERT_TRUE(h.sweep(file.all()));
  for (uint32_t part = 0; part < 4; ++part) EXPECT_FALSE(h.store->resident(part).empty());
  h.store->rebalance();
  const std::vector<uint32_t> late = {3, 8, 9, 10};
  for (int wave = 0; wave < 8; ++wave) {
    ASSERT_TRUE(h.sweep(late));
    h.store->rebalance();
  }
  ASSERT_TRUE(h.sweep(late));
  EXPECT_EQ(h.reads(), 0u);
  for (uint32_t part = 0; part < 12; ++part) EXPECT_EQ(views[part], h.store->resident(part).data());
}

TEST(PartStore, parts_used_without_a_sweep_stay) {
  const PartFile file(kTwelve);
  Harness h(file, {.memory_limit_bytes = 6 * 8192, .read_ahead_bytes = 0});
  ASSERT_TRUE(h.sweep(file.all()));
  const uint64_t evicted = h.store->counters().parts_evicted;
  for (int wave = 0; wave < 8; ++wave) {
    for (uint32_t part = 0; part < 4; ++part) h.store->note_use(part);
    ASSERT_TRUE(h.sweep(std::vector<uint32_t>{8, 9, 10}));
    h.store->rebalance();
  }
  for (uint32_t part = 0; part < 4; ++part) EXPECT_FALSE(h.store->resident(part).empty());
  EXPECT_EQ(h.store->counters().parts_evicted, evicted + 8 * 3);
}

TEST(PartStore, memory_does_not_move_once_the_room_is_full) {
  const PartFile file(kTwelve);
  Harness h(file, {.memory_limit_bytes = 50000});
  ASSERT_TRUE(h.sweep(file.all()));
  memory_reset_peaks();
  const MemoryUse before = memory_use(MemoryTag::pages);
  for (int wave = 0; wave < 3; ++wave) ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(memory_use(MemoryTag::pages).current_bytes, before.current_bytes);
  EXPECT_EQ(memory_use(MemoryTag::pages).peak_bytes, before.current_bytes);
}

// ---- reads that begin before their sweep ----

TEST(PartStore, parts_that_are_read_early_are_visited_first_and_read_once) {
  const PartFile file(kTwelve);
  // Room for four parts beside a ring of two.
  Harness h(file, {.memory_limit_bytes = 6 * 8192, .read_ahead_bytes = 0});
  ASSERT_TRUE(h.sweep(file.all()));
  memory_reset_peaks();
  const MemoryUse before = memory_use(MemoryTag::pages);
  EXPECT_TRUE(h.store->read_early(9));
  EXPECT_TRUE(h.store->read_early(6));
  EXPECT_FALSE(h.store->read_early(9));   // begun
  EXPECT_FALSE(h.store->read_early(0));   // in memory
  EXPECT_FALSE(h.store->read_early(11));  // the ring holds two
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(h.visited, (std::vector<uint32_t>{9, 6, 0, 1, 2, 3, 4, 5, 7, 8, 10, 11}));
  EXPECT_EQ(h.reads(), 8u);
  EXPECT_EQ(h.store->counters().parts_read, 12u + 8);
  EXPECT_EQ(memory_use(MemoryTag::pages).peak_bytes, before.current_bytes);
  EXPECT_TRUE(h.store->read_early(11));
  std::vector<uint32_t> backwards = file.all();
  std::ranges::reverse(backwards);
  ASSERT_TRUE(h.sweep(backwards));
  EXPECT_EQ(h.visited, backwards);
}

TEST(PartStore, parts_that_are_read_early_stay_when_there_is_room) {
  const PartFile file(kTwelve);
  Harness h(file, {.memory_limit_bytes = 6 * 8192, .read_ahead_bytes = 0});
  for (const uint32_t part : {8u, 2u, 11u, 5u, 0u, 1u}) EXPECT_TRUE(h.store->read_early(part));
  EXPECT_FALSE(h.store->read_early(3));
  ASSERT_TRUE(h.sweep(file.all()));
  for (const uint32_t part : {2u, 5u, 8u, 11u}) EXPECT_FALSE(h.store->resident(part).empty());
  EXPECT_EQ(h.store->counters().parts_read, 12u);
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(h.reads(), 8u);
}

TEST(PartStore, what_is_read_early_and_not_asked_for_is_dropped) {
  const PartFile file(kTwelve);
  Harness h(file, {.memory_limit_bytes = 6 * 8192, .read_ahead_bytes = 0});
  EXPECT_TRUE(h.store->read_early(7));  // would stay
  ASSERT_TRUE(h.sweep(std::vector<uint32_t>{1, 2, 3, 4}));
  EXPECT_EQ(h.visited, (std::vector<uint32_t>{1, 2, 3, 4}));
  EXPECT_TRUE(h.store->resident(7).empty());
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_TRUE(h.store->read_early(9));  // would not
  ASSERT_TRUE(h.sweep(std::vector<uint32_t>{8, 10}));
  EXPECT_EQ(h.visited, (std::vector<uint32_t>{8, 10}));
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(h.visited, file.all());
}

TEST(PartStore, an_early_read_that_fails_fails_the_sweep_that_asks_for_it) {
  const PartFile file(kTwelve);
  bool refuses = true;
  Harness h(file, {.memory_limit_bytes = 6 * 8192, .read_ahead_bytes = 0},
            [&](std::span<const std::byte>, std::string_view where) {
              return refuses && where.find("part 9 ") != std::string_view::npos ? Status(error("{}: refused", where))
                                                                                : Status();
            });
  EXPECT_TRUE(h.store->read_early(9));
  EXPECT_TRUE(h.sweep(std::vector<uint32_t>{1, 2}));
  EXPECT_TRUE(h.store->read_early(9));
  const Status status = h.sweep(file.all());
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("part 9 at byte 73728: refused"), std::string::npos) << status.error().message;
  refuses = false;
  ASSERT_TRUE(h.sweep(file.all()));
  EXPECT_EQ(h.visited, file.all());
}

TEST(PartStore, random_early_reads_by_many_threads_change_no_byte) {
  const PartFile file(std::vector<uint64_t>(40, 20000));
  std::mt19937 random(3);
  Harness h(file, {.memory_limit_bytes = 300000});
  for (int wave = 0; wave < 40; ++wave) {
    std::vector<std::thread> threads;
    for (int t = 0; t < 3; ++t)
      threads.emplace_back([&h, part = random() % 40] {
        for (uint32_t i = 0; i < 5; ++i) h.store->read_early(static_cast<uint32_t>(part + 7 * i) % 40);
      });
    for (std::thread& thread : threads) thread.join();
    ASSERT_TRUE(h.sweep(file.all()));
    std::ranges::sort(h.visited);
    ASSERT_EQ(h.visited, file.all());
    h.store->rebalance();
  }
  EXPECT_EQ(h.store->counters().unique_bytes, 40u * 20000);
}

}  // namespace
}  // namespace spillway::cache
