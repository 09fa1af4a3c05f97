#pragma once

// Shape loopsubdiv: a triangle mesh smoothed by Loop's scheme (Loop 1987), refined "levels" times, then moved to the
// limit surface, with its normals.
//
// OpenSubdiv refines. Around vertices of other than three or six triangles its weights are Loop's, pbrt's are Warren's:
// the surfaces differ there by a little. Edges of one triangle stay edges.
// Memory: the refined meshes of all levels; `most_bytes` bounds them.
// Fails: lists of the wrong length, indices out of range, too many levels; meshes OpenSubdiv refuses.

#include "tools/import/params.h"
#include "tools/import/ply.h"

namespace spillway::tools {

Result<PlyMesh> subdivide_loop(const ParamList& params, Place place, uint64_t most_bytes);

}  // namespace spillway::tools
