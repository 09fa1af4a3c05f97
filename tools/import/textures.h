#pragma once

// Named textures: defined in any order, sent to the sink when first used, children first.

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "tools/import/colors.h"
#include "tools/import/params.h"
#include "tools/import/session.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// How deep textures and mixed materials may use one another: far above any scene, below any stack.
inline constexpr int kMaxUseDepth = 64;

enum class TextureValue : uint8_t { real, spectrum };  // pbrt keeps the two kinds under separate names
enum class SendState : uint8_t { waiting, sending, sent };

// pbrt's default: files of floats are linear, all others sRGB.
[[nodiscard]] cache::TexelEncoding default_encoding(const std::string& file);

class TextureTable {
 public:
  explicit TextureTable(Session& session) : session_(session) {}

  Status define(TextureValue value, const Token& name, std::string type, ParamList params, Place place,
                const Transform& world_from_texture);

  // The node of a named texture. `place` is where it is used.
  Result<TextureId> use(TextureValue value, const std::string& name, const Place& place);
  Result<TextureId> add_constant(Rgb value, const Place& place);

  // A material's parameter, given as a value or as a texture; none when absent.
  Result<std::optional<pipeline::Param>> real_param(const ParamList& params, std::string_view name);
  Result<std::optional<pipeline::Param>> rgb_param(const ParamList& params, std::string_view name, RgbRange range);
  Result<pipeline::Param> scaled(const pipeline::Param& param, float scale, const Place& place);

  // The file that a material names as its normal map: linear, whatever its format.
  Result<TextureId> add_normal_map(const Parameter& file);

 private:
  struct Definition {
    std::string type;
    ParamList params;
    Place place;
    Transform world_from_texture;  // the current one where the texture was defined
    SendState state = SendState::waiting;
    TextureId id;
  };
  using Key = std::pair<TextureValue, std::string>;

  Result<TextureId> send(TextureValue value, const std::string& name, Definition& definition);
  Result<TextureId> add_node(const pipeline::TextureNode& node, const Place& place);
  // One a kind of Texture (texture_nodes.cpp).
  struct NodeReader {
    std::string_view type;
    bool real, spectrum;  // which textures may be of this type
    Result<pipeline::TextureNode> (TextureTable::*read)(TextureValue, const Definition&);
    [[nodiscard]] bool serves(TextureValue value) const { return value == TextureValue::real ? real : spectrum; }
  };
  static const std::array<NodeReader, 13> kNodeReaders;
  static const NodeReader* find_reader(std::string_view type, TextureValue value);
  static Error unknown_type(TextureValue value, const std::string& name, const Definition& definition);
  Result<pipeline::TextureNode> constant_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> image_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> scale_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> mix_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> checkerboard_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> bilerp_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> direction_mix_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> dots_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> face_node(TextureValue value, const Definition& definition);
  Result<pipeline::TextureNode> noise_node(TextureValue value, const Definition& definition);
  Status set_place(const Definition& definition, pipeline::TextureMapping mapping, pipeline::TextureNode& node);
  Status read_mapping(const Definition& definition, pipeline::TextureNode& node);
  Result<ImageId> add_image(const Parameter& parameter, cache::TexelEncoding encoding);
  Result<uint32_t> child(TextureValue value, const Definition& definition, std::string_view name, float otherwise);

  Session& session_;
  std::map<Key, Definition> definitions_;
  std::map<std::pair<std::string, cache::TexelEncoding>, ImageId> images_;
  int depth_ = 0;
};

}  // namespace spillway::tools
