#pragma once

// The numbers as CSV (RFC 4180), for those who draw their own charts; and the rows of other renderers, read back.

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "tools/lab/experiment.h"

namespace spillway::tools::lab {

// A line a render.
[[nodiscard]] std::string rows_csv(std::span<const SceneResult> scenes);
// A line a configuration and number of samples: bands, variance, efficiency, slope.
[[nodiscard]] std::string summary_csv(std::span<const SceneResult> scenes);

// A render of some renderer, as bench/peers.py measured it.
struct PeerRow {
  std::string scene, renderer;
  uint32_t spp = 0, seed = 0;
  double seconds = 0, peak_bytes = 0, rel_mse = 0, flip = 0;
};
// Header: scene,renderer,spp,seed,seconds,peak_bytes,rel_mse,flip. Fails with file and line.
Result<std::vector<PeerRow>> read_peers(const std::filesystem::path& path);

}  // namespace spillway::tools::lab
