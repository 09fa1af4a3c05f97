#include "pipeline/pack/pack_media.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "tests/support/file_bytes.h"
#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

constexpr std::array<int32_t, 3> kCounts = {11, 9, 45};

// No two alike, none zero.
float sample_at(int32_t x, int32_t y, int32_t z, uint32_t channel) {
  return static_cast<float>(1 + x + kCounts[0] * (y + kCounts[1] * (z + kCounts[2] * static_cast<int32_t>(channel))));
}

std::shared_ptr<SampleStream> samples(uint32_t channels) {
  const auto stream = std::make_shared<SampleStream>(cache::StreamOptions{.tag = MemoryTag::pack});
  for (int32_t z = 0; z < kCounts[2]; ++z)
    for (int32_t y = 0; y < kCounts[1]; ++y)
      for (int32_t x = 0; x < kCounts[0]; ++x)
        for (uint32_t c = 0; c < channels; ++c) EXPECT_TRUE(stream->append(std::array{sample_at(x, y, z, c)}));
  EXPECT_TRUE(stream->finish());
  return stream;
}

// A slab of layers is read for each row of bricks along z: every brick gets its own.
TEST(PackMedia, bricks_of_every_size_hold_the_samples_that_were_given) {
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "volumes.bricks";
  for (const uint32_t channels : {1u, 3u})
    for (const int32_t voxels : {8, 16, 64}) {
      SaidMedia media;
      ASSERT_TRUE(media.add_volume({"grid", {}, {}, kCounts, channels, samples(channels)}));
      auto file = cache::WriteFile::create(path, cache::IoPurpose::pack);
      ASSERT_TRUE(file);
      const auto packed = media.pack(*file, path, {.brick_voxels = voxels});
      ASSERT_TRUE(packed) << packed.error().message;
      ASSERT_TRUE(file->commit());
      const std::string bytes = test::bytes_of(path);
      int found = 0;
      for (size_t at = 0; at < bytes.size();) {
        const auto& header = *reinterpret_cast<const cache::VolumeBrickHeader*>(&bytes[at]);
        const cache::VolumeBrickView brick(std::as_bytes(std::span(bytes)).subspan(at, header.size_bytes));
        for (int32_t z = std::max(header.corner[2], 0); z < std::min(header.corner[2] + voxels, kCounts[2]); ++z)
          for (int32_t y = std::max(header.corner[1], 0); y < std::min(header.corner[1] + voxels, kCounts[1]); ++y)
            for (int32_t x = std::max(header.corner[0], 0); x < std::min(header.corner[0] + voxels, kCounts[0]); ++x) {
              const Float3 place{static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
              ASSERT_EQ(channels == 1 ? brick.interpolate(place) : brick.interpolate_color(place).r,
                        sample_at(x, y, z, 0));
              ASSERT_EQ(brick.interpolate_color(place).b, sample_at(x, y, z, channels - 1));
              ++found;
            }
        at += header.size_bytes;
      }
      EXPECT_EQ(found, kCounts[0] * kCounts[1] * kCounts[2]);
    }
}

}  // namespace
}  // namespace spillway::pipeline
