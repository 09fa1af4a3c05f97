#include "tools/import/vertex_lists.h"

#include <cstring>
#include <numeric>

namespace spillway::tools {
namespace {

// `name`'s numbers as items of type T, one a vertex; absent is empty.
template <class T>
Status read_per_vertex(const ParamList& params, ParamType type, std::string_view name, size_t vertices,
                       std::vector<T>& items) {
  const Parameter* parameter = params.find(type, name);
  if (parameter == nullptr) return {};
  SPILLWAY_TRY(expect_count(*parameter, parameter->numbers.size(), sizeof(T) / sizeof(float) * vertices));
  items.resize(vertices);
  std::memcpy(items.data(), parameter->numbers.data(), vertices * sizeof(T));
  return {};
}

}  // namespace

Status read_vertices(const ParamList& params, std::string_view shape, Place place, PlyMesh& mesh) {
  const Parameter* points = params.find(ParamType::point3, "P");
  if (points == nullptr) return error_at(place, "{} without \"point3 P\"", shape);
  if (points->numbers.empty() || points->numbers.size() % 3 != 0)
    return error_at(points->place, "\"P\" takes three numbers a vertex, not {} in all", points->numbers.size());
  const size_t count = points->numbers.size() / 3;
  SPILLWAY_TRY(read_per_vertex(params, ParamType::point3, "P", count, mesh.positions));
  SPILLWAY_TRY(read_per_vertex(params, ParamType::normal3, "N", count, mesh.normals));
  return read_per_vertex(params, ParamType::point2, "uv", count, mesh.uvs);
}

Status read_corners(const ParamList& params, std::string_view shape, Place place, size_t corners, PlyMesh& mesh) {
  const Parameter* indices = params.find(ParamType::integer, "indices");
  if (indices == nullptr) {
    if (mesh.positions.size() != corners) return error_at(place, "{} without \"integer indices\"", shape);
    mesh.indices.resize(corners);
    std::iota(mesh.indices.begin(), mesh.indices.end(), 0u);
    return {};
  }
  if (indices->integers.empty() || indices->integers.size() % corners != 0)
    return error_at(indices->place, "\"indices\" takes {} numbers a face, not {} in all", corners,
                    indices->integers.size());
  mesh.indices.reserve(indices->integers.size());
  for (const int32_t index : indices->integers) {
    if (index < 0 || static_cast<size_t>(index) >= mesh.positions.size())
      return error_at(indices->place, "\"indices\" names vertex {} of {}", index, mesh.positions.size());
    mesh.indices.push_back(static_cast<uint32_t>(index));
  }
  return {};
}

}  // namespace spillway::tools
