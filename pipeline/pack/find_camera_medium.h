#pragma once

// Which medium a camera stands in, for scenes that do not say it.
//
// In:     the spooled scene, its meshes numbered; instances; where cameras stand.
// Out:    a medium for each of these places, or none.
// Rule:   from the place, rays go in nine fixed directions and to the middle of the first triangle that divides media, past
//         everything that does not. Of the surface that divides media and is met first, the near side's medium is the
//         ray's vote; a ray that meets none has no vote. Most votes win, and of as many the least number: surfaces that do
//         not close, or are met along an edge, are outvoted. Moving instances stand where they begin.
// Memory: tag pack: a region of the spool. Only triangles that divide media are read; without any, nothing is done.
// Order:  serial, of the surfaces met at one distance the first counts: the same for any threads and memory.

#include <span>
#include <vector>

#include "cache/trace_page.h"
#include "pipeline/pack/mesh_spool.h"

namespace spillway::pipeline {

Result<std::vector<uint32_t>> find_camera_media(const SpooledScene& scene, std::span<const cache::Instance> instances,
                                                std::span<const Float3> eyes_world);

}  // namespace spillway::pipeline
