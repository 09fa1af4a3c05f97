#include "pipeline/render/park_rays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "tests/support/kernel_scene.h"

namespace spillway::pipeline {
namespace {

constexpr uint32_t kWave = 5000;  // rays: several blocks of the copies
constexpr uint32_t kStepsBefore = 5;  // that a ray took in its wave

RayColumns<PathRecord> column() {
  RayColumns<PathRecord> wave{Buffer<cache::TraceRay>(MemoryTag::rays, kWave),
                              cache::RecordStream<PathRecord>{cache::StreamOptions{}}};
  wave.hot.set_size(0);
  return wave;
}

// Ray n begins at x = n and is of sample n.
RayColumns<PathRecord> wave_of(uint32_t first, uint32_t count) {
  RayColumns<PathRecord> wave = column();
  wave.hot.set_size(count);
  std::vector<PathRecord> records(count);
  for (uint32_t i = 0; i < count; ++i) {
    wave.hot[i].origin_world.x = static_cast<float>(first + i);
    records[i].sample = first + i;
  }
  EXPECT_TRUE(wave.cold.append(std::span<const PathRecord>(records)));
  EXPECT_TRUE(wave.cold.finish());
  return wave;
}

// Parks those of [first, first + count) that `waits` says.
template <class Waits>
void park(ParkedColumn<PathRecord>& parked, uint32_t first, uint32_t count, const Waits& waits) {
  std::vector<cache::TraceHit> hits(count);
  for (uint32_t i = 0; i < count; ++i) hits[i].flags = waits(first + i) ? uint32_t{cache::kHitWaits} : 0u;
  const std::vector<RayCost> costs(count, {kStepsBefore, 0});
  ASSERT_TRUE(parked.park(wave_of(first, count), hits, costs));
}

// The prim that ray n hits: another order than that of the rays.
uint32_t prim_of(float x) { return static_cast<uint32_t>(x) * 7919 % 10007; }

// As a sweep would: every ray hits its prim.
void trace(ParkedColumn<PathRecord>& parked) {
  const ParkedBatch batch = parked.gather();
  ASSERT_EQ(batch.rays.size(), parked.size());
  for (size_t i = 0; i < batch.rays.size(); ++i) {
    batch.hits[i] = {};
    batch.hits[i].prim = prim_of(batch.rays[i].origin_world.x);
    batch.costs[i].tree_steps += batch.hits[i].prim;
  }
  SortRaysScratch scratch;
  parked.set_traced(scratch);
}

// The samples of the next `count` that come back, each with its ray, hit and cost.
std::vector<uint32_t> come_back(ParkedColumn<PathRecord>& parked, size_t count) {
  RayColumns<PathRecord> later = column();
  std::vector<cache::TraceHit> hits(count);
  std::vector<RayCost> costs(count);
  EXPECT_TRUE(parked.give_back(later, hits, costs));
  EXPECT_TRUE(later.cold.finish());
  std::vector<PathRecord> records(later.hot.size());
  EXPECT_TRUE(later.cold.read(0, std::span(records)));
  std::vector<uint32_t> samples;
  for (size_t i = 0; i < records.size(); ++i) {
    EXPECT_EQ(later.hot[i].origin_world.x, static_cast<float>(records[i].sample));
    EXPECT_EQ(hits[i].prim, prim_of(later.hot[i].origin_world.x));
    EXPECT_EQ(costs[i].tree_steps, hits[i].prim + kStepsBefore);
    samples.push_back(records[i].sample);
  }
  return samples;
}

TEST(ParkedColumn, those_that_wait_come_back_once_each_by_what_they_hit) {
  ParkedColumn<PathRecord> parked(kWave, true);
  park(parked, 0, kWave, [](uint32_t i) { return i % 3 == 0; });
  EXPECT_EQ(parked.size(), 1667u);
  EXPECT_EQ(parked.room(), kWave - 1667);
  EXPECT_EQ(parked.of_half(), (std::array<uint64_t, 2>{834, 833}));
  EXPECT_EQ(parked.traced_count(), 0u);
  trace(parked);
  std::vector<uint32_t> samples = come_back(parked, 1000);
  EXPECT_EQ(parked.traced_count(), 667u);
  std::ranges::copy(come_back(parked, 667), std::back_inserter(samples));
  EXPECT_TRUE(std::ranges::is_sorted(samples, {}, [](uint32_t s) { return prim_of(static_cast<float>(s)); }));
  std::ranges::sort(samples);
  for (uint32_t i = 0; i < samples.size(); ++i) ASSERT_EQ(samples[i], 3 * i);
  EXPECT_EQ(parked.size(), 0u);
  EXPECT_EQ(parked.of_half(), (std::array<uint64_t, 2>{0, 0}));
}

// Ray n ends at prim n; they come back in parts.
TEST(ParkedColumn, shadow_rays_take_along_where_they_end) {
  RayColumns<ShadowRecord> wave{Buffer<cache::TraceRay>(MemoryTag::rays, kWave),
                                cache::RecordStream<ShadowRecord>{cache::StreamOptions{}}};
  EndStream ends{cache::StreamOptions{}};
  std::vector<ShadowRecord> records(kWave);
  std::vector<shading::LightPlace> places(kWave);
  for (uint32_t i = 0; i < kWave; ++i) records[i].sample = i, places[i].prim = i;
  EXPECT_TRUE(wave.cold.append(std::span<const ShadowRecord>(records)) && wave.cold.finish());
  EXPECT_TRUE(ends.append(std::span<const shading::LightPlace>(places)) && ends.finish());
  ParkedColumn<ShadowRecord> parked(kWave, false, true);
  std::vector<cache::TraceHit> hits(kWave);
  for (uint32_t i = 0; i < kWave; ++i) hits[i].flags = i % 3 == 0 ? uint32_t{cache::kHitWaits} : 0u;
  ASSERT_TRUE(parked.park(wave, hits, {}, &ends));
  const ParkedBatch batch = parked.gather();
  for (size_t i = 0; i < batch.hits.size(); ++i) batch.hits[i].prim = prim_of(static_cast<float>(i));
  SortRaysScratch scratch;
  parked.set_traced(scratch);
  wave.hot.set_size(0), wave.cold.clear(), ends.clear();
  for (const size_t count : {700, 600, 367}) ASSERT_TRUE(parked.give_back(wave, std::span(hits).first(count), {}, &ends));
  EXPECT_EQ(parked.traced_count(), 0u);
  EXPECT_TRUE(wave.cold.finish() && ends.finish());
  records.resize(1667), places.resize(1667);
  ASSERT_TRUE(wave.cold.read(0, std::span(records)) && ends.read(0, std::span(places)));
  for (size_t i = 0; i < records.size(); ++i) ASSERT_EQ(places[i].prim, records[i].sample) << i;
}

TEST(ParkedColumn, its_slots_are_taken_again_while_others_wait_to_come_back) {
  ParkedColumn<PathRecord> parked(2 * kWave, true);
  test::Random random(3);
  std::set<uint32_t> in, out;  // samples
  uint32_t next = 0;
  for (int round = 0; round < 40; ++round) {
    const uint32_t count = std::min<uint32_t>(random.below(kWave), static_cast<uint32_t>(parked.room()));
    park(parked, next, count, [&](uint32_t i) { return i % 2 == 0 && in.insert(i).second; });
    next += count;
    if (parked.traced_count() == 0) trace(parked);
    for (const uint32_t sample : come_back(parked, std::min(kWave, random.below(static_cast<uint32_t>(parked.traced_count()) + 1))))
      EXPECT_TRUE(out.insert(sample).second) << "came back twice";
    EXPECT_EQ(parked.size(), in.size() - out.size());
  }
  while (parked.size() > 0) {
    if (parked.traced_count() == 0) trace(parked);
    for (const uint32_t sample : come_back(parked, std::min<size_t>(kWave, parked.traced_count())))
      EXPECT_TRUE(out.insert(sample).second) << "came back twice";
  }
  EXPECT_EQ(in, out);
  EXPECT_GT(in.size(), 3 * size_t{kWave});
}

}  // namespace
}  // namespace spillway::pipeline
