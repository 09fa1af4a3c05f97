#include "tests/support/cages.h"

#include <bit>
#include <cmath>

#include "cache/base/check.h"
#include "cache/base/hash.h"

namespace spillway::test {
namespace {

using namespace pipeline;

void add_face(CageData& cage, const std::vector<uint32_t>& corners) {
  cage.corner_counts.push_back(static_cast<uint32_t>(corners.size()));
  cage.indices.insert(cage.indices.end(), corners.begin(), corners.end());
}

uint64_t bits(Float3 p) {
  return hash_combine(hash_combine(std::bit_cast<uint32_t>(p.x), std::bit_cast<uint32_t>(p.y)), std::bit_cast<uint32_t>(p.z));
}

}  // namespace

SubdivisionInput CageData::input() const {
  SubdivisionInput input{};
  input.cage.name = name;
  input.cage.positions = positions, input.cage.uvs = uvs, input.cage.indices = indices;
  input.cage.material = MaterialId{0};
  input.corner_counts = corner_counts, input.uv_indices = uv_indices, input.holes = holes;
  input.sharp_edges = sharp_edges, input.sharp_vertices = sharp_vertices;
  input.boundary = boundary, input.uv_rule = uv_rule, input.displacement_scale = displacement_scale;
  return input;
}

SubdivisionCage CageData::cage() const {
  auto made = make_cage(input());
  SPILLWAY_CHECK(made ? "" : made.error().message, ==, "");
  return std::move(*made);
}

CageData cube_cage() {
  CageData cage;
  cage.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
  for (const auto& face : {std::vector<uint32_t>{0, 3, 2, 1}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}, {4, 5, 6, 7}})
    add_face(cage, face);
  return cage;
}

CageData tent_cage() {
  CageData cage;
  cage.positions = {{0, 0, 0},    {1, 0, 0}, {1, 1, 0}, {0, 1, 0},      {0, 0, 1},
                    {1, 0, 1.3f}, {1, 1, 1}, {0, 1, 1}, {.5f, .5f, 1.6f}};
  for (const auto& face : {std::vector<uint32_t>{0, 3, 2, 1}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7},
                           {4, 5, 8}, {5, 6, 8}, {6, 7, 8}, {7, 4, 8}})
    add_face(cage, face);
  return cage;
}

CageData prism_cage() {
  CageData cage;
  constexpr uint32_t kSides = 6;
  std::vector<uint32_t> bottom, top;
  for (uint32_t k = 0; k < kSides; ++k) {
    const float angle = static_cast<float>(k) * 2 * static_cast<float>(M_PI) / kSides;
    for (const float z : {0.0f, 1.0f}) cage.positions.push_back({std::cos(angle), std::sin(angle), z + 0.1f * angle * z});
    bottom.insert(bottom.begin(), 2 * k), top.push_back(2 * k + 1);
  }
  add_face(cage, bottom), add_face(cage, top);
  for (uint32_t k = 0; k < kSides; ++k) {
    const uint32_t a = 2 * k, b = 2 * ((k + 1) % kSides);
    add_face(cage, {a, b, b + 1, a + 1});
  }
  return cage;
}

CageData torus_cage(uint32_t around, uint32_t across) {
  CageData cage;
  for (uint32_t i = 0; i < around; ++i)
    for (uint32_t j = 0; j < across; ++j) {
      const double a = 2 * M_PI * i / around, b = 2 * M_PI * j / across, r = 2 + std::cos(b);
      cage.positions.push_back({static_cast<float>(r * std::cos(a)), static_cast<float>(r * std::sin(a)), static_cast<float>(std::sin(b))});
    }
  for (uint32_t i = 0; i <= around; ++i)
    for (uint32_t j = 0; j <= across; ++j)
      cage.uvs.push_back({static_cast<float>(i) / static_cast<float>(around), static_cast<float>(j) / static_cast<float>(across)});
  for (uint32_t i = 0; i < around; ++i)
    for (uint32_t j = 0; j < across; ++j) {
      const uint32_t i1 = (i + 1) % around, j1 = (j + 1) % across, row = across + 1;
      add_face(cage, {i * across + j, i1 * across + j, i1 * across + j1, i * across + j1});
      cage.uv_indices.insert(cage.uv_indices.end(), {i * row + j, (i + 1) * row + j, (i + 1) * row + j + 1, i * row + j + 1});
    }
  return cage;
}

CageData sheet_cage(uint32_t size) {
  CageData cage;
  for (uint32_t j = 0; j <= size; ++j)
    for (uint32_t i = 0; i <= size; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(size), v = static_cast<float>(j) / static_cast<float>(size);
      cage.positions.push_back({u, v, 0.2f * std::sin(7 * u) * std::cos(5 * v)});
      cage.uvs.push_back({u, v});
    }
  for (uint32_t j = 0; j < size; ++j)
    for (uint32_t i = 0; i < size; ++i) {
      const uint32_t a = j * (size + 1) + i;
      add_face(cage, {a, a + 1, a + size + 2, a + size + 1});
    }
  return cage;
}

CageData creased_cage() {
  CageData cage = tent_cage();
  // 3-2 and 2-6: for ever, ending in darts at 3 and 6; 1-5, 5-4: worn off; 7: a corner.
  cage.sharp_edges = {{{3, 2}, 10}, {{2, 6}, 12}, {{1, 5}, 2.5f}, {{5, 4}, 3}};
  cage.sharp_vertices = {{7, 10}, {0, 1.5f}};
  return cage;
}

EdgePieces any_pieces(uint32_t most) {
  const auto choices = static_cast<uint32_t>(std::countr_zero(most)) + 1;
  return [choices](const Float3(&edge)[3]) { return 1u << (mix64(bits(edge[1])) % choices); };
}

EdgePieces equal_pieces(uint32_t pieces) {
  return [pieces](const Float3(&)[3]) { return pieces; };
}

std::vector<DicedPiece> diced(const SubdivisionCage& cage, const EdgePieces& pieces, const HeightsAt& heights) {
  auto dicer = CageDicer::create(cage, pieces, heights);
  SPILLWAY_CHECK(dicer ? "" : dicer.error().message, ==, "");
  (*dicer)->evaluate_shared();
  std::vector<DicedPiece> made;
  for (size_t i = 0; i < (*dicer)->piece_count(); ++i) made.push_back((*dicer)->piece(i));
  return made;
}

std::map<DirectedEdge, int> directed_edges(const std::vector<DicedPiece>& pieces) {
  std::map<DirectedEdge, int> edges;
  for (const DicedPiece& piece : pieces)
    for (size_t i = 0; i < piece.indices.size(); ++i) {
      const Float3 a = piece.positions[piece.indices[i]];
      const Float3 b = piece.positions[piece.indices[i % 3 == 2 ? i - 2 : i + 1]];
      const auto word = [](float f) { return std::bit_cast<uint32_t>(f); };
      ++edges[{word(a.x), word(a.y), word(a.z), word(b.x), word(b.y), word(b.z)}];
    }
  return edges;
}

std::vector<DirectedEdge> unpaired_edges(const std::map<DirectedEdge, int>& edges) {
  std::vector<DirectedEdge> unpaired;
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge[3], edge[4], edge[5], edge[0], edge[1], edge[2]});
    if (count != 1 || back == edges.end() || back->second != 1) unpaired.push_back(edge);
  }
  return unpaired;
}

}  // namespace spillway::test
