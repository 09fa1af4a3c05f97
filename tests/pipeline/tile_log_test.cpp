#include "pipeline/render/tile_log.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

constexpr uint32_t kVersion = 1;
const char* const kKind = "SPWTEST ";

struct Use {
  std::vector<uint64_t> bits;
  std::vector<uint32_t> counts;
  [[nodiscard]] cache::TextureCache::WaveTileUse view() const { return {bits, counts}; }
};

Use some_use(std::mt19937& random, uint32_t tile_count) {
  Use use{std::vector<uint64_t>(tile_count / 64 + 1), std::vector<uint32_t>(tile_count)};
  for (uint32_t tile = 0; tile < tile_count; ++tile) {
    if (random() % 3 == 0) use.bits[tile / 64] |= uint64_t{1} << (tile % 64);
    if (random() % 5 == 0) use.counts[tile] = random() % 300;
  }
  return use;
}

class TileLogTest : public testing::Test {
 protected:
  Status write(TileLog& log) {
    SPILLWAY_TRY(log.finish());
    cache::SectionWriter writer(kKind, kVersion);
    log.add_to(writer);
    return writer.write(path_);
  }
  Status visit(size_t waves, const TileLog::Visit& visitor = {}) {
    SPILLWAY_ASSIGN(const auto file, cache::SectionReader::open(path_, kKind, kVersion));
    return TileLog::visit(file, waves, visitor);
  }

  test::TemporaryDirectory directory_;
  const std::filesystem::path path_ = directory_.path() / "tiles.log";
};

// Some 20 MB of sets, of which no more than the limit, a wave's set and the tables are ever in memory.
TEST_F(TileLogTest, what_many_waves_used_comes_back_within_bounded_memory) {
  constexpr uint32_t kTiles = 200'000, kWaves = 120;
  std::mt19937 random(1);
  std::vector<Use> uses;
  for (int i = 0; i < 3; ++i) uses.push_back(some_use(random, kTiles));
  memory_reset_peaks();
  const uint64_t before = memory_total().current_bytes;
  TileLog log;
  ASSERT_TRUE(log.open(directory_.path(), std::vector<uint32_t>(kTiles, 5000)));
  for (uint32_t wave = 0; wave < kWaves; ++wave) ASSERT_TRUE(log.append(uses[wave % 3].view()));
  ASSERT_TRUE(write(log));
  EXPECT_LT(memory_total().peak_bytes, before + TileLog::kMemoryBytes + 3 * TileLog::kChunkBytes);
  EXPECT_GT(std::filesystem::file_size(path_), 3 * TileLog::kMemoryBytes);
  size_t visited = 0;
  const Status checked = visit(kWaves, [&](size_t wave, const WaveTiles& tiles) {
    EXPECT_EQ(wave, visited++);
    const Use& use = uses[wave % 3];
    Use back{std::vector<uint64_t>(use.bits.size()), std::vector<uint32_t>(kTiles)};
    for (const uint64_t tile : tiles.touched) back.bits[tile / 64] |= uint64_t{1} << (tile % 64);
    for (const auto& [tile, times] : tiles.read) back.counts[tile] = static_cast<uint32_t>(times);
    EXPECT_TRUE(back.bits == use.bits && back.counts == use.counts) << wave;
  });
  EXPECT_TRUE(checked) << checked.error().message;
  EXPECT_EQ(visited, kWaves);
}

// Under right checksums.
TEST_F(TileLogTest, tiles_that_cannot_be_are_refused_by_wave) {
  std::mt19937 random(1);
  const Use use = some_use(random, 1000);
  TileLog log;
  ASSERT_TRUE(log.open(directory_.path(), std::vector<uint32_t>(700, 1)));
  ASSERT_TRUE(log.append(use.view()));
  ASSERT_TRUE(write(log));
  const Status beyond = visit(1);
  ASSERT_FALSE(beyond);
  EXPECT_NE(beyond.error().message.find("tiles of wave 0"), std::string::npos) << beyond.error().message;
  TileLog right;
  ASSERT_TRUE(right.open(directory_.path(), std::vector<uint32_t>(1000, 1)));
  ASSERT_TRUE(right.append(use.view()) && right.append(use.view()));
  ASSERT_TRUE(write(right));
  EXPECT_TRUE(visit(2));
  EXPECT_FALSE(visit(1));
  EXPECT_FALSE(visit(3));
}

TEST_F(TileLogTest, of_a_scene_without_textures_is_empty) {
  TileLog log;
  ASSERT_TRUE(write(log));
  EXPECT_TRUE(visit(7, [](size_t, const WaveTiles&) { ADD_FAILURE(); }));
}

}  // namespace
}  // namespace spillway::pipeline
