#pragma once

// The page: everything in one HTML file that needs no other and no network.

#include <span>
#include <string>

#include "tools/lab/chart.h"
#include "tools/lab/experiment.h"
#include "tools/lab/results.h"

namespace spillway::tools::lab {

struct PageInputs {
  std::span<const SceneResult> scenes;
  std::span<const PeerRow> peers;
  std::string command;       // that made the page
  std::string peers_remark;  // instead of peers, where there are none
  int threads = 1;
  uint32_t seed_count = 0;
};
[[nodiscard]] std::string page_html(const PageInputs& inputs);

// The charts of an axis, with the names of their files: error over samples, seconds and bytes, FLIP, resources.
struct NamedChart {
  std::string name;
  Chart chart;
};
[[nodiscard]] std::vector<NamedChart> charts_of(const AxisResult& result);
[[nodiscard]] Chart peers_chart(const std::string& scene, std::span<const PeerRow> rows);

}  // namespace spillway::tools::lab
