#pragma once

// Reads that are under way while their caller does something else.
//
// Owns: a few threads, from the first reads on. Memory: none; reads bring their own.
// Threads: one caller; no lock is held over a read.
// Fails: finish() gives the error of the first read, in their order, that failed.

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "cache/base/result.h"

namespace spillway::cache {

class ReadsAhead {
 public:
  using Read = std::function<Status()>;

  ReadsAhead() = default;
  ReadsAhead(const ReadsAhead&) = delete;
  ReadsAhead& operator=(const ReadsAhead&) = delete;
  ~ReadsAhead();  // waits for what is under way

  // Begins them in this order, several at a time. After finish() of those before.
  void begin(std::vector<Read> reads);
  // Waits for all that were begun.
  Status finish();

 private:
  void read_until_ended();

  std::mutex mutex_;  // of all below
  std::condition_variable to_readers_, to_caller_;
  std::vector<Read> reads_;
  size_t next_ = 0, done_ = 0;
  std::optional<Error> failure_;
  size_t failed_ = 0;
  bool ends_ = false;
  std::vector<std::thread> readers_;
};

}  // namespace spillway::cache
