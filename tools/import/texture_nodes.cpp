// The kinds of Texture: pbrt's parameters as one node each, children first.

#include <algorithm>
#include <charconv>
#include <cmath>

#include "shading/noise.h"
#include "tools/import/colors.h"
#include "tools/import/textures.h"

namespace spillway::tools {
namespace {

using pipeline::Param;
using pipeline::TextureKind;
using pipeline::TextureMapping;
using pipeline::TextureNode;

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

void set_rgb(TextureNode& node, Rgb value) {
  node.value[0] = value.r, node.value[1] = value.g, node.value[2] = value.b;
}

Result<Affine3> finite_affine(const Transform& texture_from_world, const Place& place) {
  const Affine3 rounded = texture_from_world.affine();
  for (const auto& row : rounded.m)
    for (const float number : row)
      if (!std::isfinite(number))
        return error_at(place, "the transform of this texture is too small for 32-bit floats");
  return rounded;
}

// Rows of the place: s along v1, t along v2.
Result<Transform> planar_map(const ParamList& params) {
  SPILLWAY_ASSIGN(const Float3 v1, params.vector3("v1", {1, 0, 0}));
  SPILLWAY_ASSIGN(const Float3 v2, params.vector3("v2", {0, 1, 0}));
  SPILLWAY_ASSIGN(const float s, params.real("udelta", 0));
  SPILLWAY_ASSIGN(const float t, params.real("vdelta", 0));
  return Transform{{{v1.x, v1.y, v1.z, s}, {v2.x, v2.y, v2.z, t}, {0, 0, 0, 0}}};
}

Status read_uv(const ParamList& params, TextureNode& node) {
  SPILLWAY_ASSIGN(node.uv_scale[0], params.real("uscale", 1));
  SPILLWAY_ASSIGN(node.uv_scale[1], params.real("vscale", 1));
  SPILLWAY_ASSIGN(node.uv_offset[0], params.real("udelta", 0));
  SPILLWAY_ASSIGN(node.uv_offset[1], params.real("vdelta", 0));
  return {};
}

Status read_octaves(const ParamList& params, Place place, TextureNode& node) {
  SPILLWAY_ASSIGN(const int32_t octaves, params.integer("octaves", 8));
  if (octaves < 0 || static_cast<uint32_t>(octaves) > shading::kMaxOctaves)
    return error_at(place, "{} octaves of noise: 0 to {} can be", octaves, shading::kMaxOctaves);
  SPILLWAY_ASSIGN(node.value[0], params.real("roughness", 0.5f));
  node.value[1] = static_cast<float>(octaves);
  return {};
}

}  // namespace

const std::array<TextureTable::NodeReader, 13> TextureTable::kNodeReaders = {{
    {"constant", true, true, &TextureTable::constant_node},
    {"imagemap", true, true, &TextureTable::image_node},
    {"scale", true, true, &TextureTable::scale_node},
    {"mix", true, true, &TextureTable::mix_node},
    {"directionmix", true, true, &TextureTable::direction_mix_node},
    {"checkerboard", true, true, &TextureTable::checkerboard_node},
    {"bilerp", true, true, &TextureTable::bilerp_node},
    {"dots", true, true, &TextureTable::dots_node},
    {"ptex", true, true, &TextureTable::face_node},
    {"fbm", true, false, &TextureTable::noise_node},
    {"wrinkled", true, false, &TextureTable::noise_node},
    {"windy", true, false, &TextureTable::noise_node},
    {"marble", false, true, &TextureTable::noise_node},
}};

namespace {

// pbrt's encodings; its default for face textures is a gamma.
Result<pipeline::TexelCurve> read_curve(const ParamList& params) {
  SPILLWAY_ASSIGN(const std::string name, params.string("encoding", "gamma 2.2"));
  if (name == "linear") return pipeline::TexelCurve{};
  if (name == "sRGB") return pipeline::TexelCurve{cache::FaceTexEncoding::srgb, 1};
  constexpr std::string_view kGamma = "gamma ";
  float gamma = 0;
  const char* const end = name.data() + name.size();
  if (name.starts_with(kGamma)) {
    const auto [rest, code] = std::from_chars(name.data() + kGamma.size(), end, gamma);
    if (code == std::errc() && rest == end && gamma > 0 && std::isfinite(gamma))
      return pipeline::TexelCurve{cache::FaceTexEncoding::gamma, gamma};
  }
  return error_at(params.find(ParamType::string, "encoding")->place,
                  "encoding \"{}\" is not supported: use \"sRGB\", \"linear\" or \"gamma\" and a number", name);
}

}  // namespace

// The level for a footprint is chosen at random; with "string filter" "trilinear", which pbrt does not know, two are
// blended.
Result<TextureNode> TextureTable::face_node(TextureValue value, const Definition& definition) {
  const ParamList& params = definition.params;
  TextureNode node;
  node.kind = TextureKind::face;
  node.is_float = value == TextureValue::real;
  SPILLWAY_ASSIGN(const float scale, params.real("scale", 1));
  set_rgb(node, {scale, scale, scale});
  SPILLWAY_ASSIGN(const std::string filter, params.string("filter", "stochastic"));
  if (filter != "stochastic" && filter != "trilinear")
    return error_at(params.find(ParamType::string, "filter")->place,
                    "filter \"{}\" is not one of face textures: use \"stochastic\" or \"trilinear\"", filter);
  if (filter == "trilinear") node.filter = cache::TexelFilter::trilinear;
  const Parameter* file = params.find(ParamType::string, "filename");
  if (file == nullptr) return error_at(definition.place, "ptex without \"string filename\"");
  SPILLWAY_TRY(expect_count(*file, file->strings.size(), 1));
  SPILLWAY_ASSIGN(const pipeline::TexelCurve curve, read_curve(params));
  SPILLWAY_ASSIGN(const std::string name, params.string("texture", ""));  // of a .facetex file of several
  const Result<FaceTextureId> id = session_.sink.add_face_texture(session_.resolved(file->strings[0]), curve, name);
  if (!id) return error_at(file->place, "{}", id.error().message);
  node.image = id->value;
  return node;
}

Status TextureTable::set_place(const Definition& definition, TextureMapping mapping, TextureNode& node) {
  node.mapping = mapping;
  SPILLWAY_ASSIGN(node.texture_from_world, finite_affine(definition.world_from_texture.inverse(), definition.place));
  return {};
}

Status TextureTable::read_mapping(const Definition& definition, TextureNode& node) {
  const ParamList& params = definition.params;
  SPILLWAY_ASSIGN(const std::string mapping, params.string("mapping", "uv"));
  if (mapping == "uv") return read_uv(params, node);
  if (mapping == "spherical") return set_place(definition, TextureMapping::spherical, node);
  if (mapping == "cylindrical") return set_place(definition, TextureMapping::cylindrical, node);
  if (mapping != "planar") {
    return error_at(params.find(ParamType::string, "mapping")->place,
                    "mapping \"{}\" is not known: use \"uv\", \"spherical\", \"cylindrical\" or \"planar\"", mapping);
  }
  node.mapping = TextureMapping::planar;
  SPILLWAY_ASSIGN(const Transform map, planar_map(params));
  SPILLWAY_ASSIGN(node.texture_from_world,
                  finite_affine(map * definition.world_from_texture.inverse(), definition.place));
  return {};
}

Result<TextureNode> TextureTable::constant_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  set_rgb(node, {1, 1, 1});
  if (value == TextureValue::real) {
    SPILLWAY_ASSIGN(const float number, definition.params.real("value", 1));
    set_rgb(node, {number, number, number});
  } else {
    SPILLWAY_ASSIGN(const std::optional<Rgb> rgb,
                    surface_color(session_, definition.params, "value", RgbRange::unbounded));
    if (rgb) set_rgb(node, *rgb);
  }
  return node;
}

