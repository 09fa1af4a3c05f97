#pragma once

// What another budget would have made of a render: the waves of its log, planned and replayed without rendering.
//
// In:     the log of a render; a budget, as for the planner.
// Out:    the plan, and the waves, bytes and seconds that it would come to.
// Memory: the log, and rows of parts. Order: serial, a function of the log and the options alone.
//
// How: the log's sampled paths go through the loop of the renderer (replay_waves.h), ray after ray, each for as many as
// there are to a sample. What their rays need tells how many visit each page that is not in memory: whether it is read at
// once, which rays are parked, and what all in the lot need when it is swept (replay_pages.h); those that were parked go
// on afterwards. Reads then follow from the policy of residency itself (cache/residency.h). Compute is the log's own,
// without what logging took; a byte that is read again costs what the log's probe measured: time, and processors that
// tracing does
// not have. Limits: waves smaller than those of the log need less than is known of them (`finer_than_log`): log with
// small waves, which is what an unlimited budget plans. A ray that meets a page from several instances counts once.
// Attribute blocks are those of whole waves of the log, more than those of the rays that come back from the lot. Textures
// and volumes are not replayed.

#include <string>
#include <vector>

#include "pipeline/render/access_log.h"

namespace spillway::pipeline {

struct ReplayRates {
  double disk_bytes_per_second = 0;       // 0: as the log's probe found
  double spill_bytes_per_second = 0.7e9;  // as the planner's
};

struct Replay {
  Plan plan;
  uint64_t wave_count = 0, page_bytes = 0, attribute_bytes = 0, spill_bytes = 0;
  uint64_t page_sweeps = 0;                                 // of waves and of the lot, that read pages
  double parked_rays = 0, waiting_rays = 0;                 // times that rays were parked, and that they swept
  double compute_seconds = 0, io_seconds = 0, seconds = 0;  // io: what is waited for
  bool finer_than_log = false;
};

// Fails as the planner does, and for a log without waves.
Result<Replay> replay_access(const AccessLog& log, PlanOptions options, const ReplayRates& rates = {});

}  // namespace spillway::pipeline
