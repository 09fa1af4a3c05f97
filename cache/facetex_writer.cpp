#include "cache/facetex_writer.h"

#include <algorithm>
#include <cstring>

#include "cache/base/check.h"
#include "cache/base/hash.h"
#include "cache/base/parallel.h"

namespace spillway::cache {

// A level of a class while it is written.
struct FaceTexWriter::Image {
  FaceTexImage layout;  // of what there is so far
  uint64_t face_count = 0;
  uint32_t band = 0;                // the one in `texels`
  std::vector<std::byte> texels;    // row by row; empty: nothing since the last band was put away
  std::vector<FaceTexTile> tiles;  // offsets of those still in the chunk are from its beginning
  std::vector<std::byte> chunk;
  size_t first_in_chunk = 0;        // tile

  // Rows that are put together before they become tiles: of tiles, or of faces where several stand side by side.
  [[nodiscard]] uint32_t band_rows() const {
    return layout.faces_per_row() > 1 ? std::max(1u << layout.tile_log2, 1u << layout.vlog2) : 1u << layout.tile_log2;
  }
};

FaceTexWriter::FaceTexWriter(WriteFile file, const FaceTexFormat& format)
    : file_(std::move(file)), format_(format), decoder_(format) {}

FaceTexWriter::~FaceTexWriter() = default;

Result<std::unique_ptr<FaceTexWriter>> FaceTexWriter::create(const std::filesystem::path& path,
                                                             const FaceTexFormat& format, IoPurpose purpose) {
  SPILLWAY_CHECK(format.channels, >=, 1u);
  SPILLWAY_CHECK(format.channels, <=, 4u);
  SPILLWAY_CHECK(format.tile_log2, >=, kLeastFaceTileLog2);
  SPILLWAY_CHECK(format.tile_log2, <=, kMostFaceTileLog2);
  SPILLWAY_ASSIGN(WriteFile file, WriteFile::create(path, purpose));
  FaceTexFront front{};
  std::memcpy(front.magic, kFaceTexMagic, sizeof front.magic);
  front.version = kFaceTexVersion;
  SPILLWAY_TRY(file.append(std::as_bytes(std::span(&front, 1))));
  return std::unique_ptr<FaceTexWriter>(new FaceTexWriter(std::move(file), format));
}

Status FaceTexWriter::begin_texture(FaceTextureShape texture) {
  SPILLWAY_TRY(end_texture());
  if (texture.faces.empty()) return error("face texture '{}': has no faces", texture.name);
  for (uint32_t f = 0; f < texture.faces.size(); ++f) {
    const FaceInfo& face = texture.faces[f];
    if (face.ulog2 > kMaxFaceLog2 || face.vlog2 > kMaxFaceLog2 ||
        (texture.shape == FaceShape::triangle && face.ulog2 != face.vlog2))
      return error("face texture '{}', face {}: 2^{} x 2^{} texels are not possible", texture.name, f, face.ulog2,
                   face.vlog2);
    if (const uint32_t edge = first_inconsistent_edge(texture.faces, texture.shape, f); edge != kNoFace)
      return error("face texture '{}', face {}: its neighbour across edge {} does not lead back", texture.name, f,
                   edge);
  }
  FaceTexTexture entry{};
  entry.first_face = faces_.size();
  entry.face_count = static_cast<uint32_t>(texture.faces.size());
  entry.shape = texture.shape, entry.u_border = texture.u_border, entry.v_border = texture.v_border;
  texture.name.copy(entry.name, sizeof entry.name - 1);
  textures_.push_back(entry);
  faces_.insert(faces_.end(), texture.faces.begin(), texture.faces.end());
  return {};
}

Status FaceTexWriter::end_texture() {
  if (textures_.empty()) return {};
  FaceTexTexture& texture = textures_.back();
  if (numbers_.size() != faces_.size())
    return error("face texture '{}': {} of its {} faces were given", texture.name, numbers_.size() - texture.first_face,
                 texture.face_count);
  for (uint32_t c = 0; c < format_.channels; ++c)
    texture.mean[c] = static_cast<float>(mean_[c] / texture.face_count), mean_[c] = 0;
  return {};
}

std::vector<std::unique_ptr<FaceTexWriter::Image>>& FaceTexWriter::class_of(const FaceInfo& face) {
  const bool is_constant = (face.flags & kFaceIsConstant) != 0;
  const uint32_t ulog2 = is_constant ? 0u : face.ulog2, vlog2 = is_constant ? 0u : face.vlog2;
  auto& levels = classes_[{ulog2, vlog2}];
  if (!levels.empty()) return levels;
  std::vector<FaceTexImage> images;
  SPILLWAY_CHECK(append_images(0, {ulog2, vlog2, 1}, format_.tile_log2, images), ==, true);
  for (const FaceTexImage& layout : images) {
    levels.push_back(std::make_unique<Image>());
    levels.back()->layout = layout;
  }
  return levels;
}

void FaceTexWriter::add_to_mean(std::span<const std::byte> texel) {
  for (uint32_t c = 0; c < format_.channels; ++c) mean_[c] += static_cast<double>(decoder_.value(texel.data(), c));
}

Status FaceTexWriter::check_face(uint64_t face, std::span<const std::byte> texels) const {
  if (textures_.empty() || face >= faces_.size()) return error("a face of no texture");
  const FaceInfo& info = faces_[face];
  const bool is_constant = (info.flags & kFaceIsConstant) != 0;
  const size_t wanted = (is_constant ? 1 : size_t{1} << (info.ulog2 + info.vlog2)) * format_.texel_bytes();
  if (texels.size() == wanted) return {};
  return error("face texture '{}', face {}: {} bytes of texels, {} wanted", textures_.back().name,
               face - textures_.back().first_face, texels.size(), wanted);
}

FaceTexWriter::Coarser FaceTexWriter::coarser_levels(const FaceInfo& face, std::span<const std::byte> texels) const {
  Coarser levels;
  if (face.flags & kFaceIsConstant) return levels;
  for (uint32_t level = 1; level <= std::max(face.ulog2, face.vlog2); ++level)
    levels.push_back(halved_face(decoder_, format_, textures_.back().shape,
                                 level == 1 ? texels : std::span<const std::byte>(levels.back()),
                                 reduced_log2(face.ulog2, level - 1), reduced_log2(face.vlog2, level - 1)));
  return levels;
}

Status FaceTexWriter::put_levels(std::span<const std::byte> texels, const Coarser& coarser) {
  auto& levels = class_of(faces_[numbers_.size()]);
  if (levels.front()->face_count == UINT32_MAX) return error("a class of more than 2^32 faces");
  const auto number = static_cast<uint32_t>(levels.front()->face_count);
  numbers_.push_back(number);
  SPILLWAY_TRY(put_face(*levels.front(), number, texels));
  for (size_t level = 1; level < levels.size(); ++level)
    SPILLWAY_TRY(put_face(*levels[level], number, coarser[level - 1]));
  add_to_mean(coarser.empty() ? texels : std::span<const std::byte>(coarser.back()));
  return {};
}

Status FaceTexWriter::add_face(std::span<const std::byte> texels) {
  SPILLWAY_TRY(check_face(numbers_.size(), texels));
  return put_levels(texels, coarser_levels(faces_[numbers_.size()], texels));
}

Status FaceTexWriter::add_faces(std::span<const std::vector<std::byte>> faces) {
  const size_t first = numbers_.size();
  for (size_t i = 0; i < faces.size(); ++i) SPILLWAY_TRY(check_face(first + i, faces[i]));
  std::vector<Coarser> coarser(faces.size());
  parallel_blocks(faces.size(), 16, [&](size_t, size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) coarser[i] = coarser_levels(faces_[first + i], faces[i]);
  });
  for (size_t i = 0; i < faces.size(); ++i) SPILLWAY_TRY(put_levels(faces[i], coarser[i]));
  return {};
}

