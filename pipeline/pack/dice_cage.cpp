#include "pipeline/pack/dice_cage.h"

#include <bit>
#include <cmath>
#include <unordered_map>

#include "cache/base/parallel.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kFacesPerBlock = 64;             // of a parallel loop: some hundred microseconds
constexpr uint64_t kTrianglesPerPiece = 1 << 16;  // a few megabytes

Float3 rounded(const Double3& v) { return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}; }

Float3 unit_or_zero(Float3 v) { return length_squared(v) > 0 ? normalize(v) : v; }

}  // namespace

// ---- the cage ----

uint32_t CageDicer::next(uint32_t corner) const {
  const uint32_t face = topology_.face[corner];
  return corner + 1 == cage_.first_corner[face + 1] ? cage_.first_corner[face] : corner + 1;
}

uint32_t CageDicer::previous(uint32_t corner) const {
  const uint32_t face = topology_.face[corner];
  return corner == cage_.first_corner[face] ? cage_.first_corner[face + 1] - 1 : corner - 1;
}

uint32_t CageDicer::side(uint32_t corner) const {
  return topology_.edges[topology_.edge[corner]].corner[0] == corner ? 0 : 1;
}

bool CageDicer::owns_edge(uint32_t corner) const {
  const CageEdge& edge = topology_.edges[topology_.edge[corner]];
  return corner == edge.corner[0] || !has_surface_[topology_.face[edge.corner[0]]];
}

uint32_t CageDicer::spoke_rate(uint32_t face) const {
  uint32_t most = 1;
  for (uint32_t c = cage_.first_corner[face]; c < cage_.first_corner[face + 1]; ++c) most = std::max(most, rate(c) / 2);
  return most;
}

uint32_t CageDicer::side_pieces(uint32_t corner) const {
  return is_quad(topology_.face[corner]) ? rate(corner) : rate(corner) / 2;
}

QuadRates CageDicer::quad_rates(uint32_t face, uint32_t quad) const {
  const uint32_t corner = cage_.first_corner[face] + quad;
  if (is_quad(face)) return {{rate(corner), rate(corner + 1), rate(corner + 2), rate(corner + 3)}};
  const uint32_t spoke = spoke_rate(face);
  return {{rate(corner) / 2, spoke, spoke, rate(previous(corner)) / 2}};
}

Result<std::unique_ptr<CageDicer>> CageDicer::create(const SubdivisionCage& cage, const EdgePieces& edge_pieces,
                                                     HeightsAt heights) {
  std::unique_ptr<CageDicer> dicer(new CageDicer(cage));
  dicer->heights_ = std::move(heights);
  SPILLWAY_ASSIGN(dicer->topology_, cage_topology(cage));
  const LimitSurface first_look(cage, dicer->topology_, 1);
  dicer->find_owners(first_look);
  dicer->choose_rates(first_look, edge_pieces);
  dicer->cut_into_pieces();
  return dicer;
}

template <class Body>
void CageDicer::for_each_face(const LimitSurface& surface, const Body& body) const {
  parallel_blocks(cage_.face_count(), kFacesPerBlock, [&](size_t, size_t first, size_t last) {
    LimitFace face(surface);
    for (size_t f = first; f < last; ++f) {
      if (!has_surface_[f]) continue;
      face.set(static_cast<uint32_t>(f));
      body(face, static_cast<uint32_t>(f));
    }
  });
}

void CageDicer::find_owners(const LimitSurface& surface) {
  has_surface_.resize(cage_.face_count());
  vertex_owner_.assign(cage_.positions.size(), kNoCorner);
  wedge_owner_.assign(topology_.wedge_count, kNoCorner);
  for (uint32_t f = 0; f < cage_.face_count(); ++f) {
    has_surface_[f] = surface.has_face(f) ? 1 : 0;
    if (!has_surface_[f]) continue;
    for (uint32_t c = cage_.first_corner[f]; c < cage_.first_corner[f + 1]; ++c) {
      uint32_t &vertex = vertex_owner_[cage_.indices[c]], &wedge = wedge_owner_[topology_.wedge[c]];
      vertex = std::min(vertex, c), wedge = std::min(wedge, c);
    }
  }
}

