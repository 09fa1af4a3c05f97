#include "pipeline/render/film.h"

#include "cache/base/hash.h"
#include "cache/section_file.h"
#include "pipeline/render/film_file.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <thread>

namespace spillway::pipeline {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

FilmShape shape(uint32_t width = 8, uint32_t height = 4, uint32_t layers = 0) {
  return {width, height, {0, 0, width, height}, layers, 0};
}

Film make_film(const FilmShape& s, uint64_t key = 7, std::string libraries = "libm 1") {
  auto film = Film::create(s, {key, std::move(libraries)});
  EXPECT_TRUE(film) << film.error().message;
  return std::move(film).value();
}

// Deterministic records over the whole film: signed values over many magnitudes.
std::vector<SplatRecord> splats(const FilmShape& s, uint32_t first_sample, uint32_t end_sample) {
  std::vector<SplatRecord> records;
  for (uint32_t y = s.window.y0; y < s.window.y1; ++y)
    for (uint32_t x = s.window.x0; x < s.window.x1; ++x)
      for (uint32_t sample = first_sample; sample < end_sample; ++sample)
        for (uint32_t event = 0; event < 3; ++event) {
          const uint32_t sink = y * s.full_width + x;
          const uint64_t h = hash_combine(uint64_t{sink} << 32 | sample, event);
          const float v = std::ldexp(unit_float(static_cast<uint32_t>(h)) - 0.25f, static_cast<int>(h >> 40 & 31) - 20);
          records.push_back({sink, sample, event, {v, v * 0.5f, v * 3}});
        }
  return records;
}

std::vector<AovRecord> aovs(const FilmShape& s, uint32_t end_sample) {
  std::vector<AovRecord> records;
  for (uint32_t sink = 0; sink < s.full_width * s.full_height; ++sink)
    for (uint32_t sample = 0; sample < end_sample; ++sample) {
      const float t = unit_float(static_cast<uint32_t>(hash_combine(sink, sample)));
      records.push_back({sink, sample, 1 + t, {t, 0, -t}, {t, t, 1}, sink, sample, 3});
    }
  return records;
}

class FilmTest : public testing::Test {
 protected:
  void SetUp() override {
    directory_ = std::filesystem::temp_directory_path() / ("spillway_film_" + std::to_string(getpid()));
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  std::filesystem::path directory_;
};

TEST_F(FilmTest, a_pixel_is_the_mean_over_the_samples_of_both_halves) {
  Film film = make_film(shape());
  // Multiples of the unit 2^-24: no rounding, so the answers are exact.
  film.add(std::vector<SplatRecord>{{9, 0, 0, {1, 2, 4}}, {9, 1, 0, {3, 0, 0.5f}}, {9, 2, 0, {-0.5f, 0, 0}}});
  film.set_half_samples(0, 2);
  film.set_half_samples(1, 2);
  EXPECT_EQ(film.pixel(1, 1), (Rgb{3.5f / 4, 0.5f, 4.5f / 4}));
  EXPECT_EQ(film.half_pixel(0, 1, 1), (Rgb{0.25f, 1, 2}));
  EXPECT_EQ(film.half_pixel(1, 1, 1), (Rgb{1.5f, 0, 0.25f}));
  EXPECT_EQ(film.pixel(2, 1), (Rgb{0, 0, 0}));
  EXPECT_FALSE(film.faults().any());
}

TEST_F(FilmTest, order_and_threads_do_not_show) {
  const FilmShape s = shape(16, 8, kAllLayers);
  std::vector<SplatRecord> records = splats(s, 0, 64);
  std::vector<AovRecord> first_hits = aovs(s, 64);
  std::string expected;
  for (const size_t threads : {1, 2, 7}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    Film film = make_film(s);
    film.add(records);
    film.add_aovs(first_hits);
    film.set_half_samples(0, 32), film.set_half_samples(1, 32);
    if (expected.empty()) expected = film.hash();
    EXPECT_EQ(film.hash(), expected);
    std::mt19937 generator(static_cast<unsigned>(threads));
    std::shuffle(records.begin(), records.end(), generator);
    std::shuffle(first_hits.begin(), first_hits.end(), generator);
  }
}

TEST_F(FilmTest, several_threads_may_add_at_once_to_one_pixel) {
  const FilmShape s = shape(1, 1);
  const std::vector<SplatRecord> records = splats(s, 0, 20000);
  Film alone = make_film(s), shared = make_film(s);
  alone.add(records);
  std::vector<std::thread> threads;
  const size_t part = records.size() / 4;
  for (size_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] { shared.add(std::span(records).subspan(t * part, part)); });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(shared.hash(), alone.hash());
}

TEST_F(FilmTest, one_bit_of_one_splat_shows_in_the_hash) {
  const FilmShape s = shape();
  std::vector<SplatRecord> records = splats(s, 0, 2);
  Film a = make_film(s), b = make_film(s), c = make_film(s);
  a.add(records), c.add(records);
  records[17].value.g += 0x1p-20f;
  b.add(records);
  c.set_half_samples(0, 1);
  EXPECT_NE(a.hash(), b.hash());
  EXPECT_NE(a.hash(), c.hash());
}

// A value far below the unit: rounded to nearest it would vanish. The mean of n roundings of a fraction f has the
// standard deviation sqrt(f (1 - f) / n) units; 5 of them fail a right film once in 1.7 million seeds.
TEST_F(FilmTest, rounding_is_unbiased_for_dim_values_of_both_signs) {
  constexpr uint32_t kSamples = 60000;
  for (const double fraction : {0.003, 0.3, 0.77, -0.003, -0.45}) {
    Film film = make_film(shape(2, 1));
    const auto value = static_cast<float>(fraction * film.lsb());
    std::vector<SplatRecord> records;
    for (uint32_t i = 0; i < kSamples; ++i) records.push_back({1, 2 * i, 5, {value, value, value}});
    film.add(records);
    film.set_half_samples(0, kSamples);
    const Rgb mean = film.pixel(1, 0);
    const double f = std::fabs(fraction), sigma = std::sqrt(f * (1 - f) / kSamples);
    for (const float channel : {mean.r, mean.g, mean.b}) EXPECT_NEAR(channel / film.lsb(), fraction, 5 * sigma);
    // Channels are rounded by numbers of their own: three equal means would be chance of about 1 in 1000.
    if (f > 0.1) {
      EXPECT_FALSE(mean.r == mean.g && mean.g == mean.b);
    }
  }
}

TEST_F(FilmTest, events_of_one_path_round_independently) {
  Film film = make_film(shape(1, 1));
  const auto half_unit = static_cast<float>(0.5 * film.lsb());
  std::vector<SplatRecord> records;
  constexpr uint32_t kEvents = 10000;
  for (uint32_t e = 0; e < kEvents; ++e) records.push_back({0, 0, e, {half_unit, 0, 0}});
  film.add(records);
  film.set_half_samples(0, 1);
  const double units = film.pixel(0, 0).r / film.lsb();
  EXPECT_NEAR(units, 0.5 * kEvents, 5 * 0.5 * std::sqrt(kEvents));  // binomial, 5 standard deviations
}

TEST_F(FilmTest, a_film_scaled_by_a_power_of_two_holds_scaled_units) {
  FilmShape bright = shape();
  bright.scale_exponent = 20;
  Film a = make_film(shape()), b = make_film(bright);
  std::vector<SplatRecord> records = splats(shape(), 0, 4);
  a.add(records);
  for (SplatRecord& r : records) r.value *= {0x1p20f, 0x1p20f, 0x1p20f};
  b.add(records);
  a.set_half_samples(0, 2), b.set_half_samples(0, 2);
  for (uint32_t x = 0; x < 8; ++x) EXPECT_EQ(b.half_pixel(0, x, 0), a.half_pixel(0, x, 0) * 0x1p20f);
}

TEST_F(FilmTest, values_that_are_not_finite_are_counted_located_and_not_added) {
  Film film = make_film(shape()), clean = make_film(shape());
  const std::vector<SplatRecord> good = splats(shape(), 0, 2);
  film.add(good), clean.add(good);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  film.add(
      std::vector<SplatRecord>{{20, 1, 0, {1, nan, 1}}, {9, 3, 0, {kInfinity, 0, 0}}, {9, 4, 0, {-kInfinity, 0, 0}}});
  const FilmFaults faults = film.faults();
  EXPECT_EQ(faults.not_finite_count, 3u);
  EXPECT_EQ(faults.out_of_range_count, 0u);
  EXPECT_EQ(faults.sink, 9u);
  EXPECT_EQ(faults.sample, 3u);
  EXPECT_EQ(film.hash(), clean.hash());
}

TEST_F(FilmTest, a_splat_or_a_sum_that_leaves_the_range_is_a_fault) {
  Film film = make_film(shape());
  film.add(std::vector<SplatRecord>{{3, 0, 0, {0x1p36f, 0, 0}}});  // 2^60 units
  EXPECT_EQ(film.faults().out_of_range_count, 1u);
  EXPECT_EQ(film.faults().sink, 3u);
  film.set_half_samples(0, 1);
  EXPECT_EQ(film.pixel(3, 0), (Rgb{0, 0, 0}));
  std::vector<SplatRecord> large(5, {4, 2, 0, {-0x1p35f, 0, 0}});  // 5 * 2^59 units: fits
  film.add(large);
  EXPECT_EQ(film.faults().out_of_range_count, 1u);
  film.add(large);  // 10 * 2^59 > 2^62: does not
  EXPECT_EQ(film.faults().out_of_range_count, 3u);
}

TEST_F(FilmTest, a_crop_holds_the_bits_of_the_full_frame) {
  FilmShape cropped = shape(16, 8, kAllLayers);
  cropped.window = {3, 2, 9, 7};
  Film full = make_film(shape(16, 8, kAllLayers)), crop = make_film(cropped);
  full.add(splats(shape(16, 8), 0, 4));
  crop.add(splats(cropped, 0, 4));
  full.set_half_samples(0, 2), crop.set_half_samples(0, 2);
  for (uint32_t y = 2; y < 7; ++y)
    for (uint32_t x = 3; x < 9; ++x) EXPECT_EQ(crop.pixel(x, y), full.pixel(x, y));
  EXPECT_LT(Film::bytes(cropped), Film::bytes(full.shape()) / 4);
}

TEST_F(FilmTest, first_hit_layers_mean_what_their_comments_say) {
  Film film = make_film(shape(2, 1, kAllLayers));
  film.add_aovs(std::vector<AovRecord>{{1, 1, 4, {0, 1, 0}, {0.5f, 0, 0}, 7, 8, 9},
                                       {1, 0, 2, {0, 0, 1}, {0.25f, 1, 0}, 4, 5, 6},
                                       {1, 2, kInfinity, {0, 0, 0}, {0, 0, 0}, ~0u, ~0u, ~0u},
                                       {1, 3, 6, {0, 1, 0}, {0.25f, 1, 0}, 4, 5, 6},
                                       {0, 0, kInfinity, {0, 0, 0}, {0, 0, 0}, ~0u, ~0u, ~0u}});
  film.set_half_samples(0, 2), film.set_half_samples(1, 2);
  EXPECT_EQ(film.depth(1, 0), 4);  // of three hits
  EXPECT_EQ(film.normal(1, 0), (Float3{0, 0.5f, 0.25f}));
  EXPECT_EQ(film.albedo(1, 0), (Rgb{0.25f, 0.5f, 0}));
  EXPECT_EQ(film.ids(1, 0).mesh, 4u);
  EXPECT_EQ(film.ids(1, 0).material, 5u);
  EXPECT_EQ(film.ids(1, 0).instance, 6u);
  EXPECT_EQ(film.depth(0, 0), kInfinity);
  EXPECT_EQ(film.ids(0, 0).mesh, ~0u);
  EXPECT_FALSE(film.faults().any());
}

TEST_F(FilmTest, its_memory_is_what_bytes_says) {
  for (const uint32_t layers : {0u, uint32_t{kLayerDepth}, uint32_t{kLayerNormal | kLayerIds}, kAllLayers}) {
    const uint64_t before = memory_use(MemoryTag::film).current_bytes;
    const Film film = make_film(shape(100, 50, layers));
    EXPECT_EQ(memory_use(MemoryTag::film).current_bytes - before, Film::bytes(film.shape()));
  }
}

TEST_F(FilmTest, shards_merged_in_any_order_are_the_whole) {
  const FilmShape s = shape(8, 4, kAllLayers);
  const auto part = [&](uint32_t first, uint32_t end) {
    Film film = make_film(s);
    film.add(splats(s, 2 * first, 2 * end));
    std::vector<AovRecord> own;
    for (const AovRecord& a : aovs(s, 12))
      if (a.sample >= 2 * first && a.sample < 2 * end) own.push_back(a);
    film.add_aovs(own);
    for (int half = 0; half < 2; ++half) EXPECT_TRUE(film.add_half_samples(half, {first, end}));
    return film;
  };
  const Film whole = part(0, 6);
  Film one = part(4, 6), other = part(0, 1);
  for (const Film& film : {part(0, 1), part(1, 4)}) EXPECT_TRUE(one.merge(film));
  for (const Film& film : {part(4, 6), part(1, 4)}) EXPECT_TRUE(other.merge(film));
  EXPECT_EQ(one.hash(), whole.hash());
  EXPECT_EQ(other.hash(), whole.hash());
  EXPECT_EQ(one.ids(2, 1).mesh, 10u);
  EXPECT_EQ(one.half_ranges(0).size(), 1u);
}

TEST_F(FilmTest, a_mismatch_is_refused_by_name_and_changes_nothing) {
  Film film = make_film(shape());
  film.add(splats(shape(), 0, 2));
  film.set_half_samples(0, 1);
  const std::string before = film.hash();
  const auto refused = [&](const Film& other, const char* word) {
    const Status status = film.merge(other);
    ASSERT_FALSE(status);
    EXPECT_NE(status.error().message.find(word), std::string::npos) << status.error().message;
    EXPECT_EQ(film.hash(), before);
  };
  FilmShape window = shape(), scale = shape();
  window.window.x1 = 7, scale.scale_exponent = 3;
  refused(make_film(shape(9, 4)), "width");
  refused(make_film(shape(8, 5)), "height");
  refused(make_film(window), "crop window");
  refused(make_film(scale), "scale");
  refused(make_film(shape(8, 4, kLayerDepth)), "layers");
  refused(make_film(shape(), 8), "settings");
  refused(make_film(shape(), 7, "libm 2"), "library versions");
  Film same_samples = make_film(shape());
  same_samples.set_half_samples(0, 4);
  refused(same_samples, "twice");
}

TEST_F(FilmTest, impossible_shapes_are_refused) {
  FilmShape outside = shape(), empty = shape(), huge = shape(100000, 100000), layer = shape();
  outside.window.x1 = 9, empty.window.y1 = 0, layer.layers = 16;
  for (const FilmShape& s : {outside, empty, huge, layer, FilmShape{}}) EXPECT_FALSE(Film::create(s, {}));
}

TEST_F(FilmTest, a_file_gives_back_the_film) {
  const FilmShape s = shape(8, 4, kAllLayers);
  Film film = make_film(s);
  film.add(splats(s, 0, 8));
  film.add_aovs(aovs(s, 8));
  film.add(std::vector<SplatRecord>{{5, 1, 9, {kInfinity, 0, 0}}});
  film.set_half_samples(0, 4), film.set_half_samples(1, 4);
  ASSERT_TRUE(write_film(film, directory_ / "a.film"));
  const auto read = read_film(directory_ / "a.film");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->hash(), film.hash());
  EXPECT_EQ(read->shape(), film.shape());
  EXPECT_EQ(read->identity().settings_key, 7u);
  EXPECT_EQ(read->identity().library_versions, "libm 1");
  EXPECT_EQ(read->faults().not_finite_count, 1u);
  EXPECT_EQ(read->faults().sink, 5u);
}

