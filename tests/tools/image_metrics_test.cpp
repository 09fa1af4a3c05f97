#include "tools/metrics/image_metrics.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

#include "tools/metrics/compare_pictures.h"
#include "tools/metrics/flip.h"
#include "tools/metrics/statistical_equality.h"

namespace spillway::tools {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Picture constant(int width, int height, Rgb value) {
  Picture p;
  p.width = width, p.height = height;
  p.pixels.assign(static_cast<size_t>(width) * height, value);
  return p;
}

std::vector<uint8_t> everything(const Picture& p) { return std::vector<uint8_t>(p.pixels.size(), 1); }

// A picture of a smooth scene with noise of known size: each half is the mean of `samples` exponential values.
Picture noisy(uint32_t seed, int samples = 32, float gain = 1) {
  Picture p = constant(64, 48, {0, 0, 0});
  p.half_a = p.half_b = p.pixels;
  std::mt19937 generator(seed);
  std::exponential_distribution<double> value(1);
  const auto half = [&](double mean) {
    double sum = 0;
    for (int i = 0; i < samples; ++i) sum += mean * value(generator);
    return static_cast<float>(sum / samples);
  };
  for (int y = 0; y < p.height; ++y)
    for (int x = 0; x < p.width; ++x) {
      const size_t i = p.index(x, y);
      const double mean = gain * (0.2 + 0.01 * x + (x > 30 && y > 20 ? 2 : 0));
      p.half_a[i] = {half(mean), half(2 * mean), half(0.1)};
      p.half_b[i] = {half(mean), half(2 * mean), half(0.1)};
      p.pixels[i] = (p.half_a[i] + p.half_b[i]) * 0.5f;
    }
  return p;
}

TEST(image_metrics, errors_have_their_closed_forms) {
  const Picture a = constant(4, 2, {1.5f, 1, 0}), b = constant(4, 2, {1, 1, 0.5f});
  const auto mask = everything(a);
  EXPECT_DOUBLE_EQ(mse(a, b, mask), (0.25 + 0 + 0.25) / 3);
  EXPECT_DOUBLE_EQ(rel_mse(a, b, mask), (0.25 / 1.01 + 0 + 0.25 / 0.26) / 3);
  EXPECT_DOUBLE_EQ(mean_ratio(a, b, mask), 1);
  EXPECT_DOUBLE_EQ(mean_ratio(constant(4, 2, {3, 3, 3}), constant(4, 2, {2, 2, 2}), mask), 1.5);
  EXPECT_EQ(mse(a, a, mask), 0);
}

TEST(image_metrics, the_largest_difference_is_located) {
  Picture a = constant(5, 4, {1, 1, 1});
  const Picture b = a;
  a.pixels[a.index(3, 2)].g = -1;
  a.pixels[a.index(4, 3)].b = 2.5f;
  const LargestDifference d = largest_difference(a, b, everything(a));
  EXPECT_EQ(d.value, 2);
  EXPECT_EQ(d.x, 3);
  EXPECT_EQ(d.y, 2);
  EXPECT_EQ(d.channel, 1);
}

TEST(image_metrics, bits_are_compared_as_bits) {
  Picture a = constant(4, 4, {0, 1, 1}), b = a;
  EXPECT_EQ(differing_pixels(a, b), 0u);
  b.pixels[3].r = -0.0f;
  b.pixels[5].g = std::nextafter(1.0f, 2.0f);
  EXPECT_EQ(differing_pixels(a, b), 2u);
}

TEST(image_metrics, excluded_rectangles_and_pixels_that_are_not_finite_are_passed_over) {
  Picture a = constant(8, 8, {1, 1, 1});
  const Picture b = a;
  a.pixels[a.index(1, 1)] = {9, 9, 9};
  a.pixels[a.index(6, 6)] = {kNan, 1, 1};
  const auto mask = metric_mask(a, b, std::vector<Rectangle>{{0, 0, 2, 2}, {-5, 7, 100, 100}});
  EXPECT_EQ(std::count(mask.begin(), mask.end(), 0), 4 + 1 + 8);
  EXPECT_EQ(mse(a, b, mask), 0);
  EXPECT_EQ(not_finite_pixels(a), 1u);
}

TEST(image_metrics, block_means_correlate_after_one_scale) {
  Picture a = constant(64, 64, {0, 0, 0}), b = a;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const auto v = static_cast<float>(i % 64 / 16 + 1);
    a.pixels[i] = {v * 3, v * 3, v * 3}, b.pixels[i] = {v, v, v};
  }
  BlockComparison c = compare_blocks(a, b, everything(a), 16);
  EXPECT_EQ(c.block_count, 16u);
  EXPECT_NEAR(c.scale, 3, 1e-12);
  EXPECT_NEAR(c.correlation, 1, 1e-12);
  EXPECT_NEAR(c.relative_deviation, 0, 1e-7);  // the root of a rounding error
  for (size_t i = 0; i < a.pixels.size(); ++i) a.pixels[i] = Rgb{5, 5, 5} - b.pixels[i];
  c = compare_blocks(a, b, everything(a), 16);
  EXPECT_NEAR(c.correlation, -1, 1e-12);
}