// An edge is measured at its ends and its middle. Where a face is no quad, the middle is a corner of the face's quads.
void CageDicer::choose_rates(const LimitSurface& surface, const EdgePieces& edge_pieces) {
  std::vector<Float3> ends(cage_.positions.size()), middles(topology_.edges.size());
  for_each_face(surface, [&](const LimitFace& face, uint32_t f) {
    for (uint32_t c = cage_.first_corner[f]; c < cage_.first_corner[f + 1]; ++c) {
      const uint32_t k = c - cage_.first_corner[f];
      if (vertex_owner_[cage_.indices[c]] == c) ends[cage_.indices[c]] = rounded(face.at(face.on_edge(k, 0)).p);
      if (owns_edge(c)) middles[topology_.edge[c]] = rounded(face.at(face.on_edge(k, 0.5)).p);
    }
  });
  rate_.resize(topology_.edges.size());
  for (size_t e = 0; e < rate_.size(); ++e) {
    const CageEdge& edge = topology_.edges[e];
    const uint32_t a = edge.corner[0];
    bool has_surface = false, has_other = false;
    for (const uint32_t c : edge.corner) {
      if (c == kNoCorner || !has_surface_[topology_.face[c]]) continue;
      has_surface = true;
      if (!is_quad(topology_.face[c])) has_other = true;
    }
    if (!has_surface) continue;
    rate_[e] = edge_pieces({ends[cage_.indices[a]], middles[e], ends[cage_.indices[next(a)]]});
    if (has_other) rate_[e] = std::max(rate_[e], 2u);
  }
}

void CageDicer::cut_into_pieces() {
  piece_begin_ = {0};
  uint64_t in_piece = 0;
  for (uint32_t f = 0; f < cage_.face_count(); ++f) {
    if (!has_surface_[f]) continue;
    uint64_t triangles = 0;
    for (uint32_t quad = 0; quad < quad_count(f); ++quad) triangles += pipeline::triangle_count(quad_rates(f, quad));
    if (in_piece > 0 && in_piece + triangles > kTrianglesPerPiece) piece_begin_.push_back(f), in_piece = 0;
    in_piece += triangles, triangle_count_ += triangles;
  }
  piece_begin_.push_back(cage_.face_count());
}

// ---- what pieces share ----

void CageDicer::number_points() {
  uint64_t points = 0, looks = 0;
  for (size_t e = 0; e < rate_.size(); ++e) {
    const uint64_t inside = rate_[e] > 1 ? rate_[e] - 1 : 0;
    first_point_.push_back(points);
    points += inside;
    for (int side = 0; side < 2; ++side) {
      first_look_.push_back(looks);
      if (side == 1 || topology_.edges[e].is_split) looks += inside;
    }
  }
  edge_points_.resize(points);
  edge_looks_.resize(looks);
  vertex_points_.resize(cage_.positions.size());
  wedge_looks_.resize(topology_.wedge_count);
  if (!heights_) return;
  vertex_heights_.resize(vertex_points_.size()), edge_heights_.resize(points);
  wedge_normals_.resize(wedge_looks_.size()), edge_normals_.resize(looks);
}

void CageDicer::evaluate_shared() {
  uint32_t most = 4;
  for (const uint32_t rate : rate_) most = std::max(most, rate);
  surface_ = std::make_unique<LimitSurface>(cage_, topology_, static_cast<uint32_t>(std::countr_zero(most)));
  number_points();
  for_each_face(*surface_, [&](const LimitFace& face, uint32_t f) { evaluate_face(face, f); });
  if (heights_) raise_shared();
}

// Each point along the mean of the normals that wedges have there, in the order of their corners.
void CageDicer::raise_shared() {
  std::vector<Float3> sums(vertex_points_.size(), Float3{0, 0, 0});
  for (uint32_t c = 0; c < cage_.indices.size(); ++c)
    if (wedge_owner_[topology_.wedge[c]] == c) sums[cage_.indices[c]] += wedge_normals_[topology_.wedge[c]];
  for (size_t v = 0; v < sums.size(); ++v) vertex_points_[v] += unit_or_zero(sums[v]) * vertex_heights_[v];
  for (size_t e = 0; e < rate_.size(); ++e)
    for (uint64_t i = 0; i + 1 < rate_[e]; ++i) {
      const Float3 sum = edge_normals_[first_look_[2 * e] + i] + edge_normals_[first_look_[2 * e + 1] + i];
      edge_points_[first_point_[e] + i] += unit_or_zero(sum) * edge_heights_[first_point_[e] + i];
    }
  vertex_heights_ = {}, edge_heights_ = {}, wedge_normals_ = {}, edge_normals_ = {};
}

