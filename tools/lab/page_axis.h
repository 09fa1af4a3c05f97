#pragma once

// The section of one axis of one scene.

#include <string>

#include "tools/lab/experiment.h"

namespace spillway::tools::lab {

// anchor: of the section, without #.
[[nodiscard]] std::string axis_html(const AxisResult& result, const std::string& anchor);

}  // namespace spillway::tools::lab