TEST(image_metrics, blocks_that_are_mostly_excluded_do_not_count) {
  const Picture a = constant(64, 32, {1, 2, 3});
  const auto mask = metric_mask(a, a, std::vector<Rectangle>{{0, 0, 32, 17}});
  EXPECT_EQ(compare_blocks(a, a, mask, 32).block_count, 1u);
  EXPECT_EQ(compare_blocks(a, a, mask, 32).correlation, 1);  // of three different channels
}

// Values of the distribution's tables: t(0.975; 1) = 12.7062, t(0.995; 10) = 3.16927, normal 1.95996.
TEST(statistical_equality, students_distribution_has_its_tabulated_values) {
  EXPECT_NEAR(student_two_sided(12.7062, 1), 0.05, 1e-6);
  EXPECT_NEAR(student_two_sided(3.16927, 10), 0.01, 1e-6);
  EXPECT_NEAR(student_two_sided(1.95996, 1e7), 0.05, 1e-5);
  EXPECT_NEAR(student_two_sided(0.3, 2), 0.7924, 1e-4);  // 1 - t / sqrt(2 + t^2)
  EXPECT_EQ(student_two_sided(0, 5), 1);
  EXPECT_NEAR(student_two_sided(1e4, 1) / (2 / (M_PI * 1e4)), 1, 1e-6);  // Cauchy's tail
}

TEST(statistical_equality, sidaks_level_holds_for_all_together) {
  EXPECT_NEAR(1 - std::pow(1 - sidak_level(0.05, 100), 100), 0.05, 1e-12);
  EXPECT_DOUBLE_EQ(sidak_level(0.05, 1), 0.05);
}

// At a significance of 1 % for blocks and for pixels, 40 equal pairs fail 0.8 times on average; 6 or more of them would
// have a probability below 1e-3.
TEST(statistical_equality, pictures_of_one_scene_are_equal_though_their_noise_differs) {
  int failed = 0;
  for (uint32_t seed = 0; seed < 40; ++seed) {
    const Picture a = noisy(2 * seed), b = noisy(2 * seed + 1);
    ASSERT_GT(differing_pixels(a, b), 3000u);
    failed += !statistical_equality(a, b, everything(a)).equal;
  }
  EXPECT_LE(failed, 5);
}

TEST(statistical_equality, pictures_of_different_sample_counts_are_equal) {
  const Picture a = noisy(1, 32), b = noisy(2, 256);
  EXPECT_TRUE(statistical_equality(a, b, everything(a)).equal);
}

TEST(statistical_equality, a_difference_in_scale_is_found_by_blocks) {
  // A block's mean has a standard error of about 1 / sqrt(64 * 64) = 1.6 %; ten per cent are 6 of them in each block.
  const Picture a = noisy(1), b = noisy(2, 32, 1.1f);
  const EqualityReport report = statistical_equality(a, b, everything(a));
  EXPECT_FALSE(report.equal);
  EXPECT_GT(report.failing_blocks, 10u);
}

TEST(statistical_equality, one_wrong_pixel_is_found) {
  const Picture a = noisy(1);
  Picture b = noisy(2);
  const size_t i = b.index(7, 40);
  for (auto* pixels : {&b.pixels, &b.half_a, &b.half_b}) (*pixels)[i] += {2, 2, 2};
  const EqualityReport report = statistical_equality(a, b, everything(a));
  EXPECT_FALSE(report.equal);
  EXPECT_GE(report.failing_pixels, 1u);
  auto mask = everything(a);
  mask[i] = 0;
  EXPECT_TRUE(statistical_equality(a, b, mask).equal);
}

TEST(statistical_equality, a_faint_seam_is_found_as_a_cluster) {
  const Picture a = noisy(3, 64);
  Picture b = noisy(4, 64);
  for (int x = 8; x < 24; ++x)
    for (auto* pixels : {&b.pixels, &b.half_a, &b.half_b}) (*pixels)[b.index(x, 10)] *= {1.6f, 1.6f, 1.6f};
  EXPECT_GT(statistical_equality(a, b, everything(a)).largest_cluster, kLargestCluster);
}

TEST(statistical_equality, noiseless_pictures_may_differ_by_float_rounding_only) {
  Picture a = constant(16, 16, {0.7f, 0.7f, 0.7f});
  a.half_a = a.half_b = a.pixels;
  Picture b = a;
  b.pixels[5].r = std::nextafter(0.7f, 1.0f);
  EXPECT_TRUE(statistical_equality(a, b, everything(a)).equal);
  b.pixels[5].r = 0.70001f;
  EXPECT_FALSE(statistical_equality(a, b, everything(a)).equal);
}

TEST(flip, is_zero_for_equal_pictures_and_symmetric) {
  const Picture a = noisy(1), b = noisy(2);
  for (const float v : flip(a, a)) ASSERT_EQ(v, 0);
  EXPECT_EQ(flip(a, b), flip(b, a));
}

