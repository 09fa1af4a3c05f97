#include "pipeline/render/park_rays.h"

#include <gtest/gtest.h>

#include <vector>

namespace spillway::pipeline {
namespace {

constexpr uint32_t kRays = 10;

RayColumns<PathRecord> column() {
  return {Buffer<cache::TraceRay>(MemoryTag::rays, kRays), cache::RecordStream<PathRecord>{cache::StreamOptions{}}};
}

// Ray i begins at x = i and is of sample i.
RayColumns<PathRecord> wave() {
  RayColumns<PathRecord> wave = column();
  std::vector<PathRecord> records(kRays);
  for (uint32_t i = 0; i < kRays; ++i) {
    wave.hot[i].origin_world.x = static_cast<float>(i);
    records[i].sample = i;
  }
  EXPECT_TRUE(wave.cold.append(std::span<const PathRecord>(records)));
  EXPECT_TRUE(wave.cold.finish());
  return wave;
}

// What comes back into an empty wave that has room for so many.
std::vector<uint32_t> come_back(ParkedColumn<PathRecord>& parked, size_t room) {
  RayColumns<PathRecord> later = column();
  later.hot.set_size(0);
  EXPECT_TRUE(parked.unpark(later, room));
  EXPECT_TRUE(later.cold.finish());
  std::vector<PathRecord> records(later.hot.size());
  EXPECT_TRUE(later.cold.read(0, std::span(records)));
  std::vector<uint32_t> samples;
  for (size_t i = 0; i < records.size(); ++i) {
    EXPECT_EQ(later.hot[i].origin_world.x, static_cast<float>(records[i].sample));
    samples.push_back(records[i].sample);
  }
  return samples;
}

TEST(ParkedColumn, those_that_wait_come_back_once_each_as_there_is_room) {
  ParkedColumn<PathRecord> parked(kRays);
  std::vector<cache::TraceHit> hits(kRays);
  for (const uint32_t i : {0u, 1u, 4u, 6u, 8u}) hits[i].flags = cache::kHitWaits;
  ASSERT_TRUE(parked.park(wave(), hits));
  EXPECT_EQ(parked.of_half(), (std::array<uint64_t, 2>{4, 1}));
  EXPECT_EQ(parked.room(), kRays - 5);
  EXPECT_EQ(come_back(parked, 2), (std::vector<uint32_t>{6, 8}));
  EXPECT_EQ(come_back(parked, 2), (std::vector<uint32_t>{1, 4}));
  EXPECT_EQ(parked.of_half(), (std::array<uint64_t, 2>{1, 0}));
  EXPECT_EQ(come_back(parked, 2), (std::vector<uint32_t>{0}));
  EXPECT_EQ(come_back(parked, 2), std::vector<uint32_t>{});
  EXPECT_EQ(parked.of_half(), (std::array<uint64_t, 2>{0, 0}));
}

}  // namespace
}  // namespace spillway::pipeline
