#pragma once

// One render, measured: what the laboratory's rows are made of.

#include <cstdint>
#include <string>

#include "pipeline/render/render_image.h"
#include "tools/metrics/picture.h"

namespace spillway::tools::lab {

struct Measurement {
  std::string scene, axis, configuration;
  uint32_t spp = 0, seed = 0;
  double samples = 0;  // camera paths
  double seconds = 0;  // of the frame with opening its files, by the wall clock
  double rel_mse = 0;  // against the reference
  double flip = 0;     // mean, the same
  uint64_t read_bytes = 0, written_bytes = 0;
  uint64_t peak_bytes = 0;  // resident at its highest, without what the laboratory itself holds beside the render
  std::string image_hash;
};

struct MeasuredPicture {
  Measurement row;  // without scene, axis, configuration, and errors
  Picture picture;  // with half buffers
};

// In this process, which is what `render` does too. Fails as render_image does, and when contributions were not finite
// or out of range: such a picture is no measurement.
Result<MeasuredPicture> render_measured(const pipeline::Store& store, const pipeline::RenderOptions& options);

// The window of a film.
[[nodiscard]] Picture picture_of(const pipeline::Film& film);

// The mean over pixels and channels of the variance of a pixel over b^2 + 0.01, as relMSE weighs it, estimated from the
// two halves of the samples: what the picture's own noise adds to an error that is held against it.
[[nodiscard]] double noise_of_halves(const Picture& picture);

}  // namespace spillway::tools::lab
