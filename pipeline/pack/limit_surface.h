#pragma once

// Limit surfaces of subdivision schemes, by OpenSubdiv; its one owner.
//
// Catmull-Clark: a face of four corners is one quad; any other is as many quads as it has corners, quad k from corner k
// (0, 0) over the middle of the edge that leaves it (1, 0) and the centre (1, 1) to the middle of the edge that arrives
// (0, 1). Over a quad, (u, v) runs from 0 to 1; du x dv points outwards.
// At multiples of 2^-levels a position is that of OpenSubdiv's limit masks after as many subdivisions, to the roundings of
// doubles; elsewhere an approximation, closer with more levels. Where one edge that is sharp for ever ends inside the
// surface (a dart), the mask itself is an approximation, whose error about halves with each level: there the limit of
// three levels is taken (Aitken's).
// Memory: the topology, and patches of irregular faces (about 40 KB a kind of neighbourhood).
// Threads: one LimitSurface may have any number of LimitFaces at once, each of one thread.

#include <memory>
#include <vector>

#include "cache/base/result.h"
#include "pipeline/pack/subdivision_cage.h"

namespace spillway::pipeline {

struct Double3 {
  double x, y, z;
};

struct QuadPlace {
  uint32_t quad;
  double u, v;
};

struct LimitPoint {
  Double3 p, du, dv;
  double uv[2];  // zero without uvs
};

class LimitSurface {
 public:
  // Both must outlive it. levels: 1 (a first look: darts as they come) to 10.
  LimitSurface(const SubdivisionCage& cage, const CageTopology& topology, uint32_t levels);
  ~LimitSurface();

  // False for a hole, and at a boundary without surface.
  [[nodiscard]] bool has_face(uint32_t face) const;

 private:
  friend class LimitFace;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

class LimitFace {
 public:
  explicit LimitFace(const LimitSurface& surface);
  ~LimitFace();

  void set(uint32_t face);  // one that has_face()
  [[nodiscard]] LimitPoint at(QuadPlace place) const;
  // On the edge that leaves corner k of the face, at t of its way.
  [[nodiscard]] QuadPlace on_edge(uint32_t k, double t) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// A triangle mesh refined `levels` times by Loop's scheme (Loop 1987) and moved to the limit surface, with its normals
// (zero where there is none). Edges of one triangle stay edges.
struct LoopMesh {
  std::vector<Float3> positions, normals;
  std::vector<uint32_t> indices;
};
// OpenSubdiv's tables and the mesh, measured at levels 8 to 11.
inline constexpr uint64_t kBytesPerLoopTriangle = 280;
// Fails: a mesh that OpenSubdiv refuses. Indices must be in range.
Result<LoopMesh> refine_loop(std::span<const Float3> positions, std::span<const uint32_t> indices, uint32_t levels);

}  // namespace spillway::pipeline
