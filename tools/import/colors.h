#pragma once

// Parameters that are colours, of any type that pbrt allows, as linear Rec. 709: of lights, and of surfaces.

#include <optional>
#include <vector>

#include "tools/import/params.h"
#include "tools/import/session.h"

namespace spillway::tools {

// What range of RGB a parameter may have.
enum class RgbRange : uint8_t { albedo, unbounded };  // 0..1, 0..infinity

// A light's colour: pbrt scales what is not RGB to luminance 1. None when absent; the default is the white of Rec. 709.
Result<std::optional<Rgb>> given_light_color(Session& session, const ParamList& params, std::string_view name);
Result<Rgb> light_color(Session& session, const ParamList& params, std::string_view name);

// A surface's, given as rgb or as a spectrum; none when absent.
Result<std::optional<Rgb>> surface_color(Session& session, const ParamList& params, std::string_view name,
                                         RgbRange range);

// A spectrum's wavelengths (nm, ascending) and values in turn: as given, or read from the file it names.
Result<std::vector<float>> spectrum_pairs(Session& session, const Parameter& spectrum);

}  // namespace spillway::tools
