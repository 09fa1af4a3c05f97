#include "pipeline/render/access_log.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <set>

#include "pipeline/render/render_image.h"
#include "pipeline/render/replay_access.h"
#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

class AccessLogTest : public testing::Test {
 protected:
  void SetUp() override {
    auto store = test::pack_small_scene(directory_.path(), "scene", {});
    ASSERT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
  }
  RenderOptions options(const PlanOptions& plan, AccessLog* log) {
    RenderOptions o;
    o.settings = store_->settings();
    o.settings.render.samples_per_pixel = 16;
    o.plan = plan;
    o.access_log = log;
    o.scratch_directory = directory_.path();
    return o;
  }
  RenderReport render(const PlanOptions& plan, AccessLog* log) { return render(options(plan, log)); }
  // Of four times as many waves, so that one sweep more or less is few of them.
  RenderReport render_long(const PlanOptions& plan, AccessLog* log) {
    RenderOptions o = options(plan, log);
    o.settings.render.samples_per_pixel = 64;
    return render(o);
  }
  RenderReport render(const RenderOptions& o) {
    const auto image = render_image(*store_, o);
    EXPECT_TRUE(image) << (image ? "" : image.error().message);
    return image->report;
  }
  std::string bytes() {
    std::ifstream file(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  test::TemporaryDirectory directory_;
  const std::filesystem::path path_ = directory_.path() / "access.log";
  std::unique_ptr<Store> store_;
};

// Every byte that was read is in the log, each page at most once a sweep, those of the lot included.
TEST_F(AccessLogTest, sweeps_of_parked_rays_are_entries_of_their_own) {
  AccessLog log;
  RenderOptions o = options({.wave_paths = 1000, .page_bytes = 200'000, .parked_rays = 500}, &log);
  const std::string hash = render(o).image_hash;
  EXPECT_EQ(log.facts.rays_are_parked, 0u);
  AccessLog parked;
  o.access_log = &parked, o.log_parked = true;
  const RenderReport report = render(o);
  EXPECT_EQ(report.image_hash, hash);
  EXPECT_GT(report.trace.parked_count, 1000u);
  uint64_t bytes_read = 0, swept = 0, sweeps_of_the_lot = 0;
  for (const WaveAccess& wave : parked.waves) {
    for (const uint32_t page : wave.read_pages) bytes_read += parked.page_bytes[page];
    swept += wave.swept_pages.size();
    const bool is_lot = wave.facts.path_count + wave.facts.shadow_count == 0;
    sweeps_of_the_lot += is_lot ? 1 : 0;
    EXPECT_TRUE(std::ranges::includes(wave.swept_pages, wave.read_pages));
    EXPECT_TRUE(!is_lot || wave.attribute_blocks.empty());
  }
  EXPECT_EQ(bytes_read, report.pages.bytes_read);
  EXPECT_EQ(swept, report.trace.pages_touched);
  EXPECT_EQ(parked.waves.size() - sweeps_of_the_lot, report.waves.size());
  EXPECT_GT(sweeps_of_the_lot, 2u);
  ASSERT_TRUE(parked.write(path_));
  const auto back = AccessLog::read(path_);
  ASSERT_TRUE(back) << back.error().message;
  const auto replay = replay_access(*back, {}, {});
  ASSERT_FALSE(replay);
  EXPECT_NE(replay.error().message.find("--log-parked"), std::string::npos) << replay.error().message;
}

TEST_F(AccessLogTest, what_is_written_comes_back) {
  AccessLog log;
  render({.wave_paths = 1000, .page_bytes = 200'000}, &log);
  ASSERT_TRUE(log.write(path_));
  const auto back = AccessLog::read(path_);
  ASSERT_TRUE(back) << back.error().message;
  ASSERT_EQ(back->waves.size(), log.waves.size());
  EXPECT_EQ(back->page_bytes, log.page_bytes);
  EXPECT_EQ(back->attribute_bytes, log.attribute_bytes);
  EXPECT_EQ(back->facts.wave_paths, 1000u);
  size_t read = 0;
  for (size_t w = 0; w < log.waves.size(); ++w) {
    const WaveAccess &a = log.waves[w], &b = back->waves[w];
    EXPECT_EQ(a.facts.path_count, b.facts.path_count);
    EXPECT_TRUE(a.camera_pages == b.camera_pages && a.continued_pages == b.continued_pages &&
                a.shadow_pages == b.shadow_pages && a.camera_boxes == b.camera_boxes &&
                a.later_boxes == b.later_boxes && a.swept_pages == b.swept_pages && a.read_pages == b.read_pages &&
                a.attribute_blocks == b.attribute_blocks && a.read_attribute_blocks == b.read_attribute_blocks);
    read += b.read_pages.size();
  }
  EXPECT_GT(read, store_->pages().size());
  EXPECT_EQ(back->sample_bytes, log.sample_bytes);
}

// Of a small frame every ray is a sample.
TEST_F(AccessLogTest, samples_are_of_all_rays_and_agree_with_the_lists) {
  AccessLog log;
  const RenderReport report = render({.wave_paths = 1000, .page_bytes = 200'000}, &log);
  ASSERT_EQ(log.facts.sampled_of, 1u);
  const auto samples = log.samples();
  ASSERT_TRUE(samples);
  uint64_t occluded = 0;
  for (size_t w = 0; w < log.waves.size(); ++w) {
    std::array<uint64_t, kRayKinds> counts = {};
    std::array<std::set<uint32_t>, kRayKinds> pages;
    for (const SampleRow& ray : samples->rays) {
      if (ray.wave != w) continue;
      const NeedsRow& row = samples->needs_of(ray);
      const auto kind = static_cast<size_t>(row.kind);
      const auto met = samples->pages(row), stops = samples->stops(row);
      const bool is_occluded = row.kind == RayKind::shadow && !stops.empty();
      EXPECT_TRUE(row.knows_boxes && !row.is_single);
      ++counts[kind];
      if (is_occluded) {
        EXPECT_TRUE(std::ranges::includes(met, stops));
      } else {
        pages[kind].insert(met.begin(), met.end());
      }
      if (is_occluded) ++occluded;
    }
    const WaveFacts& facts = log.waves[w].facts;
    EXPECT_EQ(counts, (std::array{facts.generated_count, facts.path_count - facts.generated_count, facts.shadow_count}));
    const std::array lists = {&log.waves[w].camera_pages, &log.waves[w].continued_pages, &log.waves[w].shadow_pages};
    for (size_t kind = 0; kind < kRayKinds; ++kind) EXPECT_TRUE(std::ranges::equal(pages[kind], *lists[kind])) << w;
  }
  EXPECT_EQ(occluded, report.route.occluded_count);
}

// Of images and of face textures, when they fit, when they do not, and read ahead or not: the counters are the log's.
TEST_F(AccessLogTest, tiles_are_those_that_the_counters_count) {
  std::vector<std::vector<uint64_t>> touched_by_first;
  for (const auto& [texture_bytes, read_ahead] : {std::pair{0u, true}, {1u << 16, true}, {1u << 16, false}}) {
    AccessLog log;
    RenderOptions o = options({.wave_paths = 1000, .texture_bytes = texture_bytes}, &log);
    o.read_ahead_textures = read_ahead;
    const RenderReport report = render(o);
    ASSERT_TRUE(log.write(path_));
    const auto file = cache::SectionReader::read(path_, "SPWACCES", AccessLog::kVersion, MemoryTag::scene);
    ASSERT_TRUE(file) << file.error().message;
    const auto tile_bytes = file->array<uint32_t>("tile_bytes");
    ASSERT_TRUE(tile_bytes);
    std::vector<std::vector<uint64_t>> touched;
    uint64_t read_bytes = 0;
    const auto back = AccessLog::read(path_, [&](size_t wave, const WaveTiles& tiles) {
      uint64_t unique = 0, read = 0;
      for (const uint64_t tile : tiles.touched) unique += (*tile_bytes)[tile];
      for (const auto& [tile, times] : tiles.read) read += (*tile_bytes)[tile] * times;
      EXPECT_EQ(unique, report.waves[wave].textures.wave_unique_bytes) << wave;
      EXPECT_EQ(read, report.waves[wave].textures.bytes_read) << wave;
      touched.push_back(tiles.touched), read_bytes += read;
    });
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(touched.size(), report.waves.size());
    EXPECT_EQ(read_bytes, report.textures.bytes_read);
    if (touched_by_first.empty()) touched_by_first = touched;
    EXPECT_TRUE(touched == touched_by_first) << texture_bytes;  // the rays' affair alone
    if (texture_bytes > 0) {
      EXPECT_GT(report.textures.bytes_read, report.textures.unique_bytes);
    }
  }
}

TEST_F(AccessLogTest, damaged_logs_are_refused_by_name) {
  AccessLog log;
  render({.wave_paths = 1000}, &log);
  ASSERT_TRUE(log.write(path_));
  const std::string whole = bytes();
  for (size_t i = 0; i < whole.size(); i += 97) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x10);
    std::ofstream(path_, std::ios::binary) << damaged;
    const auto back = AccessLog::read(path_);
    ASSERT_FALSE(back) << i;
    EXPECT_NE(back.error().message.find("access.log"), std::string::npos);
    std::ofstream(path_, std::ios::binary) << whole.substr(0, i);
    ASSERT_FALSE(AccessLog::read(path_)) << i;
  }
  EXPECT_FALSE(AccessLog::read(store_->directory() / kManifestFile));
}

// Under right checksums: lists that go beyond the tables, and that never end.
TEST_F(AccessLogTest, lists_that_cannot_be_are_refused) {
  AccessLog log;
  log.page_bytes = {4096, 4096};
  log.begin_wave();
  log.wave().camera_pages = {0, 2};
  log.end_wave({});
  ASSERT_TRUE(log.write(path_));
  EXPECT_FALSE(AccessLog::read(path_));
  log.page_bytes.push_back(4096);
  ASSERT_TRUE(log.write(path_));
  EXPECT_TRUE(AccessLog::read(path_));
}

// Whose replay would not end.
TEST_F(AccessLogTest, logs_of_impossible_frames_are_refused) {
  AccessLog log;
  render({.wave_paths = 1000}, &log);
  AccessLog deep = std::move(log);
  deep.facts.scene.max_depth = UINT32_MAX;
  EXPECT_FALSE(replay_access(deep, {.wave_paths = 1000}));
  deep.facts.scene.max_depth = 5, deep.facts.scene.pixel_count = 1ull << 60;
  EXPECT_FALSE(replay_access(deep, {.wave_paths = 1000}));
}

TEST_F(AccessLogTest, with_memory_for_all_each_page_that_is_needed_is_read_once) {
  AccessLog log;
  const RenderReport report = render({.wave_paths = 1000}, &log);
  const auto replay = replay_access(log, {.wave_paths = 1000});
  ASSERT_TRUE(replay) << replay.error().message;
  EXPECT_EQ(replay->attribute_bytes, report.attributes.bytes_read);
  // A sweep also reads pages that come before what stops the rays.
  EXPECT_LE(replay->page_bytes, report.pages.bytes_read);
  EXPECT_GE(static_cast<double>(replay->page_bytes), 0.8 * static_cast<double>(report.pages.bytes_read));
  EXPECT_FALSE(replay->finer_than_log);
  EXPECT_TRUE(replay_access(log, {.wave_paths = 500})->finer_than_log);
}

TEST_F(AccessLogTest, a_log_of_small_waves_foretells_what_other_budgets_and_waves_read) {
  AccessLog log;
  render_long({.wave_paths = 500}, &log);
  for (const uint64_t wave_paths : {500u, 2000u, 8000u})
    for (const uint64_t page_bytes : {150'000u, 400'000u}) {
      const PlanOptions plan{.wave_paths = wave_paths, .page_bytes = page_bytes};
      const RenderReport report = render_long(plan, nullptr);
      const auto replay = replay_access(log, plan);
      ASSERT_TRUE(replay);
      const double waves = static_cast<double>(report.waves.size());
      // Rays that masks let through make waves of a few rays at the end, which the log's averages do not foretell.
      EXPECT_NEAR(static_cast<double>(replay->wave_count) / waves, 1, 0.25) << wave_paths << ' ' << page_bytes;
      EXPECT_NEAR(static_cast<double>(replay->page_bytes) / static_cast<double>(report.pages.bytes_read), 1, 0.2)
          << wave_paths << ' ' << page_bytes;
    }
}

TEST_F(AccessLogTest, a_budget_that_is_too_small_is_refused) {
  AccessLog log;
  render({.wave_paths = 1000}, &log);
  const auto replay = replay_access(log, {.memory_bytes = 1 << 20, .floor_bytes = 1 << 27});
  ASSERT_FALSE(replay);
  EXPECT_NE(replay.error().message.find("at least"), std::string::npos);
  EXPECT_FALSE(replay_access(AccessLog{}, {}));
}

}  // namespace
}  // namespace spillway::pipeline
