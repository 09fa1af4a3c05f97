#pragma once

#include <memory>

#include "cache/base/vec.h"
#include "pipeline/pack/cut_bricks.h"

namespace spillway::tools {

struct DecodedVolume {
  std::unique_ptr<pipeline::SampleSource> samples;
  Affine3 medium_from_lattice;  // sample (i, j, k) stands at the image of (i, j, k)
};

}  // namespace spillway::tools
