#pragma once

// Spectra as RGB: light colours by integration, metals and glasses by name.

#include <optional>
#include <span>
#include <string_view>

#include "cache/base/vec.h"

namespace spillway::tools {

// Wavelengths at which optical constants are read as red, green and blue, and the helium d line of glass catalogues.
inline constexpr float kRgbWavelengths_nm[3] = {630, 532, 465};
inline constexpr float kGlassWavelength_nm = 587.56f;

// A black body's colour, linear RGB (Rec. 709) of luminance 1: pbrt divides every light's spectrum by its luminance.
// Colours outside the gamut (below about 1900 K) are brought in by setting negative components to zero.
[[nodiscard]] Rgb blackbody_rgb(float temperature_kelvin);

// The radiance of a black body over that at its brightest wavelength, as linear RGB: what glowing gas emits, of which the
// cold does not glow.
[[nodiscard]] Rgb normalised_blackbody_rgb(float temperature_kelvin);

// Wavelengths in nm and values in turn, linear in between, zero outside.
[[nodiscard]] float spectrum_at(std::span<const float> pairs, float wavelength_nm);
// None when nothing of it is visible.
[[nodiscard]] std::optional<Rgb> light_rgb(std::span<const float> pairs);

// A reflectance under the colour space's white: each of X, Y and Z as a share of what a perfect white would give. Grey
// stays grey; brought into the gamut.
[[nodiscard]] Rgb reflectance_rgb(std::span<const float> pairs);

// Standard illuminants by pbrt's names ("stdillum-A", "stdillum-F2", "illum-acesD60", ...), luminance 1.
[[nodiscard]] std::optional<Rgb> illuminant_rgb(std::string_view name);

// "metal-Ag-eta", "metal-Ag-k" and so on: at the three wavelengths above.
[[nodiscard]] std::optional<Rgb> metal_rgb(std::string_view name);
// "glass-BK7" and so on: at the d line.
[[nodiscard]] std::optional<float> glass_eta(std::string_view name);

}  // namespace spillway::tools
