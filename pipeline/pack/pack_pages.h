#pragma once

// Plans which triangle goes to which page, and writes the trace pages.
//
// In:     the spooled scene.
// Out:    pages.trace: pages of the world first, then of the prototypes in their order, each object's in depth-first
//         order of its clustering; one PageLocation and the exact bounds of each page.
// Memory: tag pack. Planning: 28 bytes a triangle of one object at a time, and 4 a triangle of the scene. Writing:
//         those 4, and pages in batches that fit the limit; each batch reads the chunks that have a share in it.
// Order:  clustering depends on sets alone; a page's triangles are ordered by prim; pages are built one a thread and
//         written in order. So threads, limit and batches do not reach the file.

#include <functional>
#include <vector>

#include "cache/file.h"
#include "cache/trace_page.h"
#include "pipeline/pack/build_trees.h"
#include "pipeline/pack/mesh_spool.h"

namespace spillway::pipeline {

struct PackPagesOptions {
  uint32_t max_triangles_per_page = 65536;  // performance; larger: fewer, longer reads
  BuildOptions tree;
  uint64_t memory_limit_bytes = 2ull << 30;  // performance; larger: the spool is read less often
};

// The opacity micromap of a triangle with the uvs given, or empty when all of it is opaque.
using BakeMicromap = std::function<Result<std::vector<std::byte>>(uint32_t texture, const Float2 (&uv)[3])>;

struct PagePlan {
  Buffer<uint32_t> page_of_prim;
  std::vector<cache::PageLocation> pages;  // offsets and sizes are set when the pages are written
};

Result<PagePlan> plan_pages(const SpooledScene& scene, const PackPagesOptions& options);

// Sets offset and size of each page of the plan. Returns the pages' bounds, in the space of their object, and chains their
// checksums into `content`.
Result<std::vector<Bounds3>> pack_pages(const SpooledScene& scene, PagePlan& plan, const BakeMicromap& bake,
                                        const PackPagesOptions& options, cache::WriteFile& file, uint64_t& content);

}  // namespace spillway::pipeline
