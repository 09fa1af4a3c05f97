#include "cache/trace_log.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "cache/base/memory.h"
#include "tests/support/small_scene.h"

namespace spillway::cache {
namespace {

using nlohmann::json;

class TraceLogTest : public testing::Test {
 protected:
  json written() {
    const Status status = trace_log_write(file_);
    EXPECT_TRUE(status) << status.error().message;
    std::ifstream stream(file_);
    return json::parse(stream);
  }
  static json events(const json& log, const std::string& phase, const std::string& name) {
    json found = json::array();
    for (const json& event : log["traceEvents"])
      if (event["ph"] == phase && event["name"] == name) found.push_back(event);
    return found;
  }

  test::TemporaryDirectory directory_;
  const std::filesystem::path file_ = directory_.path() / "trace.json";
};

TEST_F(TraceLogTest, spans_lie_within_the_spans_around_them) {
  trace_log_start();
  {
    const TraceSpan outer("stage", "outer");
    const TraceSpan inner("stage", "inner");
  }
  const json log = written();
  const json outer = events(log, "X", "outer"), inner = events(log, "X", "inner");
  ASSERT_EQ(outer.size(), 1u);
  ASSERT_EQ(inner.size(), 1u);
  EXPECT_LE(outer[0]["ts"].get<double>(), inner[0]["ts"].get<double>());
  // Microseconds with three digits: each of the four numbers is rounded by half a nanosecond.
  EXPECT_GE(outer[0]["ts"].get<double>() + outer[0]["dur"].get<double>() + 0.002,
            inner[0]["ts"].get<double>() + inner[0]["dur"].get<double>());
  EXPECT_EQ(outer[0]["tid"], inner[0]["tid"]);
}

TEST_F(TraceLogTest, ranges_counters_and_names_of_threads_are_written) {
  trace_log_start();
  trace_log_counter("live", 7);
  std::thread([] {
    trace_log_name_thread("reader");
    TraceSpan span("read", "pages");
    span.set_range(4096, 100);
  }).join();
  const json log = written();
  EXPECT_EQ(events(log, "C", "live")[0]["args"]["value"], 7);
  const json read = events(log, "X", "pages")[0];
  EXPECT_EQ(read["args"]["offset_bytes"], 4096);
  EXPECT_EQ(read["args"]["size_bytes"], 100);
  bool named = false;
  for (const json& row : events(log, "M", "thread_name"))
    named |= row["tid"] == read["tid"] && row["args"]["name"].get<std::string>().starts_with("reader");
  EXPECT_TRUE(named);
}

TEST_F(TraceLogTest, events_beyond_its_room_are_counted_and_dropped) {
  trace_log_start(10);
  EXPECT_GT(memory_use(MemoryTag::trace_log).current_bytes, 0u);
  for (uint64_t i = 0; i < 25; ++i) trace_log_counter("n", i);
  const json log = written();
  EXPECT_EQ(events(log, "C", "n").size(), 10u);
  EXPECT_EQ(log["otherData"]["dropped_events"], 15);
  EXPECT_EQ(memory_use(MemoryTag::trace_log).current_bytes, 0u);
}

TEST_F(TraceLogTest, without_a_log_nothing_is_kept_and_nothing_can_be_written) {
  { const TraceSpan span("stage", "lost"); }
  EXPECT_FALSE(trace_log_write(file_));
  EXPECT_FALSE(std::filesystem::exists(file_));
}

TEST_F(TraceLogTest, threads_write_at_once_without_losing_events) {
  constexpr int kThreads = 4, kEach = 5000;
  trace_log_start(kThreads * kEach);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t)
    threads.emplace_back([] {
      for (int i = 0; i < kEach; ++i) const TraceSpan span("stage", "short");
    });
  for (std::thread& thread : threads) thread.join();
  const json log = written();
  EXPECT_EQ(events(log, "X", "short").size(), size_t{kThreads} * kEach);
  EXPECT_EQ(log["otherData"]["dropped_events"], 0);
}

}  // namespace
}  // namespace spillway::cache
