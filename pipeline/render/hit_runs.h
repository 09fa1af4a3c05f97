#pragma once

// What a run of sorted hits consists of: surfaces and media, attribute blocks. Runs ascend by triangle, or, in waves
// whose hits are shaded from the last to the first, descend.
//
// All of these are functions of their arguments alone. `descends` says the direction of `hits`.

#include <cstdint>
#include <vector>

#include "cache/external_sort.h"
#include "pipeline/records.h"
#include "pipeline/render/attribute_store.h"

namespace spillway::pipeline {

using SortedHits = cache::SortedRecords<HitRecord>;

struct SurfacesAndMedia {
  SortedHits surfaces, media;
};
// Hits in media have no attributes; they are the last of ascending hits.
[[nodiscard]] SurfacesAndMedia surfaces_and_media(const SortedHits& hits, bool descends);

// How many hits, from the first on, are in order.
[[nodiscard]] size_t run_length(const SortedHits& hits, bool descends);

// How many of a run of surfaces, from the first on, lie in the block.
[[nodiscard]] size_t hits_in_block(const SortedHits& run, const AttributeStore& attributes, uint32_t block,
                                   bool descends);

// The blocks that a run of surfaces needs, in its direction.
[[nodiscard]] std::vector<uint32_t> blocks_touched(SortedHits run, const AttributeStore& attributes, bool descends);

}  // namespace spillway::pipeline
