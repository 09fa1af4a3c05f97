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

#include "tools/import/graphics_state.h"
#include "tools/import/params.h"
#include "tools/import/session.h"
#include "tools/import/settings.h"
#include "tools/import/tokens.h"
#include "tools/import/transform_directives.h"
#include "tools/import/world.h"

namespace spillway::tools {
namespace {

// Far above any scene; below what the stack of this process holds.
constexpr size_t kMaxIncludeDepth = 32, kMaxAttributeDepth = 1024;
// Files opened in all: a file that includes the next one twice, and so on, doubles at each step.
constexpr size_t kMaxIncludes = 100000;

// What CoordinateSystem names.
struct NamedSystem {
  Transform start, end;
};

struct OpenScope {
  Token directive;
  GraphicsState outer;
};

enum class Where : uint8_t { options, world, anywhere };

class Importer {
 public:
  explicit Importer(Session& session) : session_(session), world_(session) {
    state_.material = world_.standard_material();
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
    if (says_medium_) {
      SPILLWAY_ASSIGN(options_.camera_medium, world_.find_medium(state_.media.outside));
    }
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

  Status medium_interface(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_ASSIGN(state_.media, read_medium_interface(tokens, directive));
    says_medium_ = true;
    return {};
  }

  // ---- what the scene holds: see World ----

  Status named_medium(Tokenizer& tokens, const Token& at) { return world_.named_medium(tokens, at, state_); }
  Status texture(Tokenizer& tokens, const Token& at) { return world_.texture(tokens, at, state_); }
  Status material(Tokenizer& tokens, const Token& at) { return world_.material(tokens, at, state_); }
  Status make_named_material(Tokenizer& tokens, const Token& at) {
    return world_.make_named_material(tokens, at, state_);
  }
  Status named_material(Tokenizer& tokens, const Token& at) { return world_.named_material(tokens, at, state_); }
  Status area_light(Tokenizer& tokens, const Token& at) { return world_.area_light(tokens, at, state_); }
  Status light(Tokenizer& tokens, const Token& at) { return world_.light(tokens, at, state_); }
  Status shape(Tokenizer& tokens, const Token& at) { return world_.shape(tokens, at, state_); }
  Status object_instance(Tokenizer& tokens, const Token& at) { return world_.object_instance(tokens, at, state_); }

  Status object_begin(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_TRY(world_.begin_object(tokens, directive));
    return push_scope(directive);
  }

  Status object_end(Tokenizer& tokens, const Token& directive) {
    SPILLWAY_TRY(attribute_end(tokens, directive));
    world_.end_object();
    return {};
  }

  static const std::array<Directive, 40> kDirectives;

  Session& session_;
  World world_;
  GraphicsState state_;
  std::vector<OpenScope> scopes_;
  std::vector<std::filesystem::path> open_files_;
  std::map<std::string, NamedSystem> systems_;
  SceneOptions options_;
  bool in_world_ = false;
  bool says_medium_ = false;  // MediumInterface was given
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