// As a resumed render does: half A was saved when its epoch closed, while half B's epoch was open.
TEST_F(FilmTest, halves_saved_at_different_times_make_one_film) {
  const FilmShape s = shape(8, 4, kAllLayers);
  Film film = make_film(s);
  film.add(splats(s, 0, 4));
  film.add_aovs(aovs(s, 4));
  film.set_half_samples(0, 2);
  ASSERT_TRUE(write_film(film, directory_ / "a.film", kHalfA));
  film.set_half_samples(1, 2);
  const std::string whole = film.hash();
  ASSERT_TRUE(write_film(film, directory_ / "b.film", kHalfB));
  auto resumed = read_film(directory_ / "a.film");
  ASSERT_TRUE(resumed) << resumed.error().message;
  EXPECT_EQ(resumed->half_samples(1), 0u);
  ASSERT_TRUE(merge_film_file(*resumed, directory_ / "b.film"));
  EXPECT_EQ(resumed->hash(), whole);
  const Status again = merge_film_file(*resumed, directory_ / "b.film");
  ASSERT_FALSE(again);
  EXPECT_NE(again.error().message.find("b.film"), std::string::npos);
  EXPECT_EQ(resumed->hash(), whole);
}

TEST_F(FilmTest, a_half_whose_epoch_is_open_is_not_merged) {
  Film open = make_film(shape()), film = make_film(shape());
  open.add(splats(shape(), 0, 2));
  open.set_half_samples(0, 1);
  ASSERT_TRUE(film.merge(open));
  EXPECT_EQ(film.half_samples(1), 0u);
  film.set_half_samples(1, 1);
  EXPECT_EQ(film.half_pixel(1, 2, 2), (Rgb{0, 0, 0}));
  EXPECT_EQ(film.half_pixel(0, 2, 2), open.half_pixel(0, 2, 2));
}

