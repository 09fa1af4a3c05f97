#include "pipeline/pack/spool_mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace spillway::pipeline {
namespace {

Status check_counts(const MeshInput& input) {
  if (input.indices.size() % 3 != 0)
    return error("{}: has {} indices, which is no multiple of three", input.name, input.indices.size());
  if (input.positions.size() >= UINT32_MAX)
    return error("{}: has {} vertices, more than 32-bit indices reach; split the mesh", input.name,
                 input.positions.size());
  if (!input.normals.empty() && input.normals.size() != input.positions.size())
    return error("{}: has {} normals for {} vertices", input.name, input.normals.size(), input.positions.size());
  if (!input.uvs.empty() && input.uvs.size() != input.positions.size())
    return error("{}: has {} uvs for {} vertices", input.name, input.uvs.size(), input.positions.size());
  if (!input.faces.empty() && input.faces.size() != input.indices.size() / 3)
    return error("{}: has {} faces of a texture for {} triangles", input.name, input.faces.size(),
                 input.indices.size() / 3);
  return {};
}

Status check_values(const MeshInput& input) {
  for (size_t i = 0; i < input.positions.size(); ++i) {
    const Float3 p = input.positions[i];
    if (!is_finite(p)) return error("{}: vertex {} is ({}, {}, {}), not finite", input.name, i, p.x, p.y, p.z);
    if (max_abs(p) > kLargestCoordinate)
      return error("{}: vertex {} is ({}, {}, {}), beyond {}; scale the scene down", input.name, i, p.x, p.y, p.z,
                   kLargestCoordinate);
  }
  for (size_t i = 0; i < input.normals.size(); ++i)
    if (!is_finite(input.normals[i])) return error("{}: the normal of vertex {} is not finite", input.name, i);
  for (size_t i = 0; i < input.uvs.size(); ++i)
    if (!std::isfinite(input.uvs[i].x) || !std::isfinite(input.uvs[i].y))
      return error("{}: the uv of vertex {} is not finite", input.name, i);
  for (size_t i = 0; i < input.indices.size(); ++i)
    if (input.indices[i] >= input.positions.size())
      return error("{}: index {} of triangle {} is {}, but there are {} vertices", input.name, i % 3, i / 3,
                   input.indices[i], input.positions.size());
  for (size_t i = 0; i < input.faces.size(); ++i) {
    const TriangleFace& f = input.faces[i];
    const uint32_t corners = (1u << f.corner[0] % 32) | (1u << f.corner[1] % 32) | (1u << f.corner[2] % 32);
    const bool is_part = f.is_whole ? corners == 7 : corners <= 15 && f.fourth_vertex < input.positions.size();
    if (!is_part || std::popcount(corners) != 3) return error("{}: triangle {} is no part of a face", input.name, i);
  }
  return {};
}

// As shading computes it: what has no normal there has no area here.
bool has_area(const MeshInput& input, const uint32_t* face) {
  if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) return false;
  const Float3 p0 = input.positions[face[0]];
  const Float3 normal = cross(input.positions[face[1]] - p0, input.positions[face[2]] - p0);
  return length_squared(normal) > 0;
}

// The part of its face that a triangle is. A quad's fourth corner is moved along the quad's normal into the triangle's
// plane, as seen from both triangles alike: they agree on the (u, v) of their common edge.
cache::FaceOfTriangle face_of_triangle(const MeshInput& input, size_t triangle) {
  const TriangleFace& part = input.faces[triangle];
  const uint32_t corners = cache::face_corners(part.corner[0], part.corner[1], part.corner[2]);
  if (part.is_whole) return {part.face, corners | cache::kWholeFace, {0, 0}};
  cache::FaceOfTriangle face{part.face, corners, {0, 0}};
  Float3 corner[4];
  const uint32_t fourth = 6u - part.corner[0] - part.corner[1] - part.corner[2];
  for (size_t k = 0; k < 3; ++k) corner[part.corner[k]] = input.positions[input.indices[3 * triangle + k]];
  corner[fourth] = input.positions[part.fourth_vertex];
  const Float3 p0 = input.positions[input.indices[3 * triangle]];
  const Float3 e1 = input.positions[input.indices[3 * triangle + 1]] - p0;
  const Float3 e2 = input.positions[input.indices[3 * triangle + 2]] - p0;
  const Float3 normal = cross(corner[2] - corner[0], corner[3] - corner[1]), to = corner[fourth] - p0;
  const float volume = dot(cross(e1, e2), normal);
  const float a = dot(cross(to, e2), normal) / volume, b = dot(cross(e1, to), normal) / volume;
  // Of a quad without area: as of a parallelogram.
  const bool is_finite_place = std::isfinite(a) && std::isfinite(b);
  face.fourth[0] = is_finite_place ? a : 1, face.fourth[1] = is_finite_place ? b : 1;
  return face;
}

