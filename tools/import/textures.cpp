#include "tools/import/textures.h"

#include <algorithm>
#include <array>

#include "tools/import/spectra.h"

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

Result<cache::TexelEncoding> read_encoding(const ParamList& params, const std::string& file) {
  const Parameter* parameter = params.find(ParamType::string, "encoding");
  if (parameter == nullptr) return default_encoding(file);
  SPILLWAY_TRY(expect_count(*parameter, parameter->strings.size(), 1));
  if (parameter->strings[0] == "linear") return cache::TexelEncoding::linear;
  if (parameter->strings[0] == "sRGB") return cache::TexelEncoding::srgb;
  return error_at(parameter->place, "encoding \"{}\" is not supported: use \"sRGB\" or \"linear\"",
                  parameter->strings[0]);
}

Result<cache::WrapMode> read_wrap(const ParamList& params) {
  const Parameter* parameter = params.find(ParamType::string, "wrap");
  if (parameter == nullptr) return cache::WrapMode::repeat;
  SPILLWAY_TRY(expect_count(*parameter, parameter->strings.size(), 1));
  if (parameter->strings[0] == "repeat") return cache::WrapMode::repeat;
  if (parameter->strings[0] == "clamp") return cache::WrapMode::clamp;
  if (parameter->strings[0] == "black") return cache::WrapMode::black;
  return error_at(parameter->place, "wrap \"{}\" is not supported: use \"repeat\", \"clamp\" or \"black\"",
                  parameter->strings[0]);
}

Result<cache::TexelFilter> read_filter(const ParamList& params, Session& session) {
  (void)params.find(ParamType::real, "maxanisotropy");  // of ewa alone
  const Parameter* parameter = params.find(ParamType::string, "filter");
  if (parameter == nullptr) return cache::TexelFilter::bilinear;
  SPILLWAY_TRY(expect_count(*parameter, parameter->strings.size(), 1));
  const std::string& filter = parameter->strings[0];
  if (filter == "point") return cache::TexelFilter::point;
  if (filter == "bilinear") return cache::TexelFilter::bilinear;
  if (filter == "trilinear") return cache::TexelFilter::trilinear;
  if (filter != "ewa" && filter != "EWA") return error_at(parameter->place, "unknown filter \"{}\"", filter);
  session.warn(parameter->place, "filter \"{}\": \"trilinear\" is used instead", filter);
  return cache::TexelFilter::trilinear;
}

Status read_mapping(const ParamList& params, TextureNode& node) {
  if (const Parameter* mapping = params.find(ParamType::string, "mapping")) {
    SPILLWAY_TRY(expect_count(*mapping, mapping->strings.size(), 1));
    if (mapping->strings[0] != "uv") {
      return error_at(mapping->place, "mapping \"{}\" is not supported: use \"uv\"", mapping->strings[0]);
    }
  }
  SPILLWAY_ASSIGN(node.uv_scale[0], params.real("uscale", 1));
  SPILLWAY_ASSIGN(node.uv_scale[1], params.real("vscale", 1));
  SPILLWAY_ASSIGN(node.uv_offset[0], params.real("udelta", 0));
  SPILLWAY_ASSIGN(node.uv_offset[1], params.real("vdelta", 0));
  return {};
}

void set_rgb(TextureNode& node, Rgb value) {
  node.value[0] = value.r, node.value[1] = value.g, node.value[2] = value.b;
}

Result<std::optional<Rgb>> read_rgb(const ParamList& params, std::string_view name, RgbRange range) {
  if (const Parameter* spectrum = params.find(ParamType::spectrum, name)) {
    if (!spectrum->strings.empty())
      return error_at(spectrum->place, "\"spectrum {}\" takes pairs of wavelength (nm) and value here", name);
    SPILLWAY_TRY(check_pairs(*spectrum));
    return std::optional<Rgb>(reflectance_rgb(spectrum->numbers));
  }
  const Parameter* parameter = params.find(ParamType::rgb, name);
  if (parameter == nullptr) return std::optional<Rgb>();
  SPILLWAY_TRY(expect_count(*parameter, parameter->numbers.size(), 3));
  const Rgb rgb{parameter->numbers[0], parameter->numbers[1], parameter->numbers[2]};
  if (std::min({rgb.r, rgb.g, rgb.b}) < 0) return error_at(parameter->place, "\"{}\" must not be negative", name);
  if (range == RgbRange::albedo && max_component(rgb) > 1) {
    return error_at(parameter->place, "\"{}\" must not be above 1: it would reflect more than it gets", name);
  }
  return std::optional<Rgb>(rgb);
}

}  // namespace

cache::TexelEncoding default_encoding(const std::string& file) {
  constexpr std::array<std::string_view, 3> kLinear = {".exr", ".hdr", ".pfm"};
  const bool linear = std::find(kLinear.begin(), kLinear.end(), lower_extension(file)) != kLinear.end();
  return linear ? cache::TexelEncoding::linear : cache::TexelEncoding::srgb;
}

