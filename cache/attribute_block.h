#pragma once

// Attributes of triangles, apart from the tracing pages: positions, normals, uvs by face.
//
// Blocks hold consecutive prims, in (mesh, face) order; meshes are numbered by (material, order of import), so that
// reading attributes in the order of sorted hits reads the file front to back, each block once.
// (Trace pages are spatial clusters; keeping attributes out of them makes a ray's result independent of the page.)
//
// Format, little endian, each block at a 4096-aligned offset:
//   AttributeBlockHeader
//   AttributeSegment[segment_count]        one a mesh that has faces in this block, by ascending prim
//   per segment, each column 16-aligned, at the offset given in the segment:
//     uint16 indices[face_count][3]        into this segment's vertices
//     Float3 position_object[vertex_count]
//     Float3 normal_object[vertex_count]   only with kHasNormals
//     Float2 uv[vertex_count]              only with kHasUvs

#include <cstdint>
#include <span>
#include <string_view>

#include "cache/base/ids.h"
#include "cache/base/result.h"
#include "cache/base/vec.h"

namespace spillway::cache {

inline constexpr uint32_t kAttributeBlockMagic = 0x42415053;  // "SPAB"
inline constexpr uint32_t kAttributeBlockVersion = 1;
inline constexpr uint32_t kMaxFacesPerAttributeBlock = 16384;

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

enum AttributeSegmentFlag : uint32_t { kHasNormals = 1, kHasUvs = 2 };

struct AttributeSegment {
  uint32_t mesh;
  uint32_t first_prim;
  uint32_t face_count;
  uint32_t vertex_count;
  uint32_t flags;
  uint32_t indices_offset;  // bytes from the start of the block; 0 for an absent column
  uint32_t positions_offset;
  uint32_t normals_offset;
  uint32_t uvs_offset;
  uint32_t reserved;
};
static_assert(sizeof(AttributeSegment) == 40);

// One triangle, gathered.
struct TriangleAttributes {
  MeshId mesh;
  bool has_normals = false;
  bool has_uvs = false;
  Float3 position_object[3];
  Float3 normal_object[3];
  Float2 uv[3];  // (0,0), (1,0), (1,1)-style defaults are the caller's business when has_uvs is false
};

// Checks everything a reader will follow: sizes, offsets, indices, order. `where` names file and block for the message.
Status validate_attribute_block(std::span<const std::byte> block, std::string_view where);

// prim must lie in the (validated) block.
TriangleAttributes triangle_attributes(std::span<const std::byte> block, PrimId prim);

}  // namespace spillway::cache
