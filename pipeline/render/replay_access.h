#pragma once

// What another budget would have made of a render: the waves of its log, planned and replayed without rendering.
//
// In:     the log of a render; a budget, as for the planner.
// Out:    the plan, and the waves, bytes and seconds that it would come to.
// Memory: the log, and rows of parts. Order: serial, a function of the log and the options alone.
//
// How: a wave of the plan begins the next paths of the log's order, as many as its size leaves room for; what its
// camera rays need is what those of the same paths needed, and what its other rays need is what those of the paths of
// the waves before needed. Page reads then follow from the policy of residency itself (cache/residency.h). Compute is
// the log's own, a ray for a ray. Limits: waves smaller than those of the log need less than is known of them
// (`finer_than_log`): log with small waves, which is what an unlimited budget plans. Rays are taken to need the pages
// between them and their hits; a sweep also visits some that come before in the file (a few percent of the pages a
// wave). Textures are not replayed, nor rays that
// are parked: every wave is taken to sweep.

#include <string>
#include <vector>

#include "pipeline/render/access_log.h"

namespace spillway::pipeline {

// Measured on two cores, as are the planner's.
struct ReplayRates {
  double disk_bytes_per_second = 1.0e9;
  double check_bytes_per_second = 1.6e9;  // of pages that come from the disk: checksum and laws, on the tracing threads
  // A path step in a wave beyond the processor's caches takes this much longer to sort, route and shade ...
  double large_wave_seconds_per_step = 1.0e-7;
  // ... and a ray that waits for pages this much longer than one that does not: pairs are listed, and met one by one.
  double wait_seconds_per_ray = 1.0e-7;
};

struct Replay {
  Plan plan;
  uint64_t wave_count = 0, page_bytes = 0, attribute_bytes = 0, spill_bytes = 0;
  uint64_t page_sweeps = 0;  // waves that read pages
  double compute_seconds = 0, io_seconds = 0, seconds = 0;
  bool finer_than_log = false;
};

// Fails as the planner does, and for a log without waves.
Result<Replay> replay_access(const AccessLog& log, PlanOptions options, const ReplayRates& rates = {});

}  // namespace spillway::pipeline
