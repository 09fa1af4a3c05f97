#include "tools/import/import_pbrt.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "tools/import/attributes.h"
#include "tools/import/color_space.h"
#include "tools/import/lights.h"
#include "tools/import/materials.h"
#include "tools/import/media.h"
#include "tools/import/params.h"
#include "tools/import/session.h"
#include "tools/import/settings.h"
#include "tools/import/shapes.h"
#include "tools/import/textures.h"
#include "tools/import/tokens.h"
#include "tools/import/transform.h"
#include "tools/import/transform_directives.h"

namespace spillway::tools {
namespace {

// Far above any scene; below what the stack of this process holds.
constexpr size_t kMaxIncludeDepth = 32, kMaxAttributeDepth = 1024;
// Files opened in all: a file that includes the next one twice, and so on, doubles at each step.
constexpr size_t kMaxIncludes = 100000;

struct GraphicsState {
  Transform transform;      // the current one, at the first of TransformTimes: world from shape (before WorldBegin: camera from world)
  Transform transform_end;  // at the second
  bool changes_start = true, changes_end = true;  // ActiveTransform
  bool reverse_orientation = false;
  std::shared_ptr<MaterialDefinition> material;  // none: look up the name
  Token material_name;
  std::optional<AreaEmission> emission;
  Attributes attributes;
  MediumNames media;
  ColorSpace color_space = ColorSpace::srgb;
  [[nodiscard]] bool moves() const { return !(transform == transform_end); }
};

// What CoordinateSystem names.
struct NamedSystem {
  Transform start, end;
};

// A shape of an object that moves in it: an object of its own for the sink.
struct MovingShape {
  uint32_t object;
  Transform start, end;
};

struct OpenScope {
  Token directive;
  GraphicsState outer;
};

struct Object {
  uint32_t index = 0;
  Place place;
  uint64_t mesh_count = 0;
  bool emits = false;
  std::vector<MovingShape> moving;
};

enum class Where : uint8_t { options, world, anywhere };

class Importer {
 public:
  explicit Importer(Session& session) : session_(session), textures_(session), materials_(session, textures_), media_(session) {
    state_.material = materials_.standard();
  }

  Status run(const std::filesystem::path& scene) {
    SPILLWAY_TRY(run_file(scene, nullptr));
    if (!scopes_.empty()) {
      return error_at(scopes_.back().directive.place, "{} is never ended", scopes_.back().directive.text);
    }
    if (!in_world_) return error("{}: no WorldBegin: not a whole scene?", scene.string());
    return {};
  }

 private:
  using Handler = Status (Importer::*)(Tokenizer&, const Token&);
  struct Directive {
    std::string_view name;
    Where where;
    Handler handler;
  };

  // ---- files ----

  Status run_file(const std::filesystem::path& path, const Token* included_by) {
    std::error_code code;
    const std::filesystem::path canonical = std::filesystem::weakly_canonical(path, code);
    if (std::find(open_files_.begin(), open_files_.end(), canonical) != open_files_.end()) {
      return error_at(included_by->place, "{} includes itself", path.string());
    }
    if (open_files_.size() == kMaxIncludeDepth) {
      return error_at(included_by->place, "files include one another more than {} deep", kMaxIncludeDepth);
    }
    if (session_.file_names.size() > kMaxIncludes) {
      return error_at(included_by->place, "more than {} files are included", kMaxIncludes);
    }
    const std::string* name = &session_.file_names.emplace_back(path.string());
    Result<std::unique_ptr<Tokenizer>> tokens = Tokenizer::open(path, name);
    if (!tokens)
      return included_by == nullptr ? tokens.error() : error_at(included_by->place, "{}", tokens.error().message);
    open_files_.push_back(canonical);
    SPILLWAY_TRY(run_tokens(**tokens));
    open_files_.pop_back();
    return {};
  }

  Status run_tokens(Tokenizer& tokens) {
    for (;;) {
      SPILLWAY_ASSIGN(const Token token, tokens.take());
      if (token.kind == TokenKind::end) return {};
      SPILLWAY_TRY(run_directive(tokens, token));
    }
  }

  Status run_directive(Tokenizer& tokens, const Token& token) {
    for (const Directive& directive : kDirectives) {
      if (token.kind != TokenKind::word || directive.name != token.text) continue;
      if (directive.where == Where::options && in_world_) {
        return error_at(token.place, "{} belongs before WorldBegin", token.text);
      }
      if (directive.where == Where::world && !in_world_) {
        return error_at(token.place, "{} belongs after WorldBegin", token.text);
      }
      return (this->*directive.handler)(tokens, token);
    }
    if (token.kind != TokenKind::word)
      return error_at(token.place, "{} where a directive is expected", to_string(token));
    SPILLWAY_TRY(session_.ignorable(token.place, "unknown directive {}", to_string(token)));
    return skip_arguments(tokens);
  }

