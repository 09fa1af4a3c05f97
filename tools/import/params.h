#pragma once

// Parameter lists: "type name" [ values ] ... after a directive, typed, each with its place, each to be used once.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cache/base/vec.h"
#include "pipeline/pack/scene_sink.h"
#include "tools/import/color_space.h"
#include "tools/import/session.h"
#include "tools/import/tokens.h"

namespace spillway::tools {

enum class ParamType : uint8_t {
  boolean,
  integer,
  real,
  point2,
  vector2,
  point3,
  vector3,
  normal3,
  spectrum,
  rgb,
  blackbody,
  string,
  texture,
};
[[nodiscard]] const char* name(ParamType type);

// The values of one declaration; by type in one of the three arrays (spectrum: numbers, or the names of spectra).
struct Parameter {
  ParamType type = ParamType::real;
  std::string name;
  Place place;
  std::vector<float> numbers;
  std::vector<int32_t> integers;  // booleans: 0 or 1
  std::vector<std::string> strings;
  std::shared_ptr<pipeline::SampleStream> stream;  // of a long list of floats or colours, in place of `numbers`
  ColorSpace color_space = ColorSpace::srgb;       // of rgb
  bool inherited = false;                          // from an Attribute directive: need not be used
  mutable bool used = false;
  mutable std::optional<ParamType> wanted;  // asked for under this name with another type

  [[nodiscard]] size_t number_count() const { return numbers.size() + (stream ? stream->size() : 0); }
};

// Of one directive; the format knows none with more than 30.
inline constexpr size_t kMaxParameters = 256;

class ParamList {
 public:
  std::vector<Parameter> parameters;

  // Adds those of an Attribute directive whose names are not taken.
  void inherit(const ParamList& attributes);

  // The parameter, marked as used, or null. Array lengths are the caller's to check.
  [[nodiscard]] const Parameter* find(ParamType type, std::string_view name) const;

  // One value, or the default when absent. Errors: another count of values.
  [[nodiscard]] Result<float> real(std::string_view name, float otherwise) const;
  [[nodiscard]] Result<int32_t> integer(std::string_view name, int32_t otherwise) const;
  [[nodiscard]] Result<bool> boolean(std::string_view name, bool otherwise) const;
  [[nodiscard]] Result<std::string> string(std::string_view name, std::string_view otherwise) const;
  [[nodiscard]] Result<Float3> point3(std::string_view name, Float3 otherwise) const;
  [[nodiscard]] Result<Float3> vector3(std::string_view name, Float3 otherwise) const;

  // Nobody asked for it: an error that names the type that was wanted, or what the owner is (`Film "rgb"`).
  Status check_all_used(Session& session, std::string_view owner) const;
};

// The declarations that follow, up to the first token that is not a string. Colours are numbers of the space. With a
// sink, lists of more than kHeldNumbers floats (a colour is three) become streams of it as they are read; without, they
// are held.
inline constexpr size_t kHeldNumbers = 1 << 16;
Result<ParamList> read_params(Tokenizer& tokens, ColorSpace space = ColorSpace::srgb,
                              pipeline::SceneSink* long_lists = nullptr);

// Finite, or an error at the token. What it is for is named in the message.
Result<double> number(const Token& token);
// `count` numbers without brackets, or, when bracketed, inside one pair.
Result<std::vector<double>> read_numbers(Tokenizer& tokens, size_t count, bool bracketed, std::string_view directive);
Result<Token> read_string_token(Tokenizer& tokens, std::string_view directive);

Status expect_count(const Parameter& parameter, size_t have, size_t want);
// Of a spectrum: at least two pairs of wavelength and value, wavelengths ascending.
Status check_pairs(const Parameter& spectrum);

}  // namespace spillway::tools
