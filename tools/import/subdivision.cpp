#include "tools/import/subdivision.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>

namespace spillway::tools {
namespace {

using pipeline::BoundaryRule;
using pipeline::UvRule;

template <class Value>
struct Word {
  std::string_view text;
  Value value;
};
// As in USD.
constexpr std::array kBoundaryWords = {
    Word<BoundaryRule>{"none", BoundaryRule::none},
    Word<BoundaryRule>{"edgeOnly", BoundaryRule::edges},
    Word<BoundaryRule>{"edgeAndCorner", BoundaryRule::edges_and_corners},
};
constexpr std::array kUvWords = {
    Word<UvRule>{"none", UvRule::none},
    Word<UvRule>{"cornersOnly", UvRule::corners_only},
    Word<UvRule>{"cornersPlus1", UvRule::corners_plus1},
    Word<UvRule>{"cornersPlus2", UvRule::corners_plus2},
    Word<UvRule>{"boundaries", UvRule::boundaries},
    Word<UvRule>{"all", UvRule::all},
};

template <class Value, size_t N>
Status read_word(const ParamList& params, std::string_view name, const std::array<Word<Value>, N>& words, Value& value) {
  const Parameter* parameter = params.find(ParamType::string, name);
  if (parameter == nullptr) return {};
  SPILLWAY_TRY(expect_count(*parameter, parameter->strings.size(), 1));
  std::string known;
  for (const Word<Value>& word : words) {
    if (word.text == parameter->strings[0]) {
      value = word.value;
      return {};
    }
    known += fmt::format("{}\"{}\"", known.empty() ? "" : ", ", word.text);
  }
  return error_at(parameter->place, "\"{}\" is \"{}\"; it may be {}", name, parameter->strings[0], known);
}

// Integers that name or count things.
Status read_indices(const ParamList& params, std::string_view name, std::vector<uint32_t>& indices) {
  const Parameter* parameter = params.find(ParamType::integer, name);
  if (parameter == nullptr) return {};
  indices.clear();
  indices.reserve(parameter->integers.size());
  for (const int32_t index : parameter->integers) {
    if (index < 0) return error_at(parameter->place, "\"{}\" has {}; none may be below zero", name, index);
    indices.push_back(static_cast<uint32_t>(index));
  }
  return {};
}

// One number for each of `count` things; absent is none.
Result<std::vector<float>> read_sharpness(const ParamList& params, std::string_view name, size_t count, Place place) {
  const Parameter* parameter = params.find(ParamType::real, name);
  if (parameter == nullptr) {
    if (count == 0) return std::vector<float>{};
    return error_at(place, "subdivmesh has no \"float {}\" for {} sharp edges or corners", name, count);
  }
  SPILLWAY_TRY(expect_count(*parameter, parameter->numbers.size(), count));
  return parameter->numbers;
}

template <class T>
Status read_points(const ParamList& params, ParamType type, std::string_view name, std::vector<T>& points) {
  const Parameter* parameter = params.find(type, name);
  if (parameter == nullptr) return {};
  constexpr size_t kNumbers = sizeof(T) / sizeof(float);
  if (parameter->numbers.size() % kNumbers != 0)
    return error_at(parameter->place, "\"{}\" takes {} numbers an item, not {} in all", name, kNumbers,
                    parameter->numbers.size());
  points.resize(parameter->numbers.size() / kNumbers);
  if (!points.empty()) std::memcpy(points.data(), parameter->numbers.data(), points.size() * sizeof(T));
  return {};
}

Status read_faces(const ParamList& params, Place place, PlyMesh& mesh, ReadCage& cage) {
  SPILLWAY_TRY(read_points(params, ParamType::point3, "P", mesh.positions));
  SPILLWAY_TRY(read_points(params, ParamType::point2, "uv", mesh.uvs));
  SPILLWAY_TRY(read_indices(params, "indices", mesh.indices));
  SPILLWAY_TRY(read_indices(params, "nvertices", cage.corner_counts));
  SPILLWAY_TRY(read_indices(params, "uvindices", cage.uv_indices));
  SPILLWAY_TRY(read_indices(params, "holeindices", cage.holes));
  if (mesh.positions.empty() || mesh.indices.empty())
    return error_at(place, "subdivmesh without \"point3 P\" and \"integer indices\", or a file that has them");
  if (!cage.corner_counts.empty()) return {};
  if (mesh.indices.size() % 4 != 0)
    return error_at(place, "subdivmesh without \"integer nvertices\" has faces of four corners, but {} indices",
                    mesh.indices.size());
  cage.corner_counts.assign(mesh.indices.size() / 4, 4);
  return {};
}

// Chains of vertices: an edge between each and the next.
Status read_creases(const ParamList& params, Place place, ReadCage& cage) {
  std::vector<uint32_t> vertices, lengths;
  SPILLWAY_TRY(read_indices(params, "creaseindices", vertices));
  SPILLWAY_TRY(read_indices(params, "creaselengths", lengths));
  if (lengths.empty()) lengths.assign(vertices.size() / 2, 2);
  const uint64_t sum = std::accumulate(lengths.begin(), lengths.end(), uint64_t{0});
  if (sum != vertices.size())
    return error_at(place, "\"creaselengths\" add up to {}, but there are {} \"creaseindices\"", sum, vertices.size());
  SPILLWAY_ASSIGN(const std::vector<float> sharpness, read_sharpness(params, "creasesharpness", lengths.size(), place));
  size_t first = 0;
  for (size_t chain = 0; chain < lengths.size(); first += lengths[chain++]) {
    if (lengths[chain] < 2) return error_at(place, "\"creaselengths\" has {}; a crease joins two vertices at least", lengths[chain]);
    for (size_t i = first; i + 1 < first + lengths[chain]; ++i)
      cage.sharp_edges.push_back({{vertices[i], vertices[i + 1]}, sharpness[chain]});
  }
  return {};
}

Status read_corners(const ParamList& params, Place place, ReadCage& cage) {
  std::vector<uint32_t> vertices;
  SPILLWAY_TRY(read_indices(params, "cornerindices", vertices));
  SPILLWAY_ASSIGN(const std::vector<float> sharpness, read_sharpness(params, "cornersharpness", vertices.size(), place));
  for (size_t i = 0; i < vertices.size(); ++i) cage.sharp_vertices.push_back({vertices[i], sharpness[i]});
  return {};
}

}  // namespace

Result<ReadCage> read_cage(const ParamList& params, Place place, PlyMesh& mesh) {
  ReadCage cage;
  SPILLWAY_ASSIGN(const std::string scheme, params.string("scheme", "catmullclark"));
  if (scheme != "catmullclark")
    return error_at(place, "subdivmesh with scheme \"{}\"; \"catmullclark\" is the one there is", scheme);
  cage.corner_counts = std::move(mesh.corner_counts);
  mesh.normals.clear();  // the limit surface has its own
  SPILLWAY_TRY(read_faces(params, place, mesh, cage));
  SPILLWAY_TRY(read_creases(params, place, cage));
  SPILLWAY_TRY(read_corners(params, place, cage));
  SPILLWAY_TRY(read_word(params, "interpolateboundary", kBoundaryWords, cage.boundary));
  SPILLWAY_TRY(read_word(params, "facevaryinginterpolate", kUvWords, cage.uv_rule));
  return cage;
}

void place_cage(PlyMesh& mesh, ReadCage& cage, const Transform& object_from_shape) {
  for (Float3& p : mesh.positions) {
    const Vec3 moved = object_from_shape.point({p.x, p.y, p.z});
    p = {static_cast<float>(moved.x), static_cast<float>(moved.y), static_cast<float>(moved.z)};
  }
  if (!(object_from_shape.determinant() < 0)) return;
  size_t first = 0;
  for (const uint32_t count : cage.corner_counts) {
    if (first + count > mesh.indices.size()) return;  // the sink says so
    for (std::vector<uint32_t>* corners : {&mesh.indices, &cage.uv_indices})
      if (corners->size() == mesh.indices.size() && count > 1)
        std::reverse(corners->begin() + static_cast<ptrdiff_t>(first) + 1, corners->begin() + static_cast<ptrdiff_t>(first + count));
    first += count;
  }
}

}  // namespace spillway::tools