Result<TextureNode> TextureTable::image_node(TextureValue value, const Definition& definition) {
  const ParamList& params = definition.params;
  TextureNode node;
  node.kind = TextureKind::image;
  node.is_float = value == TextureValue::real;
  SPILLWAY_ASSIGN(node.wrap, read_wrap(params));
  SPILLWAY_ASSIGN(node.filter, read_filter(params, session_));
  SPILLWAY_ASSIGN(const float scale, params.real("scale", 1));
  set_rgb(node, {scale, scale, scale});
  SPILLWAY_ASSIGN(const bool invert, params.boolean("invert", false));
  node.invert = invert;
  SPILLWAY_TRY(read_mapping(definition, node));
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

Result<TextureNode> TextureTable::checkerboard_node(TextureValue value, const Definition& definition) {
  SPILLWAY_ASSIGN(const int32_t dimension, definition.params.integer("dimension", 2));
  if (dimension != 2 && dimension != 3)
    return error_at(definition.place, "a checkerboard of {} dimensions: there are those of 2 and 3", dimension);
  TextureNode node;
  node.kind = TextureKind::checkerboard;
  if (dimension == 2) {
    SPILLWAY_TRY(read_mapping(definition, node));
  } else {
    SPILLWAY_TRY(set_place(definition, TextureMapping::solid, node));
  }
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "tex1", 1));
  SPILLWAY_ASSIGN(node.child[1], child(value, definition, "tex2", 0));
  return node;
}

