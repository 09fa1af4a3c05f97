#pragma once

// The lists that shapes given as text share: P, N, uv, indices.

#include "tools/import/params.h"
#include "tools/import/ply.h"

namespace spillway::tools {

// "point3 P", and, where there are any, "normal3 N" and "point2 uv", one item a vertex.
Status read_vertices(const ParamList& params, std::string_view shape, Place place, PlyMesh& mesh);
// "integer indices", `corners` a face; may be absent when there are just as many vertices.
Status read_corners(const ParamList& params, std::string_view shape, Place place, size_t corners, PlyMesh& mesh);

}  // namespace spillway::tools
