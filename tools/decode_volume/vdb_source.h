#pragma once

// A float grid of an OpenVDB file as a source of samples, read slab by slab.
//
// Memory: the grid's topology (its nodes, and what a leaf has besides samples), where the file has each leaf's samples,
//         and the samples of one slab's leaves. No delayed loading, no memory map.
// Fails:  a missing, empty, wrong or damaged grid, by its name; the library's exceptions end here.

#include <string>

#include "tools/decode_volume/decoded_volume.h"

namespace spillway::tools {

Result<DecodedVolume> open_vdb(const std::string& file, const std::string& grid);

}  // namespace spillway::tools
