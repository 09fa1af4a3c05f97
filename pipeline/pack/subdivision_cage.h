#pragma once

// A Catmull-Clark cage as it waits to be diced, and how its faces meet.
//
// Fails: make_cage and cage_topology name the cage and the vertex, face, edge or corner that is wrong.

#include <cstdint>
#include <string>
#include <vector>

#include "cache/base/result.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::pipeline {

// A vertex or face with more neighbours is refused: what dicing costs grows with their square.
inline constexpr uint32_t kMostCorners = 256;
// From here on an edge or vertex stays sharp however often the cage is subdivided.
inline constexpr float kSharpForEver = 10;

// A SubdivisionInput that owns its arrays; `surface` has everything else (its spans are empty).
struct SubdivisionCage {
  MeshInput surface;
  std::vector<Float3> positions;
  std::vector<uint32_t> first_corner;  // of each face, and the number of corners
  std::vector<uint32_t> indices;       // vertex of each corner
  std::vector<Float2> uvs;
  std::vector<uint32_t> uv_indices;    // one a corner when there are uvs
  std::vector<SharpEdge> sharp_edges;
  std::vector<SharpVertex> sharp_vertices;
  std::vector<uint32_t> holes;
  BoundaryRule boundary = BoundaryRule::edges_and_corners;
  UvRule uv_rule = UvRule::corners_plus1;
  TextureId displacement;
  float displacement_scale = 1;

  [[nodiscard]] uint32_t face_count() const { return static_cast<uint32_t>(first_corner.size()) - 1; }
  [[nodiscard]] uint32_t corner_count(uint32_t face) const { return first_corner[face + 1] - first_corner[face]; }
  [[nodiscard]] uint64_t size_bytes() const;
};
Result<SubdivisionCage> make_cage(const SubdivisionInput& input);

inline constexpr uint32_t kNoCorner = UINT32_MAX;

// An edge belongs to the corners from which it leaves; its direction is that of corner[0].
struct CageEdge {
  uint32_t corner[2] = {kNoCorner, kNoCorner};  // ascending; the second is none at the boundary
  float sharpness = 0;
  // Whether the two faces have normals or uvs of their own along it: a sharp edge, a seam of the uvs.
  bool is_split = false;
};

struct CageTopology {
  std::vector<uint32_t> face;     // of each corner
  std::vector<uint32_t> edge;     // that leaves each corner towards the face's next one
  std::vector<CageEdge> edges;
  // Corners around a vertex that split edges do not part share normal and uv: a wedge.
  std::vector<uint32_t> wedge;    // of each corner
  uint32_t wedge_count = 0;
  std::vector<bool> is_hole;      // of each face
  // Of each vertex, whether one edge that is sharp for ever ends there, inside the surface. Empty without any.
  std::vector<bool> is_sharp_dart;
  bool has_interior_pair = false; // an inner vertex of two faces
};
Result<CageTopology> cage_topology(const SubdivisionCage& cage);

}  // namespace spillway::pipeline
