#include "tools/lab/png.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>

#include "cache/base/check.h"
#include "pipeline/render/write_image.h"

namespace spillway::tools::lab {
namespace {

void append_big_endian(std::vector<uint8_t>& bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<uint8_t>(value >> shift));
}

// Length, type, data, checksum of type and data (PNG specification, 5.3).
void append_chunk(std::vector<uint8_t>& bytes, const char* type, std::span<const uint8_t> data) {
  append_big_endian(bytes, static_cast<uint32_t>(data.size()));
  const size_t begin = bytes.size();
  bytes.insert(bytes.end(), type, type + 4);
  bytes.insert(bytes.end(), data.begin(), data.end());
  append_big_endian(bytes,
                    static_cast<uint32_t>(crc32(0, bytes.data() + begin, static_cast<uInt>(bytes.size() - begin))));
}

}  // namespace

std::vector<uint8_t> png(int width, int height, std::span<const uint8_t> rgb) {
  std::vector<uint8_t> rows;  // each led by its filter: none
  const size_t row_bytes = 3 * static_cast<size_t>(width);
  for (int y = 0; y < height; ++y) {
    rows.push_back(0);
    const auto row = rgb.subspan(static_cast<size_t>(y) * row_bytes, row_bytes);
    rows.insert(rows.end(), row.begin(), row.end());
  }
  uLongf size = compressBound(static_cast<uLong>(rows.size()));
  std::vector<uint8_t> packed(size);
  SPILLWAY_CHECK(compress2(packed.data(), &size, rows.data(), static_cast<uLong>(rows.size()), 9), ==, Z_OK);
  packed.resize(size);
  std::vector<uint8_t> bytes = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'}, header;
  append_big_endian(header, static_cast<uint32_t>(width)), append_big_endian(header, static_cast<uint32_t>(height));
  header.insert(header.end(), {8, 2, 0, 0, 0});  // 8 bits, RGB, deflate, filters by row, not interlaced
  append_chunk(bytes, "IHDR", header), append_chunk(bytes, "IDAT", packed), append_chunk(bytes, "IEND", {});
  return bytes;
}

std::vector<uint8_t> screen_bytes(const Picture& picture, float exposure) {
  std::vector<uint8_t> bytes;
  bytes.reserve(3 * picture.pixels.size());
  for (const Rgb& p : picture.pixels)
    for (const float v : {p.r, p.g, p.b}) bytes.push_back(pipeline::srgb_byte(v * exposure));
  return bytes;
}

std::vector<uint8_t> heat_bytes(std::span<const float> values) {
  // Five colours of even steps in lightness.
  constexpr float kRamp[5][3] = {{0, 0, 4}, {87, 16, 110}, {188, 55, 84}, {249, 142, 9}, {252, 255, 220}};
  std::vector<uint8_t> bytes;
  bytes.reserve(3 * values.size());
  for (const float value : values) {
    const float at = 4 * std::clamp(std::isfinite(value) ? value : 1.0f, 0.0f, 1.0f);
    const int first = std::min(3, static_cast<int>(at));
    for (int c = 0; c < 3; ++c)
      bytes.push_back(static_cast<uint8_t>(
          kRamp[first][c] + (kRamp[first + 1][c] - kRamp[first][c]) * (at - static_cast<float>(first)) + 0.5f));
  }
  return bytes;
}

float exposure_of(const Picture& picture) {
  double sum = 0;
  for (const Rgb& p : picture.pixels)
    if (is_finite(p)) sum += std::max(0.0f, luminance(p));
  return sum > 0 ? static_cast<float>(0.2 * static_cast<double>(picture.pixels.size()) / sum) : 1.0f;
}

std::string data_url(std::span<const uint8_t> bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text = "data:image/png;base64,";
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t left = std::min<size_t>(3, bytes.size() - i);
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k) group = group << 8 | (k < left ? bytes[i + k] : 0);
    for (size_t k = 0; k < 4; ++k) text += k <= left ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

}  // namespace spillway::tools::lab
