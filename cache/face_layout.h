#pragma once

// Faces of a face texture: their sizes, their neighbours, and the way across an edge. As in Ptex (Burley and Lacewell
// 2008, Ptex: Per-Face Texture Mapping for Production Rendering).
//
// A quad's corners have uv (0,0), (1,0), (1,1), (0,1); a triangle's (0,0), (1,0), (0,1). Edge e runs from corner e to
// the next, so that a quad's edges 0 1 2 3 are v = 0, u = 1, v = 1, u = 0, and a triangle's 0 1 2 are v = 0, 1-u-v = 0,
// u = 0. A subface is a quarter of what would be a quad: where a whole face meets subfaces, two of them share its edge;
// the whole face names the one at the edge's beginning, and both name the whole face.
//
// Texels of a triangle fill a square: the triangle of the lattice cell (i, j) that has the cell's lower corner is texel
// (i, j); the one that has its upper corner is texel (size-1-j, size-1-i).

#include <cstdint>
#include <span>

namespace spillway::cache {

enum class FaceShape : uint32_t { triangle, quad };
enum class FaceTexelType : uint32_t { uint8, uint16, half, float32 };
enum class FaceBorder : uint32_t { clamp, black, periodic };

[[nodiscard]] constexpr uint32_t texel_type_bytes(FaceTexelType type) {
  return type == FaceTexelType::uint8 ? 1 : type == FaceTexelType::float32 ? 4 : 2;
}

inline constexpr uint32_t kNoFace = 0xffffffffu;
inline constexpr uint32_t kMaxFaceLog2 = 15;  // 32768 texels an edge

enum FaceFlag : uint8_t {
  kFaceIsConstant = 1,
  kFaceHasEdits = 2,
  kFaceNeighbourhoodIsConstant = 4,
  kFaceIsSubface = 8
};

// Lies in files as it stands here.
struct FaceInfo {
  uint8_t ulog2 = 0, vlog2 = 0;  // of the texels along u and v
  uint8_t adjacent_edges = 0;    // two bits an edge: the neighbour's edge
  uint8_t flags = 0;             // FaceFlag
  uint32_t adjacent_faces[4] = {kNoFace, kNoFace, kNoFace, kNoFace};

  [[nodiscard]] uint32_t adjacent_edge(uint32_t edge) const { return adjacent_edges >> (2 * edge) & 3u; }
  [[nodiscard]] bool is_subface() const { return (flags & kFaceIsSubface) != 0; }
};
static_assert(sizeof(FaceInfo) == 20);

[[nodiscard]] constexpr uint32_t edge_count(FaceShape shape) { return shape == FaceShape::quad ? 4 : 3; }

// Where an edge leads.
struct Neighbour {
  uint32_t face = kNoFace;
  uint32_t edge = 0;
  int part =
      -1;  // into subfaces: the half of our edge that this one has; out of a subface: the half of its edge; else -1
  [[nodiscard]] bool exists() const { return face != kNoFace; }
};

// `second_half`: which half of the edge, counted along it, one leaves by; matters from whole faces to subfaces alone.
[[nodiscard]] Neighbour neighbour_across(std::span<const FaceInfo> faces, uint32_t face, uint32_t edge,
                                         bool second_half);

// A place beyond `edge` of a face, seen from the neighbour: an affine map that is exact for multiples of powers of two.
struct FacePlace {
  float u, v;
};
[[nodiscard]] FacePlace place_across(FaceShape shape, FacePlace place, uint32_t edge, bool is_from_subface,
                                     const Neighbour& to);

// How far along `edge` (0 at its beginning, 1 at its end) a place lies.
[[nodiscard]] float along_edge(FaceShape shape, FacePlace place, uint32_t edge);

// The texel of a triangle, size texels an edge, that holds a place.
struct TexelIndex {
  int u, v;
};
[[nodiscard]] TexelIndex triangle_texel(FacePlace place, int size);

// Whether four quads meet at a corner of one, so that the one across it can be told; or two subfaces do in the middle
// of a whole face's edge.
[[nodiscard]] bool is_regular_corner(std::span<const FaceInfo> faces, uint32_t face, uint32_t corner);

// Whether a face names neighbours that name it: kNoFace, or the first edge that does not.
[[nodiscard]] uint32_t first_inconsistent_edge(std::span<const FaceInfo> faces, FaceShape shape, uint32_t face);

}  // namespace spillway::cache
