#pragma once

// A float grid of a NanoVDB file as a source of samples, read slab by slab. The grid must not be compressed.
//
// Memory: the grid's inner nodes, and the leaves of one slab. The leaves are read twice where the file has their
// checksum. Every node's place is checked before it is used.
// Fails:  as open_vdb.

#include <string>

#include "tools/decode_volume/decoded_volume.h"

namespace spillway::tools {

Result<DecodedVolume> open_nanovdb(const std::string& file, const std::string& grid);

}  // namespace spillway::tools
