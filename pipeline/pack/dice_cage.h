#pragma once

// One cage into triangles on its limit surface.
//
// Vertices and edges of the cage are evaluated first, once, in the face of lowest number that has them, and kept; then
// each face evaluates what is inside it. Neighbours take shared points from what is kept: equal to the bit, whatever piece
// they are in. Normals and uvs are shared likewise inside a wedge (see subdivision_cage.h). With heights, each point moves
// along its normal; a shared one by its owner's height, along the mean of the normals that its wedges have there.
// Memory: 32 bytes a point of vertices and edges, displaced 48; a piece, 32 bytes a point and 12 a triangle.
// Threads: pieces may be made by any number of threads at once.
// Order: results depend on the cage and the numbers of pieces alone.

#include <functional>
#include <memory>
#include <vector>

#include "pipeline/pack/dice_grid.h"
#include "pipeline/pack/limit_surface.h"
#include "pipeline/pack/subdivision_cage.h"
#include "pipeline/pack/surface_sample.h"

namespace spillway::pipeline {

// The pieces that an edge of the limit surface should have, by its two ends and its middle.
using EdgePieces = std::function<uint32_t(const Float3 (&edge)[3])>;

struct DicedPiece {
  std::vector<Float3> positions, normals;
  std::vector<Float2> uvs;  // empty, or one a position
  std::vector<uint32_t> indices;
};

class CageDicer {
 public:
  // The cage must outlive it. heights: empty when nothing is displaced; called from any thread.
  static Result<std::unique_ptr<CageDicer>> create(const SubdivisionCage& cage, const EdgePieces& edge_pieces,
                                                   HeightsAt heights = {});

  [[nodiscard]] uint64_t triangle_count() const { return triangle_count_; }
  [[nodiscard]] std::span<const uint32_t> rates() const { return rate_; }  // pieces of each edge of the topology
  // Evaluates what pieces share; to be called once, before them.
  void evaluate_shared();
  [[nodiscard]] size_t piece_count() const { return piece_begin_.size() - 1; }
  [[nodiscard]] DicedPiece piece(size_t index) const;

 private:
  friend class PieceMaker;
  // What a wedge, or an edge as a wedge sees it, has beside a position.
  struct Look {
    Float3 normal;
    Float2 uv;
  };

  explicit CageDicer(const SubdivisionCage& cage) : cage_(cage) {}
  template <class Body>
  void for_each_face(const LimitSurface& surface, const Body& body) const;
  void find_owners(const LimitSurface& surface);
  void choose_rates(const LimitSurface& surface, const EdgePieces& edge_pieces);
  void cut_into_pieces();
  void number_points();
  void evaluate_face(const LimitFace& face, uint32_t f);
  void evaluate_edge(const LimitFace& face, uint32_t corner);
  void raise_shared();
  // `pieces`: of the quad's side, near the place.
  [[nodiscard]] SurfaceSample sample(const LimitFace& face, QuadPlace place, uint32_t pieces) const;
  [[nodiscard]] Look look(const SurfaceSample& sample) const;

  [[nodiscard]] uint32_t next(uint32_t corner) const;
  [[nodiscard]] uint32_t previous(uint32_t corner) const;
  [[nodiscard]] bool is_quad(uint32_t face) const { return cage_.corner_count(face) == 4; }
  [[nodiscard]] uint32_t quad_count(uint32_t face) const { return is_quad(face) ? 1 : cage_.corner_count(face); }
  [[nodiscard]] uint32_t rate(uint32_t corner) const { return rate_[topology_.edge[corner]]; }
  [[nodiscard]] uint32_t side_pieces(uint32_t corner) const;  // of the quad at the corner, along the edge that leaves it
  [[nodiscard]] uint32_t spoke_rate(uint32_t face) const;  // from the middle of an edge to the centre
  [[nodiscard]] QuadRates quad_rates(uint32_t face, uint32_t quad) const;
  [[nodiscard]] bool owns_edge(uint32_t corner) const;
  // Which of its two corners an edge leaves: 0 in its own direction.
  [[nodiscard]] uint32_t side(uint32_t corner) const;

  const SubdivisionCage& cage_;
  HeightsAt heights_;
  CageTopology topology_;
  std::unique_ptr<LimitSurface> surface_;
  std::vector<uint8_t> has_surface_;  // of each face
  std::vector<uint32_t> vertex_owner_, wedge_owner_;  // the lowest corner whose face has a surface, or none
  std::vector<uint32_t> rate_;        // pieces of each edge
  // Of each edge among edge_points_: its points between the ends, in its direction.
  std::vector<uint64_t> first_point_;
  // Of each side of each edge among edge_looks_, in the edge's direction; the same for both unless it is split.
  std::vector<uint64_t> first_look_;
  std::vector<Float3> vertex_points_, edge_points_;
  std::vector<Look> wedge_looks_, edge_looks_;
  // With heights, until points are raised: one a point, and the normals of what is not displaced, one a look.
  std::vector<float> vertex_heights_, edge_heights_;
  std::vector<Float3> wedge_normals_, edge_normals_;
  std::vector<uint32_t> piece_begin_;  // faces
  uint64_t triangle_count_ = 0;
};

}  // namespace spillway::pipeline
