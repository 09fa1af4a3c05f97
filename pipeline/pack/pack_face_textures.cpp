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

// The newest file of the kind, unless it is full.
Result<uint32_t> FaceTexturePacker::container_for(const cache::FaceTexFormat& format) {
  for (size_t c = containers_.size(); c-- > 0;)
    if (containers_[c].writer->format() == format && containers_[c].writer->written_bytes() < max_container_bytes_)
      return static_cast<uint32_t>(c);
  std::error_code code;
  std::filesystem::create_directories(directory_, code);
  Container made;
  made.file_name = fmt::format("{}{:05}{}", kPrefix, containers_.size(), kSuffix);
  SPILLWAY_ASSIGN(made.writer, cache::FaceTexWriter::create(directory_ / made.file_name, format));
  containers_.push_back(std::move(made));
  return static_cast<uint32_t>(containers_.size() - 1);
}

Result<FaceTextureId> FaceTexturePacker::begin(cache::FaceTexFormat format, cache::FaceTextureShape texture) {
  format.codec = codec_;
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

Result<FaceTextureId> FaceTexturePacker::add_file(const std::filesystem::path& file, TexelCurve encoding) {
  std::error_code code;
  const std::string whole = std::filesystem::weakly_canonical(file, code).string();
  const auto [found, is_new] =
      files_.try_emplace({whole, encoding}, FaceTextureId{static_cast<uint32_t>(textures_.size())});
  if (!is_new) return found->second;
  if (!std::filesystem::is_regular_file(file, code)) return error("{}: there is no such face texture", file.string());
  SPILLWAY_TRY(cache::FaceTexFile::is_face_tex(file) ? copy_face_tex(file) : copy_ptx(file, encoding));
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

Status FaceTexturePacker::copy_face_tex(const std::filesystem::path& path) {
  SPILLWAY_ASSIGN(const cache::FaceTexFile file,
                  cache::FaceTexFile::open(path, {MemoryTag::pack, cache::IoPurpose::pack}));
  if (file.textures().size() != 1)
    return error("{}: holds {} textures, but one is wanted", path.string(), file.textures().size());
  const cache::FaceTexTexture& texture = file.textures()[0];
  cache::FaceTextureShape shape{texture.name, texture.shape, texture.u_border, texture.v_border, {}};
  shape.faces.assign(file.faces(texture).begin(), file.faces(texture).end());
  SPILLWAY_TRY(begin(file.format(), std::move(shape)));
  for (uint32_t f = 0; f < texture.face_count; ++f) {
    SPILLWAY_ASSIGN(const std::vector<std::byte> texels, file.texels(texture, f, 0));
    SPILLWAY_TRY(add_face(texels));
  }
  return {};
}

Result<PackedFaceTextures> FaceTexturePacker::finish() {
  PackedFaceTextures packed{{}, textures_};
  for (Container& container : containers_) {
    SPILLWAY_TRY(container.writer->finish());
    SPILLWAY_ASSIGN(const cache::FaceTexFile file, cache::FaceTexFile::open(directory_ / container.file_name,
                                                                            {MemoryTag::pack, cache::IoPurpose::pack}));
    cache::FaceContainerInfo info{};
    container.file_name.copy(info.file_name, sizeof info.file_name - 1);
    for (const cache::FaceTexTexture& texture : file.textures()) info.face_count += texture.face_count;
    info.tile_count = file.tiles().size();
    info.tile_bytes = static_cast<uint32_t>(file.format().tile_bytes());
    info.image_count = static_cast<uint32_t>(file.images().size());
    packed.containers.push_back(info);
  }
  for (cache::FaceTextureInfo& texture : packed.textures)
    std::copy_n(containers_[texture.container].writer->texture(texture.texture).mean, 4, texture.mean);
  return packed;
}

}  // namespace spillway::pipeline
