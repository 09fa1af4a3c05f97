#include "pipeline/pack/limit_surface.h"

#include "cache/base/check.h"

#include <opensubdiv/bfr/refinerSurfaceFactory.h>
#include <opensubdiv/bfr/surface.h>
#include <opensubdiv/far/error.h>
#include <opensubdiv/far/primvarRefiner.h>
#include <opensubdiv/far/topologyDescriptor.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <shared_mutex>

namespace spillway::pipeline {
namespace {

namespace Bfr = OpenSubdiv::Bfr;
namespace Far = OpenSubdiv::Far;
namespace Sdc = OpenSubdiv::Sdc;

using Refiner = std::unique_ptr<Far::TopologyRefiner>;
using RefinerFactory = Far::TopologyRefinerFactory<Far::TopologyDescriptor>;
using PatchCache = Bfr::SurfaceFactoryCacheThreaded<std::shared_mutex, std::shared_lock<std::shared_mutex>,
                                                    std::unique_lock<std::shared_mutex>>;
using SurfaceFactory = Bfr::RefinerSurfaceFactory<PatchCache>;

// Cages are checked before they come here; the library's standard error is not ours to fill.
void keep_quiet() {
  static const bool once = [] {
    Far::SetErrorCallback([](Far::ErrorType, const char*) {});
    Far::SetWarningCallback([](const char*) {});
    return true;
  }();
  (void)once;
}

Sdc::Options scheme_options(const SubdivisionCage& cage) {
  constexpr Sdc::Options::VtxBoundaryInterpolation kBoundary[] = {
      Sdc::Options::VTX_BOUNDARY_NONE, Sdc::Options::VTX_BOUNDARY_EDGE_ONLY, Sdc::Options::VTX_BOUNDARY_EDGE_AND_CORNER};
  constexpr Sdc::Options::FVarLinearInterpolation kUvs[] = {
      Sdc::Options::FVAR_LINEAR_NONE,          Sdc::Options::FVAR_LINEAR_CORNERS_ONLY,
      Sdc::Options::FVAR_LINEAR_CORNERS_PLUS1, Sdc::Options::FVAR_LINEAR_CORNERS_PLUS2,
      Sdc::Options::FVAR_LINEAR_BOUNDARIES,    Sdc::Options::FVAR_LINEAR_ALL};
  Sdc::Options options;
  options.SetVtxBoundaryInterpolation(kBoundary[static_cast<size_t>(cage.boundary)]);
  options.SetFVarLinearInterpolation(kUvs[static_cast<size_t>(cage.uv_rule)]);
  return options;
}

// The arrays that a descriptor points at.
struct DescriptorArrays {
  std::vector<int> corner_counts, crease_vertices, corner_vertices, holes;
  std::vector<float> crease_sharpness, corner_sharpness;

