#include "pipeline/pack/pack_image.h"

#include "cache/base/hash.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
#include <vector>

namespace spillway::pipeline {
namespace {

constexpr int kLargestSize = 65536;
constexpr std::string_view kUnfinishedPrefix = "unfinished-";

// An image level in linear light.
struct Level {
  uint32_t width, height, channels;
  std::vector<float> texels;
};

bool is_encoded(const cache::ImageInfo& info, uint32_t channel) {
  const bool is_alpha = (info.channels == 2 && channel == 1) || channel == 3;
  return info.encoding == cache::TexelEncoding::srgb && info.texel_bytes == 1 && !is_alpha;
}

// Area weights of the source texels [first, first + weights.size()) for one destination texel along an axis.
struct Span1D {
  uint32_t first;
  std::vector<float> weights;
};

std::vector<Span1D> box_spans(uint32_t from, uint32_t to) {
  std::vector<Span1D> spans(to);
  for (uint32_t i = 0; i < to; ++i) {
    const double begin = static_cast<double>(i) * from / to, end = static_cast<double>(i + 1) * from / to;
    spans[i].first = static_cast<uint32_t>(begin);
    for (uint32_t s = spans[i].first; s < from && s < end; ++s) {
      const double covered = std::min<double>(end, s + 1) - std::max<double>(begin, s);
      if (covered > 0) spans[i].weights.push_back(static_cast<float>(covered / (end - begin)));
    }
  }
  return spans;
}

Level half_size(const Level& from) {
  Level to{std::max(1u, from.width / 2), std::max(1u, from.height / 2), from.channels, {}};
  to.texels.resize(size_t{to.width} * to.height * to.channels);
  const auto columns = box_spans(from.width, to.width), rows = box_spans(from.height, to.height);
  for (uint32_t y = 0; y < to.height; ++y)
    for (uint32_t x = 0; x < to.width; ++x)
      for (uint32_t c = 0; c < to.channels; ++c) {
        double sum = 0;
        for (size_t j = 0; j < rows[y].weights.size(); ++j)
          for (size_t i = 0; i < columns[x].weights.size(); ++i)
            sum += static_cast<double>(rows[y].weights[j]) * columns[x].weights[i] *
                   from.texels[((rows[y].first + j) * from.width + columns[x].first + i) * from.channels + c];
        to.texels[(size_t{y} * to.width + x) * to.channels + c] = static_cast<float>(sum);
      }
  return to;
}

uint8_t to_byte(float x) { return static_cast<uint8_t>(std::clamp(x, 0.0f, 1.0f) * 255.0f + 0.5f); }

std::vector<uint8_t> encoded(const Level& level, const cache::ImageInfo& info) {
  std::vector<uint8_t> bytes(level.texels.size());
  for (size_t i = 0; i < bytes.size(); ++i) {
    const float value = level.texels[i];
    const bool srgb = is_encoded(info, static_cast<uint32_t>(i % level.channels));
    bytes[i] = to_byte(srgb ? cache::srgb_from_linear(std::max(0.0f, value)) : value);
  }
  return bytes;
}

Level decoded(const std::vector<uint8_t>& bytes, const cache::ImageInfo& info) {
  Level level{info.width, info.height, info.channels, std::vector<float>(bytes.size())};
  float srgb[256];
  for (int i = 0; i < 256; ++i) srgb[i] = cache::linear_from_srgb(static_cast<float>(i) / 255.0f);
  for (size_t i = 0; i < bytes.size(); ++i)
    level.texels[i] = is_encoded(info, static_cast<uint32_t>(i % info.channels)) ? srgb[bytes[i]]
                                                                                  : static_cast<float>(bytes[i]) / 255.0f;
  return level;
}

Status check_spec(const OIIO::ImageSpec& spec, const std::string& source, uint64_t memory_limit) {
  if (spec.width < 1 || spec.height < 1 || spec.width > kLargestSize || spec.height > kLargestSize || spec.depth > 1)
    return error("{}: claims {} x {} x {} texels; at most {} x {} are read", source, spec.width, spec.height, spec.depth,
                 kLargestSize, kLargestSize);
  if (spec.nchannels < 1 || spec.nchannels > 4) return error("{}: has {} channels; 1 to 4 are read", source, spec.nchannels);
  const uint64_t needed = uint64_t{static_cast<uint32_t>(spec.width)} * spec.height * spec.nchannels * sizeof(float) * 2;
  if (needed > memory_limit / 2) return error("{}: {} x {} texels need {} bytes to pack, more than is allowed", source,
                                              spec.width, spec.height, needed);
  return {};
}

// An infinite texel would be no number under a filter's weight of nought, and all there is on coarser levels: it becomes the
// largest half float, as files that hold halves have it, or black below nought. What is no number is black. The number of
// the first such texel, plus one; 0: all are finite.
uint64_t make_finite(Level& level) {
  constexpr float kLargestHalf = 65504;
  uint64_t first = 0;
  for (size_t i = 0; i < level.texels.size(); ++i) {
    float& texel = level.texels[i];
    if (std::isfinite(texel)) continue;
    texel = texel > 0 ? kLargestHalf : 0;
    if (first == 0) first = i / level.channels + 1;
  }
  return first;
}

struct Decoded {
  cache::ImageInfo info{};
  Level level;
  std::vector<uint8_t> bytes;  // the texels as they came, of 8-bit images
};

Result<Decoded> read_image(const std::string& source, cache::TexelEncoding encoding, uint64_t memory_limit) {
  const auto input = OIIO::ImageInput::open(source);
  if (!input) return error("{}: cannot be read as an image: {}", source, OIIO::geterror());
  const OIIO::ImageSpec& spec = input->spec();
  SPILLWAY_TRY(check_spec(spec, source, memory_limit));
  Decoded d;
  d.info.width = static_cast<uint32_t>(spec.width), d.info.height = static_cast<uint32_t>(spec.height);
  d.info.channels = static_cast<uint32_t>(spec.nchannels);
  d.info.texel_bytes = spec.format == OIIO::TypeUInt8 ? 1 : 4;
  d.info.encoding = d.info.texel_bytes == 1 ? encoding : cache::TexelEncoding::linear;
  const size_t count = size_t{d.info.width} * d.info.height * d.info.channels;
  bool read = false;
  if (d.info.texel_bytes == 1) {
    d.bytes.resize(count);
    read = input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeUInt8, d.bytes.data());
    d.level = decoded(d.bytes, d.info);
  } else {
    d.level = {d.info.width, d.info.height, d.info.channels, std::vector<float>(count)};
    read = input->read_image(0, 0, 0, spec.nchannels, OIIO::TypeFloat, d.level.texels.data());
    if (encoding == cache::TexelEncoding::srgb && spec.format == OIIO::TypeUInt16)
      for (float& t : d.level.texels) t = cache::linear_from_srgb(t);
  }
  if (!read) return error("{}: is damaged: {}", source, input->geterror());
  if (d.info.texel_bytes == 4) d.info.not_finite = make_finite(d.level);
  return d;
}

// Whole tiles with zeros beyond the image: the library would leave there what was in memory.
template <class T>
bool write_tiles(OIIO::ImageOutput& output, const Level& level, OIIO::TypeDesc type, std::span<const T> texels) {
  const size_t size = cache::kTileSize, channels = level.channels;
  for (size_t y = 0; y < level.height; y += size)
    for (size_t x = 0; x < level.width; x += size) {
      std::vector<T> tile(size * size * channels);
      const size_t columns = std::min(size, level.width - x), rows = std::min(size, level.height - y);
      for (size_t row = 0; row < rows; ++row)
        std::copy_n(texels.begin() + static_cast<ptrdiff_t>(((y + row) * level.width + x) * channels), columns * channels,
                    tile.begin() + static_cast<ptrdiff_t>(row * size * channels));
      if (!output.write_tile(static_cast<int>(x), static_cast<int>(y), 0, type, tile.data())) return false;
    }
  return true;
}

Status write_levels(const Decoded& source, const std::filesystem::path& path, cache::ImageInfo& info) {
  const std::string name = path.string();
  const auto output = OIIO::ImageOutput::create(name);
  if (!output) return error("{}: cannot be written: {}", name, OIIO::geterror());
  Level level = source.level;
  for (info.levels = 0;; ++info.levels) {
    OIIO::ImageSpec spec(static_cast<int>(level.width), static_cast<int>(level.height),
                         static_cast<int>(level.channels), info.texel_bytes == 1 ? OIIO::TypeUInt8 : OIIO::TypeFloat);
    spec.tile_width = spec.tile_height = static_cast<int>(cache::kTileSize);
    spec.attribute("compression", "none");
    spec.attribute("Software", "Spillway");
    spec.attribute("DateTime", "1970:01:01 00:00:00");  // else the store's bytes would tell when it was made
    // A TIFF has no MIP levels of its own: the library takes the pages of a file so marked for levels.
    spec.attribute("textureformat", "Plain Texture");
    const auto mode = info.levels == 0 ? OIIO::ImageOutput::Create : OIIO::ImageOutput::AppendSubimage;
    bool written = output->open(name, spec, mode);
    if (written && info.texel_bytes == 1)
      written = write_tiles<uint8_t>(*output, level, OIIO::TypeUInt8, info.levels == 0 ? source.bytes : encoded(level, info));
    else if (written)
      written = write_tiles<float>(*output, level, OIIO::TypeFloat, level.texels);
    if (!written) return error("{}: cannot be written: {}", name, output->geterror());
    if (level.width == 1 && level.height == 1) break;
    level = half_size(level);
  }
  ++info.levels;
  if (!output->close()) return error("{}: cannot be written: {}", name, output->geterror());
  return {};
}

void set_mean(const Level& level, cache::ImageInfo& info) {
  info.content = checksum(level.texels.data(), level.texels.size() * sizeof(float));
  double sum[4] = {0, 0, 0, 0};
  for (size_t i = 0; i < level.texels.size(); ++i) sum[i % level.channels] += level.texels[i];
  for (uint32_t c = 0; c < 4; ++c)
    info.mean[c] = c < level.channels ? static_cast<float>(sum[c] / (double{1} * level.width * level.height)) : 0;
}

}  // namespace