// Copies a face into its band, one after the other where it has several.
Status FaceTexWriter::put_face(Image& image, uint32_t number, std::span<const std::byte> texels) {
  const FaceTexImage& layout = image.layout;
  const uint32_t width = 1u << layout.ulog2, height = 1u << layout.vlog2;
  const uint32_t x = layout.x_of(number);
  const uint64_t y = uint64_t{number / layout.faces_per_row()} << layout.vlog2;
  const size_t size = format_.texel_bytes(), row_bytes = layout.width * size;
  ++image.face_count;
  for (uint32_t row = 0; row < height; ++row) {
    const auto band = static_cast<uint32_t>((y + row) / image.band_rows());
    if (band != image.band && !image.texels.empty()) SPILLWAY_TRY(put_band(image));
    image.band = band;
    if (image.texels.empty()) image.texels.resize(row_bytes * image.band_rows());
    std::memcpy(image.texels.data() + (y + row) % image.band_rows() * row_bytes + x * size,
                texels.data() + size_t{row} * width * size, width * size);
  }
  return {};
}

Status FaceTexWriter::put_band(Image& image) {
  const uint32_t edge = format_.tile_edge();
  const size_t tile_row = edge * format_.texel_bytes(), row_bytes = image.layout.width * format_.texel_bytes();
  for (uint32_t y = 0; y < image.band_rows(); y += edge)
    for (uint32_t t = 0; t < image.layout.tiles_across(); ++t) {
      RawTile tile{&image, std::vector<std::byte>(format_.tile_bytes())};
      for (uint32_t row = 0; row < edge; ++row)
        std::memcpy(tile.texels.data() + row * tile_row, image.texels.data() + (y + row) * row_bytes + t * tile_row, tile_row);
      batch_.push_back(std::move(tile));
      batch_bytes_ += format_.tile_bytes();
    }
  image.texels.clear();
  return batch_bytes_ >= kBatchBytes ? compress_batch() : Status{};
}

