#include "cache/reads_ahead.h"

#include <gtest/gtest.h>

#include <atomic>

namespace spillway::cache {
namespace {

TEST(ReadsAhead, all_are_done_when_it_has_finished) {
  ReadsAhead ahead;
  for (int round = 0; round < 50; ++round) {
    std::atomic<int> done = 0;
    std::vector<ReadsAhead::Read> reads;
    for (int i = 0; i < round; ++i)
      reads.emplace_back([&]() -> Status {
        ++done;
        return {};
      });
    ahead.begin(std::move(reads));
    ASSERT_TRUE(ahead.finish());
    EXPECT_EQ(done, round);
  }
}

TEST(ReadsAhead, the_error_is_that_of_the_first_that_failed_and_goes_with_it) {
  ReadsAhead ahead;
  std::vector<ReadsAhead::Read> reads;
  for (int i = 0; i < 40; ++i) reads.emplace_back([i]() -> Status { return i < 7 ? Status{} : error("read {}", i); });
  ahead.begin(std::move(reads));
  const Status failed = ahead.finish();
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().message, "read 7");
  ahead.begin({[]() -> Status { return {}; }});
  EXPECT_TRUE(ahead.finish());
}

TEST(ReadsAhead, those_that_began_have_ended_when_it_is_gone) {
  std::atomic<int> begun = 0, ended = 0;
  {
    ReadsAhead ahead;
    std::vector<ReadsAhead::Read> reads;
    for (int i = 0; i < 1000; ++i)
      reads.emplace_back([&]() -> Status {
        ++begun;
        for (int k = 0; k < 100; ++k) std::this_thread::yield();
        ++ended;
        return {};
      });
    ahead.begin(std::move(reads));
  }
  EXPECT_EQ(begun, ended);
}

}  // namespace
}  // namespace spillway::cache
