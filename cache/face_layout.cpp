#include "cache/face_layout.h"

#include <algorithm>
#include <cmath>

namespace spillway::cache {
namespace {

// Along an edge of a quad, and beyond it.
struct EdgePlace {
  float along, beyond;
};

EdgePlace edge_place(FacePlace p, uint32_t edge) {
  switch (edge) {
    case 0:
      return {p.u, -p.v};
    case 1:
      return {p.v, p.u - 1};
    case 2:
      return {1 - p.u, p.v - 1};
    default:
      return {1 - p.v, -p.u};
  }
}

// The inverse, for a place inside by `depth`.
FacePlace place_inside(float along, float depth, uint32_t edge) {
  switch (edge) {
    case 0:
      return {along, depth};
    case 1:
      return {1 - depth, along};
    case 2:
      return {1 - along, 1 - depth};
    default:
      return {depth, 1 - along};
  }
}

// Seen from across, an edge runs the other way; a subface's edge is half of a whole face's.
FacePlace quad_place_across(FacePlace place, uint32_t edge, bool is_from_subface, const Neighbour& to) {
  const EdgePlace at = edge_place(place, edge);
  if (to.part < 0) return place_inside(1 - at.along, at.beyond, to.edge);
  const auto half = static_cast<float>(to.part);
  if (is_from_subface) return place_inside((1 - at.along + half) / 2, at.beyond / 2, to.edge);
  return place_inside(1 - (2 * at.along - half), 2 * at.beyond, to.edge);
}

// The two triangles make a parallelogram: what the corner opposite the edge weighs here, the other corner weighs
// against.
FacePlace triangle_place_across(FacePlace place, uint32_t edge, uint32_t to_edge) {
  const float weight[3] = {1 - place.u - place.v, place.u, place.v};
  const uint32_t begin = edge, end = (edge + 1) % 3, opposite = (edge + 2) % 3;
  float there[3];
  there[to_edge] = weight[end] + weight[opposite];
  there[(to_edge + 1) % 3] = weight[begin] + weight[opposite];
  there[(to_edge + 2) % 3] = -weight[opposite];
  return {there[1], there[2]};
}

}  // namespace

Neighbour neighbour_across(std::span<const FaceInfo> faces, uint32_t face, uint32_t edge, bool second_half) {
  const FaceInfo& from = faces[face];
  Neighbour to{from.adjacent_faces[edge], from.adjacent_edge(edge), -1};
  if (!to.exists() || faces[to.face].is_subface() == from.is_subface()) return to;
  const FaceInfo& other = faces[to.face];
  if (from.is_subface()) {
    to.part = other.adjacent_faces[to.edge] == face ? 0 : 1;
    return to;
  }
  to.part = second_half ? 1 : 0;
  if (!second_half) return to;
  // The two subfaces of an edge have an edge in common, which ends at its middle.
  const uint32_t shared = (to.edge + 3) % 4;
  to.face = other.adjacent_faces[shared];
  to.edge = (other.adjacent_edge(shared) + 3) % 4;
  return to;
}

FacePlace place_across(FaceShape shape, FacePlace place, uint32_t edge, bool is_from_subface, const Neighbour& to) {
  if (shape == FaceShape::triangle) return triangle_place_across(place, edge, to.edge);
  return quad_place_across(place, edge, is_from_subface, to);
}

float along_edge(FaceShape shape, FacePlace place, uint32_t edge) {
  if (shape == FaceShape::quad) return edge_place(place, edge).along;
  return edge == 0 ? place.u : edge == 1 ? place.v : 1 - place.v;
}

TexelIndex triangle_texel(FacePlace place, int size) {
  const float u = place.u * static_cast<float>(size), v = place.v * static_cast<float>(size);
  const int i = std::clamp(static_cast<int>(u), 0, size - 1), j = std::clamp(static_cast<int>(v), 0, size - 1);
  if (u - static_cast<float>(i) + (v - static_cast<float>(j)) <= 1) return {i, j};
  return {size - 1 - j, size - 1 - i};
}

bool is_regular_corner(std::span<const FaceInfo> faces, uint32_t face, uint32_t corner) {
  uint32_t at = face, edge = corner;
  for (int count = 1; count <= 4; ++count) {
    const Neighbour next = neighbour_across(faces, at, edge, false);
    if (!next.exists()) return false;
    if (faces[at].is_subface() && next.part == 0) return true;
    at = next.face, edge = (next.edge + 1) % 4;
    if (at == face && edge == corner) return count == 4;
  }
  return false;
}

uint32_t first_inconsistent_edge(std::span<const FaceInfo> faces, FaceShape shape, uint32_t face) {
  const FaceInfo& from = faces[face];
  for (uint32_t edge = 0; edge < edge_count(shape); ++edge) {
    if (from.adjacent_faces[edge] == kNoFace) continue;
    if (from.adjacent_faces[edge] >= faces.size() || from.adjacent_edge(edge) >= edge_count(shape)) return edge;
    const Neighbour to = neighbour_across(faces, face, edge, false);
    if (to.part == 0 && !from.is_subface() && neighbour_across(faces, face, edge, true).face >= faces.size())
      return edge;
    if (faces[to.face].adjacent_faces[to.edge] == face && faces[to.face].adjacent_edge(to.edge) == edge) continue;
    // The second subface of a whole face's edge: the first leads to it.
    if (!from.is_subface() || to.part != 1) return edge;
    const uint32_t first_half = faces[to.face].adjacent_faces[to.edge];
    if (first_half != kNoFace && first_half >= faces.size()) return edge;
    const Neighbour back = neighbour_across(faces, to.face, to.edge, false);
    if (!back.exists() || back.face >= faces.size() || back.part != 0) return edge;
    if (faces[back.face].adjacent_faces[(back.edge + 3) % 4] != face) return edge;
  }
  return kNoFace;
}

}  // namespace spillway::cache