Status TextureTable::define(TextureValue value, const Token& name, std::string type, ParamList params, Place place) {
  const auto [at, is_new] = definitions_.try_emplace(Key{value, name.text});
  if (!is_new) {
    return error_at(name.place, "texture {} is defined twice (first at {}): rename one", to_string(name),
                    to_string(at->second.place));
  }
  at->second.type = std::move(type);
  at->second.params = std::move(params);
  at->second.place = place;
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

Result<TextureId> TextureTable::send(TextureValue value, const std::string& name, Definition& definition) {
  TextureNode node;
  if (definition.type == "constant") {
    SPILLWAY_ASSIGN(node, constant_node(value, definition));
  } else if (definition.type == "imagemap") {
    SPILLWAY_ASSIGN(node, image_node(definition));
    node.is_float = value == TextureValue::real;
  } else if (definition.type == "scale") {
    SPILLWAY_ASSIGN(node, scale_node(value, definition));
  } else if (definition.type == "mix") {
    SPILLWAY_ASSIGN(node, mix_node(value, definition));
  } else if (definition.type == "checkerboard") {
    SPILLWAY_ASSIGN(node, checkerboard_node(value, definition));
  } else if (definition.type == "bilerp") {
    SPILLWAY_ASSIGN(node, bilerp_node(value, definition));
  } else {
    return error_at(definition.place,
                    "texture type \"{}\" of \"{}\" is not supported: use constant, imagemap, scale, mix, checkerboard "
                    "or bilerp",
                    definition.type, name);
  }
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

Result<TextureNode> TextureTable::constant_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  set_rgb(node, {1, 1, 1});
  if (value == TextureValue::real) {
    SPILLWAY_ASSIGN(const float number, definition.params.real("value", 1));
    set_rgb(node, {number, number, number});
  } else {
    SPILLWAY_ASSIGN(const std::optional<Rgb> rgb, read_rgb(definition.params, "value", RgbRange::unbounded));
    if (rgb) set_rgb(node, *rgb);
  }
  return node;
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

Result<TextureNode> TextureTable::image_node(const Definition& definition) {
  const ParamList& params = definition.params;
  TextureNode node;
  node.kind = TextureKind::image;
  SPILLWAY_ASSIGN(node.wrap, read_wrap(params));
  SPILLWAY_ASSIGN(node.filter, read_filter(params, session_));
  SPILLWAY_ASSIGN(const float scale, params.real("scale", 1));
  set_rgb(node, {scale, scale, scale});
  SPILLWAY_ASSIGN(const bool invert, params.boolean("invert", false));
  node.invert = invert;
  SPILLWAY_TRY(read_mapping(params, node));
  const Parameter* file = params.find(ParamType::string, "filename");
  if (file == nullptr) return error_at(definition.place, "imagemap without \"string filename\"");
  SPILLWAY_TRY(expect_count(*file, file->strings.size(), 1));
  SPILLWAY_ASSIGN(const cache::TexelEncoding encoding, read_encoding(params, file->strings[0]));
  SPILLWAY_ASSIGN(const ImageId image, add_image(*file, encoding));
  node.image = image.value;
  return node;
}

Result<uint32_t> TextureTable::child(TextureValue value, const Definition& definition, std::string_view name,
                                     float otherwise) {
  std::optional<Param> param;
  if (value == TextureValue::real) {
    SPILLWAY_ASSIGN(param, real_param(definition.params, name));
  } else {
    SPILLWAY_ASSIGN(param, rgb_param(definition.params, name, RgbRange::unbounded));
  }
  if (param && param->texture != TextureId::kNone) return param->texture;
  const Rgb constant = param ? param->constant : Rgb{otherwise, otherwise, otherwise};
  SPILLWAY_ASSIGN(const TextureId id, add_constant(constant, definition.place));
  return id.value;
}

Result<TextureNode> TextureTable::scale_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  node.kind = TextureKind::scale;
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "tex", 1));
  SPILLWAY_ASSIGN(node.child[1], child(TextureValue::real, definition, "scale", 1));
  return node;
}

Result<TextureNode> TextureTable::mix_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  node.kind = TextureKind::mix;
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "tex1", 0));
  SPILLWAY_ASSIGN(node.child[1], child(value, definition, "tex2", 1));
  SPILLWAY_ASSIGN(node.child[2], child(TextureValue::real, definition, "amount", 0.5f));
  return node;
}

// pbrt's two dimensions, that is squares in uv; cells of solid checkerboards would need places.
Result<TextureNode> TextureTable::checkerboard_node(TextureValue value, const Definition& definition) {
  SPILLWAY_ASSIGN(const int32_t dimension, definition.params.integer("dimension", 2));
  if (dimension != 2) return error_at(definition.place, "a checkerboard of {} dimensions is not supported: use 2", dimension);
  TextureNode node;
  node.kind = TextureKind::checkerboard;
  SPILLWAY_TRY(read_mapping(definition.params, node));
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "tex1", 1));
  SPILLWAY_ASSIGN(node.child[1], child(value, definition, "tex2", 0));
  return node;
}

Result<TextureNode> TextureTable::bilerp_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  node.kind = TextureKind::bilerp;
  SPILLWAY_TRY(read_mapping(definition.params, node));
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "v00", 0));
  SPILLWAY_ASSIGN(node.child[1], child(value, definition, "v01", 1));
  SPILLWAY_ASSIGN(node.child[2], child(value, definition, "v10", 0));
  SPILLWAY_ASSIGN(node.child[3], child(value, definition, "v11", 1));
  return node;
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
  SPILLWAY_ASSIGN(const std::optional<Rgb> rgb, read_rgb(params, name, range));
  if (!rgb) return std::optional<Param>();
  param.constant = *rgb;
  return std::optional<Param>(param);
}

}  // namespace spillway::tools
