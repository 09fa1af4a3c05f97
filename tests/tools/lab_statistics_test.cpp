// Bands, slopes and efficiencies of numbers whose answers are known; charts and pictures that a page can hold.

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <fstream>

#include "tests/support/random.h"
#include "tests/support/small_scene.h"
#include "tools/lab/chart.h"
#include "tools/lab/png.h"
#include "tools/lab/results.h"
#include "tools/lab/summarize.h"

namespace spillway::tools::lab {
namespace {

TEST(LabStatistics, quantiles_are_those_of_the_tables) {
  EXPECT_NEAR(student_quantile(1), 12.706, 1e-3);
  EXPECT_NEAR(student_quantile(3), 3.182, 1e-3);
  EXPECT_NEAR(student_quantile(9), 2.262, 1e-3);
  EXPECT_NEAR(student_quantile(1e6), 1.960, 1e-3);
}

// A band of 95 % holds the mean 95 times in a hundred, for any number of seeds.
TEST(LabStatistics, bands_hold_the_mean_as_often_as_they_say) {
  test::Random u(5);
  const auto normal = [&] { return std::sqrt(-2 * std::log(1 - u())) * std::cos(2 * M_PI * u()); };
  for (const int seeds : {3, 4, 8}) {
    int held = 0;
    constexpr int kTrials = 4000;
    for (int trial = 0; trial < kTrials; ++trial) {
      std::vector<double> values;
      for (int i = 0; i < seeds; ++i) values.push_back(1 + 0.05 * normal());
      const Band band = band_of(values);
      held += band.low <= 1 && 1 <= band.high;
    }
    // Four standard errors of the share, and a hundredth for the logarithm.
    EXPECT_NEAR(held / static_cast<double>(kTrials), 0.95, 4 * std::sqrt(0.95 * 0.05 / kTrials) + 0.01) << seeds;
  }
  const Band alone = band_of(std::vector{2.0});
  EXPECT_EQ(alone.low, 2);
  EXPECT_EQ(alone.high, 2);
}

TEST(LabStatistics, a_power_law_is_found_again) {
  const std::vector<Point> points = {{1, 8}, {4, 2}, {16, 0.5}, {0, 3}, {64, 0}};  // two that no logarithm has
  const PowerLaw law = fit_power_law(points);
  ASSERT_TRUE(law.is_known);
  EXPECT_NEAR(law.slope, -1, 1e-12);
  EXPECT_NEAR(law.at(2), 4, 1e-12);
  EXPECT_NEAR(law.x_of(0.25), 32, 1e-9);
  EXPECT_FALSE(fit_power_law(std::vector<Point>{{2, 1}, {2, 3}}).is_known);
  const Slope slope = slope_of(std::vector<std::vector<Point>>{{{1, 1}, {10, 0.1}}, {{1, 1}, {10, 0.01}}});
  EXPECT_NEAR(slope.value, -1.5, 1e-12);
  EXPECT_NEAR(slope.half_width, 12.706 * 0.5, 1e-2);  // two values 1 apart: deviation of their mean 0.5
}

Picture flat(float value) {
  Picture p;
  p.width = 4, p.height = 2;
  p.pixels.assign(8, {value, value, value});
  return p;
}

TEST(LabStatistics, the_variance_over_seeds_is_weighed_as_the_error_is) {
  PixelVariance variance;
  for (const float v : {1.0f, 2.0f, 4.0f}) variance.add(flat(v));
  // 1, 2, 4: mean 7/3, squares 14/3, over n - 1: 7/3.
  EXPECT_NEAR(variance.relative_to(flat(0.3f)), 7.0 / 3 / (0.09 + 0.01), 1e-4);
  PixelVariance one;
  one.add(flat(1));
  EXPECT_EQ(one.relative_to(flat(1)), 0);
}

Measurement row(const char* configuration, uint32_t spp, uint32_t seed, double seconds, double error,
                const char* hash = "a") {
  Measurement m;
  m.configuration = configuration, m.spp = spp, m.seed = seed, m.samples = spp * 100.0;
  m.seconds = seconds, m.rel_mse = error, m.flip = std::sqrt(error), m.image_hash = hash;
  return m;
}

Curve curve(const char* name, double seconds_a_sample, double error_of_one) {
  Curve c;
  c.name = name;
  std::vector<Measurement> all;
  for (const uint32_t spp : {1u, 4u, 16u, 64u}) {
    std::vector<Measurement> rows;
    for (uint32_t seed = 1; seed <= 3; ++seed)
      rows.push_back(row(name, spp, seed, seconds_a_sample * spp, error_of_one / spp));
    c.points.push_back(curve_point(rows, error_of_one / spp, 1e-5));
    all.insert(all.end(), rows.begin(), rows.end());
  }
  fit_curve(all, c);
  return c;
}

TEST(LabStatistics, twice_the_error_at_the_same_speed_takes_twice_the_time) {
  AxisResult result;
  result.curves = {curve("a", 0.5, 1), curve("b", 0.5, 2), curve("c", 0.25, 1)};
  compare_at_equal_error(result);
  EXPECT_NEAR(result.curves[0].slope.value, -1, 1e-9);
  EXPECT_NEAR(result.equal_error, 1.0 / 8, 1e-9);
  EXPECT_NEAR(result.curves[1].equal_error_seconds / result.curves[0].equal_error_seconds, 2, 1e-9);
  EXPECT_NEAR(result.curves[2].equal_error_seconds / result.curves[0].equal_error_seconds, 0.5, 1e-9);
  EXPECT_NEAR(result.curves[0].points[1].efficiency, 1 / (0.25 * 2), 1e-9);
  EXPECT_TRUE(verdict(result).starts_with("To an error of 0.125: c in 2 s, a in 2.00 times that, b in 4.00"))
      << verdict(result);
}

TEST(LabStatistics, points_in_the_noise_of_the_reference_are_left_out_of_slopes) {
  Curve c;
  c.name = "a";
  std::vector<Measurement> all;
  for (const uint32_t spp : {1u, 4u, 16u, 64u}) {
    const std::vector<Measurement> rows = {row("a", spp, 1, spp, std::max(1.0 / spp, 0.1))};
    c.points.push_back(curve_point(rows, 0, 0.05));
    all.push_back(rows.front());
  }
  fit_curve(all, c);
  EXPECT_NEAR(c.slope.value, -1, 1e-9);
  EXPECT_TRUE(c.points[1].is_above_reference_noise);
  EXPECT_FALSE(c.points[2].is_above_reference_noise);
}

TEST(LabStatistics, pictures_that_must_be_equal_and_are_not_are_a_defect) {
  EXPECT_TRUE(equality_of_bits(std::vector{row("a", 1, 1, 1, 1), row("b", 1, 1, 1, 1), row("a", 1, 2, 1, 1, "c")})
                  .starts_with("All 2"));
  EXPECT_TRUE(equality_of_bits(std::vector{row("a", 1, 1, 1, 1), row("b", 1, 1, 1, 1, "x")}).starts_with("DEFECT"));
}

TEST(LabChart, holds_its_points_and_nothing_that_a_page_could_trip_over) {
  Chart chart{.title = "a < b & \"c\"", .x_title = "x", .y_title = "y", .series = {}};
  chart.series = {{"one", {{1, 10, 8, 12}, {10, 1, 0.8, 1.2}, {100, 0, 0, 0}}},
                  {"theory", {{1, 10}, {100, 0.1}}, true}};
  const std::string svg = to_svg(chart);
  EXPECT_NE(svg.find("a &lt; b &amp; &quot;c&quot;"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
  size_t circles = 0;
  for (size_t at = 0; (at = svg.find("<circle", at)) != std::string::npos; ++at) ++circles;
  EXPECT_EQ(circles, 3u);  // two points and the legend: zero has no logarithm
  for (const Chart& empty : {Chart{}, Chart{.title = "t", .x_title = {}, .y_title = {}, .series = {{"s", {{0, 0}}}}}})
    EXPECT_NE(to_svg(empty).find("nothing to show"), std::string::npos);
  const Chart one{.title = "t", .x_title = {}, .y_title = {}, .series = {{"s", {{5, 5}}}}};
  EXPECT_EQ(to_svg(one).find("nan"), std::string::npos);
}

TEST(LabPng, is_what_libpng_reads_and_base64_what_everybody_does) {
  const std::vector<uint8_t> rgb = {255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 8, 7};
  const std::vector<uint8_t> bytes = png(2, 2, rgb);
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "a.png";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  const auto picture = read_picture(path);
  ASSERT_TRUE(picture) << picture.error().message;
  ASSERT_EQ(picture->width, 2);
  ASSERT_EQ(picture->height, 2);
  EXPECT_EQ(picture->pixels[0].r, 1);
  EXPECT_EQ(picture->pixels[1].g, 1);
  EXPECT_EQ(picture->pixels[2].b, 1);
  const auto base64 = [](const std::string& text) {
    return data_url({reinterpret_cast<const uint8_t*>(text.data()), text.size()}).substr(22);
  };
  EXPECT_EQ(base64("Man"), "TWFu");
  EXPECT_EQ(base64("Ma"), "TWE=");
  EXPECT_EQ(base64("M"), "TQ==");
  EXPECT_EQ(base64(""), "");
}

TEST(LabPeers, are_read_or_refused_where_they_are_wrong) {
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "peers.csv";
  const std::string header = "scene,renderer,spp,seed,seconds,peak_bytes,rel_mse,flip\n";
  const auto read = [&](const std::string& text) {
    std::ofstream(path, std::ios::binary) << text;
    return read_peers(path);
  };
  const auto good = read(header + "box,\"Mitsuba, \"\"llvm\"\"\",16,1,0.5,1e8,0.01,0.1\n");
  ASSERT_TRUE(good) << good.error().message;
  ASSERT_EQ(good->size(), 1u);
  EXPECT_EQ(good->front().renderer, "Mitsuba, \"llvm\"");
  EXPECT_EQ(read(header)->size(), 0u);
  for (const char* bad : {"box,m,16,1,0.5,1e8,0.01", "box,m,16,1,0.5,1e8,0.01,x", "box,m,0,1,0.5,1e8,0.01,1",
                          "box,m,1,1,nan,1,1,1", "box,m,1,1,-1,1,1,1", "\"box,m,1,1,1,1,1,1"}) {
    const auto refused = read(header + bad + "\n");
    ASSERT_FALSE(refused) << bad;
    EXPECT_NE(refused.error().message.find("peers.csv:2"), std::string::npos) << refused.error().message;
  }
  EXPECT_FALSE(read("scene\n"));
  EXPECT_FALSE(read_peers(directory.path() / "none.csv"));
}

}  // namespace
}  // namespace spillway::tools::lab
