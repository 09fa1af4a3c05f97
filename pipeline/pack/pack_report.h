#pragma once

// What each step of a packing cost: for the closing table, report.json and the benchmarks.

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/pack/dice_subdivision.h"

namespace spillway::pipeline {

struct PackStep {
  std::string name;
  double seconds = 0;         // of the clock
  double thread_seconds = 0;  // of all threads inside, where they are counted; else 0
  uint64_t read_bytes = 0, written_bytes = 0;
};

struct PackReport {
  std::vector<PackStep> steps;  // in the order of their first beginning
  double seconds = 0;
  uint64_t triangle_count = 0, instance_count = 0, mesh_count = 0, page_count = 0, attribute_block_count = 0;
  uint64_t set_count = 0;   // of triangles held at a time
  uint64_t pass_count = 0;  // over the triangles of objects that could not be held, to cut them
  uint64_t largest_set_triangles = 0;
  DiceReport dice;
  std::vector<std::string> notes;  // what was decided that the scene does not say

  PackStep& step(const std::string& name);
};

// A step at work, from here to the end of the scope; times of several add up.
class PackStepTimer {
 public:
  PackStepTimer(PackReport& report, const std::string& name);
  ~PackStepTimer();
  PackStepTimer(const PackStepTimer&) = delete;
  PackStepTimer& operator=(const PackStepTimer&) = delete;

 private:
  PackReport& report_;
  std::string name_;
  uint64_t read_bytes_, written_bytes_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

[[nodiscard]] std::string report_json(const PackReport& report);
// The closing table.
[[nodiscard]] std::string report_table(const PackReport& report);

}  // namespace spillway::pipeline