Result<TextureNode> TextureTable::bilerp_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  node.kind = TextureKind::bilerp;
  SPILLWAY_TRY(read_mapping(definition, node));
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "v00", 0));
  SPILLWAY_ASSIGN(node.child[1], child(value, definition, "v01", 1));
  SPILLWAY_ASSIGN(node.child[2], child(value, definition, "v10", 0));
  SPILLWAY_ASSIGN(node.child[3], child(value, definition, "v11", 1));
  return node;
}

Result<TextureNode> TextureTable::direction_mix_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  node.kind = TextureKind::direction_mix;
  SPILLWAY_ASSIGN(const Float3 given, definition.params.vector3("dir", {0, 1, 0}));
  const Vec3 world = definition.world_from_texture.vector({given.x, given.y, given.z});
  const double size = std::hypot(world.x, world.y, world.z);
  if (!(size > 0) || !std::isfinite(size))
    return error_at(definition.place, "\"dir\" of a directionmix must not be zero");
  node.value[0] = static_cast<float>(world.x / size), node.value[1] = static_cast<float>(world.y / size);
  node.value[2] = static_cast<float>(world.z / size);
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "tex1", 0));
  SPILLWAY_ASSIGN(node.child[1], child(value, definition, "tex2", 1));
  return node;
}

Result<TextureNode> TextureTable::dots_node(TextureValue value, const Definition& definition) {
  TextureNode node;
  node.kind = TextureKind::dots;
  SPILLWAY_TRY(read_mapping(definition, node));
  SPILLWAY_ASSIGN(node.child[0], child(value, definition, "inside", 1));
  SPILLWAY_ASSIGN(node.child[1], child(value, definition, "outside", 0));
  return node;
}

Result<TextureNode> TextureTable::noise_node(TextureValue, const Definition& definition) {
  const std::string& type = definition.type;
  TextureNode node;
  node.kind = type == "fbm"        ? TextureKind::fbm
              : type == "wrinkled" ? TextureKind::wrinkled
              : type == "windy"    ? TextureKind::windy
                                   : TextureKind::marble;
  SPILLWAY_TRY(set_place(definition, TextureMapping::solid, node));
  if (node.kind == TextureKind::windy) return node;
  SPILLWAY_TRY(read_octaves(definition.params, definition.place, node));
  if (node.kind != TextureKind::marble) return node;
  SPILLWAY_ASSIGN(node.value[2], definition.params.real("scale", 1));
  SPILLWAY_ASSIGN(node.value[3], definition.params.real("variation", 0.2f));
  return node;
}

}  // namespace spillway::tools
