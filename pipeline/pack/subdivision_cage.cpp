#include "pipeline/pack/subdivision_cage.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "pipeline/pack/spool_mesh.h"

namespace spillway::pipeline {
namespace {

template <class T>
std::vector<T> copied(std::span<const T> items) {
  return {items.begin(), items.end()};
}

// ---- what is said ----

Status check_counts(const SubdivisionInput& input) {
  const std::string& name = input.cage.name;
  if (input.corner_counts.empty()) return error("{}: a cage without faces", name);
  uint64_t corners = 0;
  for (size_t f = 0; f < input.corner_counts.size(); ++f) {
    const uint32_t count = input.corner_counts[f];
    if (count < 3 || count > kMostCorners)
      return error("{}: face {} has {} corners; 3 to {} are possible", name, f, count, kMostCorners);
    corners += count;
  }
  if (corners >= INT32_MAX || input.cage.positions.size() >= INT32_MAX || input.cage.uvs.size() >= INT32_MAX)
    return error("{}: {} corners, {} vertices, {} uvs; fewer than {} are possible", name, corners,
                 input.cage.positions.size(), input.cage.uvs.size(), INT32_MAX);
  if (corners != input.cage.indices.size())
    return error("{}: its faces have {} corners, but there are {} indices", name, corners, input.cage.indices.size());
  if (!input.cage.normals.empty()) return error("{}: has normals; a cage's surface has its own", name);
  return {};
}

Status check_uvs(const SubdivisionInput& input) {
  const MeshInput& cage = input.cage;
  const bool per_vertex = input.uv_indices.empty();
  if (cage.uvs.empty() && !per_vertex) return error("{}: has indices of uvs, but no uvs", cage.name);
  if (!cage.uvs.empty() && per_vertex && cage.uvs.size() != cage.positions.size())
    return error("{}: has {} uvs for {} vertices, and no indices of uvs", cage.name, cage.uvs.size(),
                 cage.positions.size());
  if (!per_vertex && input.uv_indices.size() != cage.indices.size())
    return error("{}: has {} indices of uvs for {} corners", cage.name, input.uv_indices.size(), cage.indices.size());
  for (size_t i = 0; i < cage.uvs.size(); ++i)
    if (!std::isfinite(cage.uvs[i].x) || !std::isfinite(cage.uvs[i].y))
      return error("{}: uv {} is not finite", cage.name, i);
  for (size_t i = 0; i < input.uv_indices.size(); ++i)
    if (input.uv_indices[i] >= cage.uvs.size())
      return error("{}: corner {} names uv {} of {}", cage.name, i, input.uv_indices[i], cage.uvs.size());
  return {};
}

Status check_positions(const MeshInput& cage) {
  for (size_t i = 0; i < cage.positions.size(); ++i) {
    const Float3 p = cage.positions[i];
    if (!is_finite(p) || max_abs(p) > kLargestCoordinate)
      return error("{}: vertex {} is ({}, {}, {}); finite numbers up to {} are possible", cage.name, i, p.x, p.y, p.z,
                   kLargestCoordinate);
  }
  for (size_t i = 0; i < cage.indices.size(); ++i)
    if (cage.indices[i] >= cage.positions.size())
      return error("{}: corner {} names vertex {} of {}", cage.name, i, cage.indices[i], cage.positions.size());
  return {};
}

Status check_faces(const SubdivisionInput& input) {
  std::vector<uint32_t> sorted;
  size_t first = 0;
  for (size_t f = 0; f < input.corner_counts.size(); first += input.corner_counts[f++]) {
    sorted.assign(&input.cage.indices[first], &input.cage.indices[first] + input.corner_counts[f]);
    std::sort(sorted.begin(), sorted.end());
    const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
    if (twice != sorted.end()) return error("{}: face {} has vertex {} at two corners", input.cage.name, f, *twice);
  }
  return {};
}

Status check_sharpness(const SubdivisionInput& input) {
  const std::string& name = input.cage.name;
  const size_t vertices = input.cage.positions.size();
  for (size_t i = 0; i < input.sharp_edges.size(); ++i) {
    const SharpEdge& e = input.sharp_edges[i];
    if (!(e.sharpness >= 0) || !std::isfinite(e.sharpness))
      return error("{}: crease {} has sharpness {}; 0 to 10 make sense", name, i, e.sharpness);
  }
  for (size_t i = 0; i < input.sharp_vertices.size(); ++i) {
    const SharpVertex& v = input.sharp_vertices[i];
    if (!(v.sharpness >= 0) || !std::isfinite(v.sharpness))
      return error("{}: corner {} has sharpness {}; 0 to 10 make sense", name, i, v.sharpness);
    if (v.vertex >= vertices) return error("{}: corner {} names vertex {} of {}", name, i, v.vertex, vertices);
  }
  for (const uint32_t face : input.holes)
    if (face >= input.corner_counts.size())
      return error("{}: names face {} of {} as a hole", name, face, input.corner_counts.size());
  if (!std::isfinite(input.displacement_scale))
    return error("{}: its displacement is scaled by {}", name, input.displacement_scale);
  return {};
}

// ---- how faces meet ----

// Which corners belong together; the lowest of a set stands for it.
class CornerSets {
 public:
  explicit CornerSets(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }
  uint32_t find(uint32_t corner) {
    while (parent_[corner] != corner) corner = parent_[corner] = parent_[parent_[corner]];
    return corner;
  }
  void unite(uint32_t a, uint32_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<uint32_t> parent_;
};

struct HalfEdge {
  uint64_t key;  // both vertices, the lower one first
  uint32_t corner;
};

class TopologyMaker {
 public:
  explicit TopologyMaker(const SubdivisionCage& cage) : cage_(cage) {}

