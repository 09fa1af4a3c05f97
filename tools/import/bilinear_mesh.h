#pragma once

// Shape bilinearmesh: patches over four corners, diced into triangles.
//
// A patch that is a parallelogram, in space and in (u, v), becomes two triangles; any other is diced so finely that
// triangles stay within kPatchError of its size, in space and in (u, v).
// Fails: lists of the wrong length, indices out of range.

#include "tools/import/params.h"
#include "tools/import/ply.h"

namespace spillway::tools {

inline constexpr double kPatchError = 1.0 / 4096;

Result<PlyMesh> dice_bilinear_mesh(const ParamList& params, Place place);

}  // namespace spillway::tools