Status FaceTexWriter::compress_batch() {
  std::vector<std::vector<std::byte>> packed(batch_.size());
  parallel_blocks(batch_.size(), 4, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) packed[i] = compress_tile(format_.codec, batch_[i].texels);
  });
  for (size_t i = 0; i < batch_.size(); ++i) {
    Image& image = *batch_[i].image;
    image.tiles.push_back({image.chunk.size(), static_cast<uint32_t>(packed[i].size()),
                           static_cast<uint32_t>(checksum(packed[i].data(), packed[i].size()))});
    image.chunk.insert(image.chunk.end(), packed[i].begin(), packed[i].end());
    if (image.chunk.size() >= kChunkBytes) SPILLWAY_TRY(write_chunk(image));
  }
  batch_.clear(), batch_bytes_ = 0;
  return {};
}

Status FaceTexWriter::write_chunk(Image& image) {
  for (; image.first_in_chunk < image.tiles.size(); ++image.first_in_chunk)
    image.tiles[image.first_in_chunk].offset += file_.size_bytes();
  if (!image.chunk.empty()) SPILLWAY_TRY(file_.append(image.chunk));
  image.chunk.clear();
  return {};
}

namespace {

template <class T>
void put(std::vector<std::byte>& out, const std::vector<T>& items) {
  const auto bytes = std::as_bytes(std::span(items));
  out.insert(out.end(), bytes.begin(), bytes.end());
}

}  // namespace

Status FaceTexWriter::finish() {
  SPILLWAY_TRY(end_texture());
  FaceTexTrailer trailer{};
  std::vector<FaceTexClass> classes;
  std::vector<FaceTexTile> tiles;
  for (auto& [size, levels] : classes_)
    for (auto& image : levels)
      if (!image->texels.empty()) SPILLWAY_TRY(put_band(*image));
  SPILLWAY_TRY(compress_batch());
  for (auto& [size, levels] : classes_) {
    classes.push_back({size.first, size.second, levels.front()->face_count});
    std::vector<FaceTexImage> layout;
    if (!append_images(0, classes.back(), format_.tile_log2, layout))
      return error("a class of faces is larger than an image can be; use more files");
    for (auto& image : levels) {
      SPILLWAY_TRY(write_chunk(*image));
      tiles.insert(tiles.end(), image->tiles.begin(), image->tiles.end());
    }
  }
  SPILLWAY_TRY(file_.pad_to(8));
  trailer.textures_offset = file_.size_bytes();
  trailer.face_count = faces_.size(), trailer.tile_count = tiles.size();
  trailer.texture_count = texture_count(), trailer.class_count = static_cast<uint32_t>(classes.size());
  trailer.format = format_, trailer.version = kFaceTexVersion;
  std::memcpy(trailer.magic, kFaceTexMagic, sizeof trailer.magic);
  std::vector<std::byte> tables;
  put(tables, textures_), put(tables, classes), put(tables, faces_), put(tables, numbers_);
  tables.resize((tables.size() + 7) / 8 * 8);
  put(tables, tiles);
  trailer.tables_checksum = checksum(tables.data(), tables.size());
  trailer.checksum =
      checksum(reinterpret_cast<const std::byte*>(&trailer) + sizeof(uint64_t), sizeof trailer - sizeof(uint64_t));
  SPILLWAY_TRY(file_.append(tables));
  SPILLWAY_TRY(file_.append(std::as_bytes(std::span(&trailer, 1))));
  return file_.commit();
}

}  // namespace spillway::cache
