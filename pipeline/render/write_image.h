#pragma once

// Pictures of a film: OpenEXR with layers and metadata, PNG for previews.
//
// Memory: strips of kStripRows scanlines (tag film), and what the library holds for as many.
// Threads: one caller an image; the library may use threads of its own.
// Fails: with the file's name; a file is written under a temporary name, synced and renamed, so that nothing
//        half-written looks whole.
// Bits: equal films and metadata give equal pixels. (PNG goes through pow: equal with one C library.)
// Format: channels R, G, B; with layers depth.Z, normal.XYZ, albedo.RGB (float), id.mesh, id.material, id.instance
//         (uint32, 4294967295: nothing there); with half buffers halfA.RGB and halfB.RGB (float). The data window is
//         the crop, the display window the full image.

#include <cstdint>
#include <filesystem>
#include <string>

#include "cache/base/result.h"
#include "pipeline/render/film.h"
#include "pipeline/render/pixel_costs.h"

namespace spillway::pipeline {

inline constexpr uint32_t kStripRows = 64;  // a multiple of OpenEXR's 16-row zip blocks

// What the film does not know of itself; goes into the header as spillway:<name>.
struct ImageMetadata {
  std::string scene;
  std::string version;  // of the program
  uint32_t max_depth = 0;
  uint32_t seed = 0;
  uint32_t epochs = 0;  // closed ones
  std::string frame_key{};  // see render_image.h; with spp, ended_by and faults, by which a finished frame is known
  std::string ended_by{};   // RenderEnd
};

struct WriteImageOptions {
  bool half_float = false;    // R, G, B as 16-bit floats (values beyond 65504 become 65504); else 32-bit
  const PixelCosts* costs = nullptr;  // cost.<name>: counts of a sample, float
  bool half_buffers = false;  // halfA, halfB: for error estimates and `spillway compare`
};

// Fails for any other extension than .exr.
Status write_exr(const Film& film, const std::filesystem::path& path, const ImageMetadata& metadata,
                 const WriteImageOptions& options = {});

// 8-bit sRGB (IEC 61966-2-1) of value * 2^exposure_stops, clamped; the crop window only.
Status write_png(const Film& film, const std::filesystem::path& path, float exposure_stops = 0);

// The same from the R, G, B channels (or the first channel) of an image file.
Status convert_to_png(const std::filesystem::path& image, const std::filesystem::path& png, float exposure_stops = 0);

// One byte of sRGB for a linear value; not-a-number is 0.
[[nodiscard]] uint8_t srgb_byte(float linear);

}  // namespace spillway::pipeline
