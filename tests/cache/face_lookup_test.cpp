// Lookups in face textures: inside faces, across edges, at borders, by footprint; for any budget.

#include "cache/face_lookup.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <random>
#include <set>

#include "cache/texture_cache.h"
#include "tests/support/face_mesh.h"
#include "tests/support/small_scene.h"

namespace spillway::cache {
namespace {

using test::FaceGrid;
using Paint = std::function<double(double, double, uint32_t)>;  // of a place in the plane

class FaceLookupTest : public testing::Test {
 protected:
  static constexpr FaceTexFormat kFloats{FaceTexelType::float32, 3, -1, FaceTexEncoding::linear, 1, FaceTexCodec::lz4};

  // Paints the grid and opens it.
  void open(const FaceGrid& grid, std::vector<FaceInfo> faces, const Paint& paint,
            FaceBorder border = FaceBorder::clamp, const FaceTexFormat& format = kFloats) {
    auto writer = FaceTexWriter::create(directory_.path() / "a.facetex", format);
    ASSERT_TRUE(writer) << writer.error().message;
    ASSERT_TRUE((*writer)->begin_texture({"grid", FaceShape::quad, border, border, faces}));
    for (uint32_t f = 0; f < faces.size(); ++f) {
      const auto texels = test::painted_face(format, faces[f], FaceShape::quad, [&](double u, double v, uint32_t c) {
        const FaceGrid::Place p = grid.place(f, u, v);
        return paint(p.x, p.y, c);
      });
      ASSERT_TRUE((*writer)->add_face(texels));
    }
    ASSERT_TRUE((*writer)->finish());
    reopen(FaceShape::quad, static_cast<uint32_t>(faces.size()), format.channels);
  }
  void reopen(FaceShape shape, uint32_t face_count, uint32_t channels, uint64_t limit = 64 << 20) {
    cache_.reset();
    const auto file = FaceTexFile::open(directory_.path() / "a.facetex", {});
    ASSERT_TRUE(file) << file.error().message;
    FaceContainerInfo info{"a.facetex", face_count, file->tiles().size(),
                           static_cast<uint32_t>(file->format().tile_bytes()),
                           static_cast<uint32_t>(file->images().size())};
    const FaceTextureInfo texture{0, 0, face_count, shape, channels, {}};
    auto cache = TextureCache::open(directory_.path(), {}, {.memory_limit_bytes = limit}, std::span(&info, 1),
                                    std::span(&texture, 1));
    ASSERT_TRUE(cache) << cache.error().message;
    cache_ = std::move(*cache);
  }
  Texel look_up(const FaceTextureRequest& request) {
    Texel texel{};
    const Status status = cache_->look_up_faces({&request, 1}, {&texel, 1});
    EXPECT_TRUE(status) << status.error().message;
    return texel;
  }
  Texel at(uint32_t face, double u, double v, double width = 0, float random = 0.5f,
           FaceLevelChoice choice = FaceLevelChoice::stochastic) {
    return look_up({0, face, static_cast<float>(u), static_cast<float>(v), static_cast<float>(width),
                    static_cast<float>(width), random, choice});
  }

