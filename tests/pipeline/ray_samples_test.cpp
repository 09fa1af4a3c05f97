#include "pipeline/render/ray_samples.h"

#include <gtest/gtest.h>

namespace spillway::pipeline {
namespace {

RayNeeds with_boxes(RayNeeds needs) {
  needs.knows_boxes = true, needs.boxes = {7, 298}, needs.boxes_behind = {{1, 3}, {3, 8}};
  return needs;
}
RayNeeds single(RayNeeds needs) {
  needs.is_single = true;
  return needs;
}

const std::vector<SampledRay> kRays = {{900, {RayKind::camera, {}, {}}},
                                       {3, {RayKind::camera, {3, 200}, {}}},
                                       {1ull << 40, {RayKind::camera, {}, {}}},
                                       {5, with_boxes({RayKind::continued, {0, 1, 2}, {2, 9, 4}})},
                                       {5, {RayKind::shadow, {5, 6, 299}, {}}},
                                       {6, single({RayKind::shadow, {5, 6, 299}, {6, 299}})}};

std::vector<std::byte> bytes_of(uint32_t wave) {
  std::vector<std::byte> bytes;
  put_samples(bytes, wave, kRays);
  return bytes;
}

RayNeeds decoded(const RaySamples& samples, const SampleRow& ray) {
  const NeedsRow& row = samples.needs_of(ray);
  const auto list = [](std::span<const uint32_t> items) { return std::vector<uint32_t>(items.begin(), items.end()); };
  RayNeeds needs{row.kind, list(samples.pages(row)), list(samples.stops(row))};
  needs.knows_boxes = row.knows_boxes, needs.is_single = row.is_single, needs.boxes = list(samples.boxes(row));
  const auto behind = samples.boxes_behind(row);
  for (size_t i = 0; i + 1 < behind.size(); i += 2) needs.boxes_behind.emplace_back(behind[i], behind[i + 1]);
  return needs;
}

TEST(RaySamples, come_back_in_their_order_and_waves_even_in_pieces) {
  std::vector<std::byte> bytes = bytes_of(2);
  put_samples(bytes, 0, {});
  put_samples(bytes, 1, std::span(kRays).first(1));
  RaySamples samples;
  ASSERT_TRUE(get_samples(bytes, 300, 3, samples));
  ASSERT_EQ(samples.rays.size(), kRays.size() + 1);
  for (size_t i = 0; i < kRays.size(); ++i) {
    EXPECT_EQ(samples.rays[i].wave, 2u);
    EXPECT_EQ(samples.rays[i].path, kRays[i].path) << i;
    EXPECT_TRUE(decoded(samples, samples.rays[i]) == kRays[i].needs) << i;
  }
  EXPECT_EQ(samples.rays.back().wave, 1u);
  EXPECT_EQ(samples.needs.size(), 5u + 1);  // what is the same is one row of a group
}

TEST(RaySamples, every_beginning_of_them_is_refused) {
  const std::vector<std::byte> bytes = bytes_of(0);
  for (size_t size = 1; size < bytes.size(); ++size) {
    RaySamples samples;
    EXPECT_FALSE(get_samples(std::span(bytes).first(size), 300, 1, samples)) << size;
  }
}

TEST(RaySamples, of_pages_waves_kinds_and_needs_that_are_not_are_refused) {
  RaySamples samples;
  EXPECT_FALSE(get_samples(bytes_of(1), 300, 1, samples));
  EXPECT_FALSE(get_samples(bytes_of(0), 299, 1, samples));
  std::vector<std::byte> bytes = bytes_of(0);
  bytes[2] = std::byte{3};  // a kind
  EXPECT_FALSE(get_samples(bytes, 300, 1, samples));
  bytes = bytes_of(0);
  bytes.back() = std::byte{5};  // needs
  EXPECT_FALSE(get_samples(bytes, 300, 1, samples));
}

}  // namespace
}  // namespace spillway::pipeline
