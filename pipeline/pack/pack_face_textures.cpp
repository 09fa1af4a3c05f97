#include "pipeline/pack/pack_face_textures.h"

#include <algorithm>
#include <cstring>

#include "pipeline/pack/ptx_file.h"

namespace spillway::pipeline {
namespace {

constexpr std::string_view kPrefix = "faces-", kSuffix = ".facetex";

// Which channels of a file are kept: all up to four, else the first three colours and the alpha.
std::vector<uint32_t> kept_channels(const PtxInfo& info) {
  std::vector<uint32_t> kept;
  for (uint32_t c = 0; c < info.channels && (info.channels <= 4 || kept.size() < 3); ++c)
    if (info.channels <= 4 || static_cast<int32_t>(c) != info.alpha_channel) kept.push_back(c);
  if (info.channels > 4 && info.alpha_channel >= 0) kept.push_back(static_cast<uint32_t>(info.alpha_channel));
  return kept;
}

std::vector<std::byte> with_channels(std::span<const std::byte> texels, const std::vector<uint32_t>& kept,
                                     size_t number_bytes, size_t texel_bytes) {
  std::vector<std::byte> out;
  out.reserve(texels.size() / texel_bytes * kept.size() * number_bytes);
  for (size_t at = 0; at < texels.size(); at += texel_bytes)
    for (const uint32_t c : kept) {
      const auto number = texels.subspan(at + c * number_bytes, number_bytes);
      out.insert(out.end(), number.begin(), number.end());
    }
  return out;
}

}  // namespace

bool is_face_container_name(std::string_view name) {
  if (!name.starts_with(kPrefix)) return false;
  name.remove_prefix(kPrefix.size());
  const size_t digits = std::min(name.find_first_not_of("0123456789"), name.size());
  name.remove_prefix(digits);
  if (digits < 5 || !name.starts_with(kSuffix)) return false;
  name.remove_prefix(kSuffix.size());
  return name.empty() || (name.starts_with(".") && name.ends_with(".tmp"));
}

Result<std::string> FaceTexturePacker::new_container_name() const {
  std::error_code code;
  std::filesystem::create_directories(directory_, code);
  return fmt::format("{}{:05}{}", kPrefix, containers_.size(), kSuffix);
}

// The open file of the kind; one that is full is completed, so that its tables take no more memory.
Result<uint32_t> FaceTexturePacker::container_for(const cache::FaceTexFormat& format) {
  for (uint32_t c = 0; c < containers_.size(); ++c) {
    const auto& writer = containers_[c].writer;
    if (!writer || writer->format() != format) continue;
    if (writer->written_bytes() < max_container_bytes_) return c;
    SPILLWAY_TRY(complete(c));
  }
  Container made;
  SPILLWAY_ASSIGN(made.file_name, new_container_name());
  SPILLWAY_ASSIGN(made.writer, cache::FaceTexWriter::create(directory_ / made.file_name, format));
  containers_.push_back(std::move(made));
  return static_cast<uint32_t>(containers_.size() - 1);
}

Status FaceTexturePacker::complete(uint32_t index) {
  Container& container = containers_[index];
  SPILLWAY_TRY(container.writer->finish());
  for (cache::FaceTextureInfo& texture : textures_)
    if (texture.container == index) std::copy_n(container.writer->texture(texture.texture).mean, 4, texture.mean);
  container.writer.reset();
  return describe(container);
}

// What a render will have to know of it.
Status FaceTexturePacker::describe(Container& container) const {
  SPILLWAY_ASSIGN(const cache::FaceTexFile file, cache::FaceTexFile::open(directory_ / container.file_name,
                                                                          {MemoryTag::pack, cache::IoPurpose::pack}));
  cache::FaceContainerInfo& info = container.info;
  container.file_name.copy(info.file_name, sizeof info.file_name - 1);
  for (const cache::FaceTexTexture& texture : file.textures()) info.face_count += texture.face_count;
  info.tile_count = file.tiles().size();
  info.tile_bytes = static_cast<uint32_t>(file.format().tile_bytes());
  info.image_count = static_cast<uint32_t>(file.images().size());
  return {};
}

Result<FaceTextureId> FaceTexturePacker::begin(cache::FaceTexFormat format, cache::FaceTextureShape texture) {
  format.codec = codec_, format.tile_log2 = tile_log2_;
  SPILLWAY_ASSIGN(const uint32_t container, container_for(format));
  const bool has_subfaces =
      std::any_of(texture.faces.begin(), texture.faces.end(), [](const auto& f) { return f.is_subface(); });
  const Requirements required{texture.name, static_cast<uint32_t>(texture.faces.size()), texture.shape, has_subfaces};
  cache::FaceTexWriter& writer = *containers_[container].writer;
  SPILLWAY_TRY(writer.begin_texture(std::move(texture)));
  textures_.push_back(
      {container, writer.texture_count() - 1, required.face_count, required.shape, format.channels, {}});
  requirements_.push_back(required);
  return FaceTextureId{static_cast<uint32_t>(textures_.size() - 1)};
}

Status FaceTexturePacker::add_face(std::span<const std::byte> texels) {
  if (textures_.empty()) return error("a face of no face texture");
  return containers_[textures_.back().container].writer->add_face(texels);
}

Status FaceTexturePacker::add_faces(std::span<const std::vector<std::byte>> faces) {
  if (textures_.empty()) return error("faces of no face texture");
  return containers_[textures_.back().container].writer->add_faces(faces);
}

Result<FaceTextureId> FaceTexturePacker::add_file(const std::filesystem::path& file, TexelCurve encoding,
                                                  const std::string& name) {
  std::error_code code;
  const std::string whole = std::filesystem::weakly_canonical(file, code).string();
  const auto [found, is_new] =
      files_.try_emplace({whole, encoding, name}, FaceTextureId{static_cast<uint32_t>(textures_.size())});
  if (!is_new) return found->second;
  if (adopted_.contains(whole)) {
    SPILLWAY_TRY(add_adopted(file, whole, name));
    return found->second;
  }
  if (!std::filesystem::is_regular_file(file, code)) return error("{}: there is no such face texture", file.string());
  const bool is_face_tex = cache::FaceTexFile::is_face_tex(file);
  if (!is_face_tex && !name.empty())
    return error("{}: is no .facetex file, and has no texture '{}'", file.string(), name);
  SPILLWAY_TRY(is_face_tex ? copy_face_tex(file, whole, name) : copy_ptx(file, encoding));
  return found->second;
}

Status FaceTexturePacker::copy_ptx(const std::filesystem::path& file, TexelCurve encoding) {
  SPILLWAY_ASSIGN(const PtxFile ptx, PtxFile::open(file, {.premultiply = true}));
  const PtxInfo& info = ptx.info();
  const std::vector<uint32_t> kept = kept_channels(info);
  cache::FaceTexFormat format;
  format.type = info.type;
  format.channels = static_cast<uint32_t>(kept.size());
  const auto alpha = std::find(kept.begin(), kept.end(), static_cast<uint32_t>(info.alpha_channel));
  format.alpha_channel = alpha == kept.end() ? -1 : static_cast<int32_t>(alpha - kept.begin());
  const bool is_integer = info.type <= cache::FaceTexelType::uint16;
  if (is_integer) format.encoding = encoding.kind, format.gamma = encoding.gamma;
  cache::FaceTextureShape shape{file.filename().string(), info.shape, info.u_border, info.v_border, {}};
  shape.faces.assign(ptx.faces().begin(), ptx.faces().end());
  // Edits change faces and not what was said of their neighbourhoods.
  const bool has_edits = std::any_of(shape.faces.begin(), shape.faces.end(),
                                     [](const auto& f) { return (f.flags & cache::kFaceHasEdits) != 0; });
  for (cache::FaceInfo& face : shape.faces)
    face.flags &=
        cache::kFaceIsConstant | cache::kFaceIsSubface | (has_edits ? 0 : cache::kFaceNeighbourhoodIsConstant);
  SPILLWAY_TRY(begin(format, std::move(shape)));
  const bool all = kept.size() == info.channels;
  for (uint32_t f = 0; f < ptx.faces().size(); ++f) {
    std::vector<std::byte> texels;
    if (ptx.faces()[f].flags & cache::kFaceIsConstant) {
      texels.assign(ptx.constant(f).begin(), ptx.constant(f).end());
    } else {
      SPILLWAY_ASSIGN(texels, ptx.texels(f));
    }
    SPILLWAY_TRY(add_face(all ? texels : with_channels(texels, kept, texel_type_bytes(info.type), ptx.texel_bytes())));
  }
  return {};
}

Status FaceTexturePacker::copy_face_tex(const std::filesystem::path& path, const std::string& whole,
                                        const std::string& name) {
  SPILLWAY_ASSIGN(const cache::FaceTexFile file,
                  cache::FaceTexFile::open(path, {MemoryTag::pack, cache::IoPurpose::pack}));
  if (file.textures().size() != 1) {
    if (name.empty())
      return error("{}: holds {} textures, but one is wanted; name it", path.string(), file.textures().size());
    SPILLWAY_TRY(adopt(path, whole, file));
    return add_adopted(path, whole, name);
  }
  const cache::FaceTexTexture& texture = file.textures()[0];
  if (!name.empty() && name != texture.name)
    return error("{}: its texture is '{}', not '{}'", path.string(), texture.name, name);
  cache::FaceTextureShape shape{texture.name, texture.shape, texture.u_border, texture.v_border, {}};
  shape.faces.assign(file.faces(texture).begin(), file.faces(texture).end());
  SPILLWAY_TRY(begin(file.format(), std::move(shape)));
  for (uint32_t f = 0; f < texture.face_count; ++f) {
    SPILLWAY_ASSIGN(const std::vector<std::byte> texels, file.texels(texture, f, 0));
    SPILLWAY_TRY(add_face(texels));
  }
  return {};
}

// A file that is packed already becomes one of the store's: its bytes are copied, not its texels.
Status FaceTexturePacker::adopt(const std::filesystem::path& path, const std::string& whole,
                                const cache::FaceTexFile& file) {
  constexpr size_t kPiece = 4 << 20;
  Container made;
  SPILLWAY_ASSIGN(made.file_name, new_container_name());
  SPILLWAY_ASSIGN(cache::WriteFile copy,
                  cache::WriteFile::create(directory_ / made.file_name, cache::IoPurpose::pack));
  SPILLWAY_ASSIGN(const cache::ReadFile source, cache::ReadFile::open(path, {.purpose = cache::IoPurpose::pack}));
  std::vector<std::byte> piece;
  for (uint64_t at = 0; at < source.size_bytes(); at += piece.size()) {
    piece.resize(std::min<uint64_t>(kPiece, source.size_bytes() - at));
    SPILLWAY_TRY(source.read(at, piece));
    SPILLWAY_TRY(copy.append(piece));
  }
  SPILLWAY_TRY(copy.commit());
  const auto container = static_cast<uint32_t>(containers_.size());
  for (uint32_t t = 0; t < file.textures().size(); ++t) {
    const cache::FaceTexTexture& from = file.textures()[t];
    const auto faces = file.faces(from);
    const bool has_subfaces = std::any_of(faces.begin(), faces.end(), [](const auto& f) { return f.is_subface(); });
    cache::FaceTextureInfo info{container, t, from.face_count, from.shape, file.format().channels, {}};
    std::copy_n(from.mean, 4, info.mean);
    made.by_name[from.name] = {info, {from.name, from.face_count, from.shape, has_subfaces}};
  }
  SPILLWAY_TRY(describe(made));
  containers_.push_back(std::move(made));
  adopted_[whole] = container;
  return {};
}

Status FaceTexturePacker::add_adopted(const std::filesystem::path& path, const std::string& whole,
                                      const std::string& name) {
  const Container& container = containers_[adopted_.at(whole)];
  const auto found = container.by_name.find(name);
  if (found == container.by_name.end())
    return error("{}: holds {} textures, and none is '{}'", path.string(), container.by_name.size(), name);
  textures_.push_back(found->second.texture);
  requirements_.push_back(found->second.required);
  return {};
}

Result<PackedFaceTextures> FaceTexturePacker::finish() {
  PackedFaceTextures packed;
  for (uint32_t c = 0; c < containers_.size(); ++c) {
    if (containers_[c].writer) SPILLWAY_TRY(complete(c));
    packed.containers.push_back(containers_[c].info);
  }
  packed.textures = textures_;
  return packed;
}

}  // namespace spillway::pipeline
