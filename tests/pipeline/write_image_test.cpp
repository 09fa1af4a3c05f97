#include "pipeline/render/write_image.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <vector>

namespace spillway::pipeline {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// 40 x 100 pixels (more than one strip), a crop of it, all layers; values that floats hold exactly.
Film test_film(uint32_t layers = kAllLayers, float gain = 1) {
  const FilmShape shape{40, 100, {4, 10, 37, 95}, layers, 0};
  auto film = Film::create(shape, {0xabcd, "libm 1"});
  std::vector<SplatRecord> splats;
  std::vector<AovRecord> aovs;
  for (uint32_t y = 10; y < 95; ++y)
    for (uint32_t x = 4; x < 37; ++x) {
      const uint32_t sink = y * 40 + x;
      for (uint32_t sample = 0; sample < 2; ++sample) {
        const Rgb value{gain * static_cast<float>(x), gain * static_cast<float>(y), static_cast<float>(sample)};
        splats.push_back({sink, sample, 0, value});
        aovs.push_back({sink, sample, 5, {0, 1, 0}, {0.5f, 0.25f, 1}, 0xfffffff0u, y, x});
      }
    }
  film->add(splats);
  film->add_aovs(aovs);
  film->set_half_samples(0, 1), film->set_half_samples(1, 1);
  return std::move(film).value();
}

struct ReadImage {
  OIIO::ImageSpec spec;
  std::vector<float> pixels;
  [[nodiscard]] int channel(const char* name) const { return spec.channelindex(name); }
  [[nodiscard]] float at(int x, int y, const char* name) const {
    const int c = channel(name);
    if (c < 0) return std::nanf("");
    return pixels[(static_cast<size_t>(y - spec.y) * spec.width + (x - spec.x)) * spec.nchannels + c];
  }
};

ReadImage read_image(const std::filesystem::path& path) {
  const auto input = OIIO::ImageInput::open(path.string());
  EXPECT_TRUE(input) << OIIO::geterror();
  if (!input) return {};
  ReadImage image{input->spec(), {}};
  image.pixels.resize(image.spec.image_pixels() * image.spec.nchannels);
  EXPECT_TRUE(input->read_image(0, 0, 0, -1, OIIO::TypeDesc::FLOAT, image.pixels.data()));
  return image;
}

std::string file_bytes(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class WriteImageTest : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = std::filesystem::temp_directory_path() / ("spillway_image_" + std::to_string(getpid()));
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  [[nodiscard]] size_t file_count() const {
    return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(directory_), {}));
  }
  std::filesystem::path directory_;
  ImageMetadata metadata_{"scene.pbrt", "0.1", 5, 3, 2};
};

TEST_F(WriteImageTest, every_channel_comes_back) {
  const Film film = test_film();
  ASSERT_TRUE(write_exr(film, directory_ / "a.exr", metadata_, {.half_buffers = true}));
  const ReadImage image = read_image(directory_ / "a.exr");
  EXPECT_EQ(image.spec.nchannels, 3 + 1 + 3 + 3 + 3 + 6);
  for (const auto& [x, y] : {std::pair(4, 10), {36, 94}, {20, 74}}) {
    EXPECT_EQ(image.at(x, y, "R"), static_cast<float>(x));
    EXPECT_EQ(image.at(x, y, "G"), static_cast<float>(y));
    EXPECT_EQ(image.at(x, y, "B"), 0.5f);
    EXPECT_EQ(image.at(x, y, "depth.Z"), 5);
    EXPECT_EQ(image.at(x, y, "normal.Y"), 1);
    EXPECT_EQ(image.at(x, y, "normal.X"), 0);
    EXPECT_EQ(image.at(x, y, "albedo.G"), 0.25f);
    EXPECT_EQ(image.at(x, y, "halfA.B"), 0);
    EXPECT_EQ(image.at(x, y, "halfB.B"), 1);
    EXPECT_EQ(image.at(x, y, "halfA.R"), static_cast<float>(x));
  }
}

TEST_F(WriteImageTest, ids_keep_all_32_bits) {
  ASSERT_TRUE(write_exr(test_film(), directory_ / "a.exr", metadata_));
  const auto input = OIIO::ImageInput::open((directory_ / "a.exr").string());
  const OIIO::ImageSpec& spec = input->spec();
  const int c = spec.channelindex("id.mesh");
  ASSERT_GE(c, 0);
  ASSERT_EQ(spec.channelformat(c), OIIO::TypeDesc::UINT32);
  std::vector<uint32_t> ids(spec.image_pixels());
  ASSERT_TRUE(input->read_image(0, 0, c, c + 1, OIIO::TypeDesc::UINT32, ids.data()));
  for (const uint32_t id : ids) ASSERT_EQ(id, 0xfffffff0u);  // a float would hold 2^32
}

TEST_F(WriteImageTest, windows_of_a_crop_lie_in_the_full_image) {
  ASSERT_TRUE(write_exr(test_film(0), directory_ / "a.exr", metadata_));
  const OIIO::ImageSpec spec = read_image(directory_ / "a.exr").spec;
  EXPECT_EQ(spec.x, 4);
  EXPECT_EQ(spec.y, 10);
  EXPECT_EQ(spec.width, 33);
  EXPECT_EQ(spec.height, 85);
  EXPECT_EQ(spec.full_x, 0);
  EXPECT_EQ(spec.full_y, 0);
  EXPECT_EQ(spec.full_width, 40);
  EXPECT_EQ(spec.full_height, 100);
  EXPECT_EQ(spec.nchannels, 3);  // layers exist only when asked for
}

