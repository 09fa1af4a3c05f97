#pragma once

// Cuts the scene's triangles into pages, and writes the trace pages.
//
// In:     the spooled scene.
// Out:    pages.trace: pages of the world first, then of the prototypes in their order, each object's in depth-first
//         order of its clustering; one PageLocation and the exact bounds of each page; the pages' checksums, chained.
// Memory: tag pack, within the limit: a set of triangles at a time, 40 bytes each (small objects together, an object
//         that does not fit in several sets), and the pages that are being built. Cutting an object into sets takes a
//         pass over its chunks for each level of cuts, and each set reads the chunks that have a share in it.
// Order:  clustering depends on sets alone; a page's triangles are ordered by prim; pages are built one a thread and
//         written in order. So threads, limit and sets do not reach the file.

#include <functional>
#include <vector>

#include "cache/file.h"
#include "cache/trace_page.h"
#include "pipeline/pack/build_trees.h"
#include "pipeline/pack/mesh_spool.h"
#include "pipeline/pack/pack_report.h"

namespace spillway::pipeline {

struct PackPagesOptions {
  uint32_t max_triangles_per_page = 65536;  // performance; larger: fewer, longer reads
  BuildOptions tree;
  uint64_t memory_limit_bytes = 2ull << 30;  // performance; larger: the spool is read less often
};

// The opacity micromap of a triangle with the uvs given, or empty when all of it is opaque.
using BakeMicromap = std::function<Result<std::vector<std::byte>>(uint32_t texture, const Float2 (&uv)[3])>;

struct PackedPages {
  std::vector<cache::PageLocation> pages;
  std::vector<Bounds3> bounds;  // of each page, in the space of its object
  uint64_t content = 0;
};

Result<PackedPages> pack_pages(const SpooledScene& scene, const BakeMicromap& bake, const PackPagesOptions& options,
                               cache::WriteFile& file, PackReport& report);

}  // namespace spillway::pipeline
