#include "shading/sampler.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace spillway::shading {
namespace {

// Samples of one half share a scramble: half = sample & 1.
Float2 point(uint32_t i, uint32_t half, uint32_t slot, uint32_t sink = 5, uint32_t seed = 0) {
  return sample_2d({sink, 2 * i + half, seed}, slot);
}

TEST(Sampler, every_power_of_two_of_samples_is_a_net) {
  for (const uint32_t half : {0u, 1u})
    for (const uint32_t slot : {0u, 3u, 17u})
      for (const uint32_t bits : {2u, 5u, 8u}) {
        const uint32_t count = 1u << bits;
        for (uint32_t x_bits = 0; x_bits <= bits; ++x_bits) {
          std::set<std::pair<uint32_t, uint32_t>> cells;
          for (uint32_t i = 0; i < count; ++i) {
            const Float2 p = point(i, half, slot);
            ASSERT_TRUE(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
            cells.insert({static_cast<uint32_t>(p.x * static_cast<float>(1u << x_bits)),
                          static_cast<uint32_t>(p.y * static_cast<float>(1u << (bits - x_bits)))});
          }
          ASSERT_EQ(cells.size(), count) << "one point in each elementary interval";
        }
      }
}

TEST(Sampler, slots_sinks_halves_and_seeds_are_independent) {
  const auto correlation = [](auto&& a, auto&& b) {
    constexpr int kCount = 4096;
    double sum = 0;
    for (uint32_t i = 0; i < kCount; ++i) sum += (a(i) - 0.5) * (b(i) - 0.5);
    return 12 * sum / kCount;
  };
  const auto base = [](uint32_t i) { return static_cast<double>(point(i, 0, 4).x); };
  // Independent points correlate by 1 / sqrt(4096) = 0.016: four deviations.
  EXPECT_LT(std::abs(correlation(base, [](uint32_t i) { return static_cast<double>(point(i, 0, 4).y); })), 0.0625);
  EXPECT_LT(std::abs(correlation(base, [](uint32_t i) { return static_cast<double>(point(i, 0, 5).x); })), 0.0625);
  EXPECT_LT(std::abs(correlation(base, [](uint32_t i) { return static_cast<double>(point(i, 1, 4).x); })), 0.0625);
  EXPECT_LT(std::abs(correlation(base, [](uint32_t i) { return static_cast<double>(point(i, 0, 4, 6).x); })), 0.0625);
  EXPECT_LT(std::abs(correlation(base, [](uint32_t i) { return static_cast<double>(point(i, 0, 4, 5, 1).x); })), 0.0625);
}

// Independent: no net, no stratum; every part of the key changes the point.
TEST(Sampler, independent_samples_are_uniform_and_nothing_more) {
  const auto at = [](uint32_t sink, uint32_t sample, uint32_t seed, uint32_t slot) {
    return sample_2d({sink, sample, seed, SamplerKind::independent}, slot);
  };
  std::vector<int> cells(64);
  constexpr int kSamples = 64000;
  double correlation = 0;
  for (uint32_t i = 0; i < kSamples; ++i) {
    const Float2 p = at(3, i, 0, 7), next = at(3, i + 1, 0, 7);
    ASSERT_TRUE(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
    ++cells[static_cast<size_t>(p.x * 8) * 8 + static_cast<size_t>(p.y * 8)];
    correlation += 12 * (p.x - 0.5) * (next.x - 0.5) / kSamples;
  }
  double chi_square = 0;
  for (const int n : cells) chi_square += (n - 1000.0) * (n - 1000.0) / 1000;
  EXPECT_LT(chi_square, 120);  // 63 degrees of freedom: mean 63, deviation 11.2
  EXPECT_GT(chi_square, 20);   // and no better than chance, as stratified points would be
  EXPECT_LT(std::abs(correlation), 0.02);
  const Float2 base = at(1, 2, 3, 4);
  EXPECT_NE(base.x, at(2, 2, 3, 4).x);
  EXPECT_NE(base.x, at(1, 3, 3, 4).x);
  EXPECT_NE(base.x, at(1, 2, 4, 4).x);
  EXPECT_NE(base.x, at(1, 2, 3, 5).x);
}

TEST(Sampler, one_sample_is_uniform_over_pixels) {
  std::vector<int> cells(64);
  constexpr int kSinks = 64000;
  for (uint32_t sink = 0; sink < kSinks; ++sink) {
    const Float2 p = point(0, 0, 0, sink);
    ++cells[static_cast<size_t>(p.x * 8) * 8 + static_cast<size_t>(p.y * 8)];
  }
  double chi_square = 0;
  for (const int n : cells) chi_square += (n - 1000.0) * (n - 1000.0) / 1000;
  EXPECT_LT(chi_square, 120);  // 63 degrees of freedom: mean 63, deviation 11.2
}

TEST(Sampler, the_points_of_a_bounce_are_those_of_its_slots) {
  for (uint32_t i = 0; i < 4096; ++i) {
    const SampleKey key{i * 2654435761u, i * 40503u, i % 3, i % 5 == 0 ? SamplerKind::independent : SamplerKind::sobol};
    const BouncePoints points = sample_bounce(key, i % 37);
    for (const BounceSlot slot : {kBounceLight, kBounceLightSelect, kBounceBsdf, kBounceLobeAndRoulette}) {
      const Float2 alone = sample_2d(key, bounce_slot(i % 37, slot));
      ASSERT_EQ(points[slot].x, alone.x);
      ASSERT_EQ(points[slot].y, alone.y);
    }
  }
}

TEST(Sampler, hashed_numbers_are_uniform_and_depend_on_every_part_of_the_key) {
  double sum = 0;
  for (uint32_t i = 0; i < 10000; ++i) sum += hashed_1d({i, 1, 2}, SampleStream::decisions, 3, 4, 5);
  EXPECT_NEAR(sum / 10000, 0.5, 0.0116);  // four deviations
  const float base = hashed_1d({1, 2, 3}, SampleStream::decisions, 4, 5, 6);
  EXPECT_NE(base, hashed_1d({2, 2, 3}, SampleStream::decisions, 4, 5, 6));
  EXPECT_NE(base, hashed_1d({1, 3, 3}, SampleStream::decisions, 4, 5, 6));
  EXPECT_NE(base, hashed_1d({1, 2, 4}, SampleStream::decisions, 4, 5, 6));
  EXPECT_NE(base, hashed_1d({1, 2, 3}, SampleStream::camera_paths, 4, 5, 6));
  EXPECT_NE(base, hashed_1d({1, 2, 3}, SampleStream::decisions, 5, 5, 6));
  EXPECT_NE(base, hashed_1d({1, 2, 3}, SampleStream::decisions, 4, 6, 6));
  EXPECT_NE(base, hashed_1d({1, 2, 3}, SampleStream::decisions, 4, 5, 7));
  EXPECT_EQ(base, hashed_1d({1, 2, 3}, SampleStream::decisions, 4, 5, 6));
}

}  // namespace
}  // namespace spillway::shading
