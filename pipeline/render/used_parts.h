#pragma once

// Which stages, caches, columns and tables a run used, and which it left out: a part is left out when its counter is
// zero. Counters are those of the stages, rows those of the tables that the store holds in memory, bytes those of the
// film: nothing here knows what a scene should need.

#include "pipeline/render/render_state.h"

namespace spillway::pipeline {

// All parts there are, in the order of the report. When the frame's counters are in the report.
[[nodiscard]] std::vector<UsedPart> used_parts(const RenderState& state, const RenderReport& report);

}  // namespace spillway::pipeline
