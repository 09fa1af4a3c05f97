#include "cache/attribute_block.h"

#include <algorithm>
#include <cstring>

#include "cache/base/alignment.h"
#include "cache/base/all_finite.h"
#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "cache/compact_segment.h"

namespace spillway::cache {
namespace {

constexpr uint64_t kColumnAlignment = 16;
constexpr uint64_t kChecksummedFrom = offsetof(AttributeBlockHeader, size_bytes);

uint64_t group_count(uint64_t face_count) { return (face_count + kFacesPerIndexGroup - 1) / kFacesPerIndexGroup; }

// Gives a segment the places of its columns, from its counts and flags; returns their end. 64 bit: counts from a
// damaged file must not overflow.
uint64_t place_columns(uint64_t begin, AttributeSegment& segment) {
  uint64_t end = begin;
  const auto place = [&](bool is_there, uint32_t& offset, uint64_t count, uint64_t size) {
    offset = 0;
    if (!is_there) return;
    end = aligned(end, kColumnAlignment);
    offset = static_cast<uint32_t>(end);
    end += count * size;
  };
  const uint64_t faces = segment.face_count, vertices = segment.vertex_count;
  const bool narrow = (segment.flags & kNarrowIndices) != 0, paired = (segment.flags & kPairedPositions) != 0;
  place(true, segment.indices_offset, 3 * faces, narrow ? sizeof(uint8_t) : sizeof(uint16_t));
  place(narrow, segment.bases_offset, group_count(faces), sizeof(uint16_t));
  place(true, segment.positions_offset, vertices, paired ? sizeof(PositionCode) : sizeof(Float3));
  place(paired, segment.pairs_offset, segment.pair_count, sizeof(Float2));
  place(paired, segment.lones_offset, segment.lone_count, sizeof(float));
  place((segment.flags & kHasNormals) != 0, segment.normals_offset, vertices, sizeof(Float3));
  place((segment.flags & kHasUvs) != 0, segment.uvs_offset, vertices, sizeof(Float2));
  place((segment.flags & kHasFaces) != 0, segment.faces_offset, faces, sizeof(FaceOfTriangle));
  return end;
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
template <class T>
void put_column(std::span<std::byte> block, uint64_t offset, const std::vector<T>& items) {
  if (!items.empty()) std::memcpy(block.data() + offset, items.data(), items.size() * sizeof(T));
}

// As it will lie in the block.
struct CompactSegment {
  AttributeSegment entry{};
  const AttributeSegmentData* data = nullptr;
  NarrowIndices narrow;
  PairedPositions paired;

  explicit CompactSegment(const AttributeSegmentData& from) : data(&from), paired(pair_positions(from.positions)) {
    const bool is_paired = !paired.codes.empty();
    const size_t vertex_bytes = (is_paired ? sizeof(PositionCode) : sizeof(Float3)) +
                                (from.normals.empty() ? 0 : sizeof(Float3)) + (from.uvs.empty() ? 0 : sizeof(Float2));
    const auto vertex_count = static_cast<uint32_t>(from.positions.size());
    narrow = narrow_indices(from.indices, vertex_count, static_cast<uint32_t>(vertex_bytes));
    const bool is_narrow = !narrow.bases.empty();
    entry.mesh = from.mesh;
    entry.first_prim = from.first_prim;
    entry.face_count = static_cast<uint32_t>(from.indices.size() / 3);
    entry.vertex_count = is_narrow ? static_cast<uint32_t>(narrow.vertex.size()) : vertex_count;
    entry.flags = (from.normals.empty() ? 0u : kHasNormals) | (from.uvs.empty() ? 0u : kHasUvs) |
                  (from.faces.empty() ? 0u : kHasFaces) | (is_narrow ? kNarrowIndices : 0u) |
                  (is_paired ? kPairedPositions | paired.lone_axis << kLoneAxisShift : 0u);
    entry.pair_count = static_cast<uint32_t>(paired.pairs.size());
    entry.lone_count = static_cast<uint32_t>(paired.lones.size());
  }

  void put(std::span<std::byte> block) const {
    if (narrow.bases.empty())
      put_column(block, entry.indices_offset, data->indices);
    else
      put_column(block, entry.indices_offset, narrow.offsets), put_column(block, entry.bases_offset, narrow.bases);
    if (paired.codes.empty())
      put_vertices(block, entry.positions_offset, data->positions);
    else
      put_vertices(block, entry.positions_offset, paired.codes);
    put_column(block, entry.pairs_offset, paired.pairs);
    put_column(block, entry.lones_offset, paired.lones);
    put_vertices(block, entry.normals_offset, data->normals);
    put_vertices(block, entry.uvs_offset, data->uvs);
    put_column(block, entry.faces_offset, data->faces);
  }

 private:
  // In the order in which vertices are numbered.
  template <class T>
  void put_vertices(std::span<std::byte> block, uint64_t offset, const std::vector<T>& items) const {
    if (narrow.bases.empty() || items.empty()) return put_column(block, offset, items);
    std::byte* to = block.data() + offset;
    for (const uint16_t vertex : narrow.vertex) {
      std::memcpy(to, &items[vertex], sizeof(T));
      to += sizeof(T);
    }
  }
};

void check_input(std::span<const AttributeSegmentData> segments) {
  SPILLWAY_CHECK(segments.size(), >, 0u);
  size_t faces = 0;
  for (const AttributeSegmentData& data : segments) {
    SPILLWAY_CHECK(data.indices.size() % 3, ==, 0u);
    SPILLWAY_CHECK(data.positions.size(), <=, size_t{kMaxVerticesPerAttributeSegment});
    SPILLWAY_CHECK(size_t{*std::ranges::max_element(data.indices)}, <, data.positions.size());
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
  const uint32_t lone_axis = segment.flags >> kLoneAxisShift;
  const bool paired = (segment.flags & kPairedPositions) != 0;
  if (segment.vertex_count == 0 || segment.vertex_count > kMaxVerticesPerAttributeSegment ||
      segment.face_count > kMaxFacesPerAttributeBlock || lone_axis > (paired ? 2u : 0u) ||
      (segment.pair_count != 0) != paired || (segment.lone_count != 0) != paired ||
      segment.pair_count > segment.vertex_count || segment.lone_count > segment.vertex_count)
    return error("{}: segment {} has impossible counts or flags; pack the scene again", where, index);
  AttributeSegment placed = segment;
  end = place_columns(end, placed);
  if (std::memcmp(&placed, &segment, sizeof segment) != 0 || end > block_bytes)
    return error("{}: segment {} has columns at wrong places; pack the scene again", where, index);
  return {};
}

uint32_t highest_index(std::span<const std::byte> block, const AttributeSegment& segment) {
  uint32_t highest = 0;
  const size_t corners = size_t{3} * segment.face_count;
  if (!(segment.flags & kNarrowIndices)) {
    const auto* indices = column<uint16_t>(block, segment.indices_offset);
    return *std::max_element(indices, indices + corners);
  }
  for (size_t c = 0; c < corners; ++c) highest = std::max(highest, vertex_index(block.data(), segment, c));
  return highest;
}

Status validate_positions(std::span<const std::byte> block, const AttributeSegment& segment, std::string_view where,
                          size_t index) {
  if (!(segment.flags & kPairedPositions)) {
    if (all_finite(column<float>(block, segment.positions_offset), size_t{3} * segment.vertex_count)) return {};
  } else {
    const auto* codes = column<PositionCode>(block, segment.positions_offset);
    uint32_t pair = 0, lone = 0;
    for (uint32_t v = 0; v < segment.vertex_count; ++v)
      pair = std::max<uint32_t>(pair, codes[v].pair), lone = std::max<uint32_t>(lone, codes[v].lone);
    if (pair >= segment.pair_count || lone >= segment.lone_count)
      return error("{}: segment {} has a position made of coordinate {} of {} or {} of {}; pack the scene again", where,
                   index, pair, segment.pair_count, lone, segment.lone_count);
    if (all_finite(column<float>(block, segment.pairs_offset), size_t{2} * segment.pair_count) &&
        all_finite(column<float>(block, segment.lones_offset), segment.lone_count))
      return {};
  }
  return error("{}: segment {} has a value that is not finite; pack the scene again", where, index);
}

Status validate_columns(std::span<const std::byte> block, const AttributeSegment& segment, std::string_view where,
                        size_t index) {
  if (const uint32_t highest = highest_index(block, segment); highest >= segment.vertex_count)
    return error("{}: segment {} has index {} of {} vertices; pack the scene again", where, index, highest,
                 segment.vertex_count);
  SPILLWAY_TRY(validate_positions(block, segment, where, index));
  const size_t vertices = segment.vertex_count;
  if (((segment.flags & kHasNormals) && !all_finite(column<float>(block, segment.normals_offset), 3 * vertices)) ||
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
  std::vector<CompactSegment> compact(segments.begin(), segments.end());
  std::vector<AttributeSegment> table;
  for (CompactSegment& segment : compact) {
    end = place_columns(end, segment.entry);
    table.push_back(segment.entry);
  }

  Buffer<std::byte> block(MemoryTag::pack, aligned(end, kAttributeBlockAlignment));
  AttributeBlockHeader header{};
  header.magic = kAttributeBlockMagic;
  header.version = kAttributeBlockVersion;
  header.size_bytes = block.size();
  header.first_prim = table.front().first_prim;
  header.prim_count = table.back().first_prim + table.back().face_count - header.first_prim;
  header.segment_count = segment_count;
  for (const CompactSegment& segment : compact) segment.put(block);
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

uint32_t vertex_index(const std::byte* block, const AttributeSegment& segment, size_t corner) {
  if (!(segment.flags & kNarrowIndices)) return column<uint16_t>(block, segment.indices_offset)[corner];
  return uint32_t{column<uint16_t>(block, segment.bases_offset)[corner / (3 * kFacesPerIndexGroup)]} +
         column<uint8_t>(block, segment.indices_offset)[corner];
}

Float3 vertex_position(const std::byte* block, const AttributeSegment& segment, uint32_t vertex) {
  if (!(segment.flags & kPairedPositions)) return column<Float3>(block, segment.positions_offset)[vertex];
  const PositionCode code = column<PositionCode>(block, segment.positions_offset)[vertex];
  return paired_position(segment.flags >> kLoneAxisShift, column<Float2>(block, segment.pairs_offset)[code.pair],
                         column<float>(block, segment.lones_offset)[code.lone]);
}

void prefetch_indices(const TrianglePlace& place) {
  const AttributeSegment& segment = *place.segment;
  const bool narrow = (segment.flags & kNarrowIndices) != 0;
  __builtin_prefetch(place.block + segment.indices_offset + size_t{3} * place.face * (narrow ? 1 : 2));
  if (narrow)
    __builtin_prefetch(column<uint16_t>(place.block, segment.bases_offset) + place.face / kFacesPerIndexGroup);
}

void prefetch_vertices(const TrianglePlace& place) {
  const AttributeSegment& segment = *place.segment;
  const size_t position_bytes = (segment.flags & kPairedPositions) != 0 ? sizeof(PositionCode) : sizeof(Float3);
  for (size_t k = 0; k < 3; ++k) {
    const uint32_t index = vertex_index(place.block, segment, size_t{3} * place.face + k);
    __builtin_prefetch(place.block + segment.positions_offset + index * position_bytes);
    if (segment.flags & kHasNormals) __builtin_prefetch(column<Float3>(place.block, segment.normals_offset) + index);
    if (segment.flags & kHasUvs) __builtin_prefetch(column<Float2>(place.block, segment.uvs_offset) + index);
  }
}

TriangleAttributes triangle_attributes(const TrianglePlace& place) {
  const AttributeSegment& segment = *place.segment;
  TriangleAttributes triangle;
  triangle.mesh = MeshId{segment.mesh};
  triangle.has_normals = (segment.flags & kHasNormals) != 0;
  triangle.has_uvs = (segment.flags & kHasUvs) != 0;
  triangle.has_face = (segment.flags & kHasFaces) != 0;
  if (triangle.has_face) triangle.face = column<FaceOfTriangle>(place.block, segment.faces_offset)[place.face];
  for (size_t k = 0; k < 3; ++k) {
    const uint32_t index = vertex_index(place.block, segment, size_t{3} * place.face + k);
    triangle.position_object[k] = vertex_position(place.block, segment, index);
    if (triangle.has_normals) triangle.normal_object[k] = column<Float3>(place.block, segment.normals_offset)[index];
    if (triangle.has_uvs) triangle.uv[k] = column<Float2>(place.block, segment.uvs_offset)[index];
  }
  return triangle;
}

}  // namespace spillway::cache