  explicit DescriptorArrays(const SubdivisionCage& cage) : holes(cage.holes.begin(), cage.holes.end()) {
    for (uint32_t f = 0; f < cage.face_count(); ++f) corner_counts.push_back(static_cast<int>(cage.corner_count(f)));
    for (const SharpEdge& e : cage.sharp_edges) {
      for (const uint32_t vertex : e.vertices) crease_vertices.push_back(static_cast<int>(vertex));
      crease_sharpness.push_back(std::min(e.sharpness, kSharpForEver));
    }
    for (const SharpVertex& v : cage.sharp_vertices) {
      corner_vertices.push_back(static_cast<int>(v.vertex));
      corner_sharpness.push_back(std::min(v.sharpness, kSharpForEver));
    }
  }
};

const int* as_int(const std::vector<uint32_t>& items) { return reinterpret_cast<const int*>(items.data()); }

Refiner make_refiner(const SubdivisionCage& cage) {
  keep_quiet();
  const DescriptorArrays arrays(cage);
  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = static_cast<int>(cage.positions.size());
  descriptor.numFaces = static_cast<int>(cage.face_count());
  descriptor.numVertsPerFace = arrays.corner_counts.data();
  descriptor.vertIndicesPerFace = as_int(cage.indices);
  descriptor.numCreases = static_cast<int>(arrays.crease_sharpness.size());
  descriptor.creaseVertexIndexPairs = arrays.crease_vertices.data();
  descriptor.creaseWeights = arrays.crease_sharpness.data();
  descriptor.numCorners = static_cast<int>(arrays.corner_sharpness.size());
  descriptor.cornerVertexIndices = arrays.corner_vertices.data();
  descriptor.cornerWeights = arrays.corner_sharpness.data();
  descriptor.numHoles = static_cast<int>(arrays.holes.size());
  descriptor.holeIndices = arrays.holes.data();
  Far::TopologyDescriptor::FVarChannel uvs;
  uvs.numValues = static_cast<int>(cage.uvs.size());
  uvs.valueIndices = as_int(cage.uv_indices);
  descriptor.numFVarChannels = cage.uvs.empty() ? 0 : 1;
  descriptor.fvarChannels = &uvs;
  return Refiner(RefinerFactory::Create(descriptor, RefinerFactory::Options(Sdc::SCHEME_CATMARK, scheme_options(cage))));
}

// More do not fit into OpenSubdiv's patch parameters.
constexpr uint32_t kMostLevels = 10;

SurfaceFactory::Options factory_options(const SubdivisionCage& cage, const CageTopology& topology, uint32_t levels) {
  // Semi-sharp features are exact where subdivision has worn them off.
  uint32_t sharp = levels;
  const auto wear_off = [&](float sharpness) {
    if (sharpness < kSharpForEver) sharp = std::max(sharp, static_cast<uint32_t>(std::ceil(sharpness)));
  };
  for (const SharpEdge& e : cage.sharp_edges) wear_off(e.sharpness);
  for (const SharpVertex& v : cage.sharp_vertices) wear_off(v.sharpness);
  SurfaceFactory::Options options;
  options.SetApproxLevelSmooth(static_cast<int>(levels)).SetApproxLevelSharp(static_cast<int>(sharp));
  // OpenSubdiv below 3.6.1 mixes up the points of such neighbourhoods when faces share them (its issue 1353).
  if (!cage.uvs.empty()) options.SetDefaultFVarID(0);
  options.EnableCaching(!topology.has_interior_pair);
  return options;
}

// The points that a patch is evaluated from: what the cage has, and what follows from it.
void gather(const Bfr::Surface<double>& surface, const float* values, int size, std::vector<double>& points) {
  points.resize(static_cast<size_t>(size) * static_cast<size_t>(surface.GetNumPatchPoints()));
  surface.GatherControlPoints(values, size, points.data(), size);
  surface.ComputePatchPoints(points.data(), size);
}

// Of a sequence whose steps shrink by one ratio.
Double3 limit_of(const Double3& a, const Double3& b, const Double3& c) {
  const Double3 d{b.x - a.x, b.y - a.y, b.z - a.z}, e{c.x - b.x, c.y - b.y, c.z - b.z};
  const double squares = d.x * d.x + d.y * d.y + d.z * d.z;
  const double ratio = squares > 0 ? (d.x * e.x + d.y * e.y + d.z * e.z) / squares : 0;
  if (!(ratio > 0 && ratio < 0.9)) return c;
  const double rest = ratio / (1 - ratio);
  return {c.x + rest * e.x, c.y + rest * e.y, c.z + rest * e.z};
}

}  // namespace

// ---- Catmull-Clark ----

struct LimitSurface::Impl {
  const SubdivisionCage& cage;
  const CageTopology& topology;
  Refiner refiner;
  SurfaceFactory factory;
  std::vector<std::unique_ptr<SurfaceFactory>> dart_factories;  // three of ascending levels, when there are darts

