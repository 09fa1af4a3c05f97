#pragma once

// The baseline: the triangles of a store in one Embree scene in robust mode, traced ray by ray.
//
// Prims with an alpha texture have no micromap here: each is a hit that shading decides, so a picture agrees with ours
// statistically, not bit for bit.

#include <memory>

#include "pipeline/store.h"
#include "tests/support/reference_integrator.h"

namespace spillway::bench {

// World triangles and instances of the store. Fails on scenes it cannot read.
Result<std::unique_ptr<test::Tracer>> embree_tracer(const pipeline::Store& store);

}  // namespace spillway::bench
