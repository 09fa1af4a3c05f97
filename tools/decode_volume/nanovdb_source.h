#pragma once

// A float grid of a NanoVDB file as a source of samples. Memory: the whole grid, as the format knows no parts.
// Fails: as open_vdb.

#include <string>

#include "tools/decode_volume/decoded_volume.h"

namespace spillway::tools {

Result<DecodedVolume> open_nanovdb(const std::string& file, const std::string& grid);

}  // namespace spillway::tools
