#include "cache/record_stream.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <numeric>

#include "tests/support/damage.h"
#include "tests/support/kernel_scene.h"
#include "tests/support/small_scene.h"

namespace spillway::cache {
namespace {

class RecordStreamTest : public testing::Test {
 protected:
  RecordStream<uint64_t> stream(uint64_t memory, uint64_t scratch_limit = 0) {
    auto scratch = Scratch::create(directory_.path(), scratch_limit);
    EXPECT_TRUE(scratch);
    scratch_ = std::move(*scratch);
    return RecordStream<uint64_t>({.what = "paths", .tag = MemoryTag::paths, .memory_limit_bytes = memory,
                                   .block_bytes = 1 << 14, .scratch = scratch_.get()});
  }
  static std::vector<uint64_t> numbers(uint64_t count) {
    std::vector<uint64_t> all(count);
    std::iota(all.begin(), all.end(), 1000);
    return all;
  }

  test::TemporaryDirectory directory_;
  std::unique_ptr<Scratch> scratch_;
};

TEST_F(RecordStreamTest, what_went_in_comes_out_for_any_memory_limit_and_any_pieces) {
  const auto all = numbers(50000);
  for (const uint64_t memory : {uint64_t{UINT64_MAX}, uint64_t{200} << 10, uint64_t{40} << 10, uint64_t{0}}) {
    auto s = stream(memory);
    test::Random random(1);
    for (size_t first = 0; first < all.size();) {
      const size_t count = std::min<size_t>(1 + random.below(3000), all.size() - first);
      ASSERT_TRUE(s.append(std::span(all).subspan(first, count)));
      first += count;
    }
    ASSERT_TRUE(s.finish());
    EXPECT_EQ(s.size(), all.size());
    EXPECT_EQ(s.spilled_bytes() > 0, memory < all.size() * 8) << memory;
    for (const size_t size : {size_t{s.records_per_block()}, size_t{1}, size_t{999}})
      for (size_t first = 0; first < all.size(); first += size == 1 ? 1237 : size) {
        std::vector<uint64_t> out(std::min(size, all.size() - first));
        ASSERT_TRUE(s.read(first, out));
        ASSERT_TRUE(std::equal(out.begin(), out.end(), all.begin() + static_cast<ptrdiff_t>(first))) << memory << ' ' << first;
      }
  }
}

// The lender takes 16 bytes for every record of 8, as a sort of hits does.
TEST_F(RecordStreamTest, what_is_read_ahead_stays_until_it_is_asked_for_while_its_memory_is_taken_back) {
  const auto all = numbers(50000);
  for (const uint64_t limit : {uint64_t{0}, uint64_t{100} << 10})
    for (const size_t lent : {size_t{0}, size_t{100} << 10, size_t{400} << 10, 16 * all.size() + (100 << 10)}) {
      Buffer<std::byte> memory(MemoryTag::hits, lent);
      auto s = stream(limit);
      ASSERT_TRUE(s.append(all));
      ASSERT_TRUE(s.finish());
      s.read_ahead(memory, 16);
      size_t taken = 0;
      for (size_t first = 0; first < all.size(); first += 777) {
        std::vector<uint64_t> out(std::min<size_t>(777, all.size() - first));
        ASSERT_TRUE(s.read(first, out));
        ASSERT_TRUE(std::equal(out.begin(), out.end(), all.begin() + static_cast<ptrdiff_t>(first))) << lent << ' ' << first;
        const size_t now = std::min(lent, 16 * (first + out.size()));
        std::fill(memory.begin() + taken, memory.begin() + now, std::byte{0xff});
        taken = now;
      }
    }
}

TEST_F(RecordStreamTest, damage_met_ahead_is_told_when_the_block_is_asked_for) {
  Buffer<std::byte> memory(MemoryTag::hits, 1 << 20);  // lent for longer than the stream lives
  auto s = stream(0);
  ASSERT_TRUE(s.append(numbers(30000)));
  ASSERT_TRUE(s.finish());
  ASSERT_TRUE(test::damage_scratch_file(directory_.path(), 3 * (1 << 14) + 100));
  s.read_ahead(memory, 8);
  std::vector<uint64_t> out(s.records_per_block());
  for (uint64_t block = 0; block < 6; ++block) {
    const Status status = s.read(block * s.records_per_block(), out);
    EXPECT_EQ(static_cast<bool>(status), block != 3);
    const std::string message = status ? "came back damaged" : status.error().message;
    EXPECT_NE(message.find("came back damaged"), std::string::npos) << message;
  }
}

TEST_F(RecordStreamTest, pieces_in_parallel_are_the_same_as_one_after_the_other) {
  const auto all = numbers(30000);
  for (const uint64_t memory : {uint64_t{UINT64_MAX}, uint64_t{64} << 10}) {
    auto s = stream(memory);
    std::vector<RecordSpan> pieces;
    for (size_t first = 0; first < all.size(); first += 700)
      pieces.push_back({all.data() + first, std::min<size_t>(700, all.size() - first)});
    ASSERT_TRUE(s.append(std::span<const RecordSpan>(pieces)));
    ASSERT_TRUE(s.finish());
    std::vector<uint64_t> out(all.size());
    ASSERT_TRUE(s.read(0, out));
    EXPECT_EQ(out, all);
  }
}

TEST_F(RecordStreamTest, a_stream_that_stays_in_memory_makes_no_file) {
  auto s = stream(UINT64_MAX);
  ASSERT_TRUE(s.append(numbers(10000)));
  ASSERT_TRUE(s.finish());
  EXPECT_EQ(scratch_->peak_bytes(), 0u);
}

TEST_F(RecordStreamTest, scratch_files_have_no_name_and_their_bytes_come_back) {
  {
    auto s = stream(0);
    ASSERT_TRUE(s.append(numbers(50000)));
    ASSERT_TRUE(s.finish());
    EXPECT_GE(scratch_->used_bytes(), 50000u * 8);
    EXPECT_TRUE(std::filesystem::is_empty(directory_.path()));
    s.clear();
    EXPECT_EQ(scratch_->used_bytes(), 0u);
  }
  EXPECT_EQ(scratch_->used_bytes(), 0u);
}

TEST_F(RecordStreamTest, a_disk_that_gives_back_other_bytes_is_an_error_with_its_place) {
  auto s = stream(0);
  ASSERT_TRUE(s.append(numbers(50000)));
  ASSERT_TRUE(s.finish());
  std::vector<uint64_t> out(s.records_per_block());
  const uint64_t block_bytes = 1 << 14, header_bytes = 32;
  for (const uint64_t offset : {uint64_t{0}, header_bytes - 1, header_bytes, uint64_t{9999}}) {
    ASSERT_TRUE(test::damage_scratch_file(directory_.path(), 2 * block_bytes + offset));
    const Status status = s.read(2 * s.records_per_block(), out);
    ASSERT_FALSE(status) << offset;
    for (const char* part : {"paths", "block 2", "byte 32768", "damaged"})
      EXPECT_NE(status.error().message.find(part), std::string::npos) << status.error().message;
    EXPECT_TRUE(s.read(s.records_per_block(), out)) << "the block before is as it was";
    ASSERT_TRUE(test::damage_scratch_file(directory_.path(), 2 * block_bytes + offset));
    EXPECT_TRUE(s.read(2 * s.records_per_block(), out)) << "and so is this one, once the bit is flipped back";
  }
}

TEST_F(RecordStreamTest, a_disk_that_is_full_is_an_error_that_says_how_much_was_needed) {
  // The limit of file sizes stands for a full disk: writes fail with EFBIG.
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{100 << 10, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  auto s = stream(0);
  Status status = s.append(numbers(100000));
  if (status) status = s.finish();
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("paths needs"), std::string::npos) << status.error().message;
  EXPECT_NE(status.error().message.find("bytes are in use"), std::string::npos) << status.error().message;
}

TEST_F(RecordStreamTest, the_scratch_limit_holds) {
  auto s = stream(0, 100 << 10);
  Status status = s.append(numbers(100000));
  if (status) status = s.finish();
  ASSERT_FALSE(status);
  EXPECT_LE(scratch_->peak_bytes(), 100u << 10);
}

}  // namespace
}  // namespace spillway::cache
