// Option "name" value: pbrt's, by name (pbrt-v4, BasicSceneBuilder::Option).

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "tools/import/settings.h"

namespace spillway::tools {
namespace {

enum class Value : uint8_t { truth, number, text };

struct KnownOption {
  std::string_view name;
  Value value;
  std::string_view instead;  // what is done where the value asks for more than the default; empty: it shows nowhere
};
constexpr std::array kOptions = {
    KnownOption{"seed", Value::number, ""},
    KnownOption{"disablepixeljitter", Value::truth, "pixels are sampled all over their filter"},
    KnownOption{"disabletexturefiltering", Value::truth, "textures are filtered as they say themselves"},
    KnownOption{"disablewavelengthjitter", Value::truth, ""},
    KnownOption{"displacementedgescale", Value::number, "displacement is diced by the renderer's own rule"},
    KnownOption{"forcediffuse", Value::truth, "materials are kept"},
    KnownOption{"msereferenceimage", Value::text, ""},
    KnownOption{"msereferenceout", Value::text, ""},
    KnownOption{"pixelstats", Value::truth, ""},
    KnownOption{"rendercoordsys", Value::text, ""},
    KnownOption{"wavefront", Value::truth, ""},
};

// As pbrt compares them: without case, dashes and underscores. A type before the name, as of a parameter, is dropped.
std::string plain_name(std::string_view given) {
  if (const size_t space = given.find_last_of(" \t"); space != std::string_view::npos) given.remove_prefix(space + 1);
  std::string plain;
  for (const char c : given)
    if (c != '-' && c != '_') plain += c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  return plain;
}

Result<Token> read_value(Tokenizer& tokens, const Token& directive) {
  SPILLWAY_ASSIGN(Token value, tokens.take());
  const bool bracketed = value.kind == TokenKind::open;
  if (bracketed) {
    SPILLWAY_ASSIGN(value, tokens.take());
  }
  if (value.kind != TokenKind::word && value.kind != TokenKind::string)
    return error_at(value.place, "{} where the value of an {} is expected", to_string(value), directive.text);
  if (!bracketed) return value;
  SPILLWAY_ASSIGN(const Token close, tokens.take());
  if (close.kind == TokenKind::close) return value;
  return error_at(close.place, "{} where ] is expected: an {} has one value", to_string(close), directive.text);
}

Status check_value(const Token& value, const KnownOption& option) {
  const bool is_string = value.kind == TokenKind::string;
  if (option.value == Value::text && !is_string)
    return error_at(value.place, "option \"{}\" takes a string, not {}", option.name, to_string(value));
  if (option.value == Value::truth && (is_string || (value.text != "true" && value.text != "false")))
    return error_at(value.place, "option \"{}\" takes true or false, not {}", option.name, to_string(value));
  if (option.value != Value::number) return {};
  SPILLWAY_ASSIGN([[maybe_unused]] const double any, number(value));
  return {};
}

}  // namespace

Status read_option(Session& session, Tokenizer& tokens, const Token& directive, SceneOptions& options) {
  SPILLWAY_ASSIGN(const Token name, read_string_token(tokens, directive.text));
  SPILLWAY_ASSIGN(const Token value, read_value(tokens, directive));
  const std::string plain = plain_name(name.text);
  const auto known =
      std::find_if(kOptions.begin(), kOptions.end(), [&](const KnownOption& o) { return o.name == plain; });
  if (known == kOptions.end())
    return session.ignorable(name.place, "option {} is not known: remove it", to_string(name));
  SPILLWAY_TRY(check_value(value, *known));
  if (plain == "seed") {
    SPILLWAY_ASSIGN(const double seed, number(value));
    if (!(seed >= INT32_MIN && seed <= INT32_MAX))
      return error_at(value.place, "a seed of {} has more than 32 bits", seed);
    options.seed = static_cast<int32_t>(seed);
  }
  if (!known->instead.empty() && value.text != "false")
    session.warn(name.place, "option \"{}\" has no effect: {}", known->name, known->instead);
  return {};
}

}  // namespace spillway::tools
