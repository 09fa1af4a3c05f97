#include "cache/facetex_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "cache/base/hash.h"

namespace spillway::cache {
namespace {

constexpr uint64_t kLargestHeight = (1u << 31) - (1u << kMostFaceTileLog2);  // of an image, as OpenImageIO counts

uint64_t aligned8(uint64_t n) { return (n + 7) / 8 * 8; }

uint64_t trailer_checksum(const FaceTexTrailer& trailer) {
  return checksum(reinterpret_cast<const std::byte*>(&trailer) + sizeof(uint64_t), sizeof trailer - sizeof(uint64_t));
}

// Where the tables end, for counts that are within the file's size.
struct TableEnds {
  uint64_t textures, classes, faces, numbers, tiles_begin, tiles;
  explicit TableEnds(const FaceTexTrailer& t) {
    textures = t.textures_offset + uint64_t{t.texture_count} * sizeof(FaceTexTexture);
    classes = textures + uint64_t{t.class_count} * sizeof(FaceTexClass);
    faces = classes + t.face_count * sizeof(FaceInfo);
    numbers = faces + t.face_count * sizeof(uint32_t);
    tiles_begin = aligned8(numbers);
    tiles = tiles_begin + t.tile_count * sizeof(FaceTexTile);
  }
};

template <class T>
std::span<const std::byte> take(std::span<const std::byte> from, MemoryTag tag, uint64_t count, Buffer<T>& to) {
  to = Buffer<T>(tag, count);
  if (count > 0) std::memcpy(to.data(), from.data(), to.size_bytes());
  return from.subspan(to.size_bytes());
}

bool is_format(const FaceTexFormat& f) {
  return f.type <= FaceTexelType::float32 && f.channels >= 1 && f.channels <= 4 && f.alpha_channel >= -1 &&
         f.alpha_channel < static_cast<int32_t>(f.channels) && f.encoding <= FaceTexEncoding::gamma &&
         f.codec <= FaceTexCodec::zstd && f.tile_log2 >= kLeastFaceTileLog2 && f.tile_log2 <= kMostFaceTileLog2 && std::isfinite(f.gamma) && f.gamma > 0 &&
         (f.type <= FaceTexelType::uint16 || f.encoding == FaceTexEncoding::linear);
}

}  // namespace

bool append_images(uint32_t class_index, const FaceTexClass& of, uint32_t tile_log2,
                   std::vector<FaceTexImage>& images) {
  for (uint32_t level = 0; level <= std::max(of.ulog2, of.vlog2); ++level) {
    FaceTexImage image;
    image.class_index = class_index, image.level = level;
    image.ulog2 = reduced_log2(of.ulog2, level), image.vlog2 = reduced_log2(of.vlog2, level);
    image.face_count = of.face_count, image.tile_log2 = tile_log2;
    image.width = std::max(1u << tile_log2, 1u << image.ulog2);
    const uint64_t rows = (of.face_count + image.faces_per_row() - 1) / image.faces_per_row();
    if (rows > kLargestHeight >> image.vlog2) return false;
    image.height = static_cast<uint32_t>(rows << image.vlog2);
    image.first_tile = images.empty() ? 0 : images.back().first_tile + images.back().tile_count;
    image.tile_count = (((uint64_t{image.height} - 1) >> tile_log2) + 1) * image.tiles_across();
    images.push_back(image);
  }
  return true;
}

Error FaceTexFile::damaged(uint64_t offset, std::string_view what) const {
  return error("{}: byte {}: {}; pack the textures again", file_.path().string(), offset, what);
}

bool FaceTexFile::is_face_tex(const std::filesystem::path& path) {
  const Result<ReadFile> file = ReadFile::open(path, {.purpose = IoPurpose::textures});
  FaceTexFront front{};
  if (!file || file->size_bytes() < sizeof front) return false;
  return file->read(0, std::as_writable_bytes(std::span(&front, 1))) && std::memcmp(front.magic, kFaceTexMagic, 8) == 0;
}

Result<FaceTexFile> FaceTexFile::open(const std::filesystem::path& path, Options options) {
  SPILLWAY_ASSIGN(ReadFile opened, ReadFile::open(path, {.purpose = options.purpose, .direct = options.direct}));
  FaceTexFile file(std::move(opened));
  FaceTexTrailer trailer{};
  SPILLWAY_TRY(file.read_trailer(trailer));
  SPILLWAY_TRY(file.read_tables(trailer, options.tag));
  SPILLWAY_TRY(file.make_images(trailer));
  SPILLWAY_TRY(file.check_faces(trailer));
  SPILLWAY_TRY(file.check_tiles(trailer));
  return file;
}

Status FaceTexFile::read_trailer(FaceTexTrailer& trailer) const {
  const uint64_t size = file_.size_bytes();
  if (size < sizeof(FaceTexFront) + sizeof trailer) return damaged(size, "is cut short, or is no .facetex file");
  FaceTexFront front{};
  SPILLWAY_TRY(file_.read(0, std::as_writable_bytes(std::span(&front, 1))));
  if (std::memcmp(front.magic, kFaceTexMagic, sizeof kFaceTexMagic) != 0) return damaged(0, "is no .facetex file");
  if (front.version != kFaceTexVersion || front.reserved != 0)
    return damaged(8, fmt::format("version {}; this program reads {}", front.version, kFaceTexVersion));
  const uint64_t at = size - sizeof trailer;
  SPILLWAY_TRY(file_.read(at, std::as_writable_bytes(std::span(&trailer, 1))));
  if (std::memcmp(trailer.magic, kFaceTexMagic, sizeof kFaceTexMagic) != 0 || trailer.version != kFaceTexVersion)
    return damaged(at, "the file is cut short");
  if (trailer.checksum != trailer_checksum(trailer)) return damaged(at, "the checksum of the trailer does not match");
  if (!is_format(trailer.format))
    return damaged(at + offsetof(FaceTexTrailer, format), "the kind of texels or the size of tiles is unknown");
  const uint64_t most = at / sizeof(FaceTexTile);
  const bool counts = trailer.texture_count <= most && trailer.class_count <= 256 && trailer.face_count <= at / 24 &&
                      trailer.tile_count <= most && trailer.textures_offset >= sizeof front &&
                      trailer.textures_offset <= at && trailer.textures_offset % 8 == 0;
  if (!counts || TableEnds(trailer).tiles != at) return damaged(at, "the tables do not fill what is left of the file");
  return {};
}

Status FaceTexFile::read_tables(const FaceTexTrailer& trailer, MemoryTag tag) {
  format_ = trailer.format;
  const uint64_t begin = trailer.textures_offset, end = file_.size_bytes() - sizeof trailer;
  Buffer<std::byte> bytes(tag, end - begin);
  if (end > begin) SPILLWAY_TRY(file_.read(begin, bytes));
  if (checksum(bytes.data(), bytes.size()) != trailer.tables_checksum)
    return damaged(begin, "the checksum of the tables does not match");
  std::span<const std::byte> rest(bytes.data(), bytes.size());
  rest = take(rest, tag, trailer.texture_count, textures_);
  rest = take(rest, tag, trailer.class_count, classes_);
  rest = take(rest, tag, trailer.face_count, faces_);
  rest = take(rest, tag, trailer.face_count, numbers_);
  take(rest.subspan(rest.size() - trailer.tile_count * sizeof(FaceTexTile)), tag, trailer.tile_count, tiles_);
  return {};
}

Status FaceTexFile::make_images(const FaceTexTrailer& trailer) {
  const uint64_t at = TableEnds(trailer).textures;
  uint64_t faces = 0;
  std::fill(std::begin(image_of_), std::end(image_of_), kNoFace);
  for (uint32_t c = 0; c < classes_.size(); ++c) {
    const FaceTexClass& of = classes_[c];
    const uint64_t offset = at + c * sizeof of;
    if (of.ulog2 > kMaxFaceLog2 || of.vlog2 > kMaxFaceLog2)
      return damaged(offset, fmt::format("faces of 2^{} x 2^{} texels", of.ulog2, of.vlog2));
    if (c > 0 && std::pair(of.ulog2, of.vlog2) <= std::pair(classes_[c - 1].ulog2, classes_[c - 1].vlog2))
      return damaged(offset, "classes do not ascend");
    if (of.face_count == 0 || of.face_count > faces_.size())
      return damaged(offset, fmt::format("a class of {} faces", of.face_count));
    image_of_[of.ulog2 << 4 | of.vlog2] = static_cast<uint32_t>(images_.size());
    if (!append_images(c, of, format_.tile_log2, images_)) return damaged(offset, "a class is larger than an image can be");
    faces += of.face_count;
  }
  if (faces != faces_.size())
    return damaged(at, fmt::format("classes have {} faces, but there are {}", faces, faces_.size()));
  return {};
}

Status FaceTexFile::check_faces(const FaceTexTrailer& trailer) const {
  const TableEnds ends(trailer);
  uint64_t next = 0;
  for (size_t t = 0; t < textures_.size(); ++t) {
    const FaceTexTexture& texture = textures_[t];
    const uint64_t offset = trailer.textures_offset + t * sizeof texture;
    if (texture.first_face != next || texture.face_count == 0 || texture.face_count > faces_.size() - next)
      return damaged(offset, fmt::format("texture {} has faces {} + {}", t, texture.first_face, texture.face_count));
    if (texture.shape > FaceShape::quad || texture.u_border > FaceBorder::periodic ||
        texture.v_border > FaceBorder::periodic || texture.name[sizeof texture.name - 1] != 0)
      return damaged(offset, fmt::format("texture {} has a shape, border or name that is none", t));
    next += texture.face_count;
    const std::span<const FaceInfo> faces = this->faces(texture);
    for (uint32_t f = 0; f < faces.size(); ++f) {
      const uint64_t face_offset = ends.classes + (texture.first_face + f) * sizeof(FaceInfo);
      const FaceInfo& face = faces[f];
      if (face.ulog2 > kMaxFaceLog2 || face.vlog2 > kMaxFaceLog2 || first_image(face) == kNoFace)
        return damaged(face_offset, fmt::format("face {} of texture {} has no class", f, t));
      if (numbers_[texture.first_face + f] >= images_[first_image(face)].face_count)
        return damaged(face_offset, fmt::format("face {} of texture {} is none of its class", f, t));
      if (texture.shape == FaceShape::triangle && face.ulog2 != face.vlog2)
        return damaged(face_offset, fmt::format("face {} of texture {}, a triangle, is not square", f, t));
      if (first_inconsistent_edge(faces, texture.shape, f) != kNoFace)
        return damaged(face_offset, fmt::format("face {} of texture {} has a neighbour that does not lead back", f, t));
    }
  }
  if (next != faces_.size()) return damaged(trailer.textures_offset, "there are faces of no texture");
  return {};
}

Status FaceTexFile::check_tiles(const FaceTexTrailer& trailer) const {
  const TableEnds ends(trailer);
  const uint64_t wanted = images_.empty() ? 0 : images_.back().first_tile + images_.back().tile_count;
  if (wanted != tiles_.size())
    return damaged(ends.tiles_begin, fmt::format("{} tiles, but the classes have {}", tiles_.size(), wanted));
  const size_t most = most_packed_bytes(format_.codec, format_.tile_bytes());
  for (size_t i = 0; i < tiles_.size(); ++i) {
    const FaceTexTile& tile = tiles_[i];
    if (tile.offset < sizeof(FaceTexFront) || tile.offset > trailer.textures_offset || tile.size_bytes == 0 ||
        tile.size_bytes > trailer.textures_offset - tile.offset || tile.size_bytes > most)
      return damaged(ends.tiles_begin + i * sizeof tile, fmt::format("tile {} lies elsewhere", i));
  }
  return {};
}

uint64_t FaceTexFile::tables_bytes() const {
  return textures_.size_bytes() + classes_.size_bytes() + faces_.size_bytes() + numbers_.size_bytes() +
         tiles_.size_bytes();
}

Status FaceTexFile::decode_tile(uint64_t number, std::span<const std::byte> packed, std::span<std::byte> out) const {
  const FaceTexTile& tile = tiles_[number];
  if (static_cast<uint32_t>(checksum(packed.data(), packed.size())) != tile.checksum)
    return damaged(tile.offset, fmt::format("the checksum of tile {} does not match", number));
  if (!decompress_tile(format_.codec, packed, out))
    return damaged(tile.offset, fmt::format("tile {} does not unpack to {} bytes", number, out.size()));
  return {};
}

Status FaceTexFile::read_tile(uint64_t number, std::span<std::byte> out) const {
  static thread_local std::vector<std::byte> packed;
  packed.resize(tiles_[number].size_bytes);
  SPILLWAY_TRY(file_.read(tiles_[number].offset, packed));
  return decode_tile(number, packed, out);
}

Result<std::vector<std::byte>> FaceTexFile::texels(const FaceTexTexture& texture, uint32_t face, uint32_t level) const {
  const FaceInfo& info = faces(texture)[face];
  const bool is_constant = (info.flags & kFaceIsConstant) != 0;
  const FaceTexImage& image = images_[first_image(info) + (is_constant ? 0 : level)];
  const uint32_t number = numbers(texture)[face], x0 = image.x_of(number), y0 = image.y_of(number);
  const uint32_t width = 1u << image.ulog2, height = 1u << image.vlog2;
  const size_t texel = format_.texel_bytes(), edge = format_.tile_edge();
  std::vector<std::byte> out(size_t{width} * height * texel), tile(format_.tile_bytes());
  const auto step_x = std::min<uint32_t>(width, edge), step_y = std::min<uint32_t>(height, edge);
  for (uint32_t y = 0; y < height; y += step_y)
    for (uint32_t x = 0; x < width; x += step_x) {
      const uint32_t at_x = x0 + x, at_y = y0 + y;
      SPILLWAY_TRY(read_tile(image.tile_at(at_x, at_y), tile));
      for (uint32_t row = 0; row < step_y; ++row)
        std::memcpy(out.data() + (size_t{y + row} * width + x) * texel,
                    tile.data() + ((at_y + row) % edge * edge + at_x % edge) * texel,
                    step_x * texel);
    }
  return out;
}

}  // namespace spillway::cache
