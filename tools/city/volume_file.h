#pragma once

// Writes grids into a .vdb file, through a child process that links OpenVDB: spillway_write_volume, beside the program.
//
// In:     grids of floats from functions of their lattice, asked for column by column, by all threads.
// Out:    one .vdb file of FloatGrids, saved as halves; samples of zero are left out, in leaves of 8^3.
// Memory: one row of leaves at a time; the child holds all grids of the file.
// Order:  leaves in lattice order: the same bytes for any number of threads. The file's identifier, which the library
//         draws at random, is made from the bytes that follow it.
// Fails:  a full disk, a missing or failing child; no file of that name is then left, nor the leaves beside it.

#include <filesystem>
#include <functional>
#include <span>

#include "cache/base/result.h"
#include "tools/city/air.h"

namespace spillway::tools::city {

struct GridToWrite {
  AirGrid grid;
  // Fills the samples above lattice point (x, y, 0), upwards. May be called by several threads at once.
  std::function<void(int32_t x, int32_t y, std::span<float> samples)> fill_column;
};

Status write_volume_file(const std::filesystem::path& file, std::span<const GridToWrite> grids);

}  // namespace spillway::tools::city
