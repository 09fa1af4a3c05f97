#include "pipeline/render/epochs.h"

#include <gtest/gtest.h>

#include <bit>
#include <vector>

namespace spillway::pipeline {
namespace {

// Opens and closes everything; returns the epochs in the order they were opened.
std::vector<Epoch> run(EpochSchedule& schedule) {
  std::vector<Epoch> epochs;
  while (const auto epoch = schedule.open_next()) {
    epochs.push_back(*epoch);
    const auto other = schedule.open_next();
    if (other) epochs.push_back(*other);
    schedule.close(epoch->half);
    if (other) schedule.close(other->half);
  }
  return epochs;
}

TEST(Epochs, every_sample_of_both_halves_is_in_one_epoch) {
  for (const uint32_t spp : {1u, 2u, 7u, 64u, 100u})
    for (const uint32_t smallest : {1u, 8u}) {
      EpochSchedule schedule({spp, 16, smallest});
      uint32_t next[2] = {0, 0};
      for (const Epoch& epoch : run(schedule)) {
        EXPECT_EQ(epoch.first_sample, next[epoch.half]);
        next[epoch.half] += epoch.sample_count;
      }
      EXPECT_EQ(next[0], (spp + 1) / 2);
      EXPECT_EQ(next[1], spp / 2);
      EXPECT_TRUE(schedule.finished());
    }
}

TEST(Epochs, at_most_one_of_each_half_is_open) {
  EpochSchedule schedule({64, 16});
  const auto a = schedule.open_next(), b = schedule.open_next();
  ASSERT_TRUE(a && b);
  EXPECT_NE(a->half, b->half);
  EXPECT_FALSE(schedule.open_next());
  schedule.close(a->half);
  EXPECT_TRUE(schedule.open_next());
}

TEST(Epochs, a_half_grows_by_powers_of_two) {
  EpochSchedule schedule({256, 1 << 16});
  for (const Epoch& epoch : run(schedule)) EXPECT_TRUE(std::has_single_bit(epoch.first_sample + epoch.sample_count));
}

TEST(Epochs, a_stop_leaves_both_halves_equal) {
  EpochSchedule schedule({64, 16});
  const auto a = schedule.open_next();
  schedule.close(a->half);
  const auto b = schedule.open_next(), c = schedule.open_next();
  schedule.stop_early();
  schedule.close(b->half), schedule.close(c->half);
  for (const Epoch& epoch : run(schedule)) EXPECT_LE(epoch.sample_count, 2u);
  EXPECT_TRUE(schedule.finished());
  EXPECT_EQ(schedule.closed_samples()[0], schedule.closed_samples()[1]);
  EXPECT_LT(schedule.closed_samples()[0], 32u);
}

TEST(Epochs, of_a_checked_schedule_wait_for_each_other_and_have_the_sizes_that_no_plan_changes) {
  std::vector<std::vector<uint32_t>> looks(2);
  for (const int plan : {0, 1}) {
    EpochSchedule schedule({200, plan ? 16u : 4096u, plan ? 1u : 512u, true});
    while (const auto a = schedule.open_next()) {
      const auto b = schedule.open_next();
      ASSERT_TRUE(b);
      EXPECT_FALSE(schedule.open_next());
      schedule.close(a->half);
      EXPECT_FALSE(schedule.open_next());  // B is still on its way
      EXPECT_FALSE(schedule.halves_are_equal());
      schedule.close(b->half);
      EXPECT_TRUE(schedule.halves_are_equal());
      looks[plan].push_back(schedule.closed_samples()[0]);
    }
    EXPECT_TRUE(schedule.finished());
  }
  EXPECT_EQ(looks[0], (std::vector<uint32_t>{8, 12, 16, 24, 32, 48, 64, 96, 100}));
  EXPECT_EQ(looks[0], looks[1]);
}

TEST(Epochs, of_a_checked_schedule_reach_an_odd_count) {
  for (const uint32_t samples : {1u, 2u, 3u, 17u, 25u}) {
    EpochSchedule schedule({samples, 16, 1, true});
    run(schedule);
    EXPECT_TRUE(schedule.finished()) << samples;
    EXPECT_EQ(schedule.closed_samples()[0] + schedule.closed_samples()[1], samples);
  }
}

}  // namespace
}  // namespace spillway::pipeline