SurfaceSample CageDicer::sample(const LimitFace& face, QuadPlace place, uint32_t pieces) const {
  return heights_ ? displaced_sample(face, place, 0.5 / pieces, heights_) : surface_sample(face, place);
}

CageDicer::Look CageDicer::look(const SurfaceSample& sample) const {
  return {cage_.surface.flip_normals ? -sample.normal : sample.normal, sample.uv};
}

void CageDicer::evaluate_face(const LimitFace& face, uint32_t f) {
  for (uint32_t c = cage_.first_corner[f]; c < cage_.first_corner[f + 1]; ++c) {
    const uint32_t vertex = cage_.indices[c], wedge = topology_.wedge[c];
    const bool owns_vertex = vertex_owner_[vertex] == c, owns_wedge = wedge_owner_[wedge] == c;
    if (owns_vertex || owns_wedge) {
      const SurfaceSample at = sample(face, face.on_edge(c - cage_.first_corner[f], 0), side_pieces(c));
      if (owns_vertex) vertex_points_[vertex] = at.position;
      if (owns_vertex && heights_) vertex_heights_[vertex] = at.height;
      if (owns_wedge) wedge_looks_[wedge] = look(at);
      if (owns_wedge && heights_) wedge_normals_[wedge] = at.normal_limit;
    }
    evaluate_edge(face, c);
  }
}

void CageDicer::evaluate_edge(const LimitFace& face, uint32_t corner) {
  const uint32_t e = topology_.edge[corner], k = corner - cage_.first_corner[topology_.face[corner]];
  const bool owns_points = owns_edge(corner), owns_looks = owns_points || topology_.edges[e].is_split;
  if (!owns_looks) return;
  const uint32_t backwards = side(corner);
  for (uint32_t i = 1; i < rate_[e]; ++i) {
    const uint64_t along = (backwards ? rate_[e] - i : i) - 1;
    const uint64_t point = first_point_[e] + along, look_at = first_look_[2 * e + backwards] + along;
    const SurfaceSample at = sample(face, face.on_edge(k, static_cast<double>(i) / rate_[e]), side_pieces(corner));
    if (owns_points) edge_points_[point] = at.position;
    if (owns_points && heights_) edge_heights_[point] = at.height;
    edge_looks_[look_at] = look(at);
    if (heights_) edge_normals_[look_at] = at.normal_limit;
  }
}

// ---- pieces ----

// Numbers the points of a piece: those of wedges and edges as they are first met, shared by the piece's faces.
class PieceMaker {
 public:
  explicit PieceMaker(const CageDicer& dicer) : dicer_(dicer), face_(*dicer.surface_) {}

  DicedPiece make(uint32_t first_face, uint32_t last_face) {
    for (uint32_t f = first_face; f < last_face; ++f)
      if (dicer_.has_surface_[f]) add_face(f);
    return std::move(piece_);
  }

 private:
  using Look = CageDicer::Look;

  void add_face(uint32_t f) {
    face_.set(f);
    first_ = dicer_.cage_.first_corner[f], count_ = dicer_.cage_.corner_count(f);
    if (!dicer_.is_quad(f)) add_spokes(dicer_.spoke_rate(f));
    for (uint32_t quad = 0; quad < dicer_.quad_count(f); ++quad) {
      const QuadRates rates = dicer_.quad_rates(f, quad);
      grid_.resize(rates.grid_size());
      if (dicer_.is_quad(f)) {
        for (uint32_t side = 0; side < 4; ++side)
          fill_side(rates, side, [&](uint32_t i) { return edge_point(side, i); });
      } else {
        fill_sides_of_part(rates, quad);
      }
      add_inside(rates, quad);
    }
  }

  uint32_t add(Float3 position, const Look& look) {
    piece_.positions.push_back(position);
    piece_.normals.push_back(look.normal);
    if (!dicer_.cage_.uvs.empty()) piece_.uvs.push_back(look.uv);
    return static_cast<uint32_t>(piece_.positions.size()) - 1;
  }

  // A point that no other face has.
  uint32_t add_own(QuadPlace place, uint32_t pieces) {
    const SurfaceSample at = dicer_.sample(face_, place, pieces);
    return add(at.displaced(), dicer_.look(at));
  }

  uint32_t wedge_point(uint32_t corner) {
    const uint32_t wedge = dicer_.topology_.wedge[corner];
    const auto [at, is_new] = wedges_.try_emplace(wedge, 0);
    if (is_new) at->second = add(dicer_.vertex_points_[dicer_.cage_.indices[corner]], dicer_.wedge_looks_[wedge]);
    return at->second;
  }

