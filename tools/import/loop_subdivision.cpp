#include "tools/import/loop_subdivision.h"

#include "pipeline/pack/limit_surface.h"
#include "tools/import/vertex_lists.h"

namespace spillway::tools {

Result<PlyMesh> subdivide_loop(const ParamList& params, Place place, uint64_t most_bytes) {
  PlyMesh cage;
  SPILLWAY_TRY(read_vertices(params, "loopsubdiv", place, cage));
  SPILLWAY_TRY(read_corners(params, "loopsubdiv", place, 3, cage));
  SPILLWAY_ASSIGN(const int32_t levels, params.integer("levels", 3));
  (void)params.find(ParamType::string, "scheme");  // pbrt knows one
  const uint64_t most = most_bytes / pipeline::kBytesPerLoopTriangle;
  if (levels < 0 || levels > 12 || ((cage.indices.size() / 3) << (2 * levels)) > most)
    return error_at(place, "\"levels\" is {}; it must be from 0 to 12 and make at most {} triangles", levels, most);
  auto mesh = pipeline::refine_loop(cage.positions, cage.indices, static_cast<uint32_t>(levels));
  if (!mesh) return error_at(place, "the mesh of the loopsubdiv {}", mesh.error().message);
  return PlyMesh{std::move(mesh->positions), std::move(mesh->normals), {}, std::move(mesh->indices), {}, {}};
}

}  // namespace spillway::tools
