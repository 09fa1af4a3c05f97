#include "pipeline/render/write_image.h"

#include <OpenImageIO/imageio.h>

#include <fcntl.h>
#include <immintrin.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <vector>

namespace spillway::pipeline {
namespace {

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

constexpr float kLargestHalf = 65504.0f;  // IEEE 754 binary16

// An image that is being written: under a temporary name until commit().
class ImageFile {
 public:
  static Result<ImageFile> create(const std::filesystem::path& path, const char* format, const ImageSpec& spec);
  ImageFile(ImageFile&& other) noexcept = default;
  ~ImageFile() {
    if (!output_) return;
    output_->close();
    std::error_code ignored;
    std::filesystem::remove(temporary_, ignored);
  }

  // Rows [y_begin, y_end) in image coordinates, in the channels' own types when type is UNKNOWN.
  Status write_rows(int y_begin, int y_end, TypeDesc type, const void* rows) {
    if (output_->write_scanlines(y_begin, y_end, 0, type, rows)) return {};
    return error("{}: cannot write rows {} to {}: {}", path_.string(), y_begin, y_end, output_->geterror());
  }
  Status commit();

 private:
  ImageFile() = default;
  std::filesystem::path path_, temporary_;
  std::unique_ptr<ImageOutput> output_;
};

Result<ImageFile> ImageFile::create(const std::filesystem::path& path, const char* format, const ImageSpec& spec) {
  ImageFile file;
  file.path_ = path;
  file.temporary_ = path.string() + fmt::format(".{}.tmp", getpid());
  auto output = ImageOutput::create(format);
  if (!output) return error("{}: the image library has no writer for {}: {}", path.string(), format, OIIO::geterror());
  if (!output->open(file.temporary_.string(), spec))
    return error("{}: cannot be written: {}", path.string(), output->geterror());
  file.output_ = std::move(output);
  return file;
}

Status sync_file(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool synced = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int code = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!synced) return error("{}: cannot be synced: {}", path.string(), std::strerror(code));
  return {};
}

Status ImageFile::commit() {
  if (!output_->close()) return error("{}: cannot be finished: {}", path_.string(), output_->geterror());
  SPILLWAY_TRY(sync_file(temporary_));
  std::error_code code;
  std::filesystem::rename(temporary_, path_, code);
  if (code) return error("{}: cannot take its name: {}", path_.string(), code.message());
  output_.reset();
  return {};
}

// ---- EXR ----

// A group of channels: their names, type, and how to fill them for one pixel.
struct ChannelGroup {
  std::vector<std::string> names;
  TypeDesc type;
  std::function<void(uint32_t x, uint32_t y, std::byte* out)> fill;
};

template <class T>
void put(std::byte*& out, T value) {
  std::memcpy(out, &value, sizeof value);
  out += sizeof value;
}

void put(std::byte* out, Rgb c) { put(out, c.r), put(out, c.g), put(out, c.b); }

void put_half(std::byte* out, Rgb c) {
  const auto half = [](float x) {
    const __m128 clamped = _mm_set_ss(std::clamp(x, -kLargestHalf, kLargestHalf));
    return static_cast<uint16_t>(_mm_cvtsi128_si32(_mm_cvtps_ph(clamped, _MM_FROUND_TO_NEAREST_INT)));
  };
  put(out, half(c.r)), put(out, half(c.g)), put(out, half(c.b));
}

std::vector<ChannelGroup> channel_groups(const Film& film, const WriteImageOptions& options) {
  std::vector<ChannelGroup> groups;
  const uint32_t layers = film.shape().layers;
  if (options.half_float)
    groups.push_back(
        {{"R", "G", "B"}, TypeDesc::HALF, [&](auto x, auto y, auto* out) { put_half(out, film.pixel(x, y)); }});
  else
    groups.push_back(
        {{"R", "G", "B"}, TypeDesc::FLOAT, [&](auto x, auto y, auto* out) { put(out, film.pixel(x, y)); }});
  if (layers & kLayerDepth)
    groups.push_back({{"depth.Z"}, TypeDesc::FLOAT, [&](auto x, auto y, auto* out) { put(out, film.depth(x, y)); }});
  if (layers & kLayerNormal)
    groups.push_back({{"normal.X", "normal.Y", "normal.Z"}, TypeDesc::FLOAT, [&](auto x, auto y, auto* out) {
                        const Float3 n = film.normal(x, y);
                        put(out, Rgb{n.x, n.y, n.z});
                      }});
  if (layers & kLayerAlbedo)
    groups.push_back({{"albedo.R", "albedo.G", "albedo.B"}, TypeDesc::FLOAT, [&](auto x, auto y, auto* out) {
                        put(out, film.albedo(x, y));
                      }});
  if (layers & kLayerIds)
    groups.push_back({{"id.mesh", "id.material", "id.instance"}, TypeDesc::UINT32, [&](auto x, auto y, auto* out) {
                        put(out, film.ids(x, y));
                      }});
  if (options.half_buffers) {
    groups.push_back({{"halfA.R", "halfA.G", "halfA.B"}, TypeDesc::FLOAT, [&](auto x, auto y, auto* out) {
                        put(out, film.half_pixel(0, x, y));
                      }});
    groups.push_back({{"halfB.R", "halfB.G", "halfB.B"}, TypeDesc::FLOAT, [&](auto x, auto y, auto* out) {
                        put(out, film.half_pixel(1, x, y));
                      }});
  }
  if (options.costs != nullptr) {
    std::vector<std::string> names;
    for (uint32_t c = 0; c < kCostCount; ++c) names.push_back(fmt::format("cost.{}", name(static_cast<Cost>(c))));
    groups.push_back({std::move(names), TypeDesc::FLOAT, [&film, costs = options.costs](auto x, auto y, auto* out) {
                        const float samples = static_cast<float>(std::max(1u, film.samples()));
                        for (uint32_t c = 0; c < kCostCount; ++c)
                          put(out, static_cast<float>(costs->at(x, y, static_cast<Cost>(c))) / samples);
                      }});
  }
  return groups;
}

void set_metadata(ImageSpec& spec, const Film& film, const ImageMetadata& metadata, const WriteImageOptions& options) {
  const auto count = [&](const char* key, uint32_t value) { spec.attribute(key, TypeDesc::UINT32, &value); };
  spec.attribute("Software", "Spillway " + metadata.version);
  spec.attribute("DateTime", "");  // else the library gives the clock's, and equal films would not be equal files
  spec.attribute("spillway:renderer", "Spillway");
  spec.attribute("spillway:version", metadata.version);
  spec.attribute("spillway:scene", metadata.scene);
  spec.attribute("spillway:library_versions", film.identity().library_versions);
  spec.attribute("spillway:settings_key", fmt::format("{:016x}", film.identity().settings_key));
  spec.attribute("spillway:image_hash", film.hash());
  spec.attribute("spillway:film_lsb", fmt::format("{:a}", film.lsb()));
  count("spillway:spp", film.samples());
  count("spillway:max_depth", metadata.max_depth);
  count("spillway:seed", metadata.seed);
  count("spillway:epochs", metadata.epochs);
  spec.attribute("spillway:frame_key", metadata.frame_key);
  spec.attribute("spillway:ended_by", metadata.ended_by);
  spec.attribute("spillway:faults", film.faults().any() ? "some" : "none");
  if (!options.half_buffers) return;
  count("spillway:half_a_spp", film.half_samples(0));
  count("spillway:half_b_spp", film.half_samples(1));
}

ImageSpec window_spec(const FilmShape& shape, int channels) {
  const FilmWindow& w = shape.window;
  ImageSpec spec(static_cast<int>(w.width()), static_cast<int>(w.height()), channels, TypeDesc::FLOAT);
  spec.x = static_cast<int>(w.x0), spec.y = static_cast<int>(w.y0);
  spec.full_width = static_cast<int>(shape.full_width), spec.full_height = static_cast<int>(shape.full_height);
  return spec;
}

ImageSpec exr_spec(const Film& film, const std::vector<ChannelGroup>& groups) {
  size_t channels = 0;
  for (const ChannelGroup& group : groups) channels += group.names.size();
  ImageSpec spec = window_spec(film.shape(), static_cast<int>(channels));
  spec.channelnames.clear();
  for (const ChannelGroup& group : groups)
    for (const std::string& channel : group.names) {
      spec.channelnames.push_back(channel);
      spec.channelformats.push_back(group.type);
    }
  spec.alpha_channel = -1;
  spec.z_channel = -1;
  spec.attribute("compression", "zip");
  spec.attribute("oiio:ColorSpace", "Linear");
  return spec;
}

// Rows [y0, y1) of the image in native channel types, pixel by pixel.
void fill_strip(const Film& film, const std::vector<ChannelGroup>& groups, uint32_t y0, uint32_t y1, std::byte* out) {
  const FilmWindow& w = film.shape().window;
  for (uint32_t y = y0; y < y1; ++y)
    for (uint32_t x = w.x0; x < w.x1; ++x)
      for (const ChannelGroup& group : groups) {
        group.fill(x, y, out);
        out += group.names.size() * group.type.size();
      }
}

// Calls body(y0, y1) for strips of the window, top to bottom, until one fails.
template <class Body>
Status for_strips(uint32_t y_begin, uint32_t y_end, const Body& body) {
  for (uint32_t y = y_begin; y < y_end; y += kStripRows) SPILLWAY_TRY(body(y, std::min(y + kStripRows, y_end)));
  return {};
}

// ---- PNG ----

void srgb_row(const float* rgb, size_t count, float gain, uint8_t* out) {
  for (size_t i = 0; i < count; ++i) out[i] = srgb_byte(rgb[i] * gain);
}

ImageSpec png_spec(uint32_t width, uint32_t height) {
  ImageSpec spec(static_cast<int>(width), static_cast<int>(height), 3, TypeDesc::UINT8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  return spec;
}

}  // namespace

uint8_t srgb_byte(float linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 255;
  const double encoded = linear <= 0.0031308f ? 12.92 * linear : 1.055 * std::pow(double{linear}, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(encoded * 255 + 0.5);
}

Status write_exr(const Film& film, const std::filesystem::path& path, const ImageMetadata& metadata,
                 const WriteImageOptions& options) {
  if (path.extension() != ".exr") return error("{}: the picture's name must end in .exr", path.string());
  const std::vector<ChannelGroup> groups = channel_groups(film, options);
  ImageSpec spec = exr_spec(film, groups);
  set_metadata(spec, film, metadata, options);
  SPILLWAY_ASSIGN(ImageFile file, ImageFile::create(path, "openexr", spec));
  const FilmWindow& w = film.shape().window;
  Buffer<std::byte> strip(MemoryTag::film, spec.pixel_bytes(true) * w.width() * std::min(kStripRows, w.height()));
  SPILLWAY_TRY(for_strips(w.y0, w.y1, [&](uint32_t y0, uint32_t y1) {
    fill_strip(film, groups, y0, y1, strip.data());
    return file.write_rows(static_cast<int>(y0), static_cast<int>(y1), TypeDesc::UNKNOWN, strip.data());
  }));
  return file.commit();
}

Status write_png(const Film& film, const std::filesystem::path& path, float exposure_stops) {
  const FilmWindow& w = film.shape().window;
  SPILLWAY_ASSIGN(ImageFile file, ImageFile::create(path, "png", png_spec(w.width(), w.height())));
  std::vector<uint8_t> row(3 * size_t{w.width()});
  const float gain = std::exp2(exposure_stops);
  for (uint32_t y = w.y0; y < w.y1; ++y) {
    for (uint32_t x = w.x0; x < w.x1; ++x) {
      const Rgb c = film.pixel(x, y);
      srgb_row(&c.r, 3, gain, &row[3 * (x - w.x0)]);
    }
    const int image_row = static_cast<int>(y - w.y0);
    SPILLWAY_TRY(file.write_rows(image_row, image_row + 1, TypeDesc::UINT8, row.data()));
  }
  return file.commit();
}

Status convert_to_png(const std::filesystem::path& image, const std::filesystem::path& png, float exposure_stops) {
  const auto input = ImageInput::open(image.string());
  if (!input) return error("{}: cannot be read: {}", image.string(), OIIO::geterror());
  const ImageSpec& spec = input->spec();
  const int channels = spec.nchannels < 3 ? 1 : 3;
  const auto width = static_cast<size_t>(spec.width);
  const ImageSpec out_spec = png_spec(static_cast<uint32_t>(width), static_cast<uint32_t>(spec.height));
  SPILLWAY_ASSIGN(ImageFile file, ImageFile::create(png, "png", out_spec));
  std::vector<float> strip(width * channels * kStripRows);
  std::vector<uint8_t> bytes(width * 3 * kStripRows);
  const float gain = std::exp2(exposure_stops);
  SPILLWAY_TRY(for_strips(0, static_cast<uint32_t>(spec.height), [&](uint32_t y0, uint32_t y1) -> Status {
    const int top = spec.y + static_cast<int>(y0), bottom = spec.y + static_cast<int>(y1);
    if (!input->read_scanlines(0, 0, top, bottom, 0, 0, channels, TypeDesc::FLOAT, strip.data()))
      return error("{}: row {} cannot be read: {}", image.string(), top, input->geterror());
    for (size_t i = 0; i < width * 3 * (y1 - y0); ++i) srgb_row(&strip[channels == 3 ? i : i / 3], 1, gain, &bytes[i]);
    return file.write_rows(static_cast<int>(y0), static_cast<int>(y1), TypeDesc::UINT8, bytes.data());
  }));
  return file.commit();
}

}  // namespace spillway::pipeline