  Result<CageTopology> make() {
    number_faces();
    SPILLWAY_TRY(make_edges());
    SPILLWAY_TRY(set_sharpness());
    SPILLWAY_TRY(check_fans());
    make_wedges();
    return std::move(topology_);
  }

 private:
  [[nodiscard]] uint32_t next(uint32_t corner) const {
    const uint32_t face = topology_.face[corner];
    return corner + 1 == cage_.first_corner[face + 1] ? cage_.first_corner[face] : corner + 1;
  }
  [[nodiscard]] uint64_t key(uint32_t a, uint32_t b) const {
    return uint64_t{std::min(a, b)} << 32 | std::max(a, b);
  }

  void number_faces() {
    topology_.face.resize(cage_.indices.size());
    for (uint32_t f = 0; f < cage_.face_count(); ++f)
      for (uint32_t c = cage_.first_corner[f]; c < cage_.first_corner[f + 1]; ++c) topology_.face[c] = f;
    topology_.is_hole.resize(cage_.face_count());
    for (const uint32_t hole : cage_.holes) topology_.is_hole[hole] = true;
  }

  Status make_edges() {
    half_.resize(cage_.indices.size());
    for (uint32_t c = 0; c < half_.size(); ++c) half_[c] = {key(cage_.indices[c], cage_.indices[next(c)]), c};
    std::sort(half_.begin(), half_.end(), [](const HalfEdge& a, const HalfEdge& b) {
      return a.key != b.key ? a.key < b.key : a.corner < b.corner;
    });
    topology_.edge.resize(half_.size());
    for (size_t first = 0; first < half_.size();) {
      size_t last = first + 1;
      while (last < half_.size() && half_[last].key == half_[first].key) ++last;
      SPILLWAY_TRY(add_edge(std::span(half_).subspan(first, last - first)));
      first = last;
    }
    return {};
  }

  Status add_edge(std::span<const HalfEdge> halves) {
    const uint32_t a = cage_.indices[halves[0].corner], b = cage_.indices[next(halves[0].corner)];
    if (halves.size() > 2)
      return error("{}: the edge of vertices {} and {} has {} faces; 2 are possible", cage_.surface.name, a, b,
                   halves.size());
    if (halves.size() == 2 && cage_.indices[halves[1].corner] == a)
      return error("{}: faces {} and {} pass the edge from vertex {} to {} in the same direction; turn one of them round",
                   cage_.surface.name, topology_.face[halves[0].corner], topology_.face[halves[1].corner], a, b);
    CageEdge edge;
    for (size_t i = 0; i < halves.size(); ++i) {
      edge.corner[i] = halves[i].corner;
      topology_.edge[halves[i].corner] = static_cast<uint32_t>(topology_.edges.size());
    }
    topology_.edges.push_back(edge);
    return {};
  }

  Status set_sharpness() {
    for (const SharpEdge& sharp : cage_.sharp_edges) {
      const uint64_t wanted = key(sharp.vertices[0], sharp.vertices[1]);
      const auto found = std::lower_bound(half_.begin(), half_.end(), wanted,
                                          [](const HalfEdge& half, uint64_t k) { return half.key < k; });
      if (found == half_.end() || found->key != wanted)
        return error("{}: a crease goes from vertex {} to {}, where there is no edge", cage_.surface.name,
                     sharp.vertices[0], sharp.vertices[1]);
      topology_.edges[topology_.edge[found->corner]].sharpness = sharp.sharpness;
    }
    return {};
  }

  // Joins corners around vertices across edges. body(edge) says which edges join.
  template <class Joins>
  CornerSets fans(const Joins& joins) const {
    CornerSets sets(cage_.indices.size());
    for (const CageEdge& edge : topology_.edges) {
      const auto [a, b] = edge.corner;
      if (b == kNoCorner || !joins(edge)) continue;
      sets.unite(a, next(b));
      sets.unite(next(a), b);
    }
    return sets;
  }

