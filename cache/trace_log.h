#pragma once

// What ran when, for a timeline: spans and counters of all threads, written in Chrome's trace format (JSON object
// format, "Trace Event Format", Google 2016), which chrome://tracing and Perfetto open.
//
// Owns: one log of the process, beside the I/O and memory counters; none unless trace_log_start() made it.
// Memory: tag trace_log, kTraceLogEvents events; what comes later is counted and dropped, and the file says how many.
// Threads: spans and counters from any thread, without a lock; start and write when nothing else runs.
// Fails: write, as WriteFile does; without a log everything here is a test of a pointer.

#include <cstdint>
#include <filesystem>

#include "cache/base/result.h"

namespace spillway::cache {

inline constexpr size_t kTraceLogEvents = size_t{1} << 18;

void trace_log_start(size_t event_capacity = kTraceLogEvents);
// Writes what was logged since the start and ends the log.
Status trace_log_write(const std::filesystem::path& path);

// The row of the calling thread is named; else it is "thread N". `name` is a literal.
void trace_log_name_thread(const char* name);
// The value of a counter from now on. `name` is a literal.
void trace_log_counter(const char* name, uint64_t value);

// From construction to destruction, on the calling thread's row. `name` and `category` are literals.
class TraceSpan {
 public:
  explicit TraceSpan(const char* category, const char* name);
  ~TraceSpan();
  TraceSpan(const TraceSpan&) = delete;
  TraceSpan& operator=(const TraceSpan&) = delete;

  // For reads and writes: which bytes of the file.
  void set_range(uint64_t offset_bytes, uint64_t size_bytes) { offset_bytes_ = offset_bytes, size_bytes_ = size_bytes; }

 private:
  const char* category_;
  const char* name_;
  uint64_t begin_ns_ = 0;
  uint64_t offset_bytes_ = 0, size_bytes_ = 0;
};

}  // namespace spillway::cache
