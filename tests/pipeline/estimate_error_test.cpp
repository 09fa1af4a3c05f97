// The error that two halves tell of, on films whose answer is known, and renders that stop by it.

#include "pipeline/render/estimate_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "cache/base/parallel.h"
#include "pipeline/render/render_image.h"
#include "tests/support/small_scene.h"

namespace spillway::test {
namespace {

using namespace pipeline;

// A film of one sample a half and pixel, whose values are value(x, y, half).
template <class Value>
Film film_of(const FilmWindow& window, const Value& value) {
  FilmShape shape;
  shape.full_width = shape.full_height = 64, shape.window = window;
  auto film = Film::create(shape, {});
  EXPECT_TRUE(film);
  for (const uint32_t half : {0u, 1u})
    for (uint32_t y = window.y0; y < window.y1; ++y)
      for (uint32_t x = window.x0; x < window.x1; ++x) {
        const SplatRecord splat{y * 64 + x, half, 0, value(x, y, half)};
        film->add({&splat, 1});
      }
  film->set_half_samples(0, 1), film->set_half_samples(1, 1);
  return std::move(*film);
}

TEST(EstimateError, of_equal_pixels_is_the_squared_difference_over_four) {
  for (const FilmWindow window : {FilmWindow{0, 0, 64, 64}, FilmWindow{5, 9, 6, 10}, FilmWindow{60, 0, 64, 64}}) {
    const auto error = estimate_error(film_of(window, [](uint32_t, uint32_t, uint32_t half) {
      return half == 0 ? Rgb{1.1f, 2.2f, 0} : Rgb{0.9f, 1.8f, 0};
    }));
    ASSERT_TRUE(error);
    EXPECT_NEAR(error->rel_mse, (0.01 / 1.01 + 0.04 / 4.01) / 3, 1e-6);
    EXPECT_NEAR(error->standard_error, 0, 1e-5);
    EXPECT_NEAR(error->relative_error(), std::sqrt(error->rel_mse), 1e-9);
  }
}

TEST(EstimateError, is_nothing_while_a_half_has_no_samples) {
  Film film = film_of({0, 0, 64, 64}, [](uint32_t, uint32_t, uint32_t) { return Rgb{1, 1, 1}; });
  EXPECT_EQ(estimate_error(film)->rel_mse, 0);
  film.set_half_samples(1, 0);
  EXPECT_FALSE(estimate_error(film));
}

// Normal noise of 10 % on a ramp: the estimate is right within 10 %, and the picture's own error is below the bound in
// 95 of 100 pictures, less four standard deviations of that count.
TEST(EstimateError, of_normal_noise_is_its_variance_and_the_bound_holds) {
  std::mt19937 engine(1);
  std::normal_distribution<float> normal;
  const auto truth = [](uint32_t x) { return 0.2f + static_cast<float>(x) / 16; };
  int below = 0;
  double mean_ratio = 0;
  for (int picture = 0; picture < 100; ++picture) {
    const Film film = film_of({0, 0, 64, 32}, [&](uint32_t x, uint32_t, uint32_t) {
      const float v = truth(x);
      return Rgb{v * (1 + 0.1f * normal(engine)), v * (1 + 0.1f * normal(engine)), v * (1 + 0.1f * normal(engine))};
    });
    double own = 0, expected = 0;
    for (uint32_t y = 0; y < 32; ++y)
      for (uint32_t x = 0; x < 64; ++x) {
        const double t = truth(x), square = t * t + kRelativeErrorEpsilon;
        const Rgb p = film.pixel(x, y);
        own += ((p.r - t) * (p.r - t) + (p.g - t) * (p.g - t) + (p.b - t) * (p.b - t)) / 3 / square / 2048;
        expected += 0.01 * t * t / 2 / square / 2048;
      }
    const auto error = estimate_error(film);
    EXPECT_NEAR(error->relative_error() / std::sqrt(expected), 1, 0.1);
    mean_ratio += std::sqrt(error->rel_mse / expected) / 100;
    below += std::sqrt(own) <= error->relative_error_bound();
  }
  EXPECT_GE(below, 95 - 9);  // four deviations of a binomial count of 100 at 95 % are 8.7
  EXPECT_LE(mean_ratio, 1.05);
  EXPECT_GE(mean_ratio, 1.0);  // the lesser square: rather too large
}

// One sample of a thousand times the light: divided by its own square, its error would be one.
TEST(EstimateError, of_a_stray_sample_is_not_hidden_by_its_own_light) {
  const auto error = estimate_error(film_of({0, 0, 64, 64}, [](uint32_t x, uint32_t y, uint32_t half) {
    const float v = x == 20 && y == 20 && half == 1 ? 1000.0f : 1.0f;
    return Rgb{v, v, v};
  }));
  EXPECT_NEAR(error->rel_mse, 999.0 * 999 / 4 / 1.01 / 4096, 0.01);
  EXPECT_GT(error->standard_error, 0.9 * error->rel_mse);
}

class StopAtError : public testing::Test {
 protected:
  StopAtError() {
    auto store = pack_small_scene(directory_.path(), "scene", {});
    EXPECT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
    options_.settings = store_->settings();
    options_.settings.render.samples_per_pixel = 4096;
    options_.scratch_directory = directory_.path();
    options_.error = 0.35;
  }
  RenderedImage render(const RenderOptions& o, int threads = 2) const {
    Result<RenderedImage> image = on_threads(threads, [&] { return render_image(*store_, o); });
    EXPECT_TRUE(image) << image.error().message;
    return image ? std::move(*image) : RenderedImage{};
  }
  TemporaryDirectory directory_;
  std::unique_ptr<Store> store_;
  RenderOptions options_;
};

TEST_F(StopAtError, has_the_bits_of_as_many_samples_and_the_same_count_for_any_machine) {
  const RenderedImage image = render(options_);
  const RenderReport& report = image.report;
  ASSERT_EQ(report.ended_by, RenderEnd::error);
  EXPECT_LE(report.error->relative_error_bound(), options_.error);
  EXPECT_GT(report.samples_per_pixel, 2 * kFirstCheckedSamples);
  EXPECT_LT(report.samples_per_pixel, 4096u);
  EXPECT_FALSE(report.stopped_early());
  RenderOptions plain = options_;
  plain.error = 0, plain.settings.render.samples_per_pixel = report.samples_per_pixel;
  const RenderedImage same = render(plain);
  EXPECT_EQ(same.report.image_hash, report.image_hash);
  EXPECT_EQ(same.report.error->rel_mse, report.error->rel_mse);
  EXPECT_EQ(same.report.ended_by, RenderEnd::samples);

  RenderOptions o = options_;
  o.plan.wave_paths = 100000;  // epochs of a plain render would fill such a wave
  EXPECT_EQ(render(o, 1).report.image_hash, report.image_hash);
  o.plan.wave_paths = 999, o.plan.page_bytes = 100000, o.plan.spill = 1;
  const RenderedImage small = render(o, 7);
  EXPECT_EQ(small.report.image_hash, report.image_hash);
  EXPECT_EQ(small.report.error->rel_mse, report.error->rel_mse);
  EXPECT_GT(small.report.spilled_bytes, 0u);
}

TEST_F(StopAtError, is_not_reached_before_the_samples_or_the_time_are_over) {
  RenderOptions o = options_;
  o.settings.render.samples_per_pixel = 21, o.error = 1e-3;
  const RenderedImage capped = render(o);
  EXPECT_EQ(capped.report.ended_by, RenderEnd::samples);
  EXPECT_EQ(capped.report.half_samples, (std::array<uint32_t, 2>{11, 10}));
  EXPECT_GT(capped.report.error->relative_error_bound(), o.error);
  o = options_, o.error = 1e-5, o.time_limit_seconds = 1e-3;
  const RenderedImage late = render(o);
  EXPECT_EQ(late.report.ended_by, RenderEnd::time);
  EXPECT_EQ(late.report.half_samples[0], late.report.half_samples[1]);
  EXPECT_EQ(late.report.half_samples[0], kFirstCheckedSamples);
  RenderOptions plain = options_;
  plain.error = 0, plain.settings.render.samples_per_pixel = late.report.samples_per_pixel;
  EXPECT_EQ(render(plain).report.image_hash, late.report.image_hash);
}

}  // namespace
}  // namespace spillway::test