TEST_F(FilmTest, every_prefix_and_every_flipped_byte_is_refused) {
  const FilmShape s = shape(3, 2, kAllLayers);
  Film film = make_film(s);
  film.add(splats(s, 0, 2));
  film.set_half_samples(0, 1), film.set_half_samples(1, 1);
  const auto path = directory_ / "a.film";
  ASSERT_TRUE(write_film(film, path));
  std::ifstream in(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  ASSERT_GT(bytes.size(), 500u);
  const auto read = [&](const std::string& content) {
    std::ofstream(path, std::ios::binary | std::ios::trunc) << content;
    return read_film(path);
  };
  for (size_t n = 0; n < bytes.size(); ++n) EXPECT_FALSE(read(bytes.substr(0, n))) << n;
  for (size_t n = 0; n < bytes.size(); ++n) {
    std::string flipped = bytes;
    flipped[n] = static_cast<char>(flipped[n] ^ 0x10);
    const auto result = read(flipped);  // padding between sections means nothing
    if (result) {
      EXPECT_EQ(result->hash(), film.hash()) << n;
    }
  }
}

// Damage that a checksum does not find: a file that was written so.
TEST_F(FilmTest, sections_that_contradict_the_header_are_refused) {
  struct Header {
    FilmShape shape;
    uint64_t key;
    uint32_t halves, reserved;
  };
  const auto path = directory_ / "a.film";
  const auto read = [&](Header header, size_t beauty_count, std::vector<SampleRange> ranges) {
    cache::SectionWriter writer(kFilmKind, kFilmVersion);
    const std::vector<int64_t> beauty(beauty_count);
    const uint64_t faults[3] = {0, 0, UINT64_MAX};
    writer.add_array("header", std::span<const Header>(&header, 1));
    writer.add_array("libraries", std::span<const char>("x", 1));
    writer.add_array("a.beauty", std::span<const int64_t>(beauty));
    writer.add_array("a.faults", std::span<const uint64_t>(faults));
    writer.add_array("a.ranges", std::span<const SampleRange>(ranges));
    EXPECT_TRUE(writer.write(path));
    return static_cast<bool>(read_film(path));
  };
  const Header good{shape(2, 2), 1, kHalfA, 0};
  EXPECT_TRUE(read(good, 12, {{0, 1}}));
  EXPECT_FALSE(read(good, 11, {{0, 1}}));
  EXPECT_FALSE(read(good, 12, {{1, 1}}));
  EXPECT_FALSE(read(good, 12, {{0, 2}, {1, 3}}));
  EXPECT_FALSE(read(good, 12, {{0, 0xffffffffu}}));
  EXPECT_FALSE(read({shape(60000, 60000), 1, kHalfA, 0}, 12, {{0, 1}}));
  EXPECT_FALSE(read({shape(2, 2, kLayerDepth), 1, kHalfA, 0}, 12, {{0, 1}}));
  EXPECT_FALSE(read({shape(2, 2), 1, kBothHalves, 0}, 12, {{0, 1}}));
  EXPECT_FALSE(read({shape(2, 2), 1, 0, 0}, 12, {{0, 1}}));
}

}  // namespace
}  // namespace spillway::pipeline
