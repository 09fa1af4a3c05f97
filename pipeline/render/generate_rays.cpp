#include "pipeline/render/generate_rays.h"

#include "cache/base/parallel.h"
#include "shading/sampler.h"

namespace spillway::pipeline {
namespace {

constexpr uint32_t kTile = 64;
constexpr size_t kBlockRays = 1024;

// Every other bit of x, packed.
uint32_t even_bits(uint32_t x) {
  x &= 0x55555555;
  x = (x | (x >> 1)) & 0x33333333;
  x = (x | (x >> 2)) & 0x0f0f0f0f;
  return (x | (x >> 4)) & 0x00ff00ff;
}

}  // namespace

RayTimes ray_times(const Store& store, const SceneSettings& settings) {
  if (store.motions().empty()) return {};
  const uint32_t motion = settings.camera.motion;
  return {shutter_of(settings), motion == 0 ? nullptr : &store.motions()[motion - 1]};
}

CameraRays::CameraRays(const shading::Camera& camera, const shading::Filter& filter, PixelWindow window, uint32_t seed,
                       shading::SamplerKind sampler, const RayTimes& times, float exposure_scale,
                       uint32_t camera_medium)
    : camera_(camera),
      filter_(filter),
      window_(window),
      seed_(seed),
      sampler_(sampler),
      times_(times),
      exposure_scale_(exposure_scale),
      medium_(camera_medium),
      next_pixel_(window.pixel_count()) {}

void CameraRays::begin(const Epoch& epoch) {
  epoch_ = epoch;
  next_pixel_ = 0;
  next_sample_ = 0;
}

// Rows of tiles, tiles in a row, Morton inside a full tile, scanlines inside one that the window cuts.
CameraRays::Pixel CameraRays::pixel(uint64_t index) const {
  const uint64_t row_pixels = uint64_t{kTile} * window_.width();
  const uint32_t tile_row = static_cast<uint32_t>(index / row_pixels);
  const uint32_t height = std::min(kTile, window_.height() - tile_row * kTile);
  const uint64_t in_row = index - tile_row * row_pixels;
  const uint32_t tile = static_cast<uint32_t>(in_row / (uint64_t{kTile} * height));
  const uint32_t width = std::min(kTile, window_.width() - tile * kTile);
  const uint32_t in_tile = static_cast<uint32_t>(in_row - uint64_t{tile} * kTile * height);
  const bool whole = width == kTile && height == kTile;
  const uint32_t x = whole ? even_bits(in_tile) : in_tile % width;
  const uint32_t y = whole ? even_bits(in_tile >> 1) : in_tile / width;
  return {window_.x0 + tile * kTile + x, window_.y0 + tile_row * kTile + y};
}

void CameraRays::camera_path(Pixel p, uint32_t sample, cache::TraceRay& ray, PathRecord& path) const {
  const uint32_t sink = p.y * camera_.resolution_x_px + p.x;
  const shading::SampleKey key{sink, sample, seed_, sampler_};
  const shading::FilterSample film = filter_.sample(shading::sample_2d(key, shading::kSlotFilm));
  const Float2 raster{static_cast<float>(p.x) + 0.5f + film.offset_px.x, static_cast<float>(p.y) + 0.5f + film.offset_px.y};
  const Float2 u_lens = camera_.lens_radius > 0 ? shading::sample_2d(key, shading::kSlotLens) : Float2{0.5f, 0.5f};
  const float time = ray_time(times_.shutter, key);
  const shading::CameraRay camera =
      times_.camera == nullptr ? shading::camera_ray(camera_, raster, u_lens)
                               : shading::camera_ray(camera_, transform_at(*times_.camera, time), raster, u_lens);
  ray = {camera.origin_world, INFINITY, camera.direction_world, time};
  path = PathRecord{};
  path.sink = sink, path.sample = sample, path.medium = medium_;
  const float weight = film.weight * exposure_scale_;
  path.throughput = {weight, weight, weight};
  path.cone_width = camera.cone_width, path.cone_spread = camera.cone_spread;
  path.eta_scale = 1 / exposure_scale_;  // roulette plays for what the path carries, however long it is exposed
  path.position_previous = camera.origin_world;
}

size_t CameraRays::generate_rays(size_t count, cache::TraceRay* rays, PathRecord* paths) {
  const uint64_t left = (window_.pixel_count() - next_pixel_) * epoch_.sample_count - next_sample_;
  const size_t made = static_cast<size_t>(std::min<uint64_t>(count, left));
  const uint64_t start = next_pixel_ * epoch_.sample_count + next_sample_;
  parallel_blocks(made, kBlockRays, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) {
      const uint64_t n = start + i;
      const uint32_t index = epoch_.first_sample + static_cast<uint32_t>(n % epoch_.sample_count);
      camera_path(pixel(n / epoch_.sample_count), 2 * index + epoch_.half, rays[i], paths[i]);
    }
  });
  next_pixel_ = (start + made) / epoch_.sample_count;
  next_sample_ = static_cast<uint32_t>((start + made) % epoch_.sample_count);
  return made;
}

}  // namespace spillway::pipeline