  Impl(const SubdivisionCage& c, const CageTopology& t, uint32_t levels)
      : cage(c), topology(t), refiner(make_refiner(c)), factory(*refiner, factory_options(c, t, levels)) {
    if (topology.is_sharp_dart.empty() || levels == 1) return;
    for (const uint32_t l : {kMostLevels - 2, kMostLevels - 1, kMostLevels})
      dart_factories.push_back(std::make_unique<SurfaceFactory>(*refiner, factory_options(c, t, l)));
  }
};

LimitSurface::LimitSurface(const SubdivisionCage& cage, const CageTopology& topology, uint32_t levels)
    : impl_(std::make_unique<Impl>(cage, topology, levels)) {}
LimitSurface::~LimitSurface() = default;

struct LimitFace::Impl {
  const LimitSurface::Impl& surface;
  uint32_t corner_count = 4;
  Bfr::Surface<double> positions{}, uvs{};
  Bfr::Parameterization parameters{};
  std::vector<double> position_points{}, uv_points{};
  uint32_t first_corner = 0;
  Bfr::Surface<double> dart{};
  std::vector<double> dart_points{};

  // Whether the place is a vertex of the cage that is a dart.
  [[nodiscard]] bool is_dart(QuadPlace at) const {
    if (surface.dart_factories.empty() || (at.u != 0 && at.u != 1) || (at.v != 0 && at.v != 1)) return false;
    uint32_t k = at.quad;
    if (corner_count == 4) k = at.v == 0 ? (at.u == 0 ? 0 : 1) : (at.u == 0 ? 3 : 2);
    else if (at.u != 0 || at.v != 0) return false;
    return surface.topology.is_sharp_dart[surface.cage.indices[first_corner + k]];
  }
  [[nodiscard]] Double3 dart_position(const double (&uv)[2]) {
    Double3 p[3];
    for (size_t i = 0; i < 3; ++i) {
      const auto face = static_cast<int>(surface.topology.face[first_corner]);
      SPILLWAY_CHECK(surface.dart_factories[i]->InitVertexSurface(face, &dart), ==, true);
      gather(dart, &surface.cage.positions[0].x, 3, dart_points);
      dart.Evaluate(uv, dart_points.data(), 3, &p[i].x);
    }
    return limit_of(p[0], p[1], p[2]);
  }