// Collects faces and their vertices; `local` holds a vertex's number in the chunk, or kUnseen.
class ChunkMaker {
 public:
  explicit ChunkMaker(const MeshInput& input) : input_(input), local_(MemoryTag::pack, input.positions.size()) {}

  void add_face(size_t triangle) {
    for (size_t k = 0; k < 3; ++k) data_.indices.push_back(local_vertex(input_.indices[3 * triangle + k]));
    if (!input_.faces.empty()) data_.faces.push_back(face_of_triangle(input_, triangle));
  }
  [[nodiscard]] size_t face_count() const { return data_.indices.size() / 3; }
  [[nodiscard]] const cache::AttributeSegmentData& data() const { return data_; }
  void clear() {
    for (const uint32_t vertex : vertices_) local_[vertex] = 0;
    vertices_.clear(), data_.indices.clear(), data_.positions.clear(), data_.normals.clear(), data_.uvs.clear();
    data_.faces.clear();
  }

 private:
  uint16_t local_vertex(uint32_t vertex) {
    if (local_[vertex] == 0) {
      vertices_.push_back(vertex);
      local_[vertex] = static_cast<uint32_t>(vertices_.size());
      data_.positions.push_back(input_.positions[vertex]);
      if (!input_.normals.empty()) data_.normals.push_back(input_.normals[vertex]);
      if (!input_.uvs.empty()) data_.uvs.push_back(input_.uvs[vertex]);
    }
    return static_cast<uint16_t>(local_[vertex] - 1);
  }

  const MeshInput& input_;
  Buffer<uint32_t> local_;  // number in the chunk plus one; 0: not in it
  std::vector<uint32_t> vertices_;
  cache::AttributeSegmentData data_;
};

Status append_chunk(ChunkMaker& maker, MeshSpool& spool, SpooledMesh& mesh) {
  if (maker.face_count() == 0) return {};
  SPILLWAY_ASSIGN(const MeshChunk chunk, spool.append(maker.data(), mesh.row.material));
  mesh.chunks.push_back(chunk);
  mesh.row.face_count += chunk.face_count;
  maker.clear();
  return {};
}

SpooledMesh mesh_without_faces(const MeshInput& input) {
  SpooledMesh mesh;
  mesh.name = input.name;
  mesh.row.material = input.material.value;
  mesh.row.object = input.object;
  mesh.row.light_base = LightId::kNone;
  mesh.row.alpha_texture = input.alpha.value;
  mesh.row.flags = (input.flip_normals ? kMeshFlipNormals : 0u) | (input.normals.empty() ? 0u : kMeshHasNormals) |
                   (input.uvs.empty() ? 0u : kMeshHasUvs) | (input.divides_media ? kMeshDividesMedia : 0u);
  mesh.row.medium_inside = static_cast<uint16_t>(input.medium_inside);
  mesh.row.medium_outside = static_cast<uint16_t>(input.medium_outside);
  mesh.emits = input.emits && !is_black(input.emission);
  mesh.emits_two_sided = input.emits_two_sided;
  mesh.emission = input.emission;
  mesh.emission_texture = input.emission_texture.value;
  mesh.emission_is_mean = input.emission_is_mean;
  return mesh;
}

}  // namespace

Result<SpooledMesh> spool_mesh(const MeshInput& input, MeshSpool& spool, uint32_t max_faces_per_chunk,
                               uint64_t& degenerate_count) {
  SPILLWAY_TRY(check_counts(input));
  SPILLWAY_TRY(check_values(input));
  if (input.indices.size() / 3 >= PrimId::kNone)
    return error("{}: has {} triangles, more than a scene can hold", input.name, input.indices.size() / 3);
  SpooledMesh mesh = mesh_without_faces(input);
  ChunkMaker maker(input);
  for (size_t i = 0; i < input.indices.size(); i += 3) {
    if (!has_area(input, &input.indices[i])) {
      ++degenerate_count;
      continue;
    }
    maker.add_face(i / 3);
    if (maker.face_count() == max_faces_per_chunk) SPILLWAY_TRY(append_chunk(maker, spool, mesh));
  }
  SPILLWAY_TRY(append_chunk(maker, spool, mesh));
  return mesh;
}

}  // namespace spillway::pipeline