  // Everything up to what may be the next directive.
  Status skip_arguments(Tokenizer& tokens) {
    for (;;) {
      SPILLWAY_ASSIGN(const Token* next, tokens.peek());
      const bool is_number = next->kind == TokenKind::word && number(*next);
      const bool is_truth = next->kind == TokenKind::word && (next->text == "true" || next->text == "false");
      if (next->kind == TokenKind::end || (next->kind == TokenKind::word && !is_number && !is_truth)) return {};
      SPILLWAY_ASSIGN([[maybe_unused]] const Token skipped, tokens.take());
    }
  }

  Status include(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token file, read_string_token(tokens, directive.text));
    return run_file(session_.resolved(file.text), &file);
  }

  // Like Include, in a scope of its own.
  Status import(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token file, read_string_token(tokens, directive.text));
    const size_t depth = scopes_.size();
    SPILLWAY_TRY(push_scope(directive));
    SPILLWAY_TRY(run_file(session_.resolved(file.text), &file));
    if (scopes_.size() != depth + 1) return error_at(file.place, "{} does not end what it begins", to_string(file));
    pop_scope();
    return {};
  }

  // ---- scopes ----

  Status push_scope(const Token& directive) {
    if (scopes_.size() == kMaxAttributeDepth)
      return error_at(directive.place, "scopes nest more than {} deep", kMaxAttributeDepth);
    scopes_.push_back({directive, state_});
    return {};
  }

  void pop_scope() {
    state_ = std::move(scopes_.back().outer);
    scopes_.pop_back();
  }

  Status attribute_begin(Tokenizer&, const Token& directive) { return push_scope(directive); }

  Status attribute_end(Tokenizer&, const Token& directive) {
    const std::string begin = directive.text.substr(0, directive.text.size() - 3) + "Begin";
    if (scopes_.empty()) return error_at(directive.place, "{} without {}", directive.text, begin);
    const Token& open = scopes_.back().directive;
    if (open.text != begin) {
      return error_at(directive.place, "{} cannot end the {} at {}", directive.text, open.text, to_string(open.place));
    }
    pop_scope();
    return {};
  }

  Status transform_begin(Tokenizer&, const Token& directive) {
    session_.warn(directive.place, "TransformBegin is deprecated: it keeps everything, as AttributeBegin does");
    return push_scope(directive);
  }

  Status attribute(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token target, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(ParamList added, read_params(tokens, state_.color_space));
    return state_.attributes.add(target, std::move(added));
  }

  Result<ParamList> params_with_attributes(Tokenizer& tokens, Target target) {
    SPILLWAY_ASSIGN(ParamList params, read_params(tokens, state_.color_space));
    state_.attributes.extend(target, params);
    return params;
  }

  // ---- transforms ----

