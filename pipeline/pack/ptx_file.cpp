#include "pipeline/pack/ptx_file.h"

#include <immintrin.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>

namespace spillway::pipeline {

using cache::FaceInfo;
using cache::FaceTexelType;

#pragma pack(push, 1)
struct PtxFile::Header {
  uint32_t magic, version, shape, type;
  int32_t alpha_channel;
  uint16_t channels, level_count;
  uint32_t face_count, extra_size, faces_size, constants_size, levels_size, minor_version;
  uint64_t level_data_size;
  uint32_t metadata_zipped_size, metadata_size;
};
struct PtxFile::Extra {
  uint16_t u_border, reserved, v_border, edge_filter;
  uint32_t large_metadata_headers_zipped_size, large_metadata_headers_size;
  uint64_t large_metadata_size, edits_size, edits_offset;
};
#pragma pack(pop)

namespace {

#pragma pack(push, 1)
struct LevelEntry {
  uint64_t size;
  uint32_t header_size, face_count;
};
struct EditHeader {
  uint8_t type;
  uint32_t size;
};
struct FaceEdit {
  uint32_t face;
  FaceInfo info;
  uint32_t block;
};
#pragma pack(pop)

constexpr uint32_t kMagic = 0x78657450;  // "Ptex"
constexpr uint32_t kMostLevels = 2 * cache::kMaxFaceLog2;
constexpr uint64_t kMostExpansion = 1032;  // of deflate, by its format
enum Encoding : uint32_t { kConstant, kDeflated, kDifferences, kTiled };

template <class T>
void sum_up(std::span<std::byte> bytes) {
  T last = 0;
  for (size_t i = 0; i + sizeof(T) <= bytes.size(); i += sizeof(T)) {
    T value;
    std::memcpy(&value, bytes.data() + i, sizeof value);
    last = static_cast<T>(last + value);
    std::memcpy(bytes.data() + i, &last, sizeof last);
  }
}

// Numbers of a type, as floats in the type's own scale.
float number_at(FaceTexelType type, const std::byte* at) {
  switch (type) {
    case FaceTexelType::uint8:
      return static_cast<float>(*at);
    case FaceTexelType::uint16: {
      uint16_t value;
      std::memcpy(&value, at, sizeof value);
      return value;
    }
    case FaceTexelType::half: {
      uint16_t value;
      std::memcpy(&value, at, sizeof value);
      return _cvtsh_ss(value);
    }
    case FaceTexelType::float32:
      break;
  }
  float value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

// To the nearest, ties away from zero: half a unit more, then cut off.
uint16_t half_from(float value) {
  const __m128 up = _mm_set_ss(std::bit_cast<float>(std::bit_cast<uint32_t>(value) + 0x1000));
  return static_cast<uint16_t>(_mm_cvtsi128_si32(_mm_cvtps_ph(up, _MM_FROUND_TO_ZERO)));
}

void put_number(FaceTexelType type, float value, std::byte* at) {
  if (type == FaceTexelType::uint8) {
    *at = static_cast<std::byte>(static_cast<uint8_t>(value));
  } else if (type == FaceTexelType::float32) {
    std::memcpy(at, &value, sizeof value);
  } else {
    const uint16_t bits = type == FaceTexelType::uint16 ? static_cast<uint16_t>(value) : half_from(value);
    std::memcpy(at, &bits, sizeof bits);
  }
}

// An image in memory, and its texels' numbers.
struct Texels {
  const std::vector<std::byte>& bytes;
  FaceTexelType type;
  uint32_t channels, width;
  [[nodiscard]] float at(uint32_t x, uint32_t y, uint32_t channel) const {
    return number_at(type, bytes.data() + ((size_t{y} * width + x) * channels + channel) * texel_type_bytes(type));
  }
};

// `sum_of(x, y, channel)` over `share` of texels: integers round down.
template <class SumOf>
std::vector<std::byte> shrunk(const Texels& from, uint32_t width, uint32_t height, float share, const SumOf& sum_of) {
  const uint32_t size = texel_type_bytes(from.type);
  std::vector<std::byte> out(size_t{width} * height * from.channels * size);
  std::byte* at = out.data();
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      for (uint32_t c = 0; c < from.channels; ++c, at += size) put_number(from.type, sum_of(x, y, c) * share, at);
  return out;
}

std::vector<std::byte> halved_in_u(const Texels& from, uint32_t width, uint32_t height) {
  return shrunk(from, width, height, 0.5f,
                [&](uint32_t x, uint32_t y, uint32_t c) { return from.at(2 * x, y, c) + from.at(2 * x + 1, y, c); });
}

std::vector<std::byte> halved_in_v(const Texels& from, uint32_t width, uint32_t height) {
  return shrunk(from, width, height, 0.5f,
                [&](uint32_t x, uint32_t y, uint32_t c) { return from.at(x, 2 * y, c) + from.at(x, 2 * y + 1, c); });
}

// Three triangles that stand as the large one does, and the one upside down between them.
std::vector<std::byte> halved_triangle(const Texels& from, uint32_t size) {
  const uint32_t last = from.width - 1;
  return shrunk(from, size, size, 0.25f, [&](uint32_t x, uint32_t y, uint32_t c) {
    return from.at(2 * x, 2 * y, c) + from.at(2 * x + 1, 2 * y, c) + from.at(2 * x, 2 * y + 1, c) +
           from.at(last - 2 * y, last - 2 * x, c);
  });
}

}  // namespace

Error PtxFile::damaged(uint64_t offset, std::string_view what) const {
  return error("{}: byte {}: {}; export the texture again", file_.path().string(), offset, what);
}

template <class T>
Result<T> PtxFile::read(uint64_t offset, uint64_t end) const {
  if (offset > end || end - offset < sizeof(T)) return damaged(offset, "the file or a part of it ends here");
  T value;
  SPILLWAY_TRY(file_.read(offset, std::as_writable_bytes(std::span(&value, 1))));
  return value;
}

Status PtxFile::check_expansion(uint64_t offset, uint64_t zipped_bytes, uint64_t unpacked_bytes) const {
  if (unpacked_bytes > zipped_bytes * kMostExpansion + 64)
    return damaged(offset, fmt::format("{} bytes cannot unpack to {}", zipped_bytes, unpacked_bytes));
  if (unpacked_bytes > options_.memory_limit_bytes)
    return damaged(
        offset, fmt::format("needs {} bytes, more than the {} allowed", unpacked_bytes, options_.memory_limit_bytes));
  return {};
}

Status PtxFile::inflate_at(uint64_t offset, uint64_t zipped_bytes, std::span<std::byte> out) const {
  std::vector<std::byte> piece(std::min<uint64_t>(zipped_bytes, 64 << 10));
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return error("{}: no memory to unpack it", file_.path().string());
  const std::unique_ptr<z_stream, int (*)(z_stream*)> ended(&stream, inflateEnd);
  size_t written = 0;
  int code = Z_OK;
  for (uint64_t taken = 0; code == Z_OK && taken < zipped_bytes;) {
    const auto part = std::span(piece).first(std::min<uint64_t>(piece.size(), zipped_bytes - taken));
    SPILLWAY_TRY(file_.read(offset + taken, part));
    taken += part.size();
    stream.next_in = reinterpret_cast<Bytef*>(part.data());
    stream.avail_in = static_cast<uInt>(part.size());
    while (code == Z_OK && stream.avail_in > 0) {
      const uInt room = static_cast<uInt>(std::min<size_t>(out.size() - written, 1u << 30));
      stream.next_out = reinterpret_cast<Bytef*>(out.data() + written);
      stream.avail_out = room;
      code = inflate(&stream, Z_NO_FLUSH);
      written += room - stream.avail_out;
    }
  }
  if (code != Z_STREAM_END || written != out.size())
    return damaged(offset, fmt::format("deflated data is damaged, or is not of {} bytes", out.size()));
  return {};
}

// ---- opening ----

Result<PtxFile> PtxFile::open(const std::filesystem::path& path, Options options) {
  SPILLWAY_ASSIGN(cache::ReadFile file, cache::ReadFile::open(path, {.purpose = cache::IoPurpose::pack}));
  PtxFile ptx(std::move(file));
  ptx.options_ = options;
  Header header{};
  SPILLWAY_TRY(ptx.read_header(header));
  const uint64_t size = ptx.file_.size_bytes();
  Extra extra{};
  const auto extra_bytes =
      std::as_writable_bytes(std::span(&extra, 1)).first(std::min<size_t>(sizeof extra, header.extra_size));
  uint64_t at = sizeof(Header);
  if (header.extra_size > size - at) return ptx.damaged(at, "the extended header is cut short");
  SPILLWAY_TRY(ptx.file_.read(at, extra_bytes));
  const uint64_t faces = at += header.extra_size;
  const uint64_t parts[] = {header.faces_size, header.constants_size, header.levels_size, header.level_data_size,
                            header.metadata_zipped_size};
  uint64_t starts[6] = {faces};
  for (size_t i = 0; i < std::size(parts); ++i) {
    if (parts[i] > size - starts[i])
      return ptx.damaged(starts[i], fmt::format("a part of {} bytes is cut short", parts[i]));
    starts[i + 1] = starts[i] + parts[i];
  }
  SPILLWAY_TRY(ptx.check_expansion(starts[4], header.metadata_zipped_size, header.metadata_size));
  if (extra.u_border > 2 || extra.v_border > 2) return ptx.damaged(sizeof(Header), "the border mode is unknown");
  ptx.info_.u_border = static_cast<cache::FaceBorder>(extra.u_border);
  ptx.info_.v_border = static_cast<cache::FaceBorder>(extra.v_border);
  SPILLWAY_TRY(ptx.read_faces(header, starts[0], starts[1]));
  SPILLWAY_TRY(ptx.read_levels(header, starts[2], starts[3]));
  const bool has_edits_place = extra.edits_offset > 0;
  if (has_edits_place && (extra.edits_offset > size || extra.edits_size > size - extra.edits_offset))
    return ptx.damaged(sizeof(Header) + offsetof(Extra, edits_size), "the edits lie beyond the end of the file");
  // Files without the place of their edits have them at the end, after eight bytes for old readers.
  const uint64_t after_metadata = std::min(size, starts[5] + 8);
  if (!has_edits_place &&
      (extra.large_metadata_headers_zipped_size > size - after_metadata ||
       extra.large_metadata_size > size - after_metadata - extra.large_metadata_headers_zipped_size))
    return ptx.damaged(sizeof(Header), "the large metadata is cut short");
  const uint64_t edits = has_edits_place
                             ? extra.edits_offset
                             : after_metadata + extra.large_metadata_headers_zipped_size + extra.large_metadata_size;
  if (edits < starts[5]) return ptx.damaged(sizeof(Header), "the edits lie inside the texture");
  SPILLWAY_TRY(ptx.read_edits(edits, has_edits_place ? edits + extra.edits_size : size));
  SPILLWAY_TRY(ptx.check_faces(faces));
  return ptx;
}

Status PtxFile::read_header(Header& header) {
  SPILLWAY_ASSIGN(header, read<Header>(0, file_.size_bytes()));
  if (header.magic != kMagic) return damaged(0, "is no .ptx file");
  if (header.version != 1) return damaged(4, fmt::format("version {}; 1 can be read", header.version));
  if (header.shape > 1) return damaged(8, fmt::format("mesh type {} is unknown", header.shape));
  if (header.type > 3) return damaged(12, fmt::format("data type {} is unknown", header.type));
  if (header.channels == 0) return damaged(20, "there are no channels");
  if (header.level_count == 0 || header.level_count > kMostLevels)
    return damaged(22, fmt::format("{} levels; 1 to {} are possible", header.level_count, kMostLevels));
  if (header.face_count == 0) return damaged(24, "there are no faces");
  if (header.levels_size != header.level_count * sizeof(LevelEntry))
    return damaged(40, "the table of levels has a wrong size");
  info_.shape = static_cast<cache::FaceShape>(header.shape);
  info_.type = static_cast<FaceTexelType>(header.type);
  info_.channels = header.channels;
  info_.alpha_channel = header.alpha_channel >= 0 && header.alpha_channel < header.channels ? header.alpha_channel : -1;
  return {};
}

Status PtxFile::read_faces(const Header& header, uint64_t faces_offset, uint64_t constants_offset) {
  const uint64_t count = header.face_count;
  SPILLWAY_TRY(check_expansion(faces_offset, header.faces_size, count * sizeof(FaceInfo)));
  SPILLWAY_TRY(check_expansion(constants_offset, header.constants_size, count * texel_bytes()));
  faces_.resize(count);
  SPILLWAY_TRY(inflate_at(faces_offset, header.faces_size, std::as_writable_bytes(std::span(faces_))));
  constants_.resize(count * texel_bytes());
  SPILLWAY_TRY(inflate_at(constants_offset, header.constants_size, constants_));
  if (options_.premultiply) multiply_by_alpha(constants_);
  for (size_t f = 0; f < count; ++f)
    if (faces_[f].ulog2 > cache::kMaxFaceLog2 || faces_[f].vlog2 > cache::kMaxFaceLog2)
      return damaged(faces_offset, fmt::format("face {} has 2^{} x 2^{} texels; at most 2^{} an edge are possible", f,
                                               faces_[f].ulog2, faces_[f].vlog2, cache::kMaxFaceLog2));
  number_by_size();
  return {};
}

void PtxFile::number_by_size() {
  const auto size = [&](uint32_t f) {
    const FaceInfo& face = faces_[f];
    return face.flags & cache::kFaceIsConstant ? 1 : std::min(face.ulog2, face.vlog2);
  };
  std::vector<uint32_t> order(faces_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return size(a) > size(b); });
  number_by_size_.resize(order.size());
  for (uint32_t i = 0; i < order.size(); ++i) number_by_size_[order[i]] = i;
}

Status PtxFile::read_levels(const Header& header, uint64_t infos_offset, uint64_t levels_offset) {
  const uint64_t levels_end = levels_offset + header.level_data_size;
  uint64_t at = levels_offset;
  for (uint32_t l = 0; l < header.level_count; ++l) {
    const uint64_t entry_offset = infos_offset + l * sizeof(LevelEntry);
    SPILLWAY_ASSIGN(const LevelEntry entry, read<LevelEntry>(entry_offset, file_.size_bytes()));
    if (entry.size > levels_end - at || entry.header_size > entry.size)
      return damaged(entry_offset, fmt::format("level {} is larger than what there is", l));
    if (entry.face_count > header.face_count || (l == 0 && entry.face_count != header.face_count))
      return damaged(entry_offset + 12,
                     fmt::format("level {} has {} faces of {}", l, entry.face_count, header.face_count));
    SPILLWAY_TRY(check_expansion(at, entry.header_size, uint64_t{entry.face_count} * sizeof(uint32_t)));
    levels_.emplace_back(entry.face_count);
    SPILLWAY_TRY(read_blocks(at, entry.header_size, at + entry.size, levels_.back()));
    at += entry.size;
  }
  return {};
}

// A deflated table of block headers, and the blocks after it.
Status PtxFile::read_blocks(uint64_t offset, uint64_t zipped_bytes, uint64_t end, std::span<Block> blocks) const {
  std::vector<uint32_t> headers(blocks.size());
  if (!headers.empty()) SPILLWAY_TRY(inflate_at(offset, zipped_bytes, std::as_writable_bytes(std::span(headers))));
  uint64_t at = offset + zipped_bytes;
  for (size_t i = 0; i < blocks.size(); ++i) {
    blocks[i] = {at, headers[i]};
    at += blocks[i].size_bytes();
    if (at > end) return damaged(blocks[i].offset, fmt::format("block {} ends beyond its level", i));
  }
  return {};
}

Status PtxFile::read_edits(uint64_t offset, uint64_t end) {
  while (offset + sizeof(EditHeader) <= end) {
    SPILLWAY_ASSIGN(const EditHeader edit, read<EditHeader>(offset, end));
    if (edit.size == 0) return {};
    const uint64_t begin = offset + sizeof edit;
    if (edit.size > end - begin) return damaged(offset, "an edit ends beyond the file");
    if (edit.type == 0) SPILLWAY_TRY(read_edit(begin, begin + edit.size));
    offset = begin + edit.size;
  }
  return {};
}

Status PtxFile::read_edit(uint64_t offset, uint64_t end) {
  SPILLWAY_ASSIGN(const FaceEdit edit, read<FaceEdit>(offset, end));
  if (edit.face >= faces_.size()) return damaged(offset, fmt::format("edits face {} of {}", edit.face, faces_.size()));
  if (edit.info.ulog2 > cache::kMaxFaceLog2 || edit.info.vlog2 > cache::kMaxFaceLog2)
    return damaged(offset + 4, fmt::format("the edit of face {} has absurdly many texels", edit.face));
  const uint64_t texel = offset + sizeof edit;
  if (end - texel < texel_bytes()) return damaged(texel, "an edit is cut short");
  const auto constant = std::span(constants_).subspan(size_t{edit.face} * texel_bytes(), texel_bytes());
  SPILLWAY_TRY(file_.read(texel, constant));
  if (options_.premultiply) multiply_by_alpha(constant);
  faces_[edit.face] = edit.info;
  faces_[edit.face].flags |= cache::kFaceHasEdits;
  if (edit.info.flags & cache::kFaceIsConstant) return {};
  const Block block{texel + texel_bytes(), edit.block};
  if (block.size_bytes() > end - block.offset) return damaged(block.offset, "the texels of an edit are cut short");
  levels_[0][edit.face] = block;
  return {};
}

// After the edits, which may bring other neighbours.
Status PtxFile::check_faces(uint64_t offset) const {
  for (uint32_t f = 0; f < faces_.size(); ++f) {
    const FaceInfo& face = faces_[f];
    if (info_.shape == cache::FaceShape::triangle && face.ulog2 != face.vlog2)
      return damaged(offset, fmt::format("face {}, a triangle, has 2^{} x 2^{} texels", f, face.ulog2, face.vlog2));
    const uint32_t edge = first_inconsistent_edge(faces_, info_.shape, f);
    if (edge != cache::kNoFace)
      return damaged(offset,
                     fmt::format("face {}, edge {}: leads to face {}, edge {} of {} faces, which does not lead back", f,
                                 edge, face.adjacent_faces[edge], face.adjacent_edge(edge), faces_.size()));
  }
  return {};
}

// ---- texels ----

std::span<const std::byte> PtxFile::constant(uint32_t face) const {
  return std::span(constants_).subspan(size_t{face} * texel_bytes(), texel_bytes());
}

Result<std::vector<std::byte>> PtxFile::texels(uint32_t face, uint32_t ulog2, uint32_t vlog2) const {
  const FaceInfo& info = faces_[face];
  if (ulog2 > info.ulog2 || vlog2 > info.vlog2)
    return error("{}: face {} has 2^{} x 2^{} texels, not 2^{} x 2^{}", file_.path().string(), face, info.ulog2,
                 info.vlog2, ulog2, vlog2);
  if ((info.flags & cache::kFaceIsConstant) || (ulog2 == 0 && vlog2 == 0)) {
    const uint64_t count = uint64_t{1} << (ulog2 + vlog2);
    if (count * texel_bytes() > options_.memory_limit_bytes)
      return damaged(0, fmt::format("face {} needs {} bytes, more than allowed", face, count * texel_bytes()));
    std::vector<std::byte> out(count * texel_bytes());
    for (size_t i = 0; i < count; ++i)
      std::copy_n(constant(face).data(), texel_bytes(), out.data() + i * texel_bytes());
    return out;
  }
  const uint32_t halvings_u = info.ulog2 - ulog2, halvings_v = info.vlog2 - vlog2;
  const bool is_whole = halvings_u == 0 && halvings_v == 0;
  if (is_whole) {
    SPILLWAY_ASSIGN(std::vector<std::byte> out, block_texels(levels_[0][face], ulog2, vlog2, true));
    if (options_.premultiply) multiply_by_alpha(out);
    return out;
  }
  if (halvings_u == halvings_v && halvings_u < levels_.size() && !(info.flags & cache::kFaceHasEdits)) {
    const auto& level = levels_[halvings_u];
    if (number_by_size_[face] < level.size()) return block_texels(level[number_by_size_[face]], ulog2, vlog2, true);
  }
  return reduced(face, ulog2, vlog2);
}

Result<std::vector<std::byte>> PtxFile::reduced(uint32_t face, uint32_t ulog2, uint32_t vlog2) const {
  const FaceInfo& info = faces_[face];
  const uint32_t width = 1u << ulog2, height = 1u << vlog2;
  const uint32_t halvings_u = info.ulog2 - ulog2, halvings_v = info.vlog2 - vlog2;
  if (info_.shape == cache::FaceShape::triangle) {
    if (halvings_u != halvings_v)
      return error("{}: a triangle is reduced along all edges alike", file_.path().string());
    SPILLWAY_ASSIGN(const std::vector<std::byte> from, texels(face, ulog2 + 1, vlog2 + 1));
    return halved_triangle({from, info_.type, info_.channels, 2 * width}, width);
  }
  const bool in_u = halvings_u == halvings_v ? (ulog2 & 1) != 0 : halvings_u > halvings_v;
  if (in_u) {
    SPILLWAY_ASSIGN(const std::vector<std::byte> from, texels(face, ulog2 + 1, vlog2));
    return halved_in_u({from, info_.type, info_.channels, 2 * width}, width, height);
  }
  SPILLWAY_ASSIGN(const std::vector<std::byte> from, texels(face, ulog2, vlog2 + 1));
  return halved_in_v({from, info_.type, info_.channels, width}, width, height);
}

Result<std::vector<std::byte>> PtxFile::block_texels(const Block& block, uint32_t ulog2, uint32_t vlog2,
                                                     bool may_be_tiled) const {
  const uint64_t size = (uint64_t{1} << (ulog2 + vlog2)) * texel_bytes();
  const bool is_tiled = block.encoding() == kTiled;
  if (is_tiled && !may_be_tiled) return damaged(block.offset, "a tile of tiles");
  // A block of constant tiles unpacks to much; of anything else deflate sets the limit.
  if (block.encoding() == kDeflated || block.encoding() == kDifferences)
    SPILLWAY_TRY(check_expansion(block.offset, block.size_bytes(), size));
  if (size > options_.memory_limit_bytes)
    return damaged(block.offset, fmt::format("needs {} bytes, more than allowed", size));
  if (!is_tiled) {
    std::vector<std::byte> out(size);
    SPILLWAY_TRY(flat_texels(block, ulog2, vlog2, out));
    return out;
  }
  std::vector<std::byte> out;
  if (block.size_bytes() < 6) return damaged(block.offset, "the header of tiles is cut short");
  out.resize(size);
  SPILLWAY_TRY(tiled_texels(block, ulog2, vlog2, out));
  return out;
}

Status PtxFile::flat_texels(const Block& block, uint32_t ulog2, uint32_t vlog2, std::span<std::byte> out) const {
  const size_t texel = texel_bytes(), count = size_t{1} << (ulog2 + vlog2);
  if (block.encoding() == kConstant) {
    if (block.size_bytes() != texel) return damaged(block.offset, "a constant block is not of one texel");
    SPILLWAY_TRY(file_.read(block.offset, out.first(texel)));
    for (size_t i = 1; i < count; ++i) std::copy_n(out.data(), texel, out.data() + i * texel);
    return {};
  }
  std::vector<std::byte> planes(out.size());
  SPILLWAY_TRY(inflate_at(block.offset, block.size_bytes(), planes));
  if (block.encoding() == kDifferences && info_.type == FaceTexelType::uint8) sum_up<uint8_t>(planes);
  if (block.encoding() == kDifferences && info_.type == FaceTexelType::uint16) sum_up<uint16_t>(planes);
  const size_t number = texel_type_bytes(info_.type);
  for (size_t c = 0; c < info_.channels; ++c)
    for (size_t i = 0; i < count; ++i)
      std::memcpy(out.data() + i * texel + c * number, planes.data() + (c * count + i) * number, number);
  return {};
}

Status PtxFile::tiled_texels(const Block& block, uint32_t ulog2, uint32_t vlog2, std::span<std::byte> out) const {
#pragma pack(push, 1)
  struct TilesHeader {
    uint8_t ulog2, vlog2;
    uint32_t table_size;
  };
#pragma pack(pop)
  const uint64_t end = block.offset + block.size_bytes();
  SPILLWAY_ASSIGN(const TilesHeader header, read<TilesHeader>(block.offset, end));
  if (header.ulog2 > ulog2 || header.vlog2 > vlog2) return damaged(block.offset, "tiles are larger than their face");
  const uint64_t table = block.offset + sizeof header;
  if (header.table_size > end - table) return damaged(block.offset + 2, "the table of tiles is cut short");
  const uint32_t across = 1u << (ulog2 - header.ulog2), tiles = across << (vlog2 - header.vlog2);
  SPILLWAY_TRY(check_expansion(table, header.table_size, uint64_t{tiles} * sizeof(uint32_t)));
  std::vector<Block> blocks(tiles);
  SPILLWAY_TRY(read_blocks(table, header.table_size, end, blocks));
  const size_t row_bytes = size_t{texel_bytes()} << header.ulog2;
  for (uint32_t t = 0; t < tiles; ++t) {
    SPILLWAY_ASSIGN(const std::vector<std::byte> tile, block_texels(blocks[t], header.ulog2, header.vlog2, false));
    const size_t x_bytes = (t % across) * row_bytes, y = size_t{t / across} << header.vlog2;
    for (size_t row = 0; row < size_t{1} << header.vlog2; ++row)
      std::copy_n(tile.data() + row * row_bytes, row_bytes, out.data() + (y + row) * (across * row_bytes) + x_bytes);
  }
  return {};
}

// Channels before the alpha, or after it when it is the first.
void PtxFile::multiply_by_alpha(std::span<std::byte> texels) const {
  if (info_.alpha_channel < 0) return;
  const auto alpha = static_cast<uint32_t>(info_.alpha_channel);
  const uint32_t first = alpha == 0 ? 1 : 0, last = alpha == 0 ? info_.channels : alpha;
  const uint32_t number = texel_type_bytes(info_.type);
  const float scale = info_.type == FaceTexelType::uint8    ? 1 / 255.0f
                      : info_.type == FaceTexelType::uint16 ? 1 / 65535.0f
                                                            : 1;
  for (size_t at = 0; at < texels.size(); at += texel_bytes()) {
    const float factor = scale * number_at(info_.type, texels.data() + at + alpha * number);
    for (uint32_t c = first; c < last; ++c) {
      std::byte* value = texels.data() + at + c * number;
      put_number(info_.type, number_at(info_.type, value) * factor, value);
    }
  }
}

}  // namespace spillway::pipeline
