#include "tools/sizes.h"

#include <charconv>
#include <cmath>

namespace spillway::tools {
namespace {

constexpr uint32_t kLargestResolution = 65536;

// Reads one unsigned number at `text[at]`, moving `at` behind it.
bool read_number(const std::string& text, size_t& at, uint32_t& value) {
  const char* first = text.data() + at;
  const auto [end, code] = std::from_chars(first, text.data() + text.size(), value);
  if (code != std::errc() || end == first) return false;
  at += static_cast<size_t>(end - first);
  return true;
}

bool read_char(const std::string& text, size_t& at, char wanted) { return at < text.size() && text[at++] == wanted; }

}  // namespace

Result<uint64_t> parse_bytes(const std::string& text) {
  double number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  const std::string unit(end, text.data() + text.size());
  double scale = 0;
  if (unit.empty() || unit == "B") scale = 1;
  if (unit == "KiB") scale = 0x1p10;
  if (unit == "MiB") scale = 0x1p20;
  if (unit == "GiB") scale = 0x1p30;
  if (unit == "TiB") scale = 0x1p40;
  if (code != std::errc() || scale == 0 || !(number > 0) || number * scale >= 0x1p62)
    return error("'{}' is not a size; write bytes, or KiB, MiB, GiB, such as 512MiB or 1.5GiB", text);
  return static_cast<uint64_t>(number * scale);
}

Result<Resolution> parse_resolution(const std::string& text) {
  Resolution r;
  size_t at = 0;
  const bool read = read_number(text, at, r.x) && read_char(text, at, 'x') && read_number(text, at, r.y);
  if (!read || at != text.size() || r.x < 1 || r.y < 1 || r.x > kLargestResolution || r.y > kLargestResolution)
    return error("'{}' is not a resolution; write WIDTHxHEIGHT in pixels, such as 1280x720", text);
  return r;
}

Result<Crop> parse_crop(const std::string& text) {
  Crop c;
  size_t at = 0;
  const bool read = read_number(text, at, c.x0) && read_char(text, at, ',') && read_number(text, at, c.y0) &&
                    read_char(text, at, ',') && read_number(text, at, c.x1) && read_char(text, at, ',') &&
                    read_number(text, at, c.y1);
  if (!read || at != text.size() || c.x1 <= c.x0 || c.y1 <= c.y0)
    return error("'{}' is not a crop; write x0,y0,x1,y1 in pixels with x0 < x1 and y0 < y1", text);
  return c;
}

std::string duration_text(double seconds) {
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<uint64_t>(std::llround(seconds));
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

}  // namespace spillway::tools
