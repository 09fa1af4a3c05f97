#pragma once

// A stage at work: its seconds in the report, its span in the timeline.

#include <chrono>

#include "cache/trace_log.h"

namespace spillway::pipeline {

using Clock = std::chrono::steady_clock;
[[nodiscard]] inline double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

class StageTimer {
 public:
  StageTimer(const char* stage, double& seconds) : span_("stage", stage), seconds_(seconds) {}
  ~StageTimer() { seconds_ += seconds_since(start_); }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  cache::TraceSpan span_;
  double& seconds_;
  Clock::time_point start_ = Clock::now();
};

}  // namespace spillway::pipeline
