#pragma once

// Writes the attribute file.
//
// In:     the spooled scene, chunks by ascending prim.
// Out:    attributes.blocks: chunks joined into blocks of at most max_faces_per_block faces, by ascending prim;
//         one AttributeLocation a block, and the checksums of all blocks chained into `content`.
// Memory: tag pack: some blocks of at most 2 MB, within the limit. Nothing spills.
// Order:  blocks are built side by side and written in order; what is in a block follows from the meshes alone, not
// from
//         the page layout.

#include <vector>

#include "cache/file.h"
#include "pipeline/pack/mesh_spool.h"

namespace spillway::pipeline {

// What the columns of the chunks will take in the file at least: as if everything were as compact as can be.
[[nodiscard]] uint64_t least_attribute_bytes(const std::vector<PlacedChunk>& chunks);

Result<std::vector<AttributeLocation>> pack_attributes(const SpooledScene& scene, uint32_t max_faces_per_block,
                                                       uint64_t memory_limit_bytes, cache::WriteFile& file,
                                                       uint64_t& content);

}  // namespace spillway::pipeline
