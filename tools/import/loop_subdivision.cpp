#include "tools/import/loop_subdivision.h"

#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>

#include <memory>

#include "tools/import/vertex_lists.h"

namespace spillway::tools {
namespace {

namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

// What OpenSubdiv mixes.
struct Point {
  Float3 p{0, 0, 0};
  void Clear() { p = {0, 0, 0}; }
  void AddWithWeight(const Point& other, float weight) { p += other.p * weight; }
};

using Refiner = std::unique_ptr<Far::TopologyRefiner>;

Refiner make_refiner(const PlyMesh& cage) {
  const std::vector<int> corner_counts(cage.indices.size() / 3, 3);
  const std::vector<int> corners(cage.indices.begin(), cage.indices.end());
  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = static_cast<int>(cage.positions.size());
  descriptor.numFaces = static_cast<int>(corner_counts.size());
  descriptor.numVertsPerFace = corner_counts.data();
  descriptor.vertIndicesPerFace = corners.data();
  Sdc::Options options;
  options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
  using Factory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
  return Refiner(Factory::Create(descriptor, Factory::Options(Sdc::SCHEME_LOOP, options)));
}

std::vector<Point> refined_points(const Far::TopologyRefiner& refiner, const PlyMesh& cage) {
  std::vector<Point> points(cage.positions.size());
  for (size_t i = 0; i < points.size(); ++i) points[i].p = cage.positions[i];
  const Far::PrimvarRefiner primvars(refiner);
  for (int level = 1; level <= refiner.GetMaxLevel(); ++level) {
    std::vector<Point> finer(static_cast<size_t>(refiner.GetLevel(level).GetNumVertices()));
    primvars.Interpolate(level, points, finer);
    points = std::move(finer);
  }
  return points;
}

PlyMesh limit_mesh(const Far::TopologyRefiner& refiner, const std::vector<Point>& points) {
  std::vector<Point> limit(points.size()), along_u(points.size()), along_v(points.size());
  Far::PrimvarRefiner(refiner).Limit(points, limit, along_u, along_v);
  PlyMesh mesh;
  for (size_t i = 0; i < limit.size(); ++i) {
    mesh.positions.push_back(limit[i].p);
    const Float3 normal = cross(along_u[i].p, along_v[i].p);
    mesh.normals.push_back(length_squared(normal) > 0 ? normalize(normal) : Float3{0, 0, 0});
  }
  const Far::TopologyLevel& last = refiner.GetLevel(refiner.GetMaxLevel());
  for (int face = 0; face < last.GetNumFaces(); ++face) {
    const Far::ConstIndexArray corners = last.GetFaceVertices(face);
    for (int c = 0; c < 3; ++c) mesh.indices.push_back(static_cast<uint32_t>(corners[c]));
  }
  return mesh;
}

}  // namespace

Result<PlyMesh> subdivide_loop(const ParamList& params, Place place, uint64_t most_bytes) {
  PlyMesh cage;
  SPILLWAY_TRY(read_vertices(params, "loopsubdiv", place, cage));
  SPILLWAY_TRY(read_corners(params, "loopsubdiv", place, 3, cage));
  SPILLWAY_ASSIGN(const int32_t levels, params.integer("levels", 3));
  (void)params.find(ParamType::string, "scheme");  // pbrt knows one
  const uint64_t most = most_bytes / kBytesPerSubdividedTriangle;
  if (levels < 0 || levels > 12 || ((cage.indices.size() / 3) << (2 * levels)) > most)
    return error_at(place, "\"levels\" is {}; it must be from 0 to 12 and make at most {} triangles", levels, most);
  const Refiner refiner = make_refiner(cage);
  if (!refiner)
    return error_at(place, "the mesh of the loopsubdiv cannot be subdivided: more than two triangles at an edge?");
  Far::TopologyRefiner::UniformOptions uniform(levels);
  uniform.fullTopologyInLastLevel = true;  // limits ask for it
  refiner->RefineUniform(uniform);
  return limit_mesh(*refiner, refined_points(*refiner, cage));
}

}  // namespace spillway::tools
