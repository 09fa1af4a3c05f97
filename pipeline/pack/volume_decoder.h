#pragma once

// Packs a grid of a .vdb or .nvdb file into a file of bricks, in a child process.
//
// OpenVDB and NanoVDB are not hardened, and linking OpenVDB costs every process that does it: spillway_decode_volume,
// beside the running program, does the work under limits of memory and time. Its crash is an error that names the file.
// Memory: none here. Fails: as the decoder says; nothing half-written keeps its name.

#include <cstdint>
#include <filesystem>
#include <string>

#include "cache/base/result.h"
#include "cache/base/vec.h"

namespace spillway::pipeline {

struct VolumeDecoderOptions {
  int32_t brick_voxels = 32;
  uint64_t memory_limit_bytes = 8ull << 30;  // of the child's address space
  uint32_t time_limit_seconds = 3600;        // of its processor time
};

// Writes `bricks_file`; returns medium_from_lattice.
Result<Affine3> decode_volume(const std::filesystem::path& source, const std::string& grid,
                              const std::filesystem::path& bricks_file, const VolumeDecoderOptions& options);

// What the child prints when all went well, and how the parent reads it.
[[nodiscard]] std::string volume_answer(const Affine3& medium_from_lattice);

}  // namespace spillway::pipeline
