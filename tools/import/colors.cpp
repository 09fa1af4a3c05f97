#include "tools/import/colors.h"

#include <algorithm>
#include <cmath>

#include "tools/import/spectra.h"

namespace spillway::tools {
namespace {

constexpr size_t kMostSpectrumNumbers = 1 << 16;  // of a file; measured spectra have some hundreds

Result<Rgb> three_numbers(const Parameter& rgb) {
  SPILLWAY_TRY(expect_count(rgb, rgb.number_count(), 3));
  const Rgb color{rgb.numbers[0], rgb.numbers[1], rgb.numbers[2]};
  // Wide spaces have colours of negative components of their own; Rec. 709 is refused what no light and no surface is.
  if (rgb.color_space == ColorSpace::srgb && std::min({color.r, color.g, color.b}) < 0)
    return error_at(rgb.place, "\"{}\" must not be negative", rgb.name);
  return color;
}

Rgb clamped(Rgb c, float most) {
  return {std::clamp(c.r, 0.0f, most), std::clamp(c.g, 0.0f, most), std::clamp(c.b, 0.0f, most)};
}

// Roundings of the conversion are not worth a word.
bool is_near(Rgb a, Rgb b) {
  constexpr float kRounding = 1e-4f;
  const Rgb d = a - b;
  return std::max({std::fabs(d.r), std::fabs(d.g), std::fabs(d.b)}) <= kRounding * std::max(1.0f, max_component(a));
}

Rgb brought_inside(Session& session, const Parameter& rgb, Rgb converted, float most) {
  const Rgb inside = clamped(converted, most);
  if (!is_near(converted, inside))
    session.warn(rgb.place, "\"{}\" lies outside of Rec. 709, at ({}, {}, {}): ({}, {}, {}) is used", rgb.name,
                 converted.r, converted.g, converted.b, inside.r, inside.g, inside.b);
  return inside;
}

Result<Rgb> blackbody_color(const Parameter& body) {
  SPILLWAY_TRY(expect_count(body, body.numbers.size(), 1));
  // Colder bodies do not glow, and hotter ones look the same (Rayleigh-Jeans).
  constexpr float kColdest_kelvin = 500, kHottest_kelvin = 1e6f;
  const float kelvin = body.numbers[0];
  if (kelvin >= kColdest_kelvin && kelvin <= kHottest_kelvin) return blackbody_rgb(kelvin);
  return error_at(body.place, "\"blackbody {}\" takes {} to {} kelvin", body.name, kColdest_kelvin, kHottest_kelvin);
}

Result<Rgb> spectrum_color(Session& session, const Parameter& spectrum) {
  if (spectrum.strings.size() == 1) {
    if (const std::optional<Rgb> known = illuminant_rgb(spectrum.strings[0])) return *known;
  }
  SPILLWAY_ASSIGN(const std::vector<float> pairs, spectrum_pairs(session, spectrum));
  if (const std::optional<Rgb> rgb = light_rgb(pairs)) return *rgb;
  return error_at(spectrum.place, "\"spectrum {}\" takes pairs of wavelength (nm) and value, some of it visible",
                  spectrum.name);
}

Result<std::vector<float>> read_spectrum_file(Session& session, const Parameter& spectrum) {
  const std::filesystem::path path = session.resolved(spectrum.strings[0]);
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code))
    return error_at(
        spectrum.place,
        "spectrum \"{}\" is neither known by name (stdillum-..., illum-acesD60, metal-..., glass-...) nor a "
        "file",
        spectrum.strings[0]);
  const std::string* name = &session.file_names.emplace_back(path.string());
  SPILLWAY_ASSIGN(const std::unique_ptr<Tokenizer> tokens, Tokenizer::open(path, name));
  std::vector<float> pairs;
  for (;;) {
    SPILLWAY_ASSIGN(const Token token, tokens->take());
    if (token.kind == TokenKind::end) return pairs;
    if (pairs.size() == kMostSpectrumNumbers)
      return error_at(token.place, "a spectrum of more than {} numbers", kMostSpectrumNumbers);
    SPILLWAY_ASSIGN(const double value, number(token));
    pairs.push_back(static_cast<float>(value));
  }
}

}  // namespace

Result<std::vector<float>> spectrum_pairs(Session& session, const Parameter& spectrum) {
  if (spectrum.strings.empty()) {
    SPILLWAY_TRY(check_pairs(spectrum));
    return spectrum.numbers;
  }
  SPILLWAY_TRY(expect_count(spectrum, spectrum.strings.size() + spectrum.numbers.size(), 1));
  Parameter read = spectrum;
  SPILLWAY_ASSIGN(read.numbers, read_spectrum_file(session, spectrum));
  SPILLWAY_TRY(check_pairs(read));
  return read.numbers;
}

Result<std::optional<Rgb>> given_light_color(Session& session, const ParamList& params, std::string_view name) {
  std::optional<Rgb> color;
  if (const Parameter* rgb = params.find(ParamType::rgb, name)) {
    SPILLWAY_ASSIGN(const Rgb given, three_numbers(*rgb));
    color = brought_inside(session, *rgb, light_rec709(rgb->color_space, given), INFINITY);
  } else if (const Parameter* body = params.find(ParamType::blackbody, name)) {
    SPILLWAY_ASSIGN(color, blackbody_color(*body));
  } else if (const Parameter* spectrum = params.find(ParamType::spectrum, name)) {
    SPILLWAY_ASSIGN(color, spectrum_color(session, *spectrum));
  }
  return color;
}

Result<Rgb> light_color(Session& session, const ParamList& params, std::string_view name) {
  SPILLWAY_ASSIGN(const std::optional<Rgb> given, given_light_color(session, params, name));
  return given.value_or(Rgb{1, 1, 1});
}

Result<std::optional<Rgb>> surface_color(Session& session, const ParamList& params, std::string_view name,
                                         RgbRange range) {
  if (const Parameter* spectrum = params.find(ParamType::spectrum, name)) {
    SPILLWAY_ASSIGN(const std::vector<float> pairs, spectrum_pairs(session, *spectrum));
    return std::optional<Rgb>(reflectance_rgb(pairs));
  }
  const Parameter* rgb = params.find(ParamType::rgb, name);
  if (rgb == nullptr) return std::optional<Rgb>();
  SPILLWAY_ASSIGN(const Rgb color, three_numbers(*rgb));
  if (range == RgbRange::albedo && max_component(color) > 1)
    return error_at(rgb->place, "\"{}\" must not be above 1: it would reflect more than it gets", name);
  const float most = range == RgbRange::albedo ? 1 : INFINITY;
  return std::optional<Rgb>(brought_inside(session, *rgb, surface_rec709(rgb->color_space, color), most));
}

}  // namespace spillway::tools
