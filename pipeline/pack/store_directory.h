#pragma once

// The directory that a scene is packed into: what may lie there, and what killed processes left.

#include <filesystem>

#include "cache/base/result.h"

namespace spillway::pipeline {

// Makes the directory. Fails when it holds things of others: that is probably a mistake, and packing would write among them.
Status check_store_directory(const std::filesystem::path& directory);

// Removes what packings that were killed left under temporary names.
void remove_temporaries(const std::filesystem::path& directory);

}  // namespace spillway::pipeline
