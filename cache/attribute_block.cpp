#include "cache/attribute_block.h"

#include <algorithm>
#include <cstring>

#include "cache/base/alignment.h"
#include "cache/base/all_finite.h"
#include "cache/base/check.h"
#include "cache/base/hash.h"

namespace spillway::cache {
namespace {

constexpr uint64_t kColumnAlignment = 16;
constexpr uint64_t kChecksummedFrom = offsetof(AttributeBlockHeader, size_bytes);


// Where a segment's columns lie, given where they may begin. 64 bit: counts from a damaged file must not overflow.
struct Columns {
  uint64_t indices = 0, positions = 0, normals = 0, uvs = 0, faces = 0;
  uint64_t end = 0;
};

Columns columns_from(uint64_t begin, uint32_t face_count, uint32_t vertex_count, uint32_t flags) {
  Columns at;
  at.indices = aligned(begin, kColumnAlignment);
  at.positions = aligned(at.indices + uint64_t{face_count} * 3 * sizeof(uint16_t), kColumnAlignment);
  at.end = at.positions + uint64_t{vertex_count} * sizeof(Float3);
  if (flags & kHasNormals) {
    at.normals = aligned(at.end, kColumnAlignment);
    at.end = at.normals + uint64_t{vertex_count} * sizeof(Float3);
  }
  if (flags & kHasUvs) {
    at.uvs = aligned(at.end, kColumnAlignment);
    at.end = at.uvs + uint64_t{vertex_count} * sizeof(Float2);
  }
  if (flags & kHasFaces) {
    at.faces = aligned(at.end, kColumnAlignment);
    at.end = at.faces + uint64_t{face_count} * sizeof(FaceOfTriangle);
  }
  return at;
}

uint64_t table_end(uint32_t segment_count) {
  return sizeof(AttributeBlockHeader) + uint64_t{segment_count} * sizeof(AttributeSegment);
}

uint64_t block_checksum(std::span<const std::byte> block) {
  return checksum(block.data() + kChecksummedFrom, block.size() - kChecksummedFrom);
}

const AttributeBlockHeader& header_of(std::span<const std::byte> block) {
  return *reinterpret_cast<const AttributeBlockHeader*>(block.data());
}

std::span<const AttributeSegment> segments_of(std::span<const std::byte> block) {
  const auto* first = reinterpret_cast<const AttributeSegment*>(block.data() + sizeof(AttributeBlockHeader));
  return {first, header_of(block).segment_count};
}

template <class T>
const T* column(const std::byte* block, uint32_t offset) {
  return reinterpret_cast<const T*>(block + offset);
}
template <class T>
const T* column(std::span<const std::byte> block, uint32_t offset) {
  return column<T>(block.data(), offset);
}
const uint16_t* indices_of(const TrianglePlace& place) {
  return column<uint16_t>(place.block, place.segment->indices_offset) + size_t{3} * place.face;
}

template <class T>
void put_column(std::span<std::byte> block, uint64_t offset, const std::vector<T>& items) {
  if (!items.empty()) std::memcpy(block.data() + offset, items.data(), items.size() * sizeof(T));
}

AttributeSegment segment_entry(const AttributeSegmentData& data, uint64_t& end) {
  AttributeSegment segment{};
  segment.mesh = data.mesh;
  segment.first_prim = data.first_prim;
  segment.face_count = static_cast<uint32_t>(data.indices.size() / 3);
  segment.vertex_count = static_cast<uint32_t>(data.positions.size());
  segment.flags = (data.normals.empty() ? 0u : kHasNormals) | (data.uvs.empty() ? 0u : kHasUvs) |
                  (data.faces.empty() ? 0u : kHasFaces);
  const Columns at = columns_from(end, segment.face_count, segment.vertex_count, segment.flags);
  segment.indices_offset = static_cast<uint32_t>(at.indices);
  segment.positions_offset = static_cast<uint32_t>(at.positions);
  segment.normals_offset = static_cast<uint32_t>(at.normals);
  segment.uvs_offset = static_cast<uint32_t>(at.uvs);
  segment.faces_offset = static_cast<uint32_t>(at.faces);
  end = at.end;
  return segment;
}

void check_input(std::span<const AttributeSegmentData> segments) {
  SPILLWAY_CHECK(segments.size(), >, 0u);
  size_t faces = 0;
  for (const AttributeSegmentData& data : segments) {
    SPILLWAY_CHECK(data.indices.size() % 3, ==, 0u);
    SPILLWAY_CHECK(data.positions.size(), <=, size_t{kMaxVerticesPerAttributeSegment});
    SPILLWAY_CHECK(data.first_prim, ==, segments[0].first_prim + static_cast<uint32_t>(faces));
    if (!data.normals.empty()) SPILLWAY_CHECK(data.normals.size(), ==, data.positions.size());
    if (!data.uvs.empty()) SPILLWAY_CHECK(data.uvs.size(), ==, data.positions.size());
    if (!data.faces.empty()) SPILLWAY_CHECK(data.faces.size(), ==, data.indices.size() / 3);
    faces += data.indices.size() / 3;
  }
  SPILLWAY_CHECK(faces, <=, size_t{kMaxFacesPerAttributeBlock});
}

Status validate_header(std::span<const std::byte> block, std::string_view where) {
  if (block.size() < sizeof(AttributeBlockHeader))
    return error("{}: an attribute block of {} bytes is shorter than its header; pack the scene again", where,
                 block.size());
  const AttributeBlockHeader& header = header_of(block);
  if (header.magic != kAttributeBlockMagic) return error("{}: byte 0: is no attribute block", where);
  if (header.version != kAttributeBlockVersion)
    return error("{}: byte 4: an attribute block of version {}, this program reads version {}; pack the scene again",
                 where, header.version, kAttributeBlockVersion);
  if (header.size_bytes != block.size() || block.size() % kAttributeBlockAlignment != 0)
    return error("{}: byte 16: an attribute block should have {} bytes but {} are there; pack the scene again", where,
                 header.size_bytes, block.size());
  if (header.checksum != block_checksum(block))
    return error("{}: byte 8: the checksum of an attribute block does not match; pack the scene again", where);
  if (header.prim_count == 0 || header.prim_count > kMaxFacesPerAttributeBlock ||
      header.first_prim > PrimId::kNone - header.prim_count)
    return error("{}: byte 24: an attribute block of prims {} + {} is impossible; pack the scene again", where,
                 header.first_prim, header.prim_count);
  if (header.segment_count == 0 || header.segment_count > header.prim_count ||
      table_end(header.segment_count) > block.size())
    return error("{}: byte 32: an attribute block cannot have {} segments; pack the scene again", where,
                 header.segment_count);
  return {};
}

// `end`: where the columns before this segment end; moved on.
Status validate_layout(const AttributeSegment& segment, uint64_t& end, uint64_t block_bytes, std::string_view where,
                       size_t index) {
  const Columns at = columns_from(end, segment.face_count, segment.vertex_count, segment.flags);
  if (segment.vertex_count == 0 || segment.vertex_count > kMaxVerticesPerAttributeSegment ||
      segment.face_count > kMaxFacesPerAttributeBlock || (segment.flags & ~(kHasNormals | kHasUvs | kHasFaces)) != 0)
    return error("{}: segment {} has impossible counts or flags; pack the scene again", where, index);
  if (segment.indices_offset != at.indices || segment.positions_offset != at.positions ||
      segment.normals_offset != at.normals || segment.uvs_offset != at.uvs || segment.faces_offset != at.faces ||
      at.end > block_bytes)
    return error("{}: segment {} has columns at wrong places; pack the scene again", where, index);
  end = at.end;
  return {};
}

Status validate_columns(std::span<const std::byte> block, const AttributeSegment& segment, std::string_view where,
                        size_t index) {
  const auto* indices = column<uint16_t>(block, segment.indices_offset);
  const uint16_t highest = *std::max_element(indices, indices + size_t{3} * segment.face_count);
  if (highest >= segment.vertex_count)
    return error("{}: segment {} has index {} of {} vertices; pack the scene again", where, index, highest,
                 segment.vertex_count);
  const size_t vertices = segment.vertex_count;
  if (!all_finite(column<float>(block, segment.positions_offset), 3 * vertices) ||
      ((segment.flags & kHasNormals) && !all_finite(column<float>(block, segment.normals_offset), 3 * vertices)) ||
      ((segment.flags & kHasUvs) && !all_finite(column<float>(block, segment.uvs_offset), 2 * vertices)))
    return error("{}: segment {} has a value that is not finite; pack the scene again", where, index);
  if (!(segment.flags & kHasFaces)) return {};
  const auto* faces = column<FaceOfTriangle>(block, segment.faces_offset);
  for (uint32_t f = 0; f < segment.face_count; ++f)
    if (faces[f].corners >= 2 * kWholeFace || !all_finite(faces[f].fourth, 2))
      return error("{}: segment {}, face {}: is no part of a face texture; pack the scene again", where, index, f);
  return {};
}

}  // namespace

Buffer<std::byte> build_attribute_block(std::span<const AttributeSegmentData> segments) {
  check_input(segments);
  const auto segment_count = static_cast<uint32_t>(segments.size());
  uint64_t end = table_end(segment_count);
  std::vector<AttributeSegment> table;
  for (const AttributeSegmentData& data : segments) table.push_back(segment_entry(data, end));

  Buffer<std::byte> block(MemoryTag::pack, aligned(end, kAttributeBlockAlignment));
  AttributeBlockHeader header{};
  header.magic = kAttributeBlockMagic;
  header.version = kAttributeBlockVersion;
  header.size_bytes = block.size();
  header.first_prim = table.front().first_prim;
  header.prim_count = table.back().first_prim + table.back().face_count - header.first_prim;
  header.segment_count = segment_count;
  for (size_t i = 0; i < segments.size(); ++i) {
    put_column(block, table[i].indices_offset, segments[i].indices);
    put_column(block, table[i].positions_offset, segments[i].positions);
    put_column(block, table[i].normals_offset, segments[i].normals);
    put_column(block, table[i].uvs_offset, segments[i].uvs);
    put_column(block, table[i].faces_offset, segments[i].faces);
  }
  put_column(block, sizeof header, table);
  std::memcpy(block.data(), &header, sizeof header);
  header.checksum = block_checksum(block);
  std::memcpy(block.data(), &header, sizeof header);
  return block;
}

Status validate_attribute_block(std::span<const std::byte> block, std::string_view where) {
  SPILLWAY_TRY(validate_header(block, where));
  const AttributeBlockHeader& header = header_of(block);
  uint64_t end = table_end(header.segment_count);
  uint64_t next_prim = header.first_prim;
  const std::span<const AttributeSegment> segments = segments_of(block);
  for (size_t i = 0; i < segments.size(); ++i) {
    if (segments[i].first_prim != next_prim || segments[i].face_count == 0 ||
        (i > 0 && segments[i].mesh <= segments[i - 1].mesh))
      return error("{}: segment {} is out of order; pack the scene again", where, i);
    SPILLWAY_TRY(validate_layout(segments[i], end, block.size(), where, i));
    SPILLWAY_TRY(validate_columns(block, segments[i], where, i));
    next_prim += segments[i].face_count;
  }
  if (next_prim != uint64_t{header.first_prim} + header.prim_count)
    return error("{}: an attribute block lacks prims; pack the scene again", where);
  return {};
}

TriangleAttributes triangle_attributes(std::span<const std::byte> block, PrimId prim) {
  return triangle_attributes(triangle_place(block, prim, {}));
}

TrianglePlace triangle_place(std::span<const std::byte> block, PrimId prim, const TrianglePlace& neighbour) {
  if (neighbour.block == block.data() && prim.value - neighbour.segment->first_prim < neighbour.segment->face_count)
    return {neighbour.block, neighbour.segment, prim.value - neighbour.segment->first_prim};
  const std::span<const AttributeSegment> segments = segments_of(block);
  const auto after = std::upper_bound(segments.begin(), segments.end(), prim.value,
                                      [](uint32_t p, const AttributeSegment& s) { return p < s.first_prim; });
  SPILLWAY_CHECK(after - segments.begin(), >, 0);
  const AttributeSegment& segment = *(after - 1);
  SPILLWAY_CHECK(prim.value - segment.first_prim, <, segment.face_count);
  return {block.data(), &segment, prim.value - segment.first_prim};
}

void prefetch_indices(const TrianglePlace& place) { __builtin_prefetch(indices_of(place)); }

void prefetch_vertices(const TrianglePlace& place) {
  const AttributeSegment& segment = *place.segment;
  const uint16_t* index = indices_of(place);
  for (int k = 0; k < 3; ++k) {
    __builtin_prefetch(column<Float3>(place.block, segment.positions_offset) + index[k]);
    if (segment.flags & kHasNormals) __builtin_prefetch(column<Float3>(place.block, segment.normals_offset) + index[k]);
    if (segment.flags & kHasUvs) __builtin_prefetch(column<Float2>(place.block, segment.uvs_offset) + index[k]);
  }
}

TriangleAttributes triangle_attributes(const TrianglePlace& place) {
  const AttributeSegment& segment = *place.segment;
  const uint16_t* index = indices_of(place);
  TriangleAttributes triangle;
  triangle.mesh = MeshId{segment.mesh};
  triangle.has_normals = (segment.flags & kHasNormals) != 0;
  triangle.has_uvs = (segment.flags & kHasUvs) != 0;
  triangle.has_face = (segment.flags & kHasFaces) != 0;
  if (triangle.has_face) triangle.face = column<FaceOfTriangle>(place.block, segment.faces_offset)[place.face];
  for (int k = 0; k < 3; ++k) {
    triangle.position_object[k] = column<Float3>(place.block, segment.positions_offset)[index[k]];
    if (triangle.has_normals) triangle.normal_object[k] = column<Float3>(place.block, segment.normals_offset)[index[k]];
    if (triangle.has_uvs) triangle.uv[k] = column<Float2>(place.block, segment.uvs_offset)[index[k]];
  }
  return triangle;
}

}  // namespace spillway::cache
