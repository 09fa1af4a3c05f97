#include "tools/import/params.h"

#include <array>
#include <charconv>
#include <cmath>

namespace spillway::tools {
namespace {

struct TypeName {
  std::string_view name;
  ParamType type;
};
constexpr std::array kTypeNames = {
    TypeName{"bool", ParamType::boolean},    TypeName{"integer", ParamType::integer},
    TypeName{"float", ParamType::real},      TypeName{"point2", ParamType::point2},
    TypeName{"vector2", ParamType::vector2}, TypeName{"point3", ParamType::point3},
    TypeName{"point", ParamType::point3},    TypeName{"vector3", ParamType::vector3},
    TypeName{"vector", ParamType::vector3},  TypeName{"normal", ParamType::normal3},
    TypeName{"normal3", ParamType::normal3}, TypeName{"spectrum", ParamType::spectrum},
    TypeName{"rgb", ParamType::rgb},         TypeName{"blackbody", ParamType::blackbody},
    TypeName{"string", ParamType::string},   TypeName{"texture", ParamType::texture},
};

// Values are 32-bit in number, and so is every count made of them.
constexpr size_t kMaxValues = size_t{1} << 30;

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

size_t skip_blanks(std::string_view text, size_t at) {
  while (at < text.size() && is_blank(text[at])) ++at;
  return at;
}

size_t skip_word(std::string_view text, size_t at) {
  while (at < text.size() && !is_blank(text[at])) ++at;
  return at;
}

// Splits "type name".
Result<Parameter> read_declaration(const Token& token) {
  const std::string_view text = token.text;
  const size_t type_first = skip_blanks(text, 0), type_last = skip_word(text, type_first);
  const size_t name_first = skip_blanks(text, type_last), name_last = skip_word(text, name_first);
  if (name_first == name_last || skip_blanks(text, name_last) != text.size()) {
    return error_at(token.place, "{} is no parameter: write \"type name\", such as \"float fov\"", to_string(token));
  }
  Parameter parameter;
  parameter.place = token.place;
  parameter.name = text.substr(name_first, name_last - name_first);
  const std::string_view type = text.substr(type_first, type_last - type_first);
  for (const TypeName& known : kTypeNames) {
    if (known.name != type) continue;
    parameter.type = known.type;
    return parameter;
  }
  return error_at(token.place, "unknown parameter type \"{}\" of \"{}\"", type, parameter.name);
}

Error wrong_value(const Parameter& parameter, const Token& token, std::string_view want) {
  return error_at(token.place, "{} is no value for \"{} {}\": {} expected", to_string(token), name(parameter.type),
                  parameter.name, want);
}

Status add_boolean(Parameter& parameter, const Token& token) {
  if (token.text != "true" && token.text != "false") return wrong_value(parameter, token, "true or false");
  parameter.integers.push_back(token.text == "true");
  return {};
}

Status add_integer(Parameter& parameter, const Token& token) {
  int32_t value = 0;
  const char* first = token.text.data() + (token.text.starts_with('+') ? 1 : 0);
  const char* last = token.text.data() + token.text.size();
  const auto [end, code] = std::from_chars(first, last, value);
  if (token.kind != TokenKind::word || code != std::errc() || end != last) {
    return wrong_value(parameter, token, "a whole number of 32 bits");
  }
  parameter.integers.push_back(value);
  return {};
}

Status add_number(Parameter& parameter, const Token& token) {
  SPILLWAY_ASSIGN(const double value, number(token));
  const float rounded = static_cast<float>(value);
  if (!std::isfinite(rounded)) return wrong_value(parameter, token, "a number that fits a 32-bit float");
  parameter.numbers.push_back(rounded);
  return {};
}

Status add_value(Parameter& parameter, const Token& token) {
  const size_t count = parameter.number_count() + parameter.integers.size() + parameter.strings.size();
  if (count == kMaxValues) return error_at(token.place, "\"{}\" has more than {} values", parameter.name, kMaxValues);
  switch (parameter.type) {
    case ParamType::boolean:
      return add_boolean(parameter, token);
    case ParamType::integer:
      return add_integer(parameter, token);
    case ParamType::string:
    case ParamType::texture:
      if (token.kind != TokenKind::string) return wrong_value(parameter, token, "a string in quotes");
      parameter.strings.push_back(token.text);
      return {};
    case ParamType::spectrum:
      if (token.kind != TokenKind::string) return add_number(parameter, token);
      parameter.strings.push_back(token.text);
      return {};
    default:
      return add_number(parameter, token);
  }
}

// What was read of a long list goes where it is not held.
Status pass_on(Parameter& parameter, pipeline::SceneSink& sink) {
  if (!parameter.stream) {
    SPILLWAY_ASSIGN(parameter.stream, sink.make_sample_stream());
  }
  SPILLWAY_TRY(parameter.stream->append(parameter.numbers));
  parameter.numbers.clear();
  return {};
}

Status read_values(Tokenizer& tokens, Parameter& parameter, pipeline::SceneSink* long_lists) {
  SPILLWAY_ASSIGN(Token token, tokens.take());
  if (token.kind == TokenKind::word || token.kind == TokenKind::string) return add_value(parameter, token);
  if (token.kind != TokenKind::open) {
    return error_at(token.place, "{} instead of the value of \"{}\"", to_string(token), parameter.name);
  }
  const Place opened = token.place;
  for (;;) {
    SPILLWAY_ASSIGN(token, tokens.take());
    if (token.kind == TokenKind::close) break;
    if (token.kind == TokenKind::end) return error_at(opened, "[ of \"{}\" is never closed: add a ]", parameter.name);
    if (token.kind == TokenKind::open) return error_at(token.place, "[ inside the values of \"{}\"", parameter.name);
    SPILLWAY_TRY(add_value(parameter, token));
    const bool may_be_long = parameter.type == ParamType::real || parameter.type == ParamType::rgb;
    if (long_lists != nullptr && may_be_long && parameter.numbers.size() > kHeldNumbers)
      SPILLWAY_TRY(pass_on(parameter, *long_lists));
  }
  if (!parameter.stream) return {};
  SPILLWAY_TRY(pass_on(parameter, *long_lists));
  return parameter.stream->finish();
}

}  // namespace

const char* name(ParamType type) {
  switch (type) {
    case ParamType::boolean:
      return "bool";
    case ParamType::integer:
      return "integer";
    case ParamType::real:
      return "float";
    case ParamType::point2:
      return "point2";
    case ParamType::vector2:
      return "vector2";
    case ParamType::point3:
      return "point3";
    case ParamType::vector3:
      return "vector3";
    case ParamType::normal3:
      return "normal";
    case ParamType::spectrum:
      return "spectrum";
    case ParamType::rgb:
      return "rgb";
    case ParamType::blackbody:
      return "blackbody";
    case ParamType::string:
      return "string";
    case ParamType::texture:
      return "texture";
  }
  return "?";
}

Result<double> number(const Token& token) {
  double value = 0;
  const char* first = token.text.data() + (token.text.starts_with('+') ? 1 : 0);
  const char* last = token.text.data() + token.text.size();
  const auto [end, code] = std::from_chars(first, last, value);
  // Out of range is also said of numbers too small for a double: those are zero.
  if (code == std::errc::result_out_of_range && end == last && token.text.find("e-") != std::string::npos) return 0.0;
  if (token.kind != TokenKind::word || code != std::errc() || end != last || !std::isfinite(value)) {
    return error_at(token.place, "{} instead of a finite number", to_string(token));
  }
  return value;
}

Result<std::vector<double>> read_numbers(Tokenizer& tokens, size_t count, bool bracketed, std::string_view directive) {
  std::vector<double> numbers;
  Token token;
  if (bracketed) {
    SPILLWAY_ASSIGN(token, tokens.take());
    if (token.kind != TokenKind::open) {
      return error_at(token.place, "{} takes [ {} numbers ], not {}", directive, count, to_string(token));
    }
  }
  for (size_t i = 0; i < count; ++i) {
    SPILLWAY_ASSIGN(token, tokens.take());
    if (token.kind != TokenKind::word) {
      return error_at(token.place, "{} takes {} numbers, not {}", directive, count, to_string(token));
    }
    SPILLWAY_ASSIGN(const double value, number(token));
    numbers.push_back(value);
  }
  if (bracketed) {
    SPILLWAY_ASSIGN(token, tokens.take());
    if (token.kind != TokenKind::close)
      return error_at(token.place, "{} takes {} numbers: ] expected", directive, count);
  }
  return numbers;
}

Result<Token> read_string_token(Tokenizer& tokens, std::string_view directive) {
  SPILLWAY_ASSIGN(Token token, tokens.take());
  if (token.kind == TokenKind::string) return token;
  return error_at(token.place, "{} is followed by a string in quotes, not by {}", directive, to_string(token));
}

Result<ParamList> read_params(Tokenizer& tokens, ColorSpace space, pipeline::SceneSink* long_lists) {
  ParamList list;
  for (;;) {
    SPILLWAY_ASSIGN(const Token* next, tokens.peek());
    if (next->kind != TokenKind::string) return list;
    SPILLWAY_ASSIGN(const Token token, tokens.take());
    SPILLWAY_ASSIGN(Parameter parameter, read_declaration(token));
    if (list.parameters.size() == kMaxParameters) {
      return error_at(token.place, "more than {} parameters of one directive", kMaxParameters);
    }
    for (const Parameter& other : list.parameters) {
      if (other.name != parameter.name) continue;
      return error_at(token.place, "parameter \"{}\" is given twice (first at {}): remove one", parameter.name,
                      to_string(other.place));
    }
    SPILLWAY_TRY(read_values(tokens, parameter, long_lists));
    parameter.color_space = space;
    list.parameters.push_back(std::move(parameter));
  }
}

void ParamList::inherit(const ParamList& attributes) {
  const size_t own = parameters.size();
  for (const Parameter& attribute : attributes.parameters) {
    bool taken = false;
    for (size_t i = 0; i < own; ++i) taken = taken || parameters[i].name == attribute.name;
    if (taken) continue;
    parameters.push_back(attribute);
    parameters.back().inherited = true;
  }
}

const Parameter* ParamList::find(ParamType type, std::string_view name) const {
  for (const Parameter& parameter : parameters) {
    if (parameter.name != name) continue;
    if (parameter.type == type) {
      parameter.used = true;
      return &parameter;
    }
    if (!parameter.wanted) parameter.wanted = type;
  }
  return nullptr;
}

Status expect_count(const Parameter& parameter, size_t have, size_t want) {
  if (have == want) return {};
  return error_at(parameter.place, "\"{} {}\" takes {} value{}, not {}", name(parameter.type), parameter.name, want,
                  want == 1 ? "" : "s", have);
}

Status check_pairs(const Parameter& spectrum) {
  const std::vector<float>& pairs = spectrum.numbers;
  bool ascending = pairs.size() >= 4 && pairs.size() % 2 == 0;
  for (size_t i = 2; ascending && i < pairs.size(); i += 2) ascending = pairs[i] > pairs[i - 2];
  if (ascending) return {};
  return error_at(spectrum.place, "\"{}\" takes pairs of wavelength (nm, ascending) and value", spectrum.name);
}

Result<float> ParamList::real(std::string_view name, float otherwise) const {
  const Parameter* parameter = find(ParamType::real, name);
  if (parameter == nullptr) return otherwise;
  SPILLWAY_TRY(expect_count(*parameter, parameter->number_count(), 1));
  return parameter->numbers[0];
}

Result<int32_t> ParamList::integer(std::string_view name, int32_t otherwise) const {
  const Parameter* parameter = find(ParamType::integer, name);
  if (parameter == nullptr) return otherwise;
  SPILLWAY_TRY(expect_count(*parameter, parameter->integers.size(), 1));
  return parameter->integers[0];
}

Result<bool> ParamList::boolean(std::string_view name, bool otherwise) const {
  const Parameter* parameter = find(ParamType::boolean, name);
  if (parameter == nullptr) return otherwise;
  SPILLWAY_TRY(expect_count(*parameter, parameter->integers.size(), 1));
  return parameter->integers[0] != 0;
}

Result<std::string> ParamList::string(std::string_view name, std::string_view otherwise) const {
  const Parameter* parameter = find(ParamType::string, name);
  if (parameter == nullptr) return std::string(otherwise);
  SPILLWAY_TRY(expect_count(*parameter, parameter->strings.size(), 1));
  return parameter->strings[0];
}

namespace {

Result<Float3> three(const ParamList& params, ParamType type, std::string_view name, Float3 otherwise) {
  const Parameter* parameter = params.find(type, name);
  if (parameter == nullptr) return otherwise;
  SPILLWAY_TRY(expect_count(*parameter, parameter->numbers.size(), 3));
  return Float3{parameter->numbers[0], parameter->numbers[1], parameter->numbers[2]};
}

}  // namespace

Result<Float3> ParamList::point3(std::string_view name, Float3 otherwise) const {
  return three(*this, ParamType::point3, name, otherwise);
}

Result<Float3> ParamList::vector3(std::string_view name, Float3 otherwise) const {
  return three(*this, ParamType::vector3, name, otherwise);
}

Status ParamList::check_all_used(Session& session, std::string_view owner) const {
  for (const Parameter& parameter : parameters) {
    if (parameter.used || parameter.inherited) continue;
    if (parameter.wanted) {
      SPILLWAY_TRY(session.ignorable(parameter.place, "\"{}\" of {} has type {}, not {}", parameter.name, owner,
                                     name(*parameter.wanted), name(parameter.type)));
    } else {
      SPILLWAY_TRY(session.ignorable(parameter.place,
                                     "{} has no parameter \"{} {}\", or has no use for it here: remove it", owner,
                                     name(parameter.type), parameter.name));
    }
  }
  return {};
}

}  // namespace spillway::tools
