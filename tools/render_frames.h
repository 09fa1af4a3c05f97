#pragma once

// `render --frames`: a batch of frames of a store's camera path.
//
// Residency is kept from frame to frame. A frame whose picture is there with the same key, the samples asked for, is
// finished and skipped. A frame that fails does not end the batch; an interrupt does, after the picture of whole
// samples.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/render/render_image.h"

namespace spillway::tools {

struct FrameBatch {
  std::vector<uint32_t> frames;
  std::string output;  // frame.####.exr; one frame may do without
  std::string report;  // with ####: a report a frame; without: the summary; empty: none
  bool json = false;   // the summary on stdout
  bool quiet = false;
  std::function<Result<pipeline::SceneSettings>(const pipeline::FrameCamera&)> settings_of;
  std::function<std::string(const pipeline::RenderOptions&)> key_of;
  std::function<Status(const pipeline::RenderedImage&, const pipeline::RenderOptions&, const std::filesystem::path&)>
      write;
};

// "1-48", "1-48x2" (every second), "3", and lists of these with commas; ascending, without duplicates.
Result<std::vector<uint32_t>> parse_frames(const std::string& text);

// The one run of # in the file's name becomes the number, with at least so many digits.
Result<std::filesystem::path> frame_path(const std::string& pattern, uint32_t frame);

// Returns the exit code: of the worst frame, or that of an interrupt. Fails before the first frame: with frames that
// the path does not have, a pattern without #, a budget that is too small.
Result<int> render_frames(const pipeline::Store& store, pipeline::RenderOptions options, const FrameBatch& batch);

}  // namespace spillway::tools
