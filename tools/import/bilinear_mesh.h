#pragma once

// Shape bilinearmesh: patches over four corners, diced into triangles.
//
// A patch that is a parallelogram, in space and in (u, v), becomes two triangles; any other is diced so finely that
// triangles stay within kPatchError of its size, in space and in (u, v).
// Memory: one shape, at most `most_bytes`: eight bytes of text ask for up to 8192 triangles.
// Fails: lists of the wrong length, indices out of range, too many triangles.

#include "tools/import/params.h"
#include "tools/import/ply.h"

namespace spillway::tools {

inline constexpr double kPatchError = 1.0 / 4096;

Result<PlyMesh> dice_bilinear_mesh(const ParamList& params, Place place, uint64_t most_bytes);

}  // namespace spillway::tools