  test::TemporaryDirectory directory_;
  std::unique_ptr<TextureCache> cache_;
};

std::pair<uint8_t, uint8_t> all_of(uint8_t log2) { return {log2, log2}; }
double ramp(double x, double y, uint32_t c) { return 1 + 0.3 * x + (0.2 + 0.1 * c) * y; }

TEST_F(FaceLookupTest, inside_a_face_and_across_its_edges_a_ramp_is_a_ramp_however_faces_are_turned) {
  const FaceGrid grid(4, 4, [](uint32_t f) { return f * 7 % 4; });
  open(grid, grid.faces([](uint32_t) { return all_of(4); }), ramp);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int i = 0; i < 4000; ++i) {
    const uint32_t face = i % 2 ? 5 + static_cast<uint32_t>(random() % 2) + 4 * static_cast<uint32_t>(random() % 2)
                                : 5;  // the inner four
    double u = unit(random), v = unit(random);
    if (i % 4 == 1) u = i % 8 == 1 ? 0 : 1;  // on an edge, and in a corner
    if (i % 16 == 1) v = 1;
    const auto p = grid.place(face, u, v);
    const Texel texel = at(face, u, v);
    for (uint32_t c = 0; c < 3; ++c)
      ASSERT_NEAR(texel.value[c], ramp(p.x, p.y, c), 2e-6) << face << ' ' << u << ' ' << v;
  }
}

// Blocks of lookups, most of which take the short path, against one lookup at a time by the long one: bit for bit. Runs
// of lookups stay on a face, at any level, of two textures by turns.
TEST_F(FaceLookupTest, of_bytes_the_short_path_has_the_bits_of_the_long_one) {
  const FaceGrid grid(6, 5, [](uint32_t f) { return f % 4; });
  for (const uint32_t channels : {1u, 2u, 3u, 4u}) {
    const FaceTexFormat format{FaceTexelType::uint8,  channels, channels == 4 ? 3 : -1,
                               FaceTexEncoding::srgb, 1,        FaceTexCodec::lz4};
    open(
        grid, grid.faces([](uint32_t f) { return std::pair<uint8_t, uint8_t>((f + 5) % 8, (f + 1) % 8); }),
        [](double x, double y, uint32_t c) { return 0.5 + 0.4 * std::cos(5 * x - 2 * c) * std::cos(8 * y); },
        FaceBorder::clamp, format);
    std::filesystem::copy_file(directory_.path() / "a.facetex", directory_.path() / "b.facetex",
                               std::filesystem::copy_options::overwrite_existing);
    open(
        grid, grid.faces([](uint32_t f) { return std::pair<uint8_t, uint8_t>(f % 8, (f + 2) % 8); }),
        [](double x, double y, uint32_t c) { return 0.5 + 0.4 * std::sin(9 * x + 3 * c) * std::cos(7 * y); },
        FaceBorder::clamp, format);
    const FaceTexDecoder decoder(format);
    const auto a = FaceTexSource::open(directory_.path() / "a.facetex", {});
    const auto b = FaceTexSource::open(directory_.path() / "b.facetex", {});
    ASSERT_TRUE(a && b);
    TileCache tiles(64 << 20);
    const auto added_a = tiles.add_face_tex(**a), added_b = tiles.add_face_tex(**b);
    ASSERT_TRUE(added_a && added_b);
    tiles.begin(2, false);
    const auto texture_of = [&](const FaceTexFile& file, const TileFile& added, uint32_t owner) {
      const FaceTexTexture& t = file.textures()[0];
      FaceTexture texture{&file, &t, file.faces(t), file.numbers(t), &decoder, &added, owner};
      texture.choose_tables();
      return texture;
    };
    const FaceTexture textures[] = {texture_of((*a)->file(), *added_a, 0), texture_of((*b)->file(), *added_b, 1)};
    ASSERT_TRUE(textures[0].is_bytes && textures[1].is_bytes);
    std::mt19937 random(channels);
    std::uniform_real_distribution<float> unit(0, 1);
    std::vector<FaceTextureRequest> requests(5000);
    uint32_t face = 0;
    for (FaceTextureRequest& r : requests) {
      if (random() % 4 == 0) face = static_cast<uint32_t>(random() % 30);
      r = {random() % 4 == 0 ? 1u : 0u,
           face,
           unit(random),
           unit(random),
           0.1f * unit(random) * unit(random),
           0.1f * unit(random),
           unit(random),
           random() % 4 == 0 ? FaceLevelChoice::trilinear : FaceLevelChoice::stochastic};
    }
    std::vector<Texel> values(requests.size());
    TileThread thread(tiles);
    thread.begin_block();
    ASSERT_EQ(look_up_faces(thread, textures, requests, values), requests.size());
    for (size_t i = 0; i < requests.size(); ++i) {
      float sum[4] = {0, 0, 0, 0};
      ASSERT_TRUE(look_up_face(thread, textures[requests[i].texture], requests[i], sum));
      const Texel one = spread_channels(sum, channels);
      ASSERT_EQ(std::memcmp(&one, &values[i], sizeof one), 0) << channels << ' ' << i;
    }
    EXPECT_EQ(thread.counters[0].lookups + thread.counters[1].lookups, requests.size());
    requests.back().face = 30;
    EXPECT_EQ(look_up_faces(thread, textures, requests, values), requests.size() - 1);
  }
}

// Inside faces of a texel to four tiles and across their edges, turned, of all types, at all footprints: bit for bit.
TEST_F(FaceLookupTest, values_do_not_depend_on_the_size_of_tiles) {
  const FaceGrid grid(6, 5, [](uint32_t f) { return f % 4; });
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<FaceTextureRequest> requests(20000);
  for (uint32_t i = 0; i < requests.size(); ++i)
    requests[i] = {0,
                   i * 30 / static_cast<uint32_t>(requests.size()),
                   random() % 4 == 0 ? std::round(unit(random)) : unit(random),
                   unit(random),
                   0.1f * unit(random) * unit(random),
                   0.1f * unit(random) * unit(random),
                   unit(random),
                   random() % 4 == 0 ? FaceLevelChoice::trilinear : FaceLevelChoice::stochastic};
  for (const FaceTexelType type :
       {FaceTexelType::uint8, FaceTexelType::uint16, FaceTexelType::half, FaceTexelType::float32})
    for (const uint32_t channels : {1u, 3u, 4u}) {
      std::vector<Texel> first;
      for (const uint32_t tile_log2 : {6u, 5u, 7u}) {
        open(
            grid, grid.faces([](uint32_t f) { return std::pair<uint8_t, uint8_t>((f + 5) % 9, (f * 7 + 1) % 9); }),
            [](double x, double y, uint32_t c) { return 0.5 + 0.4 * std::cos(5 * x - 2 * c) * std::cos(8 * y); },
            FaceBorder::clamp,
            {type, channels, channels == 4 ? 3 : -1, FaceTexEncoding::linear, 1, FaceTexCodec::lz4, tile_log2});
        std::vector<Texel> values(requests.size());
        ASSERT_TRUE(cache_->look_up_faces(requests, values));
        if (first.empty()) first = values;
        EXPECT_EQ(std::memcmp(first.data(), values.data(), values.size() * sizeof(Texel)), 0)
            << static_cast<int>(type) << ' ' << channels << ' ' << tile_log2;
      }
    }
}

// What threads keep at hand is within the library's limit, whatever it is.
TEST_F(FaceLookupTest, threads_keep_a_quarter_of_the_limit_at_most) {
  const FaceGrid grid(1, 1);
  open(grid, grid.faces([](uint32_t) { return all_of(6); }), ramp);
  const auto source = FaceTexSource::open(directory_.path() / "a.facetex", {});
  ASSERT_TRUE(source) << source.error().message;
  for (const int threads : {1, 2, 8})
    for (const uint64_t limit : {uint64_t{8} << 20, uint64_t{32} << 20, uint64_t{1} << 30}) {
      const tbb::global_control control(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
      TileCache tiles(limit);
      const auto added = tiles.add_face_tex(**source);
      ASSERT_TRUE(added);
      tiles.begin(1, false);
      EXPECT_TRUE(tiles.held_tiles() * added->tile_bytes * static_cast<uint64_t>(threads) <= limit / 4 ||
                  tiles.held_tiles() == TileThread::kLeastHeldTiles);
      if (limit >= uint64_t{1} << 30) {
        EXPECT_EQ(tiles.held_tiles(), TileThread::kHeldTiles);
      }
    }
}

TEST_F(FaceLookupTest, large_faces_are_a_ramp_across_their_tiles) {
  const FaceGrid grid(1, 1);
  open(grid, grid.faces([](uint32_t) { return std::pair<uint8_t, uint8_t>{8, 7}; }), ramp);
  for (double u = 0.01; u < 0.99; u += 0.013)
    for (double v = 0.01; v < 0.99; v += 0.017) ASSERT_NEAR(at(0, u, v).value[1], ramp(u, v, 1), 2e-6) << u << ' ' << v;
}

TEST_F(FaceLookupTest, both_sides_of_an_edge_agree_where_texels_are_of_one_size) {
  const FaceGrid grid(2, 1, [](uint32_t f) { return f == 0 ? 1u : 2u; });
  std::mt19937 random(9);
  std::vector<double> noise(1 << 16);
  for (double& n : noise) n = static_cast<double>(random() % 1000) / 1000;
  open(grid, grid.faces([](uint32_t) { return all_of(5); }), [&](double x, double y, uint32_t c) {
    return noise[static_cast<size_t>(x * 32) * 97 % 600 * 100 + static_cast<size_t>(y * 32) * 3 + c];
  });
  for (double y = 0; y <= 1; y += 0.01) {
    // The right side of face 0, and the left of face 1, as each counts.
    const Texel left = at(0, y, 0), right = at(1, 1, 1 - y);
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(left.value[c], right.value[c], 2e-6) << y;
  }
}

TEST_F(FaceLookupTest, one_colour_is_one_colour_for_any_sizes_footprints_and_constant_faces) {
  const FaceGrid grid(5, 5, [](uint32_t f) { return f * 3 % 4; });
  auto faces = grid.faces([](uint32_t f) { return std::pair<uint8_t, uint8_t>{f * 5 % 8, f * 3 % 7}; });
  for (const uint32_t f : {3u, 12u, 17u}) faces[f].flags = kFaceIsConstant;
  open(grid, faces, [](double, double, uint32_t c) { return 0.25 + 0.25 * c; });
  for (uint32_t f = 0; f < 25; ++f)
    for (const double width : {0.0, 0.03, 0.2, 0.9, 5.0})
      for (const double u : {0.0, 0.001, 0.37, 0.999, 1.0})
        for (const double v : {0.0, 0.5, 1.0})
          for (const auto choice : {FaceLevelChoice::stochastic, FaceLevelChoice::trilinear}) {
            const Texel texel = at(f, u, v, width, 0.3f, choice);
            ASSERT_NEAR(texel.value[0], 0.25, 1e-6);
            ASSERT_NEAR(texel.value[2], 0.75, 1e-6);
          }
}

TEST_F(FaceLookupTest, a_coarser_neighbour_is_met_half_way_and_a_finer_one_at_our_size) {
  const FaceGrid grid(2, 1);
  open(grid, grid.faces([](uint32_t f) { return all_of(f == 0 ? 5 : 2); }),
       [](double x, double, uint32_t) { return x < 1 ? 0.0 : 1.0; });
  EXPECT_NEAR(at(0, 1, 0.5).value[0], 0.5, 1e-6);
  EXPECT_NEAR(at(1, 0, 0.5).value[0], 0.5, 1e-6);
  EXPECT_NEAR(at(0, 0.9, 0.5).value[0], 0, 1e-6);
}

TEST_F(FaceLookupTest, borders_clamp_darken_or_repeat) {
  const FaceGrid grid(1, 1);
  const auto faces = grid.faces([](uint32_t) { return all_of(2); });
  const Paint paint = [](double x, double, uint32_t) { return x < 0.5 ? 1.0 : 3.0; };
  open(grid, faces, paint, FaceBorder::clamp);
  EXPECT_NEAR(at(0, 0, 0.5).value[0], 1, 1e-6);
  open(grid, faces, paint, FaceBorder::black);
  EXPECT_NEAR(at(0, 0, 0.5).value[0], 0.5, 1e-6);
  open(grid, faces, paint, FaceBorder::periodic);
  EXPECT_NEAR(at(0, 0, 0.5).value[0], 2, 1e-6);
}

TEST_F(FaceLookupTest, a_footprint_of_four_texels_sees_the_second_level) {
  const FaceGrid grid(1, 1);
  // Stripes of one texel: grey from the first level on.
  open(grid, grid.faces([](uint32_t) { return all_of(6); }),
       [](double x, double, uint32_t) { return std::fmod(x * 64, 2) < 1 ? 0.0 : 1.0; });
  EXPECT_NEAR(at(0, 8.5 / 64, 0.5, 1.0 / 64).value[0], 0, 1e-6);
  EXPECT_NEAR(at(0, 8.5 / 64, 0.5, 4.0 / 64).value[0], 0.5, 1e-6);
  EXPECT_NEAR(at(0, 8.5 / 64, 0.5, 1.5 / 64, 0, FaceLevelChoice::trilinear).value[0], 0.25, 1e-6);
}

TEST_F(FaceLookupTest, levels_chosen_at_random_have_the_blend_as_their_mean) {
  const FaceGrid grid(1, 1);
  open(grid, grid.faces([](uint32_t) { return all_of(5); }),
       [](double x, double y, uint32_t) { return std::sin(40 * x) * std::cos(31 * y) + 2; });
  for (const double width : {0.05, 0.11, 0.3}) {
    double sum = 0;
    for (int i = 0; i < 1000; ++i) sum += at(0, 0.4, 0.3, width, (static_cast<float>(i) + 0.5f) / 1000).value[0];
    EXPECT_NEAR(sum / 1000, at(0, 0.4, 0.3, width, 0, FaceLevelChoice::trilinear).value[0], 2e-3) << width;
  }
}

TEST_F(FaceLookupTest, texels_decode_by_their_encoding_and_alpha_does_not) {
  const FaceGrid grid(1, 1);
  const FaceTexFormat format{FaceTexelType::uint8, 4, 3, FaceTexEncoding::gamma, 2, FaceTexCodec::lz4};
  open(
      grid, grid.faces([](uint32_t) { return all_of(0); }),
      [](double, double, uint32_t c) { return c == 3 ? 0.4 : 0.16; }, FaceBorder::clamp, format);
  const Texel texel = at(0, 0.5, 0.5);
  EXPECT_NEAR(texel.value[0], 0.16, 1e-6);  // stored as 102 of 255
  EXPECT_NEAR(texel.value[3], 0.4, 1e-6);
}

TEST_F(FaceLookupTest, values_do_not_depend_on_the_budget_or_on_reading_ahead_and_counters_tell_them_apart) {
  const FaceGrid grid(8, 8);
  open(grid, grid.faces([](uint32_t f) {
    return std::pair<uint8_t, uint8_t>{f % 3 + 5, 7 - f % 2};
  }),
       [](double x, double y, uint32_t c) { return std::fmod(x * 37.7 + y * 91.3 + c, 1.0); });
  std::vector<FaceTextureRequest> requests;
  std::mt19937 random(1);
  for (uint32_t f = 0; f < 64; ++f)
    for (int i = 0; i < 200; ++i)
      requests.push_back({0, f, static_cast<float>(random() % 1000) / 1000, static_cast<float>(random() % 1000) / 1000,
                          0.004f, 0.004f, static_cast<float>(random() % 1000) / 1000, FaceLevelChoice::stochastic});
  std::vector<Texel> wanted(requests.size()), got(requests.size());
  ASSERT_TRUE(cache_->look_up_faces(requests, wanted));
  const TextureCounters all = cache_->counters();
  EXPECT_EQ(all.lookups, requests.size());
  EXPECT_EQ(all.tiles_read_again, 0u);
  EXPECT_EQ(all.tiles_read, all.tiles_touched);
  EXPECT_EQ(all.bytes_read, all.unique_bytes);
  // Little fits: orders that come back read again, sorted ones do not.
  reopen(FaceShape::quad, 64, 3, 3 << 20);
  cache_->begin_wave();
  ASSERT_TRUE(cache_->stage_faces(requests));
  ASSERT_TRUE(cache_->look_up_faces(requests, got));
  EXPECT_EQ(std::memcmp(wanted.data(), got.data(), wanted.size() * sizeof(Texel)), 0);
  std::vector<FaceTextureRequest> mixed = requests;
  std::shuffle(mixed.begin(), mixed.end(), random);
  const TextureCounters sorted = cache_->counters();
  EXPECT_LE(static_cast<double>(sorted.bytes_read), 1.05 * static_cast<double>(sorted.wave_unique_bytes));
  cache_->begin_wave();
  ASSERT_TRUE(cache_->look_up_faces(mixed, got));
  const TextureCounters now = gained(cache_->counters(), sorted);
  EXPECT_GT(now.tiles_read_again, 100u);
  EXPECT_GT(now.bytes_read, 2 * now.wave_unique_bytes);
  EXPECT_GT(cache_->limit_for_waves(), uint64_t{3} << 20);
}

TEST_F(FaceLookupTest, what_is_read_while_others_look_up_is_read_once_and_found) {
  const FaceGrid grid(8, 8);
  open(grid, grid.faces([](uint32_t) { return all_of(6); }),
       [](double x, double y, uint32_t c) { return std::fmod(x * 37.7 + y * 91.3 + c, 1.0); });
  std::vector<FaceTextureRequest> requests;
  for (uint32_t i = 0; i < 64 * 32; ++i)
    requests.push_back({0, i / 32, 0.5f, 0.5f, 0, 0, 0, FaceLevelChoice::stochastic});
  std::vector<Texel> wanted(requests.size()), got(requests.size());
  ASSERT_TRUE(cache_->look_up_faces(requests, wanted));
  const uint64_t touched = cache_->counters().tiles_touched;
  reopen(FaceShape::quad, 64, 3, 8 << 20);
  cache_->begin_wave();
  // Batches overlap by half: what is staged for one is not read again for the next.
  constexpr size_t kStep = 128, kBatch = 2 * kStep;
  const auto batch = [&](size_t first) {
    return std::span(requests).subspan(first, std::min(kBatch, requests.size() - first));
  };
  ASSERT_TRUE(cache_->stage_faces(batch(0)));
  for (size_t first = 0; first < requests.size(); first += kStep) {
    const size_t next = std::min(first + kStep, requests.size());
    if (next < requests.size()) {
      std::vector<TextureCache::WantedTile> wanted_tiles;
      cache_->append_wanted(batch(next), wanted_tiles);
      ASSERT_TRUE(cache_->begin_staging(std::move(wanted_tiles)));
    }
    ASSERT_TRUE(cache_->look_up_faces(batch(first), std::span(got).subspan(first)));
    ASSERT_TRUE(cache_->finish_staging());
  }
  EXPECT_EQ(std::memcmp(wanted.data(), got.data(), wanted.size() * sizeof(Texel)), 0);
  const TextureCounters now = cache_->counters();
  EXPECT_EQ(now.tiles_read, touched);
  EXPECT_EQ(now.bytes_read, now.unique_bytes);
}

TEST_F(FaceLookupTest, what_is_read_ahead_includes_the_tiles_of_neighbours) {
  const FaceGrid grid(4, 4);
  open(grid, grid.faces([](uint32_t f) { return all_of(static_cast<uint8_t>(5 + f % 3)); }), ramp);
  std::vector<FaceTextureRequest> requests;
  for (const uint32_t face : {0u, 5u, 10u})
    for (const float along : {0.0f, 0.3f, 1.0f})
      for (const auto& [u, v] : {std::pair{0.0f, along}, {1.0f, along}, {along, 0.0f}, {along, 1.0f}})
        requests.push_back({0, face, u, v, 0.05f, 0.05f, 0.5f,
                            along == 0 ? FaceLevelChoice::trilinear : FaceLevelChoice::stochastic});
  reopen(FaceShape::quad, 16, 3);
  cache_->begin_wave();
  ASSERT_TRUE(cache_->stage_faces(requests));
  const uint64_t ahead = cache_->counters().bytes_read;
  std::vector<Texel> values(requests.size());
  ASSERT_TRUE(cache_->look_up_faces(requests, values));
  const TextureCounters now = cache_->counters();
  EXPECT_GT(now.wave_tiles_touched, 4u);
  EXPECT_EQ(now.bytes_read, ahead);
  EXPECT_EQ(now.wave_unique_bytes, ahead);
}

TEST_F(FaceLookupTest, direct_reads_bring_each_block_once_and_the_tiles_that_lie_in_it) {
  const FaceGrid grid(16, 16);
  open(grid, grid.faces([](uint32_t) { return all_of(6); }),
       [](double x, double y, uint32_t c) { return std::fmod(x * 37.7 + y * 91.3 + c, 1.0); });
  cache_.reset();
  FaceTexFile::Options options;
  options.direct = true;
  const auto source = FaceTexSource::open(directory_.path() / "a.facetex", options);
  ASSERT_TRUE(source) << source.error().message;
  const FaceTexFile& file = (*source)->file();
  std::vector<uint64_t> tiles;
  for (uint64_t i = 0; i < file.tiles().size(); ++i)
    if (i % 7 != 3) tiles.push_back(i);
  // What is left for the second stage begins in a run.
  for (const uint64_t limit : {uint64_t{1} << 30, uint64_t{200} << 10}) {
    const uint64_t before = io_use(IoPurpose::textures).read_bytes;
    FaceTexSource::Stage stage = (*source)->begin_stage(tiles, limit);
    ASSERT_GT(stage.tile_count, 0u);
    EXPECT_LE(stage.bytes, limit);
    for (const auto& read : stage.reads) ASSERT_TRUE(read());
    const uint64_t read = io_use(IoPurpose::textures).read_bytes - before;
    EXPECT_LE(read, stage.bytes);
    std::set<uint64_t> blocks;
    for (size_t i = 0; i < stage.tile_count; ++i) {
      const FaceTexTile& tile = file.tiles()[tiles[i]];
      for (uint64_t at = tile.offset / file.block_bytes(); at * file.block_bytes() < tile.offset + tile.size_bytes; ++at)
        blocks.insert(at);
    }
    EXPECT_EQ(stage.bytes, blocks.size() * file.block_bytes());
    (*source)->turn_stage();
    std::vector<std::byte> staged(file.format().tile_bytes()), alone(staged.size());
    const uint64_t tally = thread_read_tally().bytes;
    for (size_t i = 0; i < stage.tile_count; ++i) {
      ASSERT_TRUE((*source)->read_tile(tiles[i], staged));
      ASSERT_TRUE(file.read_tile(tiles[i], alone));
      ASSERT_EQ(staged, alone) << tiles[i];
    }
    EXPECT_EQ(thread_read_tally().bytes, tally);
    tiles.erase(tiles.begin(), tiles.begin() + 5);
  }
}

TEST_F(FaceLookupTest, a_face_that_there_is_not_is_an_error) {
  const FaceGrid grid(1, 1);
  open(grid, grid.faces([](uint32_t) { return all_of(2); }), ramp);
  const FaceTextureRequest request{0, 1, 0.5f, 0.5f, 0, 0, 0, FaceLevelChoice::stochastic};
  Texel texel{};
  EXPECT_FALSE(cache_->look_up_faces({&request, 1}, {&texel, 1}));
}

TEST_F(FaceLookupTest, a_damaged_tile_is_an_error_that_names_the_file) {
  const FaceGrid grid(1, 1);
  open(grid, grid.faces([](uint32_t) { return all_of(2); }), ramp);
  cache_.reset();
  {
    std::fstream file(directory_.path() / "a.facetex", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(30), file.put('x');
  }
  reopen(FaceShape::quad, 1, 3);
  const FaceTextureRequest request{0, 0, 0.5f, 0.5f, 0, 0, 0, FaceLevelChoice::stochastic};
  Texel texel{};
  const Status status = cache_->look_up_faces({&request, 1}, {&texel, 1});
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("a.facetex"), std::string::npos) << status.error().message;
}

// Two triangles that make a unit square; their common edge is edge 1 of both.
TEST_F(FaceLookupTest, triangles_keep_one_colour_and_join_at_their_edge) {
  std::vector<FaceInfo> faces(2);
  for (uint32_t f = 0; f < 2; ++f) {
    faces[f].ulog2 = faces[f].vlog2 = 4;
    faces[f].adjacent_faces[1] = 1 - f, faces[f].adjacent_edges = 1 << 2;
  }
  auto writer = FaceTexWriter::create(directory_.path() / "a.facetex", kFloats);
  ASSERT_TRUE(writer);
  ASSERT_TRUE((*writer)->begin_texture({"two", FaceShape::triangle, FaceBorder::clamp, FaceBorder::clamp, faces}));
  for (uint32_t f = 0; f < 2; ++f)
    ASSERT_TRUE((*writer)->add_face(
        test::painted_face(kFloats, faces[f], FaceShape::triangle, [&](double u, double v, uint32_t c) {
          const double x = f == 0 ? u : 1 - u, y = f == 0 ? v : 1 - v;
          return c == 0 ? 0.5 : c == 1 ? x + 2 * y : std::fmod(37.7 * x + 11.1 * y, 1.0);
        })));
  ASSERT_TRUE((*writer)->finish());
  reopen(FaceShape::triangle, 2, 3);
  for (double u = 0.02; u < 1; u += 0.03) {
    const Texel here = at(0, u, 1 - u), there = at(1, 1 - u, u);
    ASSERT_NEAR(here.value[0], 0.5, 1e-6);
    ASSERT_NEAR(here.value[2], there.value[2], 2e-5) << u;
    // A ramp within a lattice step.
    for (double v = 0.1; v + u < 0.9; v += 0.05)
      ASSERT_NEAR(at(0, u, v).value[1], u + 2 * v, 3.0 / 16 * 0.5) << u << ' ' << v;
  }
  // Beyond the diagonal, where no face of a right mesh asks, is what lies on it.
  EXPECT_NEAR(at(0, 1, 1).value[0], 0.5, 1e-6);
  EXPECT_EQ(at(0, 0.75, 0.75).value[2], at(0, 0.5, 0.5).value[2]);
  // The coarser levels keep the mean.
  EXPECT_NEAR(at(0, 1.0 / 3, 1.0 / 3, 100).value[1] + at(1, 1.0 / 3, 1.0 / 3, 100).value[1], 3, 1e-5);
}

TEST(FaceLayout, neighbours_that_are_not_there_are_refused_wherever_they_are_named) {
  constexpr uint32_t kNowhere = 0x7fffffff;
  for (uint32_t edge = 0; edge < 4; ++edge) {
    std::vector<FaceInfo> faces(2);
    faces[0].adjacent_faces[edge] = 1, faces[0].flags = kFaceIsSubface;
    for (uint32_t& face : faces[1].adjacent_faces) face = kNowhere;
    EXPECT_EQ(first_inconsistent_edge(faces, FaceShape::quad, 0), edge);
    EXPECT_EQ(first_inconsistent_edge(faces, FaceShape::quad, 1), 0u);
  }
}

}  // namespace
}  // namespace spillway::cache
