#pragma once

// Shapes sphere, disk and cylinder, diced into triangles with the surface's own normals and pbrt's (u, v).
//
// Vertices lie on the surface; a chord lies at most kChordError radii below it. Triangles are wound so that
// cross(p1 - p0, p2 - p0) points along the normals: outwards, a disk's along +z.
// Fails: radii, heights and angles that make no surface.

#include "tools/import/params.h"
#include "tools/import/ply.h"

namespace spillway::tools {

// A sphere as large as a 4k picture is off by less than half a pixel.
inline constexpr double kChordError = 1.0 / 4096;

// type: "sphere", "disk" or "cylinder".
Result<PlyMesh> dice_quadric(const std::string& type, const ParamList& params, Place place);

}  // namespace spillway::tools
