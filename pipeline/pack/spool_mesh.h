#pragma once

// Checks one mesh and puts it into the spool.
//
// In:     a MeshInput, its arrays valid during the call.
// Out:    its triangles in the spool, in the order of the faces without those of zero area, cut into chunks of
//         max_faces_per_chunk; vertices deduplicated by index inside a chunk, in the order of first use.
// Memory: tag pack: four bytes a vertex of the mesh during the call.
// Order:  serial.

#include <cstdint>

#include "pipeline/pack/mesh_spool.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::pipeline {

// Coordinates beyond this are refused: cross products of edges would overflow 32-bit floats (largest 3.4e38).
inline constexpr float kLargestCoordinate = 1e18f;

// `degenerate_count` is raised by the triangles dropped. A mesh without triangles has no chunks.
Result<SpooledMesh> spool_mesh(const MeshInput& input, MeshSpool& spool, uint32_t max_faces_per_chunk,
                               uint64_t& degenerate_count);

}  // namespace spillway::pipeline
