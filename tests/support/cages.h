#pragma once

// Small Catmull-Clark cages, and what dicing makes of them.

#include <array>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "pipeline/pack/dice_cage.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::test {

// The arrays of a SubdivisionInput.
struct CageData {
  std::string name = "cage";
  std::vector<Float3> positions;
  std::vector<Float2> uvs;
  std::vector<uint32_t> corner_counts, indices, uv_indices, holes;
  std::vector<pipeline::SharpEdge> sharp_edges;
  std::vector<pipeline::SharpVertex> sharp_vertices;
  pipeline::BoundaryRule boundary = pipeline::BoundaryRule::edges_and_corners;
  pipeline::UvRule uv_rule = pipeline::UvRule::corners_plus1;
  float displacement_scale = 1;

  [[nodiscard]] pipeline::SubdivisionInput input() const;
  [[nodiscard]] pipeline::SubdivisionCage cage() const;  // must be right
};

CageData cube_cage();         // 6 quads, 8 vertices of three faces
CageData tent_cage();         // a cube whose top is four triangles: vertices of 3, 4 and 5 faces
CageData prism_cage();        // a six-sided prism: two hexagons, six quads
CageData torus_cage(uint32_t around, uint32_t across);  // regular, with uvs that have a seam both ways
CageData sheet_cage(uint32_t size);                     // an open, wavy square of quads with uvs
// The tent with creases of all kinds: for ever, worn off after two and a half levels, a dart, a sharp corner.
CageData creased_cage();

// Pieces by a hash of the edge: any power of two from 1 to `most`.
pipeline::EdgePieces any_pieces(uint32_t most);
pipeline::EdgePieces equal_pieces(uint32_t pieces);

// All pieces of a cage, each with points of its own.
std::vector<pipeline::DicedPiece> diced(const pipeline::SubdivisionCage& cage, const pipeline::EdgePieces& pieces,
                                        const pipeline::HeightsAt& heights = {});

// How often each directed edge occurs, by the bits of its ends.
using DirectedEdge = std::array<uint32_t, 6>;
std::map<DirectedEdge, int> directed_edges(const std::vector<pipeline::DicedPiece>& pieces);
// The edges that are not met exactly once in each direction.
std::vector<DirectedEdge> unpaired_edges(const std::map<DirectedEdge, int>& edges);

}  // namespace spillway::test
