#include "pipeline/render/ray_samples.h"

#include <gtest/gtest.h>

namespace spillway::pipeline {
namespace {

const CountedNeeds kRays = {{{RayKind::camera, {}, {}}, 7},
                            {{RayKind::camera, {3, 200}, {}}, 1},
                            {{RayKind::continued, {0, 1, 2}, {2, 9, 4}}, 300},
                            {{RayKind::shadow, {5, 6, 299}, {}}, 2},
                            {{RayKind::shadow, {5, 6, 299}, {6, 299}}, 4}};

std::vector<std::byte> bytes_of(uint32_t wave) {
  std::vector<std::byte> bytes;
  put_samples(bytes, wave, kRays);
  return bytes;
}

CountedNeeds counted(const WaveSamples& wave) {
  CountedNeeds all;
  for (const SampleRow& row : wave.rows) {
    const auto pages = wave.pages(row), stops = wave.stops(row);
    all[{row.kind, {pages.begin(), pages.end()}, {stops.begin(), stops.end()}}] += row.count;
  }
  return all;
}

TEST(RaySamples, come_back_in_their_waves_even_in_pieces) {
  std::vector<std::byte> bytes = bytes_of(2);
  put_samples(bytes, 0, {});
  put_samples(bytes, 2, {{{RayKind::camera, {}, {}}, 1}});
  std::vector<WaveSamples> waves(3);
  ASSERT_TRUE(get_samples(bytes, 300, waves));
  CountedNeeds expected = kRays;
  ++expected[{RayKind::camera, {}, {}}];
  EXPECT_TRUE(counted(waves[2]) == expected);
  EXPECT_TRUE(waves[0].rows.empty() && waves[1].rows.empty());
}

TEST(RaySamples, every_beginning_of_them_is_refused) {
  const std::vector<std::byte> bytes = bytes_of(0);
  for (size_t size = 1; size < bytes.size(); ++size) {
    std::vector<WaveSamples> waves(1);
    EXPECT_FALSE(get_samples(std::span(bytes).first(size), 300, waves)) << size;
  }
}

TEST(RaySamples, of_pages_waves_and_kinds_that_are_not_are_refused) {
  std::vector<WaveSamples> waves(1);
  EXPECT_FALSE(get_samples(bytes_of(1), 300, waves));
  EXPECT_FALSE(get_samples(bytes_of(0), 299, waves));
  std::vector<std::byte> bytes = bytes_of(0);
  bytes[2] = std::byte{3};
  EXPECT_FALSE(get_samples(bytes, 300, waves));
  bytes = bytes_of(0);
  bytes[3] = std::byte{0};  // rays like nobody
  EXPECT_FALSE(get_samples(bytes, 300, waves));
}

}  // namespace
}  // namespace spillway::pipeline
