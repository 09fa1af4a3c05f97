#pragma once

// How far two pictures are apart, as a table or JSON.

#include <filesystem>

#include "tools/metrics/compare_pictures.h"

namespace spillway::tools {

struct CompareImagesOptions {
  ComparePicturesOptions metrics = {};
  bool json = false;
  std::filesystem::path flip_png = {};        // written when not empty: FLIP, black 0 to white 1
  std::filesystem::path difference_png = {};  // |a - b| / (|b| + 0.1), the largest channel
};

// Prints to stdout, errors to stderr; returns the exit code. b is the reference.
int compare_images(const std::filesystem::path& a, const std::filesystem::path& b,
                   const CompareImagesOptions& options);

}  // namespace spillway::tools
