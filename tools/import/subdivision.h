#pragma once

// Shape subdivmesh, our extension: a Catmull-Clark cage, in the words of docs/subdivision.md.
//
// Fails: lists of the wrong length, indices below zero, unknown words, at their place. What only the whole cage shows
// (indices beyond the last vertex, edges of three faces, ...) is the sink's to refuse.

#include <cstdint>
#include <vector>

#include "pipeline/pack/scene_sink.h"
#include "tools/import/params.h"
#include "tools/import/ply.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// What a cage has beside positions, uvs and the corners of its faces.
struct ReadCage {
  std::vector<uint32_t> corner_counts, uv_indices, holes;
  std::vector<pipeline::SharpEdge> sharp_edges;
  std::vector<pipeline::SharpVertex> sharp_vertices;
  pipeline::BoundaryRule boundary = pipeline::BoundaryRule::edges_and_corners;
  pipeline::UvRule uv_rule = pipeline::UvRule::corners_plus1;
  TextureId displacement;
  float displacement_scale = 1;
};

// `mesh` comes with what a file had, when there is one.
Result<ReadCage> read_cage(const ParamList& params, Place place, PlyMesh& mesh);
// Moves a cage. A transform that mirrors turns its faces round, so that outside stays outside.
void place_cage(PlyMesh& mesh, ReadCage& cage, const Transform& object_from_shape);

}  // namespace spillway::tools
