#include "tools/import/textures.h"

#include <algorithm>
#include <array>

#include "tools/import/colors.h"

namespace spillway::tools {
namespace {

using pipeline::Param;
using pipeline::TextureKind;
using pipeline::TextureNode;

std::string lower_extension(const std::string& file) {
  std::string extension = std::filesystem::path(file).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return extension;
}

void set_rgb(TextureNode& node, Rgb value) {
  node.value[0] = value.r, node.value[1] = value.g, node.value[2] = value.b;
}

}  // namespace

cache::TexelEncoding default_encoding(const std::string& file) {
  constexpr std::array<std::string_view, 3> kLinear = {".exr", ".hdr", ".pfm"};
  const bool linear = std::find(kLinear.begin(), kLinear.end(), lower_extension(file)) != kLinear.end();
  return linear ? cache::TexelEncoding::linear : cache::TexelEncoding::srgb;
}

Status TextureTable::define(TextureValue value, const Token& name, std::string type, ParamList params, Place place,
                            const Transform& world_from_texture) {
  const auto [at, is_new] = definitions_.try_emplace(Key{value, name.text});
  if (!is_new) {
    return error_at(name.place, "texture {} is defined twice (first at {}): rename one", to_string(name),
                    to_string(at->second.place));
  }
  session_.has_face_textures = session_.has_face_textures || type == "ptex";
  at->second.type = std::move(type);
  at->second.params = std::move(params);
  at->second.place = place;
  at->second.world_from_texture = world_from_texture;
  return {};
}

Result<TextureId> TextureTable::use(TextureValue value, const std::string& name, const Place& place) {
  const auto at = definitions_.find(Key{value, name});
  if (at == definitions_.end()) {
    return error_at(place, "there is no {} texture \"{}\": define it before the shape that uses it",
                    value == TextureValue::real ? "float" : "spectrum", name);
  }
  Definition& definition = at->second;
  if (definition.state == SendState::sent) return definition.id;
  if (definition.state == SendState::sending) return error_at(place, "texture \"{}\" uses itself", name);
  if (depth_ == kMaxUseDepth) return error_at(place, "textures use one another more than {} deep", kMaxUseDepth);
  ++depth_;
  definition.state = SendState::sending;
  Result<TextureId> sent = send(value, name, definition);
  --depth_;
  if (!sent) return sent.error();
  definition.id = *sent;
  definition.state = SendState::sent;
  return definition.id;
}

Error TextureTable::unknown_type(TextureValue value, const std::string& name, const Definition& definition) {
  std::string known;
  for (const NodeReader& reader : kNodeReaders)
    if (reader.serves(value)) known += fmt::format("{}{}", known.empty() ? "" : ", ", reader.type);
  return error_at(definition.place, "texture type \"{}\" of \"{}\" is not supported for {} textures: use {}",
                  definition.type, name, value == TextureValue::real ? "float" : "spectrum", known);
}

const TextureTable::NodeReader* TextureTable::find_reader(std::string_view type, TextureValue value) {
  for (const NodeReader& reader : kNodeReaders)
    if (reader.type == type && reader.serves(value)) return &reader;
  return nullptr;
}

Result<TextureId> TextureTable::send(TextureValue value, const std::string& name, Definition& definition) {
  const NodeReader* reader = find_reader(definition.type, value);
  if (reader == nullptr) return unknown_type(value, name, definition);
  SPILLWAY_ASSIGN(const TextureNode node, (this->*reader->read)(value, definition));
  SPILLWAY_TRY(definition.params.check_all_used(session_, fmt::format("Texture \"{}\"", definition.type)));
  return add_node(node, definition.place);
}

Result<TextureId> TextureTable::add_node(const TextureNode& node, const Place& place) {
  Result<TextureId> id = session_.sink.add_texture(node);
  if (!id) return error_at(place, "{}", id.error().message);
  return id;
}

Result<TextureId> TextureTable::add_constant(Rgb value, const Place& place) {
  TextureNode node;
  set_rgb(node, value);
  return add_node(node, place);
}

Result<ImageId> TextureTable::add_image(const Parameter& parameter, cache::TexelEncoding encoding) {
  const std::filesystem::path file = session_.resolved(parameter.strings[0]);
  const auto [at, is_new] = images_.try_emplace({file.lexically_normal().string(), encoding});
  if (!is_new) return at->second;
  Result<ImageId> id = session_.sink.add_image(file, encoding);
  if (!id) return error_at(parameter.place, "{}", id.error().message);
  at->second = *id;
  ++session_.report.image_count;
  return id;
}

Result<Param> TextureTable::scaled(const Param& param, float scale, const Place& place) {
  if (param.texture == TextureId::kNone) return Param{param.constant * scale, TextureId::kNone};
  if (scale == 1) return param;
  TextureNode node;
  node.kind = TextureKind::scale;
  node.child[0] = param.texture;
  SPILLWAY_ASSIGN(const TextureId factor, add_constant({scale, scale, scale}, place));
  node.child[1] = factor.value;
  SPILLWAY_ASSIGN(const TextureId id, add_node(node, place));
  return Param{{}, id.value};
}

Result<TextureId> TextureTable::add_normal_map(const Parameter& file) {
  SPILLWAY_TRY(expect_count(file, file.strings.size(), 1));
  TextureNode node;
  node.kind = TextureKind::image;
  set_rgb(node, {1, 1, 1});
  SPILLWAY_ASSIGN(const ImageId image, add_image(file, cache::TexelEncoding::linear));
  node.image = image.value;
  return add_node(node, file.place);
}

Result<std::optional<Param>> TextureTable::real_param(const ParamList& params, std::string_view name) {
  Param param;
  if (const Parameter* texture = params.find(ParamType::texture, name)) {
    SPILLWAY_TRY(expect_count(*texture, texture->strings.size(), 1));
    SPILLWAY_ASSIGN(const TextureId id, use(TextureValue::real, texture->strings[0], texture->place));
    param.texture = id.value;
    return std::optional<Param>(param);
  }
  if (params.find(ParamType::real, name) == nullptr) return std::optional<Param>();
  SPILLWAY_ASSIGN(const float value, params.real(name, 0));
  param.constant = {value, value, value};
  return std::optional<Param>(param);
}

Result<std::optional<Param>> TextureTable::rgb_param(const ParamList& params, std::string_view name, RgbRange range) {
  Param param;
  if (const Parameter* texture = params.find(ParamType::texture, name)) {
    SPILLWAY_TRY(expect_count(*texture, texture->strings.size(), 1));
    SPILLWAY_ASSIGN(const TextureId id, use(TextureValue::spectrum, texture->strings[0], texture->place));
    param.texture = id.value;
    return std::optional<Param>(param);
  }
  SPILLWAY_ASSIGN(const std::optional<Rgb> rgb, surface_color(session_, params, name, range));
  if (!rgb) return std::optional<Param>();
  param.constant = *rgb;
  return std::optional<Param>(param);
}

}  // namespace spillway::tools