Result<cache::ImageInfo> pack_image(const std::filesystem::path& source, cache::TexelEncoding encoding,
                                    const std::filesystem::path& textures_directory, uint32_t image_index,
                                    uint64_t memory_limit_bytes) {
  SPILLWAY_ASSIGN(const Decoded decoded, read_image(source.string(), encoding, memory_limit_bytes));
  cache::ImageInfo info = decoded.info;
  const std::string name = packed_image_name(image_index);
  std::memcpy(info.file_name, name.c_str(), name.size() + 1);
  set_mean(decoded.level, info);
  const std::filesystem::path temporary = textures_directory / unfinished_image_name(image_index);
  SPILLWAY_TRY(write_levels(decoded, temporary, info));
  std::error_code code;
  std::filesystem::rename(temporary, textures_directory / name, code);
  if (code) return error("{}: cannot be renamed: {}", temporary.string(), code.message());
  return info;
}

std::string packed_image_name(uint32_t image_index) { return fmt::format("{:05}.tif", image_index); }

std::string unfinished_image_name(uint32_t image_index) {
  return std::string(kUnfinishedPrefix) + packed_image_name(image_index);
}

bool is_packed_image_name(std::string_view name) {
  static constexpr std::string_view kSuffix = ".tif";
  if (name.starts_with(kUnfinishedPrefix)) name.remove_prefix(kUnfinishedPrefix.size());
  if (!name.ends_with(kSuffix)) return false;
  name.remove_suffix(kSuffix.size());
  return name.size() >= 5 && std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace spillway::pipeline