  // Point i of the edge that leaves the face's corner k; its first and last are corners.
  uint32_t edge_point(uint32_t k, uint32_t i) {
    const uint32_t corner = first_ + k, e = dicer_.topology_.edge[corner], rate = dicer_.rate_[e];
    if (i == 0) return wedge_point(corner);
    if (i == rate) return wedge_point(dicer_.next(corner));
    const uint32_t side = dicer_.side(corner);
    const uint64_t looks = dicer_.first_look_[2 * e + side], points = dicer_.first_point_[e];
    const auto [at, is_new] = edges_.try_emplace(looks, static_cast<uint32_t>(piece_.positions.size()));
    if (is_new)
      for (uint32_t n = 0; n + 1 < rate; ++n) add(dicer_.edge_points_[points + n], dicer_.edge_looks_[looks + n]);
    return at->second + (side ? rate - i : i) - 1;
  }

  // The centre, and what lies between it and the middles of the edges.
  void add_spokes(uint32_t rate) {
    centre_ = add_own({0, 1, 1}, rate);
    spokes_ = static_cast<uint32_t>(piece_.positions.size());
    for (uint32_t quad = 0; quad < count_; ++quad)
      for (uint32_t i = 1; i < rate; ++i) add_own({quad, 1, static_cast<double>(i) / rate}, rate);
  }

  // Point i of the spoke from the middle of edge k.
  uint32_t spoke_point(uint32_t k, uint32_t i, uint32_t rate) {
    if (i == 0) return edge_point(k, dicer_.rate(first_ + k) / 2);
    return i == rate ? centre_ : spokes_ + k * (rate - 1) + i - 1;
  }

  // point(i): of the side's points, in the direction of the quad's outline.
  template <class PointAt>
  void fill_side(const QuadRates& rates, uint32_t side, const PointAt& point) {
    const uint32_t count = rates.side[side], u = rates.u(), v = rates.v();
    for (uint32_t i = 0; i <= count; ++i) {
      const uint32_t along_u = i * (u / count), along_v = i * (v / count);
      const uint32_t at[4] = {rates.grid_index(along_u, 0), rates.grid_index(u, along_v), rates.grid_index(u - along_u, v),
                              rates.grid_index(0, v - along_v)};
      grid_[at[side]] = point(i);
    }
  }

  // Of a face that is no quad: half an edge, a spoke outwards in, a spoke inwards out, half an edge.
  void fill_sides_of_part(const QuadRates& rates, uint32_t quad) {
    const uint32_t before = (quad + count_ - 1) % count_;
    fill_side(rates, 0, [&](uint32_t i) { return edge_point(quad, i); });
    fill_side(rates, 1, [&](uint32_t i) { return spoke_point(quad, i, rates.side[1]); });
    fill_side(rates, 2, [&](uint32_t i) { return spoke_point(before, rates.side[2] - i, rates.side[2]); });
    fill_side(rates, 3, [&](uint32_t i) { return edge_point(before, rates.side[3] + i); });
  }

  void add_inside(const QuadRates& rates, uint32_t quad) {
    for (uint32_t j = 1; j < rates.v(); ++j)
      for (uint32_t i = 1; i < rates.u(); ++i)
        grid_[rates.grid_index(i, j)] =
            add_own({quad, static_cast<double>(i) / rates.u(), static_cast<double>(j) / rates.v()},
                    std::max(rates.u(), rates.v()));
    const size_t before = piece_.indices.size();
    dice_quad(rates, piece_.indices);
    for (size_t i = before; i < piece_.indices.size(); ++i) piece_.indices[i] = grid_[piece_.indices[i]];
  }

  const CageDicer& dicer_;
  LimitFace face_;
  DicedPiece piece_;
  uint32_t first_ = 0, count_ = 0;    // the face's corners
  uint32_t centre_ = 0, spokes_ = 0;  // points of the face
  std::vector<uint32_t> grid_;        // points of the quad
  std::unordered_map<uint32_t, uint32_t> wedges_;
  std::unordered_map<uint64_t, uint32_t> edges_;  // by their first look, the first point
};

DicedPiece CageDicer::piece(size_t index) const {
  return PieceMaker(*this).make(piece_begin_[index], piece_begin_[index + 1]);
}

}  // namespace spillway::pipeline
