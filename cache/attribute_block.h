#pragma once

// Attributes of triangles, apart from the tracing pages: positions, normals, uvs by face.
//
// Blocks hold consecutive prims, in (mesh, face) order; meshes are numbered by (material, order of import), so that
// reading attributes in the order of sorted hits reads the file front to back, each block once.
// (Trace pages are spatial clusters; keeping attributes out of them makes a ray's result independent of the page.)
//
// Format, little endian, each block at a 4096-aligned offset, size_bytes a multiple of 4096 (zeros at the end):
//   AttributeBlockHeader
//   AttributeSegment[segment_count]        one a mesh that has faces in this block, by ascending prim
//   per segment, in this order and without gaps beyond the alignment, each column 16-aligned:
//     uint16 indices[face_count][3]        into this segment's vertices
//     Float3 position_object[vertex_count]
//       with kNarrowIndices (compact_segment.h) instead of the former:
//     uint8 offsets[face_count][3]         from the base of the face's group
//     uint16 bases[face groups]
//       with kPairedPositions instead of the latter:
//     PositionCode codes[vertex_count]
//     Float2 pairs[pair_count]
//     float lones[lone_count]
//     Float3 normal_object[vertex_count]   only with kHasNormals
//     Float2 uv[vertex_count]              only with kHasUvs
//     FaceOfTriangle faces[face_count]     only with kHasFaces
// There is one layout for given contents, so that a reader can refuse every other.

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "cache/base/ids.h"
#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "cache/base/vec.h"

namespace spillway::cache {

inline constexpr uint32_t kAttributeBlockMagic = 0x42415053;  // "SPAB"
inline constexpr uint32_t kAttributeBlockVersion = 2;
inline constexpr uint32_t kMaxFacesPerAttributeBlock = 16384;
inline constexpr uint32_t kMaxVerticesPerAttributeSegment = 65535;  // 16-bit indices; 16384 faces have at most 49152
inline constexpr uint32_t kAttributeBlockAlignment = 4096;

struct AttributeBlockHeader {
  uint32_t magic;
  uint32_t version;
  uint64_t checksum;  // XXH3 of everything after this field, to size_bytes
  uint64_t size_bytes;
  uint32_t first_prim;
  uint32_t prim_count;  // dense: prims first_prim .. first_prim + prim_count - 1
  uint32_t segment_count;
  uint32_t reserved;
};
static_assert(sizeof(AttributeBlockHeader) == 40);

enum AttributeSegmentFlag : uint32_t {
  kHasNormals = 1,
  kHasUvs = 2,
  kHasFaces = 4,
  kNarrowIndices = 8,
  kPairedPositions = 16,
};
inline constexpr uint32_t kLoneAxisShift = 5;  // two bits of the flags, of paired positions

// Which part of a face of a face texture a triangle is.
struct FaceOfTriangle {
  uint32_t face;
  // The face's corners that the triangle's are: two bits each, the first lowest; and kWholeFace where the face is a
  // triangle.
  uint32_t corners;
  float fourth[2];  // a quad's other corner, in the plane: p0 + fourth[0] (p1 - p0) + fourth[1] (p2 - p0)
};
static_assert(sizeof(FaceOfTriangle) == 16);
inline constexpr uint32_t kWholeFace = 64;
[[nodiscard]] constexpr uint32_t face_corners(uint32_t a, uint32_t b, uint32_t c) { return a | b << 2 | c << 4; }

struct AttributeSegment {
  uint32_t mesh;
  uint32_t first_prim;
  uint32_t face_count;
  uint32_t vertex_count;
  uint32_t flags;
  uint32_t pair_count, lone_count;
  uint32_t indices_offset;  // bytes from the start of the block; 0 for an absent column
  uint32_t bases_offset;
  uint32_t positions_offset;  // or their codes
  uint32_t pairs_offset;
  uint32_t lones_offset;
  uint32_t normals_offset;
  uint32_t uvs_offset;
  uint32_t faces_offset;
};
static_assert(sizeof(AttributeSegment) == 60);

// The faces of one mesh for one block, as the writer has them. Columns that are empty are absent.
struct AttributeSegmentData {
  uint32_t mesh = MeshId::kNone;
  uint32_t first_prim = 0;
  std::vector<uint16_t> indices;  // three a face
  std::vector<Float3> positions, normals;
  std::vector<Float2> uvs;
  std::vector<FaceOfTriangle> faces;  // one a face
};

// The bytes of a block. Segments are made as small as they get: faces keep their order, vertices need not. Segments by
// ascending prim, dense; at most kMaxFacesPerAttributeBlock faces in all.
Buffer<std::byte> build_attribute_block(std::span<const AttributeSegmentData> segments);

// One triangle, gathered.
struct TriangleAttributes {
  MeshId mesh;
  bool has_normals = false;
  bool has_uvs = false;
  bool has_face = false;
  Float3 position_object[3] = {};
  Float3 normal_object[3] = {};
  FaceOfTriangle face = {};
  Float2 uv[3] = {};  // (0,0), (1,0), (1,1)-style defaults are the caller's business when has_uvs is false
};

// Checks everything a reader will follow: sizes, offsets, indices, order. `where` names file and block for the message.
Status validate_attribute_block(std::span<const std::byte> block, std::string_view where);

// prim must lie in the (validated) block. Absent normals and uvs are zero.
TriangleAttributes triangle_attributes(std::span<const std::byte> block, PrimId prim);

// The same in steps, for sorted hits: neighbours share a segment, and what many triangles will need can be asked of the
// memory before the first of them waits for it.
struct TrianglePlace {
  const std::byte* block = nullptr;
  const AttributeSegment* segment = nullptr;
  uint32_t face = 0;
};
// `neighbour`: any place found before, or none.
TrianglePlace triangle_place(std::span<const std::byte> block, PrimId prim, const TrianglePlace& neighbour);
void prefetch_indices(const TrianglePlace& place);
void prefetch_vertices(const TrianglePlace& place);  // reads the indices
// Of one corner of a segment's faces (three times the face, plus which), and of a vertex.
[[nodiscard]] uint32_t vertex_index(const std::byte* block, const AttributeSegment& segment, size_t corner);
[[nodiscard]] Float3 vertex_position(const std::byte* block, const AttributeSegment& segment, uint32_t vertex);
TriangleAttributes triangle_attributes(const TrianglePlace& place);

}  // namespace spillway::cache