  // The library's coordinates of a place, and how far they run over its quad.
  struct Coordinates {
    double uv[2];
    double size;
  };
  [[nodiscard]] Coordinates coordinates(QuadPlace place) const {
    if (!parameters.HasSubFaces()) return {{place.u, place.v}, 1};
    const double inside[2] = {place.u, place.v};
    Coordinates result{{0, 0}, 0.5};
    parameters.ConvertNormalizedSubFaceToCoord(static_cast<int>(place.quad), inside, result.uv);
    return result;
  }
};

LimitFace::LimitFace(const LimitSurface& surface) : impl_(std::make_unique<Impl>(Impl{*surface.impl_})) {}
LimitFace::~LimitFace() = default;

bool LimitSurface::has_face(uint32_t face) const { return impl_->factory.FaceHasLimitSurface(static_cast<int>(face)); }

void LimitFace::set(uint32_t face) {
  const LimitSurface::Impl& surface = impl_->surface;
  const SubdivisionCage& cage = surface.cage;
  const auto f = static_cast<int>(face);
  // Both at once share the work of finding the neighbourhood; without uvs the library wants the simpler call.
  const bool is_set = cage.uvs.empty() ? surface.factory.InitVertexSurface(f, &impl_->positions)
                                       : surface.factory.InitSurfaces(f, &impl_->positions, &impl_->uvs);
  SPILLWAY_CHECK(is_set, ==, true);
  impl_->corner_count = cage.corner_count(face), impl_->first_corner = cage.first_corner[face];
  impl_->parameters = impl_->positions.GetParameterization();
  gather(impl_->positions, &cage.positions[0].x, 3, impl_->position_points);
  if (cage.uvs.empty()) return;
  gather(impl_->uvs, &cage.uvs[0].x, 2, impl_->uv_points);
}

LimitPoint LimitFace::at(QuadPlace place) const {
  const Impl::Coordinates at = impl_->coordinates(place);
  LimitPoint point{};
  impl_->positions.Evaluate(at.uv, impl_->position_points.data(), 3, &point.p.x, &point.du.x, &point.dv.x);
  for (Double3* d : {&point.du, &point.dv}) d->x *= at.size, d->y *= at.size, d->z *= at.size;
  if (impl_->is_dart(place)) point.p = impl_->dart_position(at.uv);
  if (!impl_->surface.cage.uvs.empty()) impl_->uvs.Evaluate(at.uv, impl_->uv_points.data(), 2, point.uv);
  return point;
}

QuadPlace LimitFace::on_edge(uint32_t k, double t) const {
  if (impl_->corner_count == 4) {
    const QuadPlace places[4] = {{0, t, 0}, {0, 1, t}, {0, 1 - t, 1}, {0, 0, 1 - t}};
    return places[k];
  }
  if (t <= 0.5) return {k, 2 * t, 0};
  return {(k + 1) % impl_->corner_count, 0, 2 - 2 * t};
}

// ---- Loop ----

namespace {

// What OpenSubdiv mixes.
struct Point {
  Float3 p{0, 0, 0};
  void Clear() { p = {0, 0, 0}; }
  void AddWithWeight(const Point& other, float weight) { p += other.p * weight; }
};

Refiner make_loop_refiner(size_t vertex_count, std::span<const uint32_t> indices) {
  keep_quiet();
  const std::vector<int> corner_counts(indices.size() / 3, 3);
  const std::vector<int> corners(indices.begin(), indices.end());
  Far::TopologyDescriptor descriptor;
  descriptor.numVertices = static_cast<int>(vertex_count);
  descriptor.numFaces = static_cast<int>(corner_counts.size());
  descriptor.numVertsPerFace = corner_counts.data();
  descriptor.vertIndicesPerFace = corners.data();
  Sdc::Options options;
  options.SetVtxBoundaryInterpolation(Sdc::Options::VTX_BOUNDARY_EDGE_ONLY);
  return Refiner(RefinerFactory::Create(descriptor, RefinerFactory::Options(Sdc::SCHEME_LOOP, options)));
}

std::vector<Point> refined_points(const Far::TopologyRefiner& refiner, std::span<const Float3> positions) {
  std::vector<Point> points(positions.size());
  for (size_t i = 0; i < points.size(); ++i) points[i].p = positions[i];
  const Far::PrimvarRefiner primvars(refiner);
  for (int level = 1; level <= refiner.GetMaxLevel(); ++level) {
    std::vector<Point> finer(static_cast<size_t>(refiner.GetLevel(level).GetNumVertices()));
    primvars.Interpolate(level, points, finer);
    points = std::move(finer);
  }
  return points;
}

LoopMesh limit_mesh(const Far::TopologyRefiner& refiner, const std::vector<Point>& points) {
  std::vector<Point> limit(points.size()), along_u(points.size()), along_v(points.size());
  Far::PrimvarRefiner(refiner).Limit(points, limit, along_u, along_v);
  LoopMesh mesh;
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

Result<LoopMesh> refine_loop(std::span<const Float3> positions, std::span<const uint32_t> indices, uint32_t levels) {
  const Refiner refiner = make_loop_refiner(positions.size(), indices);
  if (!refiner) return error("cannot be subdivided: more than two triangles at an edge?");
  Far::TopologyRefiner::UniformOptions uniform(static_cast<int>(levels));
  uniform.fullTopologyInLastLevel = true;  // limits ask for it
  refiner->RefineUniform(uniform);
  return limit_mesh(*refiner, refined_points(*refiner, positions));
}

}  // namespace spillway::pipeline
