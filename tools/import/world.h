#pragma once

// What a scene holds, as the directives after WorldBegin say it: media, materials, textures, lights, shapes, objects
// and their instances, sent to the sink as they come.
//
// Each directive reads its own arguments; `state` is the graphics state where it stands.

#include <map>
#include <string>
#include <vector>

#include "tools/import/graphics_state.h"
#include "tools/import/shapes.h"
#include "tools/import/textures.h"

namespace spillway::tools {

class World {
 public:
  explicit World(Session& session)
      : session_(session), textures_(session), materials_(session, textures_), media_(session) {}

  // Of shapes that name none.
  [[nodiscard]] std::shared_ptr<MaterialDefinition> standard_material() { return materials_.standard(); }
  [[nodiscard]] Result<uint32_t> find_medium(const Token& name) const { return media_.find(name); }

  Status named_medium(Tokenizer& tokens, const Token& directive, const GraphicsState& state);
  Status texture(Tokenizer& tokens, const Token& directive, const GraphicsState& state);
  Status material(Tokenizer& tokens, const Token& directive, GraphicsState& state);
  Status make_named_material(Tokenizer& tokens, const Token& directive, const GraphicsState& state);
  Status named_material(Tokenizer& tokens, const Token& directive, GraphicsState& state);
  Status area_light(Tokenizer& tokens, const Token& directive, GraphicsState& state);
  Status light(Tokenizer& tokens, const Token& directive, const GraphicsState& state);
  Status shape(Tokenizer& tokens, const Token& directive, GraphicsState& state);
  // Between the two, shapes are of the object.
  Status begin_object(Tokenizer& tokens, const Token& directive);
  void end_object() { object_ = nullptr; }
  Status object_instance(Tokenizer& tokens, const Token& directive, const GraphicsState& state);

 private:
  // Shapes of an object that move in it, all alike: an object of its own for the sink.
  struct MovingPart {
    uint32_t object;
    Transform start, end;
  };
  struct Object {
    uint32_t index = 0;
    Place place;
    uint64_t mesh_count = 0;
    bool emits = false;
    std::vector<MovingPart> moving;
  };

  Status divide_media(ShapeState& shape, const MediumNames& media) const;
  Status moving_shape(ReadShape shape, const GraphicsState& state);
  uint32_t moving_part(const std::string& name, const GraphicsState& state);
  Status emitter_moves(const Place& place);
  Status add_instance(uint32_t object, const Transform& start, const Transform& end, const Place& place);

  Session& session_;
  TextureTable textures_;
  MaterialTable materials_;
  MediumTable media_;
  std::map<std::string, Object> objects_;
  Object* object_ = nullptr;            // the one being defined
  uint64_t moving_instance_count_ = 0;  // of parts of objects
};

}  // namespace spillway::tools
