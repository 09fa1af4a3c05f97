#include "pipeline/render/generate_rays.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <utility>
#include <vector>

namespace spillway::pipeline {
namespace {

// Larger than a tile in both directions, with cut tiles at its ends.
constexpr PixelWindow kWindow{3, 5, 140, 100};

shading::Camera camera() {
  shading::Camera c;
  c.resolution_x_px = 160, c.resolution_y_px = 120;
  c.tan_half_fov_x = 0.8f, c.tan_half_fov_y = 0.6f;
  return c;
}

struct Rays {
  std::vector<cache::TraceRay> rays;
  std::vector<PathRecord> paths;
};

Rays all_rays(const Epoch& epoch, size_t batch) {
  CameraRays source(camera(), {shading::FilterKind::box, {0.5f, 0.5f}}, kWindow, 1);
  source.begin(epoch);
  Rays all;
  std::vector<cache::TraceRay> rays(batch);
  std::vector<PathRecord> paths(batch);
  while (!source.exhausted()) {
    const size_t made = source.generate_rays(batch, rays.data(), paths.data());
    EXPECT_GT(made, 0u);
    all.rays.insert(all.rays.end(), rays.begin(), rays.begin() + static_cast<ptrdiff_t>(made));
    all.paths.insert(all.paths.end(), paths.begin(), paths.begin() + static_cast<ptrdiff_t>(made));
  }
  EXPECT_EQ(source.generate_rays(batch, rays.data(), paths.data()), 0u);
  return all;
}

TEST(GenerateRays, every_pixel_gets_the_epochs_samples_of_its_half_once) {
  for (const uint32_t half : {0u, 1u}) {
    std::set<std::pair<uint32_t, uint32_t>> seen;  // pixel, sample
    for (const PathRecord& path : all_rays({half, 4, 3}, 1000).paths) {
      const uint32_t x = path.sink % 160, y = path.sink / 160;
      ASSERT_TRUE(x >= kWindow.x0 && x < kWindow.x1 && y >= kWindow.y0 && y < kWindow.y1);
      ASSERT_EQ(path.sample & 1, half);  // even samples are A's
      ASSERT_TRUE(path.sample / 2 >= 4 && path.sample / 2 < 7);
      ASSERT_TRUE(seen.emplace(path.sink, path.sample).second);
    }
    EXPECT_EQ(seen.size(), 3 * kWindow.pixel_count());
  }
}

TEST(GenerateRays, a_ray_looks_through_its_pixel) {
  const Rays all = all_rays({0, 0, 1}, 5000);
  for (size_t i = 0; i < all.rays.size(); ++i) {
    const Float3 d = all.rays[i].direction_world;
    const float x = (d.x / d.z / 0.8f + 1) * 80, y = (1 - d.y / d.z / 0.6f) * 60;  // in pixels of the full frame
    // From the pixel's centre at most half a pixel, and the rounding of a hundred pixels.
    ASSERT_NEAR(x, static_cast<float>(all.paths[i].sink % 160) + 0.5f, 0.5001f);
    ASSERT_NEAR(y, static_cast<float>(all.paths[i].sink / 160) + 0.5f, 0.5001f);
    ASSERT_TRUE(std::isinf(all.rays[i].t_max));
  }
}

TEST(GenerateRays, batches_do_not_show) {
  const Rays whole = all_rays({1, 2, 2}, 1 << 16);
  for (const size_t batch : {1u, 37u, 4096u}) {
    const Rays other = all_rays({1, 2, 2}, batch);
    ASSERT_EQ(other.rays.size(), whole.rays.size());
    for (size_t i = 0; i < whole.rays.size(); ++i) {
      ASSERT_EQ(other.paths[i].sink, whole.paths[i].sink);
      ASSERT_EQ(other.paths[i].sample, whole.paths[i].sample);
      ASSERT_EQ(other.rays[i].direction_world, whole.rays[i].direction_world);
    }
  }
}

}  // namespace
}  // namespace spillway::pipeline
