#include "pipeline/render/plan.h"

#include <gtest/gtest.h>

#include <cmath>

namespace spillway::pipeline {
namespace {

constexpr uint64_t kMiB = 1 << 20, kGiB = 1 << 30;

// Twice of what an ordinary machine holds.
SceneFacts large_scene() {
  SceneFacts f;
  f.trace_bytes = 40 * kGiB, f.largest_page_bytes = 6 * kMiB;
  f.attribute_bytes = 20 * kGiB, f.largest_attribute_block_bytes = 2 * kMiB;
  f.texture_bytes = 4 * kGiB;
  f.pixel_count = 1920 * 1080, f.samples_per_pixel = 64;
  return f;
}
SceneFacts small_scene() {
  SceneFacts f = large_scene();
  f.trace_bytes = 30 * kMiB, f.attribute_bytes = 15 * kMiB, f.texture_bytes = 20 * kMiB;
  return f;
}
PlanOptions budget(uint64_t bytes) {
  PlanOptions o;
  o.memory_bytes = bytes, o.floor_bytes = 120 * kMiB;
  return o;
}

TEST(Plan, what_fits_is_kept_whole_in_small_waves_without_a_spill) {
  for (const uint64_t bytes : {uint64_t{0}, 2 * kGiB}) {
    const auto plan = plan_render(small_scene(), budget(bytes));
    ASSERT_TRUE(plan);
    EXPECT_TRUE(plan->pages_fit && plan->attributes_fit && plan->textures_fit);
    EXPECT_FALSE(plan->spills);
    EXPECT_EQ(plan->wave_paths, 256u << 10);
    EXPECT_EQ(plan->first_epoch_samples, 1u);
  }
}

TEST(Plan, no_wave_drives_out_what_would_fit_beside_a_smaller_one) {
  const auto whole = plan_render(small_scene(), budget(0));
  PlanOptions fine = budget(0);
  fine.wave_paths = 64 << 10;
  const auto small = plan_render(small_scene(), fine);
  ASSERT_TRUE(whole && small);
  for (uint64_t bytes = small->memory_bytes; bytes < whole->memory_bytes; bytes += 4 * kMiB) {
    const auto plan = plan_render(small_scene(), budget(bytes));
    ASSERT_TRUE(plan) << plan.error().message;
    EXPECT_TRUE(plan->pages_fit && plan->attributes_fit && plan->textures_fit) << bytes;
    EXPECT_LT(plan->wave_paths, 256u << 10) << bytes;
  }
}

// Memory that is given back has to be touched again: only where the budget asks for it.
TEST(Plan, spilled_waves_give_memory_back_only_where_it_is_short) {
  PlanOptions o = budget(0);
  o.wave_paths = 1 << 20, o.spill = 1;
  const auto roomy = plan_render(small_scene(), o);
  ASSERT_TRUE(roomy);
  EXPECT_FALSE(roomy->gives_back);
  bool gave_back = false;
  for (uint64_t bytes = roomy->memory_bytes - kMiB; bytes > 0; bytes -= 16 * kMiB) {
    o.memory_bytes = bytes;
    const auto plan = plan_render(small_scene(), o);
    if (!plan) break;  // the least
    EXPECT_LE(plan->memory_bytes, bytes);
    gave_back = gave_back || plan->gives_back;
    EXPECT_EQ(plan->gives_back, gave_back) << bytes;
  }
  EXPECT_TRUE(gave_back);
  o.memory_bytes = 0, o.spill = 0;
  EXPECT_FALSE(plan_render(small_scene(), o)->gives_back);
}

TEST(Plan, the_budget_holds_and_more_of_it_is_never_slower) {
  double before = INFINITY;
  for (uint64_t bytes = 512 * kMiB; bytes <= 128 * kGiB; bytes *= 2) {
    const auto plan = plan_render(large_scene(), budget(bytes));
    ASSERT_TRUE(plan) << plan.error().message;
    EXPECT_LE(plan->memory_bytes, bytes);
    EXPECT_LE(plan->predicted_seconds, before * 1.04) << bytes;  // a plan that is better by three percent is passed over
    before = plan->predicted_seconds;
  }
}

TEST(Plan, a_scene_far_beyond_the_budget_goes_in_large_waves) {
  const auto plan = plan_render(large_scene(), budget(2 * kGiB));
  ASSERT_TRUE(plan);
  EXPECT_FALSE(plan->pages_fit);
  EXPECT_GE(plan->wave_paths, 1u << 20);
  EXPECT_GT(plan->predicted_page_bytes, large_scene().trace_bytes);
}

TEST(Plan, waves_are_the_same_for_any_budget_that_gives_them_the_same_size) {
  PlanOptions little = budget(2 * kGiB), much = budget(0);
  little.wave_paths = much.wave_paths = 128 << 10;
  const auto swept = plan_render(large_scene(), little), whole = plan_render(large_scene(), much);
  ASSERT_TRUE(swept && whole);
  EXPECT_TRUE(whole->pages_fit && !swept->pages_fit);
  EXPECT_EQ(swept->first_epoch_samples, whole->first_epoch_samples);
  EXPECT_EQ(swept->epoch_samples, whole->epoch_samples);
  EXPECT_GT(whole->first_epoch_samples, 1u);
}

// A scene of hundreds of pages: waves that stay in memory meet few of them, and cost less than to write every ray twice.
TEST(Plan, records_stay_in_memory_where_a_wave_meets_few_pages) {
  SceneFacts city = large_scene();
  city.trace_bytes = 1200 * kMiB, city.attribute_bytes = 400 * kMiB, city.texture_bytes = 0;
  const auto plan = plan_render(city, budget(1 * kGiB));
  ASSERT_TRUE(plan);
  EXPECT_FALSE(plan->pages_fit);
  EXPECT_FALSE(plan->spills);
}

TEST(Plan, lots_hold_a_million_rays_where_missing_pages_weigh_gigabytes) {
  SceneFacts city = large_scene();
  city.trace_bytes = 7 * kGiB, city.attribute_bytes = 1600 * kMiB, city.texture_bytes = 0;
  city.pixel_count = 1280 * 720, city.samples_per_pixel = 16;
  const auto plan = plan_render(city, budget(1 * kGiB));
  ASSERT_TRUE(plan);
  EXPECT_LT(plan->wave_paths, 1u << 20);
  EXPECT_EQ(plan->parked_rays, 1u << 20);
  EXPECT_LE(plan->memory_bytes, 1 * kGiB);
  // As many as a wave has paths where there is no room for them, and where less is missing.
  const auto little = plan_render(city, budget(400 * kMiB));
  ASSERT_TRUE(little);
  EXPECT_EQ(little->parked_rays, little->wave_paths);
  city.trace_bytes = 2 * kGiB;
  const auto less = plan_render(city, budget(1 * kGiB));
  ASSERT_TRUE(less);
  EXPECT_EQ(less->parked_rays, less->wave_paths);
}

TEST(Plan, a_budget_that_is_too_small_is_refused_with_one_that_would_do) {
  const auto refused = plan_render(large_scene(), budget(200 * kMiB));
  ASSERT_FALSE(refused);
  const std::string before = "at least ";
  const size_t at = refused.error().message.find(before);
  ASSERT_NE(at, std::string::npos) << refused.error().message;
  const double mib = std::stod(refused.error().message.substr(at + before.size()));
  EXPECT_TRUE(plan_render(large_scene(), budget(static_cast<uint64_t>((mib + 0.1) * kMiB))));
  const double to_spare = 1 + 120.0 / 32;
  EXPECT_FALSE(plan_render(large_scene(), budget(static_cast<uint64_t>((mib - to_spare - 0.2) * kMiB))));
}

// What a process holds before it begins is measured again by the run that follows the advice.
TEST(Plan, the_budget_that_would_do_still_does_when_the_process_begins_with_more) {
  PlanOptions o = budget(300 * kMiB);
  o.floor_bytes = 280 * kMiB;
  const auto refused = plan_render(large_scene(), o);
  ASSERT_FALSE(refused);
  const std::string message = refused.error().message;
  const double mib = std::stod(message.substr(message.find("at least ") + 9));
  o.memory_bytes = static_cast<uint64_t>(mib * kMiB), o.floor_bytes = 286 * kMiB;
  EXPECT_TRUE(plan_render(large_scene(), o));
}

TEST(Plan, what_the_user_fixes_is_kept) {
  PlanOptions o = budget(4 * kGiB);
  o.wave_paths = 12345, o.page_bytes = 100 * kMiB, o.spill = 1;
  const auto plan = plan_render(large_scene(), o);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->wave_paths, 12345u);
  EXPECT_EQ(plan->page_bytes, 100 * kMiB);
  EXPECT_TRUE(plan->spills);
  o.spill = 0;
  EXPECT_FALSE(plan_render(large_scene(), o)->spills);
}

TEST(Plan, what_is_in_memory_before_anything_is_loaded_is_taken_off_the_budget) {
  PlanOptions o = budget(2 * kGiB);
  const auto with_floor = plan_render(large_scene(), o);
  o.memory_bytes -= o.floor_bytes, o.floor_bytes = 0;
  const auto without = plan_render(large_scene(), o);
  ASSERT_TRUE(with_floor && without);
  EXPECT_EQ(with_floor->memory_bytes, without->memory_bytes + 120 * kMiB);
  EXPECT_EQ(with_floor->wave_paths, without->wave_paths);
  EXPECT_EQ(with_floor->page_bytes, without->page_bytes);
}

TEST(Plan, the_budget_for_textures_gives_them_what_they_want_and_a_little_less_does_not) {
  const SceneFacts f = large_scene();
  const PlanOptions o = budget(0);
  for (const uint64_t wanted : {300 * kMiB, 2 * kGiB, f.texture_bytes}) {
    const uint64_t bytes = budget_for_textures(f, o, wanted);
    ASSERT_GT(bytes, wanted);
    EXPECT_EQ(bytes % kMiB, 0u);
    EXPECT_GE(plan_render(f, budget(bytes))->texture_bytes, wanted);
    EXPECT_LT(plan_render(f, budget(bytes - kMiB))->texture_bytes, wanted);
  }
  EXPECT_EQ(budget_for_textures(f, o, f.texture_bytes + 1), 0u);  // they never get more than all
}

TEST(Plan, large_waves_get_epochs_that_fill_them) {
  PlanOptions o = budget(0);
  o.wave_paths = 32 << 20;
  const auto plan = plan_render(large_scene(), o);
  ASSERT_TRUE(plan);
  EXPECT_GE(uint64_t{plan->epoch_samples} * large_scene().pixel_count, o.wave_paths);
  EXPECT_GE(uint64_t{plan->first_epoch_samples} * large_scene().pixel_count, o.wave_paths);
}

}  // namespace
}  // namespace spillway::pipeline