// Without features FLIP is the redistributed HyAB distance. Black to white: |L| = 100, so 100^0.7 = 25.12; green to
// blue is the largest, 41.26 (203.3^0.7 with Hunt's effect); the result 0.95 + 0.05 (25.12 - 16.50) / (41.26 - 16.50).
TEST(flip, of_constant_pictures_is_the_colour_distance) {
  const auto of = [](Rgb a, Rgb b) { return flip(constant(50, 40, a), constant(50, 40, b))[1000]; };
  EXPECT_NEAR(of({0, 0, 0}, {1, 1, 1}), 0.9674, 2e-4);
  EXPECT_NEAR(of({0, 1, 0}, {0, 0, 1}), 1, 1e-5);
  EXPECT_LT(of({0.5f, 0.5f, 0.5f}, {0.51f, 0.51f, 0.51f}), 0.1f);
  EXPECT_EQ(of({5, 5, 5}, {1, 1, 1}), 0);  // beyond the display
}

TEST(flip, an_edge_counts_more_than_its_colour) {
  Picture flat = constant(64, 64, {0.2f, 0.2f, 0.2f}), line = flat;
  for (int y = 0; y < 64; ++y) line.pixels[line.index(32, y)] = {0.5f, 0.5f, 0.5f};
  const auto map = flip(flat, line);
  EXPECT_GT(map[line.index(32, 32)], 0.3f);
  EXPECT_EQ(map[line.index(2, 32)], 0);  // 30 pixels off: outside of all filters
}

TEST(compare_pictures, the_verdict_follows_the_limits) {
  const Picture a = noisy(1), b = noisy(2);
  const auto verdict = [&](const Picture& p, const Picture& q, CompareLimits limits) {
    const auto c = compare_pictures(p, q, {.limits = limits});
    EXPECT_TRUE(c) << c.error().message;
    return c && c->equal;
  };
  EXPECT_TRUE(verdict(a, a, {}));
  EXPECT_TRUE(verdict(a, b, {}));  // statistically
  EXPECT_FALSE(verdict(a, b, {.same_bits = true}));
  EXPECT_FALSE(verdict(a, b, {.rel_mse = 1e-9}));
  EXPECT_TRUE(verdict(a, b, {.rel_mse = 1.0}));
  EXPECT_FALSE(verdict(a, b, {.flip = 1e-6}));
  EXPECT_FALSE(verdict(a, b, {.correlation = 1.0}));
  EXPECT_TRUE(verdict(a, b, {.correlation = 0.9, .mean_deviation = 0.1}));
  EXPECT_FALSE(verdict(a, noisy(2, 32, 1.5f), {.mean_deviation = 0.1}));
  Picture plain = b;
  plain.half_a.clear(), plain.half_b.clear();
  EXPECT_FALSE(verdict(a, plain, {}));  // nothing to tell the noise by: bits decide
  EXPECT_FALSE(compare_pictures(a, plain, {.limits = {.statistical = true}}));
  EXPECT_FALSE(compare_pictures(a, constant(3, 3, {}), {}));
}

TEST(compare_pictures, a_pixel_that_is_not_finite_is_a_difference) {
  Picture a = noisy(1);
  a.pixels[10].r = kNan;
  const auto c = compare_pictures(a, noisy(1), {.limits = {.rel_mse = 10.0}});
  ASSERT_TRUE(c);
  EXPECT_FALSE(c->equal);
  EXPECT_TRUE(std::isfinite(c->rel_mse));
}

TEST(picture, files_come_back_with_their_half_buffers) {
  const auto path = std::filesystem::temp_directory_path() / ("spillway_picture_" + std::to_string(getpid()) + ".exr");
  OIIO::ImageSpec spec(2, 1, 9, OIIO::TypeDesc::FLOAT);
  spec.channelnames = {"R", "G", "B", "halfA.R", "halfA.G", "halfA.B", "halfB.R", "halfB.G", "halfB.B"};
  spec.attribute("spillway:half_a_spp", 3);
  spec.attribute("spillway:half_b_spp", 1);
  const float values[18] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18};
  const auto output = OIIO::ImageOutput::create("openexr");
  ASSERT_TRUE(output->open(path.string(), spec));
  ASSERT_TRUE(output->write_image(OIIO::TypeDesc::FLOAT, values) && output->close());
  const auto picture = read_picture(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(picture) << picture.error().message;
  EXPECT_EQ(picture->pixels[1], (Rgb{10, 11, 12}));
  ASSERT_TRUE(picture->has_halves());
  EXPECT_EQ(picture->half_a[0], (Rgb{4, 5, 6}));
  EXPECT_EQ(picture->half_b[1], (Rgb{16, 17, 18}));
  EXPECT_EQ(picture->weight_a, 0.75);
  EXPECT_FALSE(read_picture(path));
}

}  // namespace
}  // namespace spillway::tools
