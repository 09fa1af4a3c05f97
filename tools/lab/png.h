#pragma once

// Pictures for the page: 8-bit PNG in memory, as text that a page can hold.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/metrics/picture.h"

namespace spillway::tools::lab {

// RGB, 3 bytes a pixel, row by row.
[[nodiscard]] std::vector<uint8_t> png(int width, int height, std::span<const uint8_t> rgb);

// sRGB of value * exposure, clamped.
[[nodiscard]] std::vector<uint8_t> screen_bytes(const Picture& picture, float exposure);
// Values in [0, 1] from black over purple, red and yellow to white.
[[nodiscard]] std::vector<uint8_t> heat_bytes(std::span<const float> values);

// The exposure at which the mean luminance of the picture is a fifth of white.
[[nodiscard]] float exposure_of(const Picture& picture);

// "data:image/png;base64,..."
[[nodiscard]] std::string data_url(std::span<const uint8_t> png);

}  // namespace spillway::tools::lab