  Status check_fans() {
    CornerSets sets = fans([](const CageEdge&) { return true; });
    std::vector<uint32_t> fan(cage_.positions.size(), kNoCorner), valence(cage_.positions.size(), 0);
    for (uint32_t c = 0; c < cage_.indices.size(); ++c) {
      const uint32_t vertex = cage_.indices[c], set = sets.find(c);
      if (fan[vertex] != kNoCorner && fan[vertex] != set)
        return error("{}: the faces around vertex {} are not one fan (faces {} and {}); give each fan its own vertex",
                     cage_.surface.name, vertex, topology_.face[fan[vertex]], topology_.face[set]);
      fan[vertex] = set;
      if (++valence[vertex] > kMostCorners)
        return error("{}: vertex {} has more than {} faces", cage_.surface.name, vertex, kMostCorners);
    }
    note_special_vertices(valence);
    return {};
  }

  void note_special_vertices(const std::vector<uint32_t>& valence) {
    std::vector<uint8_t> sharp(cage_.positions.size(), 0), is_boundary(cage_.positions.size(), 0);
    for (const CageEdge& edge : topology_.edges)
      for (const uint32_t c : {edge.corner[0], next(edge.corner[0])}) {
        const uint32_t vertex = cage_.indices[c];
        if (edge.corner[1] == kNoCorner) is_boundary[vertex] = 1;
        if (edge.sharpness >= kSharpForEver) sharp[vertex] = static_cast<uint8_t>(std::min(sharp[vertex] + 1, 2));
      }
    for (size_t v = 0; v < valence.size(); ++v) {
      if (valence[v] == 0 || is_boundary[v]) continue;
      if (sharp[v] == 1) {
        topology_.is_sharp_dart.resize(valence.size());
        topology_.is_sharp_dart[v] = true;
      }
      if (valence[v] == 2) topology_.has_interior_pair = true;
    }
  }

  [[nodiscard]] bool is_seam(const CageEdge& edge) const {
    if (cage_.uv_indices.empty() || edge.corner[1] == kNoCorner) return false;
    const std::vector<uint32_t>& uv = cage_.uv_indices;
    const auto [a, b] = edge.corner;
    return uv[a] != uv[next(b)] || uv[next(a)] != uv[b];
  }

  void make_wedges() {
    std::vector<bool> is_sharp(cage_.positions.size(), false);
    for (const SharpVertex& v : cage_.sharp_vertices) is_sharp[v.vertex] = v.sharpness >= kSharpForEver;
    for (CageEdge& edge : topology_.edges)
      edge.is_split = edge.corner[1] != kNoCorner && (edge.sharpness >= kSharpForEver || is_seam(edge));
    CornerSets sets = fans([](const CageEdge& edge) { return !edge.is_split; });
    topology_.wedge.resize(cage_.indices.size());
    for (uint32_t c = 0; c < cage_.indices.size(); ++c) {
      const uint32_t set = is_sharp[cage_.indices[c]] ? c : sets.find(c);
      topology_.wedge[c] = set == c ? topology_.wedge_count++ : topology_.wedge[set];
    }
  }

  const SubdivisionCage& cage_;
  CageTopology topology_;
  std::vector<HalfEdge> half_;
};

}  // namespace

uint64_t SubdivisionCage::size_bytes() const {
  return positions.size() * sizeof(Float3) + uvs.size() * sizeof(Float2) + sharp_edges.size() * sizeof(SharpEdge) +
         sharp_vertices.size() * sizeof(SharpVertex) +
         (first_corner.size() + indices.size() + uv_indices.size() + holes.size()) * sizeof(uint32_t);
}

Result<SubdivisionCage> make_cage(const SubdivisionInput& input) {
  SPILLWAY_TRY(check_counts(input));
  SPILLWAY_TRY(check_positions(input.cage));
  SPILLWAY_TRY(check_uvs(input));
  SPILLWAY_TRY(check_faces(input));
  SPILLWAY_TRY(check_sharpness(input));
  SubdivisionCage cage;
  cage.surface = input.cage;
  cage.surface.positions = {}, cage.surface.uvs = {}, cage.surface.indices = {};
  cage.positions = copied(input.cage.positions);
  cage.indices = copied(input.cage.indices);
  cage.first_corner = {0};
  for (const uint32_t count : input.corner_counts) cage.first_corner.push_back(cage.first_corner.back() + count);
  cage.uvs = copied(input.cage.uvs);
  if (!cage.uvs.empty()) cage.uv_indices = input.uv_indices.empty() ? cage.indices : copied(input.uv_indices);
  cage.sharp_edges = copied(input.sharp_edges);
  cage.sharp_vertices = copied(input.sharp_vertices);
  cage.holes = copied(input.holes);
  cage.boundary = input.boundary, cage.uv_rule = input.uv_rule;
  cage.displacement = input.displacement, cage.displacement_scale = input.displacement_scale;
  // That its faces meet as they must is better said now, with the place, than at the end.
  if (const Result<CageTopology> topology = cage_topology(cage); !topology) return topology.error();
  return cage;
}

Result<CageTopology> cage_topology(const SubdivisionCage& cage) { return TopologyMaker(cage).make(); }

}  // namespace spillway::pipeline