  Status transform(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const TransformStep step, read_transform_step(tokens, directive));
    const bool both = state_.changes_start && state_.changes_end && !state_.moves();
    if (state_.changes_start) {
      SPILLWAY_ASSIGN(state_.transform, after_step(step, directive, state_.transform));
    }
    if (both) {
      state_.transform_end = state_.transform;
    } else if (state_.changes_end) {
      SPILLWAY_ASSIGN(state_.transform_end, after_step(step, directive, state_.transform_end));
    }
    return {};
  }

  Status name_system(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    systems_[name.text] = {state_.transform, state_.transform_end};
    return {};
  }

  Status recall_system(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    const auto at = systems_.find(name.text);
    if (at == systems_.end()) return error_at(name.place, "there is no coordinate system {}", to_string(name));
    state_.transform = at->second.start, state_.transform_end = at->second.end;
    return {};
  }

  Status reverse_orientation(Tokenizer&, const Token&) {
    state_.reverse_orientation = !state_.reverse_orientation;
    return {};
  }

  Status transform_times(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const std::vector<double> times, read_numbers(tokens, 2, false, directive.text));
    options_.motion = {static_cast<float>(times[0]), static_cast<float>(times[1])};
    const pipeline::MotionSettings& motion = options_.motion;
    if (std::isfinite(motion.start_time) && std::isfinite(motion.end_time) && motion.start_time < motion.end_time) return {};
    return error_at(directive.place, "TransformTimes {} {}: the first must be before the second", times[0], times[1]);
  }

  Status active_transform(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token which, tokens.take());
    const bool start = which.text == "StartTime", end = which.text == "EndTime", all = which.text == "All";
    if (!start && !end && !all)
      return error_at(which.place, "{} {}: use StartTime, EndTime or All", directive.text, to_string(which));
    state_.changes_start = start || all, state_.changes_end = end || all;
    return {};
  }

  // ---- before the world ----

  Status wait(Tokenizer& tokens, const Token& directive, std::optional<Waiting>& waiting) {
    SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(ParamList params, read_params(tokens));
    if (waiting)
      session_.warn(directive.place, "{} is given again: this one replaces that at {}", directive.text,
                    to_string(waiting->place));
    waiting = Waiting{type.text, std::move(params), type.place};
    return {};
  }

  Status camera(Tokenizer& tokens, const Token& directive) {
    options_.camera_from_world = state_.transform, options_.camera_from_world_end = state_.transform_end;
    systems_["camera"] = {state_.transform.inverse(), state_.transform_end.inverse()};
    SPILLWAY_ASSIGN(options_.camera_medium, media_.find(state_.media.outside));
    return wait(tokens, directive, options_.camera);
  }
  Status film(Tokenizer& tokens, const Token& directive) { return wait(tokens, directive, options_.film); }
  Status filter(Tokenizer& tokens, const Token& directive) { return wait(tokens, directive, options_.filter); }
  Status sampler(Tokenizer& tokens, const Token& directive) { return wait(tokens, directive, options_.sampler); }
  Status integrator(Tokenizer& tokens, const Token& directive) { return wait(tokens, directive, options_.integrator); }

  // pbrt's own trees: nothing to take from it.
  Status accelerator(Tokenizer& tokens, const Token& directive) {
    std::optional<Waiting> ignored;
    return wait(tokens, directive, ignored);
  }

  Status option(Tokenizer& tokens, const Token& directive) {
    return read_option(session_, tokens, directive, options_);
  }

  Status set_color_space(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    const std::optional<ColorSpace> known = color_space(name.text);
    if (!known) {
      return error_at(name.place,
                      "color space {} is not known: use \"srgb\", \"dci-p3\", \"rec2020\" or \"aces2065-1\"",
                      to_string(name));
    }
    state_.color_space = *known;
    return {};
  }

  Status world_begin(Tokenizer&, const Token& directive) {
    options_.color_space = state_.color_space;
    SPILLWAY_ASSIGN(const pipeline::SceneSettings settings, build_settings(session_, options_, directive.place));
    session_.sink.set_settings(settings);
    SPILLWAY_TRY(move_camera(settings.camera, options_.camera ? options_.camera->place : directive.place));
    in_world_ = true;
    state_.transform = state_.transform_end = {};
    state_.changes_start = state_.changes_end = true;
    systems_["world"] = {};
    return {};
  }

  // Keys that 32-bit floats cannot tell apart are none.
  Status move_camera(const shading::Camera& camera, const Place& place) {
    const Affine3 end = options_.camera_from_world_end.inverse().affine();
    if (std::memcmp(&camera.world_from_camera, &end, sizeof end) == 0) return {};
    if (const Status set = session_.sink.set_camera_end(end); !set) return error_at(place, "{}", set.error().message);
    return {};
  }

  // ---- media ----

  Status named_medium(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(ParamList params, params_with_attributes(tokens, Target::medium));
    if (state_.moves()) session_.warn(directive.place, "media do not move: this one stays where it is at the first of TransformTimes");
    return media_.define(name, std::move(params), state_.transform);
  }

  Status medium_interface(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(state_.media, read_medium_interface(tokens, directive));
    return {};
  }

  // ---- materials, textures, lights ----

  Status texture(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(const Token value, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(ParamList params, params_with_attributes(tokens, Target::texture));
    if (value.text != "float" && value.text != "spectrum") {
      return error_at(value.place, "a texture holds \"float\" or \"spectrum\", not {}", to_string(value));
    }
    const TextureValue kind = value.text == "float" ? TextureValue::real : TextureValue::spectrum;
    return textures_.define(kind, name, type.text, std::move(params), type.place, state_.transform);
  }

  Status material(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(ParamList params, params_with_attributes(tokens, Target::material));
    state_.material = std::make_shared<MaterialDefinition>();
    state_.material->type = type.text;
    state_.material->params = std::move(params);
    state_.material->place = type.place;
    return {};
  }

  Status make_named_material(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(ParamList params, params_with_attributes(tokens, Target::material));
    return materials_.define(name, std::move(params), name.place);
  }

  Status named_material(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(state_.material_name, read_string_token(tokens, directive.text));
    state_.material = nullptr;
    return {};
  }

  Status area_light(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(const ParamList params, params_with_attributes(tokens, Target::light));
    SPILLWAY_ASSIGN(state_.emission, read_area_light(session_, type.text, params, type.place));
    return {};
  }

  Status light(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(const ParamList params, params_with_attributes(tokens, Target::light));
    if (state_.moves())
      session_.warn(directive.place, "lights do not move: this one stays where it is at the first of TransformTimes");
    return add_light(session_, type.text, params, type.place, state_.transform);
  }

  // ---- shapes and objects ----

  Status shape(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token type, read_string_token(tokens, directive.text));
    SPILLWAY_ASSIGN(const ParamList params, params_with_attributes(tokens, Target::shape));
    if (!is_supported_shape(type.text)) {
      return session_.replaced(type.place, fmt::format("shape {}", to_string(type)), "nothing");
    }
    if (!state_.material) {
      SPILLWAY_ASSIGN(state_.material, materials_.find(state_.material_name.text, state_.material_name.place));
    }
    ShapeState shape_state;
    shape_state.object_from_shape = state_.transform, shape_state.reverse_orientation = state_.reverse_orientation;
    shape_state.emission = state_.emission;
    SPILLWAY_ASSIGN(shape_state.material, materials_.use(*state_.material));
    SPILLWAY_TRY(divide_media(shape_state));
    if (!shape_state.material.valid() && !shape_state.divides_media) return {};  // nothing to see, nothing to cross
    SPILLWAY_ASSIGN(ReadShape shape, read_shape(session_, textures_, type.text, params, directive.place, shape_state));
    if (state_.moves() && !shape.emits()) return moving_shape(std::move(shape));
    if (state_.moves()) SPILLWAY_TRY(emitter_moves(directive.place));
    if (object_ != nullptr) {
      shape.state.object = object_->index, ++object_->mesh_count;
      object_->emits = object_->emits || shape.emits();
    }
    return send_shape(session_, std::move(shape));
  }

  // As in pbrt, the same medium on both sides is no division: rays keep what they are in.
  Status divide_media(ShapeState& shape) const {
    shape.divides_media = state_.media.divide();
    if (!shape.divides_media) return {};
    SPILLWAY_ASSIGN(shape.medium_inside, media_.find(state_.media.inside));
    SPILLWAY_ASSIGN(shape.medium_outside, media_.find(state_.media.outside));
    return {};
  }

  // As in pbrt, an instance of an object that holds this shape alone, in its own space.
  Status moving_shape(ReadShape shape) {
    shape.state.object = session_.sink.begin_object(shape.name);
    shape.state.object_from_shape = {};
    const Place place = shape.place;
    const MovingShape moving{shape.state.object, state_.transform, state_.transform_end};
    SPILLWAY_TRY(send_shape(session_, std::move(shape)));
    if (object_ == nullptr) return add_instance(moving.object, moving.start, moving.end, place);
    object_->moving.push_back(moving);
    return {};
  }

  // Light tables know one place for each emitter.
  Status emitter_moves(const Place& place) {
    return session_.ignorable(place, "a shape that emits moves, which is not supported: it stays where it is at the first "
                              "of TransformTimes");
  }

  Status add_instance(uint32_t object, const Transform& start, const Transform& end, const Place& place) {
    const Affine3 first = start.affine(), last = end.affine();
    const Status added = std::memcmp(&first, &last, sizeof first) == 0
                             ? session_.sink.add_instance(object, first)
                             : session_.sink.add_moving_instance(object, first, last);
    return added ? added : error_at(place, "{}", added.error().message);
  }

  Status object_begin(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    if (object_ != nullptr)
      return error_at(directive.place, "ObjectBegin inside the object begun at {}", to_string(object_->place));
    const auto [at, is_new] = objects_.try_emplace(name.text);
    if (!is_new) {
      return error_at(name.place, "object {} is defined twice (first at {}): rename one", to_string(name),
                      to_string(at->second.place));
    }
    SPILLWAY_TRY(push_scope(directive));
    at->second.index = session_.sink.begin_object(name.text);
    at->second.place = directive.place;
    object_ = &at->second;
    ++session_.report.object_count;
    return {};
  }

  Status object_end(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_TRY(attribute_end(tokens, directive));
    object_ = nullptr;
    return {};
  }

  // An instance adds its transform to what the object's shapes were given: world = instance * shape.
  Status object_instance(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
    if (object_ != nullptr)
      return error_at(directive.place, "ObjectInstance inside an object: objects hold shapes only");
    const auto at = objects_.find(name.text);
    if (at == objects_.end()) {
      return error_at(name.place, "there is no object {}: define it before its first instance", to_string(name));
    }
    const Object& object = at->second;
    if (object.mesh_count == 0 && object.moving.empty()) {
      session_.warn(name.place, "object {} holds nothing: the instance is left out", to_string(name));
      return {};
    }
    if (state_.moves() && object.emits) SPILLWAY_TRY(emitter_moves(directive.place));
    const Transform& end = object.emits ? state_.transform : state_.transform_end;
    if (object.mesh_count > 0) SPILLWAY_TRY(add_instance(object.index, state_.transform, end, directive.place));
    for (const MovingShape& shape : object.moving)
      SPILLWAY_TRY(add_instance(shape.object, state_.transform * shape.start, end * shape.end, directive.place));
    ++session_.report.instance_count;
    return {};
  }

  static const std::array<Directive, 40> kDirectives;

  Session& session_;
  TextureTable textures_;
  MaterialTable materials_;
  MediumTable media_;
  GraphicsState state_;
  std::vector<OpenScope> scopes_;
  std::vector<std::filesystem::path> open_files_;
  std::map<std::string, NamedSystem> systems_;
  std::map<std::string, Object> objects_;
  Object* object_ = nullptr;  // the one being defined
  SceneOptions options_;
  bool in_world_ = false;
};

