#pragma once

// Stage generate_rays: camera paths of the open epoch, as many as the wave has room for.
//
// In: the camera, the epoch, how many paths. Out: hot and cold columns, appended.
// Memory: the caller's columns. Order: pixels in Morton order inside tiles of 64 x 64, all samples of a pixel together;
// a ray depends on (sink, sample) alone.

#include <cstdint>

#include "pipeline/records.h"
#include "pipeline/render/epochs.h"
#include "pipeline/shutter.h"
#include "pipeline/store.h"
#include "shading/camera.h"
#include "shading/sampler.h"

namespace spillway::pipeline {

// Half open, in pixels of the full frame.
struct PixelWindow {
  uint32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  [[nodiscard]] uint32_t width() const { return x1 - x0; }
  [[nodiscard]] uint32_t height() const { return y1 - y0; }
  [[nodiscard]] uint64_t pixel_count() const { return uint64_t{width()} * height(); }
};

// What moving scenes add: when rays are shot, and how the camera moves meanwhile (null: it stands still).
struct RayTimes {
  Shutter shutter;
  const Motion* camera = nullptr;
};
// Points into the store.
[[nodiscard]] RayTimes ray_times(const Store& store, const SceneSettings& settings);

// Walks the samples of one epoch; each is handed out exactly once.
class CameraRays {
 public:
  CameraRays(const shading::Camera& camera, const shading::Filter& filter, PixelWindow window, uint32_t seed,
             shading::SamplerKind sampler = shading::SamplerKind::sobol, const RayTimes& times = {},
             float exposure_scale = 1, uint32_t camera_medium = kNoMedium);

  void begin(const Epoch& epoch);
  [[nodiscard]] bool exhausted() const { return next_pixel_ == window_.pixel_count(); }
  // Writes up to `count` rays to the front of both arrays; returns how many.
  size_t generate_rays(size_t count, cache::TraceRay* rays, PathRecord* paths);

 private:
  struct Pixel {
    uint32_t x, y;
  };
  [[nodiscard]] Pixel pixel(uint64_t index) const;
  void camera_path(Pixel pixel, uint32_t sample, cache::TraceRay& ray, PathRecord& path) const;

  shading::Camera camera_;
  shading::FilterSampler filter_;
  PixelWindow window_;
  uint32_t seed_;
  shading::SamplerKind sampler_;
  RayTimes times_;
  float exposure_scale_;
  uint32_t medium_;
  Epoch epoch_;
  uint64_t next_pixel_ = 0;   // of the window, in walking order
  uint32_t next_sample_ = 0;  // inside the epoch
};

}  // namespace spillway::pipeline
