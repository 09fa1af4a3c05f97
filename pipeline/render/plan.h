#pragma once

// How a render uses its memory: one pure function of what the scene weighs, what the budget is and how fast things go.
// The renderer executes the plan, the report shows predicted against actual, `spillway plan` prints it.

#include <cstdint>
#include <string>

#include "cache/base/result.h"

namespace spillway::pipeline {

// What matters of a scene and a frame, in bytes and counts.
struct SceneFacts {
  uint64_t trace_bytes = 0, largest_page_bytes = 0;
  uint64_t attribute_bytes = 0, largest_attribute_block_bytes = 0;
  uint64_t texture_bytes = 0;  // decoded tiles of all images, levels and face textures, and what is read ahead of them
  uint64_t volume_bytes = 0, largest_brick_bytes = 0;
  uint64_t table_bytes = 0;    // manifest tables, page tree, lights, what textures take beside their tiles
  uint64_t film_bytes = 0;
  uint64_t pixel_count = 0;
  uint32_t samples_per_pixel = 1;
  uint32_t max_depth = 5;
  uint16_t has_media = 0, looks_up_emission = 0, has_costs = 0, reserved = 0;  // 0 or 1; no padding: logs hold it
};

// Measured on two cores; they decide between plans, never what is computed.
struct Rates {
  double path_steps_per_second = 2.5e6;
  double read_bytes_per_second = 2.8e9;   // of pages, several in flight
  double spill_bytes_per_second = 0.7e9;  // of records, written or read: the stages wait for most of it
  double wave_overhead_seconds = 2e-4;
  double sweep_overhead_seconds = 4e-3;   // of a wave that needs pages: one of 2 MiB at 1.2 GB/s is waited for at either end
};

// What the user fixes; zero or unset: planned.
struct PlanOptions {
  uint64_t memory_bytes = 0;         // of the whole process; 0: everything is kept in memory
  uint64_t floor_bytes = 0;          // resident before the first table: libraries, code, stacks
  uint64_t wave_paths = 0;
  uint64_t page_bytes = 0, attribute_bytes = 0, texture_bytes = 0, volume_bytes = 0;  // shares
  int spill = -1;                    // 0 never, 1 always, -1 when it pays
  bool parks = true;                 // rays may wait for a sweep outside of waves
  uint64_t parked_rays = 0, park_pairs = 0;  // see Plan
};

struct Plan {
  uint64_t wave_paths = 0;      // camera and continued paths a wave; each may send one shadow ray
  bool spills = false;          // cold columns and hits beyond their limits go to scratch
  bool gives_back = false;      // then: what a stage does not need is freed before it, to be touched again in the next wave
  bool pages_fit = true, attributes_fit = true, textures_fit = true, volumes_fit = true;
  uint64_t page_bytes = 0, attribute_bytes = 0, texture_bytes = 0, volume_bytes = 0;  // limits of the caches
  uint64_t run_bytes = 0;          // segments that wait for bricks of volumes, where those do not fit
  uint64_t read_ahead_bytes = 0;   // of each swept store, inside its limit
  uint64_t pair_bytes = 0;         // (page, ray) pairs of a sweep window
  uint64_t cold_bytes = 0;         // limit of each cold stream in memory
  uint64_t hit_bytes = 0;          // limit of the hit sort
  uint64_t page_top_bytes = 0;     // for the first nodes of all pages, held while not all fit (cache/page_tops.h)
  uint64_t parked_rays = 0;        // of each kind that may wait for a sweep outside of waves
  uint64_t park_pairs = 0;         // visits for which a page is read in the wave that needs it
  uint64_t ray_bytes = 0;          // hot columns, results, orders
  uint32_t epoch_samples = 16;     // largest epoch
  uint32_t first_epoch_samples = 1;
  uint64_t memory_bytes = 0;       // what all of it comes to, floor included
  double predicted_seconds = 0, predicted_steps = 0;  // steps: paths times their bounces
  uint64_t predicted_waves = 0, predicted_page_bytes = 0, predicted_spill_bytes = 0, predicted_scratch_bytes = 0;
};

// Small waves stay near the processor's caches, but each begins with geometry and textures gone from them: 64 Ki paths are 4 %
// faster than 32 Ki, 128 Ki another 2 % for twice the memory. Larger ones only pay when a sweep is to be shared.
inline constexpr uint64_t kInCoreWavePaths = 64 << 10;

// Fails when the budget is too small, naming the smallest that would do.
Result<Plan> plan_render(const SceneFacts& facts, const PlanOptions& options, const Rates& rates = {});

// The least budget found, in whole MiB, at which textures get so many bytes; 0: none, for their share is fixed below.
[[nodiscard]] uint64_t budget_for_textures(const SceneFacts& facts, PlanOptions options, uint64_t texture_bytes);

// For people: one line a fact.
[[nodiscard]] std::string describe(const Plan& plan);

// "1.5 GiB"
[[nodiscard]] std::string bytes_text(uint64_t bytes);

}  // namespace spillway::pipeline