const std::array<Importer::Directive, 40> Importer::kDirectives = {{
    {"Shape", Where::world, &Importer::shape},
    {"NamedMaterial", Where::world, &Importer::named_material},
    {"AttributeBegin", Where::world, &Importer::attribute_begin},
    {"AttributeEnd", Where::world, &Importer::attribute_end},
    {"ObjectInstance", Where::world, &Importer::object_instance},
    {"Transform", Where::anywhere, &Importer::transform},
    {"ConcatTransform", Where::anywhere, &Importer::transform},
    {"Identity", Where::anywhere, &Importer::transform},
    {"Translate", Where::anywhere, &Importer::transform},
    {"Scale", Where::anywhere, &Importer::transform},
    {"Rotate", Where::anywhere, &Importer::transform},
    {"LookAt", Where::anywhere, &Importer::transform},
    {"CoordinateSystem", Where::anywhere, &Importer::name_system},
    {"CoordSysTransform", Where::anywhere, &Importer::recall_system},
    {"ReverseOrientation", Where::world, &Importer::reverse_orientation},
    {"TransformTimes", Where::options, &Importer::transform_times},
    {"ActiveTransform", Where::anywhere, &Importer::active_transform},
    {"TransformBegin", Where::world, &Importer::transform_begin},
    {"TransformEnd", Where::world, &Importer::attribute_end},
    {"Attribute", Where::anywhere, &Importer::attribute},
    {"Texture", Where::world, &Importer::texture},
    {"Material", Where::world, &Importer::material},
    {"MakeNamedMaterial", Where::world, &Importer::make_named_material},
    {"AreaLightSource", Where::world, &Importer::area_light},
    {"LightSource", Where::world, &Importer::light},
    {"ObjectBegin", Where::world, &Importer::object_begin},
    {"ObjectEnd", Where::world, &Importer::object_end},
    {"Include", Where::anywhere, &Importer::include},
    {"Camera", Where::options, &Importer::camera},
    {"Film", Where::options, &Importer::film},
    {"PixelFilter", Where::options, &Importer::filter},
    {"Sampler", Where::options, &Importer::sampler},
    {"Integrator", Where::options, &Importer::integrator},
    {"Option", Where::options, &Importer::option},
    {"ColorSpace", Where::anywhere, &Importer::set_color_space},
    {"Accelerator", Where::options, &Importer::accelerator},
    {"MakeNamedMedium", Where::anywhere, &Importer::named_medium},
    {"MediumInterface", Where::anywhere, &Importer::medium_interface},
    {"Import", Where::world, &Importer::import},
    {"WorldBegin", Where::options, &Importer::world_begin},
}};

}  // namespace

Status import_pbrt(const std::filesystem::path& scene, pipeline::SceneSink& sink, const ImportOptions& options,
                   ImportReport& report) {
  Session session{sink, options, report, scene.parent_path(), {}};
  return Importer(session).run(scene);
}

}  // namespace spillway::tools
