#pragma once

// Our hits beside Embree's on the same rays: which agree, which are ties, and who is right where they differ.

#include <span>

#include "cache/ray.h"
#include "pipeline/store.h"

namespace spillway::bench {

// Prints the counts: hits on alpha masks, which Embree's scene leaves to shading; the same (instance, prim); ties, whose t differ by at most four units in the last place; and every
// other difference with a verdict from double precision: the nearest of both triangles that the exact ray meets.
Status compare_hits(const pipeline::Store& store, std::span<const cache::TraceRay> rays,
                    std::span<const cache::TraceHit> ours, std::span<const cache::TraceHit> embree);

}  // namespace spillway::bench
