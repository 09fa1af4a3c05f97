#include "tools/import/world.h"

#include <cstring>
#include <optional>
#include <utility>

namespace spillway::tools {

Status World::named_medium(Tokenizer& tokens, const Token& directive, const GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(ParamList params, state.read_params_of(tokens, Target::medium, &session_.sink));
  if (state.moves())
    session_.warn(directive.place, "media do not move: this one stays where it is at the first of TransformTimes");
  return media_.define(name, std::move(params), state.transform);
}

// ---- materials, textures, lights ----

Status World::texture(Tokenizer& tokens, const Token& directive, const GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(const Token value, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(ParamList params, state.read_params_of(tokens, Target::texture));
  if (value.text != "float" && value.text != "spectrum")
    return error_at(value.place, "a texture holds \"float\" or \"spectrum\", not {}", to_string(value));
  const TextureValue kind = value.text == "float" ? TextureValue::real : TextureValue::spectrum;
  return textures_.define(kind, name, type.text, std::move(params), type.place, state.transform);
}

Status World::material(Tokenizer& tokens, const Token& directive, GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(ParamList params, state.read_params_of(tokens, Target::material));
  state.material = std::make_shared<MaterialDefinition>();
  state.material->type = type.text;
  state.material->params = std::move(params);
  state.material->place = type.place;
  return {};
}

Status World::make_named_material(Tokenizer& tokens, const Token& directive, const GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(ParamList params, state.read_params_of(tokens, Target::material));
  return materials_.define(name, std::move(params), name.place);
}

Status World::named_material(Tokenizer& tokens, const Token& directive, GraphicsState& state) {
  SPILLWAY_ASSIGN(state.material_name, read_string_token(tokens, directive.text));
  state.material = nullptr;
  return {};
}

Status World::area_light(Tokenizer& tokens, const Token& directive, GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(const ParamList params, state.read_params_of(tokens, Target::light));
  SPILLWAY_ASSIGN(state.emission, read_area_light(session_, type.text, params, type.place));
  return {};
}

Status World::light(Tokenizer& tokens, const Token& directive, const GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(const ParamList params, state.read_params_of(tokens, Target::light));
  if (state.moves())
    session_.warn(directive.place, "lights do not move: this one stays where it is at the first of TransformTimes");
  return add_light(session_, type.text, params, type.place, state.transform);
}

// ---- shapes and objects ----

Status World::shape(Tokenizer& tokens, const Token& directive, GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(const ParamList params, state.read_params_of(tokens, Target::shape));
  if (!is_supported_shape(type.text))
    return session_.replaced(type.place, fmt::format("shape {}", to_string(type)), "nothing");
  if (!state.material) {
    SPILLWAY_ASSIGN(state.material, materials_.find(state.material_name.text, state.material_name.place));
  }
  ShapeState shape_state;
  shape_state.object_from_shape = state.transform, shape_state.reverse_orientation = state.reverse_orientation;
  shape_state.emission = state.emission;
  SPILLWAY_ASSIGN(shape_state.material, materials_.use(*state.material));
  SPILLWAY_TRY(divide_media(shape_state, state.media));
  if (!shape_state.material.valid() && !shape_state.divides_media) return {};  // nothing to see, nothing to cross
  SPILLWAY_ASSIGN(ReadShape shape, read_shape(session_, textures_, type.text, params, directive.place, shape_state));
  if (state.moves() && !shape.emits()) return moving_shape(std::move(shape), state);
  if (state.moves()) SPILLWAY_TRY(emitter_moves(directive.place));
  if (object_ != nullptr) {
    shape.state.object = object_->index, ++object_->mesh_count;
    object_->emits = object_->emits || shape.emits();
  }
  return send_shape(session_, std::move(shape));
}

// As in pbrt, the same medium on both sides is no division: rays keep what they are in.
Status World::divide_media(ShapeState& shape, const MediumNames& media) const {
  shape.divides_media = media.divide();
  if (!shape.divides_media) return {};
  SPILLWAY_ASSIGN(shape.medium_inside, media_.find(media.inside));
  SPILLWAY_ASSIGN(shape.medium_outside, media_.find(media.outside));
  return {};
}

// As in pbrt, an instance of an object that holds this shape alone, in its own space.
Status World::moving_shape(ReadShape shape, const GraphicsState& state) {
  const bool of_world = object_ == nullptr;
  shape.state.object = of_world ? session_.sink.begin_object(shape.name) : moving_part(shape.name, state);
  shape.state.object_from_shape = {};
  const Place place = shape.place;
  const uint32_t object = shape.state.object;
  SPILLWAY_TRY(send_shape(session_, std::move(shape)));
  return of_world ? add_instance(object, state.transform, state.transform_end, place) : Status{};
}

// What moves alike with the shape before it needs no object of its own.
uint32_t World::moving_part(const std::string& name, const GraphicsState& state) {
  std::vector<MovingPart>& parts = object_->moving;
  const bool alike = !parts.empty() && parts.back().start == state.transform && parts.back().end == state.transform_end;
  if (!alike) parts.push_back({session_.sink.begin_object(name), state.transform, state.transform_end});
  return parts.back().object;
}

// Light tables know one place for each emitter.
Status World::emitter_moves(const Place& place) {
  return session_.ignorable(place,
                            "a shape that emits moves, which is not supported: it stays where it is at the first "
                            "of TransformTimes");
}

Status World::add_instance(uint32_t object, const Transform& start, const Transform& end, const Place& place) {
  const Affine3 first = start.affine(), last = end.affine();
  const Status added = std::memcmp(&first, &last, sizeof first) == 0
                           ? session_.sink.add_instance(object, first)
                           : session_.sink.add_moving_instance(object, first, last);
  return added ? added : error_at(place, "{}", added.error().message);
}

Status World::begin_object(Tokenizer& tokens, const Token& directive) {
  SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
  if (object_ != nullptr)
    return error_at(directive.place, "ObjectBegin inside the object begun at {}", to_string(object_->place));
  const auto [at, is_new] = objects_.try_emplace(name.text);
  if (!is_new) {
    return error_at(name.place, "object {} is defined twice (first at {}): rename one", to_string(name),
                    to_string(at->second.place));
  }
  at->second.index = session_.sink.begin_object(name.text);
  at->second.place = directive.place;
  object_ = &at->second;
  return {};
}

// An instance adds its transform to what the object's shapes were given: world = instance * shape.
Status World::object_instance(Tokenizer& tokens, const Token& directive, const GraphicsState& state) {
  SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
  if (object_ != nullptr) return error_at(directive.place, "ObjectInstance inside an object: objects hold shapes only");
  const auto at = objects_.find(name.text);
  if (at == objects_.end())
    return error_at(name.place, "there is no object {}: define it before its first instance", to_string(name));
  const Object& object = at->second;
  if (object.mesh_count == 0 && object.moving.empty()) {
    session_.warn(name.place, "object {} holds nothing: the instance is left out", to_string(name));
    return {};
  }
  moving_instance_count_ += object.moving.size();
  if (moving_instance_count_ > session_.options.most_moving_instances)
    return error_at(directive.place,
                    "object {} holds {} parts that move, and all its instances and others' make more than {} of them: "
                    "let what moves alike follow in one piece, or make fewer instances",
                    to_string(name), object.moving.size(), session_.options.most_moving_instances);
  if (state.moves() && object.emits) SPILLWAY_TRY(emitter_moves(directive.place));
  const Transform& end = object.emits ? state.transform : state.transform_end;
  if (object.mesh_count > 0) SPILLWAY_TRY(add_instance(object.index, state.transform, end, directive.place));
  for (const MovingPart& part : object.moving)
    SPILLWAY_TRY(add_instance(part.object, state.transform * part.start, end * part.end, directive.place));
  ++session_.report.instance_count;
  return {};
}

}  // namespace spillway::tools
