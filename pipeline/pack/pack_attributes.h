#pragma once

// Writes the attribute file.
//
// In:     the spooled scene, chunks by ascending prim.
// Out:    attributes.blocks: chunks joined into blocks of at most max_faces_per_block faces, by ascending prim;
//         one AttributeLocation a block, and the checksums of all blocks chained into `content`.
// Memory: tag pack: one block. Nothing spills.
// Order:  serial, bound by the disk; what is in a block follows from the meshes alone, not from the page layout.

#include <vector>

#include "cache/file.h"
#include "pipeline/pack/mesh_spool.h"

namespace spillway::pipeline {

Result<std::vector<AttributeLocation>> pack_attributes(const SpooledScene& scene, uint32_t max_faces_per_block,
                                                       cache::WriteFile& file, uint64_t& content);

}  // namespace spillway::pipeline
