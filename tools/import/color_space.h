#pragma once

// ColorSpace: what the numbers of "rgb" parameters mean, turned into this program's own: linear Rec. 709.

#include <cstdint>
#include <optional>
#include <string_view>

#include "cache/base/vec.h"

namespace spillway::tools {

enum class ColorSpace : uint8_t { srgb, dci_p3, rec2020, aces2065_1 };

[[nodiscard]] std::optional<ColorSpace> color_space(std::string_view name);

// Of a surface: white stays white, whatever white the space has (Bradford's adaptation). Of a light: what it emits.
// A colour outside of Rec. 709's triangle gets negative components: the caller's to deal with.
[[nodiscard]] Rgb surface_rec709(ColorSpace space, Rgb rgb);
[[nodiscard]] Rgb light_rec709(ColorSpace space, Rgb rgb);

}  // namespace spillway::tools
