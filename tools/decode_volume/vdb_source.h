#pragma once

// A float grid of an OpenVDB file as a source of samples, read slab by slab.
//
// Memory: the topology of the grid, and the leaves of one slab. No delayed loading, no memory map.
// Fails:  a missing, empty, wrong or damaged grid, by its name; the library's exceptions end here.

#include <memory>
#include <string>

#include "pipeline/pack/cut_bricks.h"
#include "tools/decode_volume/decoded_volume.h"

namespace spillway::tools {

Result<DecodedVolume> open_vdb(const std::string& file, const std::string& grid);

}  // namespace spillway::tools