TEST_F(WriteImageTest, the_header_says_how_the_picture_was_made) {
  const Film film = test_film();
  ASSERT_TRUE(write_exr(film, directory_ / "a.exr", metadata_, {.half_buffers = true}));
  const OIIO::ImageSpec spec = read_image(directory_ / "a.exr").spec;
  EXPECT_EQ(spec.get_string_attribute("spillway:renderer"), "Spillway");
  EXPECT_EQ(spec.get_string_attribute("spillway:image_hash"), film.hash());
  EXPECT_EQ(spec.get_string_attribute("spillway:scene"), "scene.pbrt");
  EXPECT_EQ(spec.get_string_attribute("spillway:version"), "0.1");
  EXPECT_EQ(spec.get_string_attribute("spillway:library_versions"), "libm 1");
  EXPECT_EQ(spec.get_string_attribute("spillway:film_lsb"), "0x1p-24");
  EXPECT_EQ(spec.get_int_attribute("spillway:spp"), 2);
  EXPECT_EQ(spec.get_int_attribute("spillway:max_depth"), 5);
  EXPECT_EQ(spec.get_int_attribute("spillway:seed"), 3);
  EXPECT_EQ(spec.get_int_attribute("spillway:epochs"), 2);
  EXPECT_EQ(spec.get_int_attribute("spillway:half_a_spp"), 1);
}

TEST_F(WriteImageTest, equal_films_give_equal_files) {
  ASSERT_TRUE(write_exr(test_film(), directory_ / "a.exr", metadata_));
  ASSERT_TRUE(write_exr(test_film(), directory_ / "b.exr", metadata_));
  EXPECT_TRUE(file_bytes(directory_ / "a.exr") == file_bytes(directory_ / "b.exr"));
  // Not even a date that would differ tomorrow.
  EXPECT_EQ(read_image(directory_ / "a.exr").spec.get_string_attribute("DateTime"), "");
}

TEST_F(WriteImageTest, half_floats_round_to_nearest_and_do_not_become_infinite) {
  ASSERT_TRUE(write_exr(test_film(0, 2048.25f), directory_ / "a.exr", metadata_, {.half_float = true}));
  const ReadImage image = read_image(directory_ / "a.exr");
  EXPECT_EQ(image.spec.format, OIIO::TypeDesc::HALF);
  EXPECT_EQ(image.at(4, 10, "R"), 8192);    // 8193, in steps of 8
  EXPECT_EQ(image.at(36, 94, "G"), 65504);  // 192535.5
}

TEST_F(WriteImageTest, a_picture_that_cannot_be_written_leaves_nothing_and_names_the_file) {
  const auto missing = directory_ / "missing" / "a.exr";
  const Status status = write_exr(test_film(), missing, metadata_);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find(missing.string()), std::string::npos);
  EXPECT_FALSE(write_exr(test_film(), directory_ / "a.tif", metadata_));
  EXPECT_FALSE(convert_to_png(directory_ / "none.exr", directory_ / "a.png"));
  std::filesystem::create_directories(directory_ / "taken.exr" / "inside");  // a name that cannot be replaced
  EXPECT_FALSE(write_exr(test_film(), directory_ / "taken.exr", metadata_));
  EXPECT_EQ(file_count(), 1u);
}

TEST_F(WriteImageTest, a_damaged_picture_is_no_png) {
  ASSERT_TRUE(write_exr(test_film(), directory_ / "a.exr", metadata_));
  const std::string bytes = file_bytes(directory_ / "a.exr");
  std::ofstream(directory_ / "a.exr", std::ios::binary | std::ios::trunc) << bytes.substr(0, bytes.size() / 2);
  EXPECT_FALSE(convert_to_png(directory_ / "a.exr", directory_ / "a.png"));
  EXPECT_EQ(file_count(), 1u);
}

TEST_F(WriteImageTest, srgb_has_its_published_values) {
  EXPECT_EQ(srgb_byte(0), 0);
  EXPECT_EQ(srgb_byte(1), 255);
  EXPECT_EQ(srgb_byte(0.5f), 188);   // 187.52 by IEC 61966-2-1
  EXPECT_EQ(srgb_byte(0.002f), 7);   // linear part: 6.59
  EXPECT_EQ(srgb_byte(0.18f), 118);  // 117.65... of mid grey
  EXPECT_EQ(srgb_byte(-3), 0);
  EXPECT_EQ(srgb_byte(kInfinity), 255);
  EXPECT_EQ(srgb_byte(std::nanf("")), 0);
}

TEST_F(WriteImageTest, previews_of_film_and_file_are_the_same) {
  const Film film = test_film();
  ASSERT_TRUE(write_exr(film, directory_ / "a.exr", metadata_));
  ASSERT_TRUE(convert_to_png(directory_ / "a.exr", directory_ / "a.png", -6));
  ASSERT_TRUE(write_png(film, directory_ / "b.png", -6));
  const ReadImage a = read_image(directory_ / "a.png"), b = read_image(directory_ / "b.png");
  EXPECT_EQ(a.pixels, b.pixels);
  EXPECT_EQ(a.spec.width, 33);
  EXPECT_EQ(a.spec.height, 85);
  EXPECT_EQ(a.spec.nchannels, 3);
  EXPECT_EQ(std::lround(255 * a.pixels[3 * (33 * 22 + 28)]), srgb_byte(0.5f));  // x = 32, y = 32: 32 / 64
}

}  // namespace
}  // namespace spillway::pipeline
