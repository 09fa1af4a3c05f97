// Images through packing and the cache: a value that was written is a value that is looked up.

#include "pipeline/pack/image_decoder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>

#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

using cache::Texel;
using cache::TexelEncoding;
using cache::TexelFilter;
using cache::TextureCache;
using cache::TextureRequest;
using cache::WrapMode;

constexpr uint32_t kWidth = 150, kHeight = 70;  // three by two tiles, the last ones cut

uint8_t byte_at(uint32_t x, uint32_t y, int channel) { return static_cast<uint8_t>((x * 7 + y * 13 + static_cast<uint32_t>(channel) * 50) % 256); }

class PackImageTest : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream file(source_, std::ios::binary);
    file << "P6\n" << kWidth << ' ' << kHeight << "\n255\n";
    for (uint32_t y = 0; y < kHeight; ++y)
      for (uint32_t x = 0; x < kWidth; ++x)
        for (int c = 0; c < 3; ++c) file.put(static_cast<char>(byte_at(x, y, c)));
  }
  Result<cache::ImageInfo> pack(const std::string& folder = "textures", TexelEncoding encoding = TexelEncoding::linear) {
    return decoder_.pack(source_, encoding, directory_.path() / folder, 0);
  }
  std::unique_ptr<TextureCache> open(const cache::ImageInfo& info, uint64_t limit = 64 << 20) {
    auto cache = TextureCache::open(directory_.path() / "textures", std::span(&info, 1), {.memory_limit_bytes = limit});
    EXPECT_TRUE(cache) << cache.error().message;
    return std::move(*cache);
  }
  static Texel look_up(TextureCache& cache, const TextureRequest& request) {
    Texel texel{};
    const Status status = cache.look_up(std::span(&request, 1), std::span(&texel, 1));
    EXPECT_TRUE(status) << status.error().message;
    return texel;
  }
  static TextureRequest at(double x, double y, TexelFilter filter, WrapMode wrap = WrapMode::repeat, float width = 0) {
    return {0, wrap, filter, static_cast<float>(x / kWidth), static_cast<float>(1 - y / kHeight), width};
  }
  std::string bytes(const std::string& name) const {
    std::ifstream stream(directory_.path() / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

  test::TemporaryDirectory directory_;
  const std::filesystem::path source_ = directory_.path() / "image.ppm";
  ImageDecoder decoder_;
};

TEST_F(PackImageTest, every_texel_comes_back) {
  const auto info = pack();
  ASSERT_TRUE(info) << info.error().message;
  EXPECT_EQ(info->width, kWidth);
  EXPECT_EQ(info->height, kHeight);
  EXPECT_EQ(info->levels, 8u);  // 150, 75, 37, 18, 9, 4, 2, 1
  const auto cache = open(*info);
  for (uint32_t y = 0; y < kHeight; ++y)
    for (uint32_t x = 0; x < kWidth; ++x) {
      const Texel texel = look_up(*cache, at(x + 0.5, y + 0.5, TexelFilter::point));
      for (int c = 0; c < 3; ++c) ASSERT_EQ(texel.value[c], static_cast<float>(byte_at(x, y, c)) / 255) << x << ' ' << y;
      ASSERT_EQ(texel.value[3], 1);
    }
}

TEST_F(PackImageTest, srgb_texels_come_out_linear) {
  const auto info = pack("textures", TexelEncoding::srgb);
  ASSERT_TRUE(info);
  const Texel texel = look_up(*open(*info), at(20.5, 30.5, TexelFilter::point));
  EXPECT_EQ(texel.value[0], cache::linear_from_srgb(static_cast<float>(byte_at(20, 30, 0)) / 255));
}

TEST_F(PackImageTest, bilinear_values_lie_between_their_neighbours) {
  const auto info = pack();
  ASSERT_TRUE(info);
  const auto cache = open(*info);
  const auto value = [](uint32_t x, uint32_t y) { return byte_at(x, y, 0) / 255.0; };
  for (const auto& [x, y] : {std::pair{63u, 20u}, {10u, 63u}, {127u, 40u}}) {  // across edges of tiles too
    const Texel texel = look_up(*cache, at(x + 0.75, y + 0.9, TexelFilter::bilinear));
    const double wanted = 0.6 * (0.75 * value(x, y) + 0.25 * value(x + 1, y)) + 0.4 * (0.75 * value(x, y + 1) + 0.25 * value(x + 1, y + 1));
    EXPECT_NEAR(texel.value[0], wanted, 2e-4) << x << ' ' << y;  // u and v have 24 bits for 150 texels
  }
}

TEST_F(PackImageTest, beyond_the_edge_is_what_the_wrap_mode_says) {
  const auto info = pack();
  ASSERT_TRUE(info);
  const auto cache = open(*info);
  const auto point = [&](double x, double y, WrapMode wrap) { return look_up(*cache, at(x, y, TexelFilter::point, wrap)).value[1]; };
  EXPECT_EQ(point(kWidth + 3.5, 5.5, WrapMode::repeat), static_cast<float>(byte_at(3, 5, 1)) / 255);
  EXPECT_EQ(point(-0.5, 5.5, WrapMode::repeat), static_cast<float>(byte_at(kWidth - 1, 5, 1)) / 255);
  EXPECT_EQ(point(kWidth + 30.5, 5.5, WrapMode::clamp), static_cast<float>(byte_at(kWidth - 1, 5, 1)) / 255);
  EXPECT_EQ(point(20.5, -8.5, WrapMode::clamp), static_cast<float>(byte_at(20, 0, 1)) / 255);
  EXPECT_EQ(point(-3.5, 5.5, WrapMode::black), 0);
}

TEST_F(PackImageTest, the_first_texel_follows_the_last_where_an_image_repeats) {
  const auto info = pack();
  ASSERT_TRUE(info);
  const auto cache = open(*info);
  const double first = byte_at(0, 5, 0) / 255.0, last = byte_at(kWidth - 1, 5, 0) / 255.0;
  EXPECT_NEAR(look_up(*cache, at(0.25, 5.5, TexelFilter::bilinear)).value[0], 0.75 * first + 0.25 * last, 2e-4);
  EXPECT_NEAR(look_up(*cache, at(kWidth - 0.25, 5.5, TexelFilter::bilinear)).value[0], 0.25 * first + 0.75 * last, 2e-4);
  const double top = byte_at(9, 0, 0) / 255.0, bottom = byte_at(9, kHeight - 1, 0) / 255.0;
  EXPECT_NEAR(look_up(*cache, at(9.5, 0.25, TexelFilter::bilinear)).value[0], 0.75 * top + 0.25 * bottom, 2e-4);
}

TEST_F(PackImageTest, a_footprint_of_two_texels_sees_the_second_level) {
  const auto info = pack();
  ASSERT_TRUE(info);
  const auto cache = open(*info);
  const auto seen = [&](double texels) {
    const auto width_uv = static_cast<float>(texels / kWidth);
    return look_up(*cache, at(36.5, 0.5, TexelFilter::point, WrapMode::repeat, width_uv)).value[0] * 255;
  };
  const auto mean = [](uint32_t size) {  // of the texels that (36, 0) is averaged with
    uint32_t sum = 0;
    for (uint32_t y = 0; y < size; ++y)
      for (uint32_t x = 0; x < size; ++x) sum += byte_at(36 / size * size + x, y, 0);
    return static_cast<float>(sum) / static_cast<float>(size * size);
  };
  EXPECT_EQ(seen(0.5), byte_at(36, 0, 0));
  EXPECT_EQ(seen(1.9), byte_at(36, 0, 0));
  EXPECT_NEAR(seen(2.1), mean(2), 0.501f);  // rounded to 8 bits
  EXPECT_NEAR(seen(3.9), mean(2), 0.501f);
  EXPECT_GT(std::fabs(mean(2) - static_cast<float>(byte_at(36, 0, 0))), 100);
}

TEST_F(PackImageTest, a_footprint_of_the_whole_image_sees_its_mean) {
  const auto info = pack();
  ASSERT_TRUE(info);
  const auto cache = open(*info);
  const Texel texel = look_up(*cache, at(75, 35, TexelFilter::trilinear, WrapMode::repeat, 4));
  // 8 bits a level, rounded on each of seven levels.
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(texel.value[c], info->mean[c], 7 * 0.5 / 255 + 0.01);
}

TEST_F(PackImageTest, a_small_cache_gives_the_same_values_and_reads_again) {
  const auto info = pack();
  ASSERT_TRUE(info);
  std::vector<float> values[2];
  for (const int small : {0, 1}) {
    const auto cache = open(*info, small ? 1 << 16 : 64 << 20);
    for (uint32_t i = 0; i < 2000; ++i)
      values[small].push_back(look_up(*cache, at((i * 61) % kWidth + 0.3, (i * 37) % kHeight + 0.8, TexelFilter::bilinear)).value[2]);
  }
  EXPECT_EQ(values[0], values[1]);
}

TEST_F(PackImageTest, the_same_image_makes_the_same_bytes) {
  ASSERT_TRUE(pack("first"));
  ASSERT_TRUE(pack("second"));
  EXPECT_EQ(bytes("first/00000.tif"), bytes("second/00000.tif"));
}

TEST_F(PackImageTest, damaged_absurd_and_missing_images_are_refused_by_name_and_leave_nothing) {
  const std::string whole = bytes("image.ppm");
  const auto refused = [&](const std::string& content) {
    std::ofstream(source_, std::ios::binary).write(content.data(), static_cast<std::streamsize>(content.size()));
    const auto info = pack("refused");
    EXPECT_FALSE(info);
    EXPECT_TRUE(info || info.error().message.find("image.ppm") != std::string::npos);
    EXPECT_TRUE(std::filesystem::is_empty(directory_.path() / "refused"));
  };
  refused(whole.substr(0, whole.size() / 2));
  refused(whole.substr(0, 9));
  refused("");
  refused("P6\n2000000000 2000000000\n255\n");
  refused(std::string(5000, 'x'));
  std::filesystem::remove(source_);
  EXPECT_FALSE(pack("refused"));
}

#ifndef __SANITIZE_ADDRESS__  // where the address space has no limit
TEST_F(PackImageTest, an_image_that_needs_more_memory_than_its_decoder_may_take_is_refused_and_the_next_one_packed) {
  std::ofstream(source_, std::ios::binary) << "P6\n8000 8000\n255\n" << std::string(3ull * 8000 * 8000, 'x');
  ImageDecoder small({.memory_limit_bytes = 2ull << 30});
  const auto refused = small.pack(source_, TexelEncoding::linear, directory_.path() / "textures", 0);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("image.ppm"), std::string::npos) << refused.error().message;
  EXPECT_TRUE(std::filesystem::is_empty(directory_.path() / "textures"));
  SetUp();
  const auto packed = small.pack(source_, TexelEncoding::linear, directory_.path() / "textures", 0);
  EXPECT_TRUE(packed) << packed.error().message;
}
#endif

TEST_F(PackImageTest, a_decoder_that_takes_too_long_is_ended_and_the_next_image_packed) {
  std::ofstream(source_, std::ios::binary) << "P6\n6000 6000\n255\n" << std::string(3ull * 6000 * 6000, 'x');
  ImageDecoder impatient({.time_limit_seconds = 0});
  const auto refused = impatient.pack(source_, TexelEncoding::srgb, directory_.path() / "textures", 0);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("image.ppm: its decoder was ended by signal"), std::string::npos) << refused.error().message;
  EXPECT_TRUE(std::filesystem::is_empty(directory_.path() / "textures"));
  SetUp();
  EXPECT_TRUE(impatient.pack(source_, TexelEncoding::linear, directory_.path() / "textures", 0));
}

}  // namespace
}  // namespace spillway::pipeline
