#pragma once

// Numbers as people write them on a command line.

#include <cstdint>
#include <string>

#include "cache/base/result.h"

namespace spillway::tools {

// "512MiB", "2GiB", "64KiB", "4096": bytes. Powers of two only; KB and MB are refused for being two things.
Result<uint64_t> parse_bytes(const std::string& text);

struct Resolution {
  uint32_t x = 0, y = 0;
};
// "1280x720"
Result<Resolution> parse_resolution(const std::string& text);

struct Crop {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};
// "x0,y0,x1,y1", pixels, half open
Result<Crop> parse_crop(const std::string& text);

// "1:02:03", "2:03", "3.2 s"
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace spillway::tools
