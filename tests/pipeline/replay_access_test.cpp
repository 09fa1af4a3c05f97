// Replays of logs made by hand, whose answers are known.
#include "pipeline/render/replay_access.h"

#include <gtest/gtest.h>

#include <array>

namespace spillway::pipeline {
namespace {

constexpr uint64_t kPage = 4096;

// Four pages; a hundred pixels; waves of a hundred paths, each of which needs page 0 and one of its own.
class ReplayAccess : public testing::Test {
 protected:
  ReplayAccess() {
    log_.page_bytes = {kPage, kPage, kPage, kPage};
    SceneFacts& scene = log_.facts.scene;
    scene.trace_bytes = 4 * kPage, scene.largest_page_bytes = kPage;
    scene.pixel_count = 100, scene.samples_per_pixel = 2, scene.max_depth = 0;
    log_.facts.wave_paths = 100;
  }
  // Rays that need the same, so many. What goes on are the first paths of the wave before.
  using Rays = std::vector<std::pair<RayNeeds, uint32_t>>;
  void add_wave(const Rays& rays) {
    log_.begin_wave();
    log_.end_wave({.path_count = 100, .generated_count = 100});
    std::vector<SampledRay> samples;
    std::array<uint64_t, kRayKinds> path = {begun_, before_, before_};
    for (const auto& [needs, count] : rays)
      for (uint32_t i = 0; i < count; ++i) samples.push_back({path[static_cast<size_t>(needs.kind)]++, needs});
    before_ = begun_, begun_ = path[0];
    put_samples(log_.sample_bytes, static_cast<uint32_t>(log_.waves.size() - 1), samples);
  }
  // Two waves of whose hundred rays so many wait.
  void add_two_waves(uint32_t waiting) {
    for (const uint32_t page : {1u, 2u}) {
      add_wave({{{RayKind::camera, {0, page}, {}}, waiting}, {{RayKind::camera, {}, {}}, 100 - waiting}});
    }
  }
  Replay replay(uint64_t page_bytes, const ReplayRates& rates = {}) {
    const auto got = replay_access(
        log_, {.wave_paths = 100, .page_bytes = page_bytes, .spill = 0, .parked_rays = lot_, .park_pairs = 50}, rates);
    EXPECT_TRUE(got) << got.error().message;
    return *got;
  }

  AccessLog log_;
  uint64_t begun_ = 0, before_ = 0;
  uint64_t lot_ = 100;                                            // of each kind
  static constexpr uint64_t kAll = 4 * kPage, kRing = 2 * kPage;  // all pages; none that stays
};

TEST_F(ReplayAccess, what_fits_is_read_once) {
  add_two_waves(100);
  const Replay r = replay(kAll);
  EXPECT_EQ(r.page_bytes, 3 * kPage);
  EXPECT_EQ(r.page_sweeps, 2u);
  EXPECT_EQ(r.wave_count, 2u);
  EXPECT_EQ(r.parked_rays, 0);
}

TEST_F(ReplayAccess, where_many_rays_wait_every_wave_sweeps) {
  add_two_waves(100);
  const Replay r = replay(kRing);
  EXPECT_EQ(r.page_bytes, 4 * kPage);
  EXPECT_EQ(r.page_sweeps, 2u);
  EXPECT_EQ(r.waiting_rays, 200);
}

TEST_F(ReplayAccess, pages_that_few_wait_for_are_read_for_all_of_the_lot_at_once) {
  add_two_waves(10);
  const Replay r = replay(kRing);
  EXPECT_EQ(r.page_bytes, 3 * kPage);
  EXPECT_EQ(r.page_sweeps, 1u);
  EXPECT_EQ(r.parked_rays, 20);
  EXPECT_EQ(r.waiting_rays, 20);
  EXPECT_EQ(r.wave_count, 3u);  // the last one is of those that were parked
}

// Page 0 serves all rays, of which some wait for another one as well: then both are visited once more.
TEST_F(ReplayAccess, pages_that_many_wait_for_are_read_in_their_wave) {
  for (const uint32_t page : {1u, 2u})
    add_wave({{{RayKind::camera, {0}, {}}, 90}, {{RayKind::camera, {0, page}, {}}, 10}});
  const Replay r = replay(kRing);
  EXPECT_EQ(r.page_bytes, (1 + 1 + 3) * kPage);
  EXPECT_EQ(r.page_sweeps, 3u);
  EXPECT_EQ(r.parked_rays, 20);
}

TEST_F(ReplayAccess, where_the_lot_has_no_room_for_them_all_is_read_in_the_wave) {
  lot_ = 15;
  add_two_waves(10);
  const Replay r = replay(kRing);
  EXPECT_EQ(r.parked_rays, 10);
  EXPECT_EQ(r.page_bytes, 4 * kPage);
  EXPECT_EQ(r.page_sweeps, 2u);
}

// To the second wave 18 rays come back, so that it begins 82, of which the first 18 wait; to the third these, and it
// begins the 18 that are left.
TEST_F(ReplayAccess, a_lot_that_is_nearly_full_is_swept_and_comes_back) {
  lot_ = 20;
  add_two_waves(18);
  const Replay r = replay(kRing);
  EXPECT_EQ(r.parked_rays, 18 + 18);
  EXPECT_EQ(r.page_sweeps, 2u);
  EXPECT_EQ(r.page_bytes, 4 * kPage);
  EXPECT_EQ(r.wave_count, 3u);
}

// What is behind a hit is late, its own page is not: nothing waits when that was read.
TEST_F(ReplayAccess, rays_that_hit_in_their_wave_are_not_parked) {
  add_wave({{{RayKind::camera, {1}, {1, 2}}, 20}, {{RayKind::camera, {1}, {1}}, 80}});
  log_.facts.scene.samples_per_pixel = 1;
  const Replay r = replay(kRing);
  EXPECT_EQ(r.parked_rays, 0);
  EXPECT_EQ(r.page_bytes, kPage);
}

// Of a log of one path in two no sample met page 3. The ray that did stands for itself: it alone is parked.
TEST_F(ReplayAccess, rays_that_are_no_samples_stand_for_themselves) {
  RayNeeds single{RayKind::camera, {3}, {}};
  single.is_single = true;
  add_wave({{{RayKind::camera, {0}, {}}, 50}, {single, 1}});
  log_.facts.scene.samples_per_pixel = 1;
  log_.facts.sampled_of = 2;
  EXPECT_EQ(replay(kAll).page_bytes, 2 * kPage);
  const Replay r = replay(kRing);
  EXPECT_EQ(r.page_sweeps, 2u);
  EXPECT_EQ(r.waiting_rays, 100 + 1);
}

// Rays that hit in page 1, behind which are 2 and 3.
TEST_F(ReplayAccess, pages_behind_a_hit_are_needed_while_that_is_not_in_memory) {
  for (int wave = 0; wave < 2; ++wave) add_wave({{{RayKind::camera, {1}, {1, 2, 3}}, 100}});
  EXPECT_EQ(replay(kAll).page_bytes, 3 * kPage);   // then the hit is in memory
  EXPECT_EQ(replay(kRing).page_bytes, 6 * kPage);  // it never is
}

// Half of the paths go on, and send a shadow ray each.
class ReplayOfShadows : public ReplayAccess {
 protected:
  Replay replay_with(std::vector<uint32_t> occluders) {
    log_.facts.scene.max_depth = 1;
    for (int wave = 0; wave < 3; ++wave) {
      const uint32_t later = wave == 0 ? 0 : 50;
      add_wave({{{RayKind::camera, {1}, {}}, 100 - later},
                {{RayKind::continued, {1}, {}}, later},
                {{RayKind::shadow, {0, 1, 2, 3}, occluders}, later}});
      log_.wave().facts = {.path_count = 100, .shadow_count = later, .generated_count = 100 - later};
    }
    return replay(kAll);
  }
};

TEST_F(ReplayOfShadows, which_something_in_memory_occludes_need_no_page) {
  EXPECT_EQ(replay_with({1, 3}).page_bytes, kPage);
}

TEST_F(ReplayOfShadows, whose_occluders_are_not_in_memory_need_all_pages_as_far_as_their_light) {
  EXPECT_EQ(replay_with({2, 3}).page_bytes, 4 * kPage);
}

// Pages whose tops are not known yet are needed by rays that meet their box; of those that fit no tops are kept.
TEST_F(ReplayAccess, boxes_are_needed_until_their_page_is_read) {
  RayNeeds boxed{RayKind::camera, {0}, {}};
  boxed.knows_boxes = true, boxed.boxes = {3};
  for (int wave = 0; wave < 2; ++wave) add_wave({{boxed, 100}});
  EXPECT_EQ(replay(kAll).page_bytes, 2 * kPage);
  EXPECT_EQ(replay(kRing).page_bytes, 3 * kPage);
}

// One in ten tells of boxes: of its ten that meet one, each parks.
TEST_F(ReplayAccess, rays_that_meet_boxes_of_unknown_pages_wait) {
  RayNeeds boxed{RayKind::camera, {}, {}};
  boxed.knows_boxes = true, boxed.boxes = {3};
  add_wave({{boxed, 2}, {{RayKind::camera, {}, {}}, 98}});
  log_.facts.scene.samples_per_pixel = 1, log_.facts.boxed_of = 10;
  const Replay r = replay(kRing);
  EXPECT_EQ(r.parked_rays, 20);
  EXPECT_EQ(r.page_bytes, kPage);
}

// Paths that were parked go on after the sweep, and need what the hit's surroundings need.
TEST_F(ReplayAccess, paths_that_come_back_go_on_as_in_the_log) {
  log_.facts.scene.max_depth = 1, log_.facts.scene.samples_per_pixel = 1;
  add_wave({{{RayKind::camera, {1}, {}}, 10}, {{RayKind::camera, {}, {}}, 90}});
  add_wave({{{RayKind::continued, {3}, {}}, 10}});
  log_.wave().facts = {.path_count = 10, .generated_count = 0};
  const Replay r = replay(kRing);
  EXPECT_EQ(r.parked_rays, 20);
  EXPECT_EQ(r.page_bytes, 2 * kPage);
  EXPECT_EQ(r.page_sweeps, 2u);  // of the lot: pages 1, then 3
  EXPECT_EQ(r.wave_count, 4u);
}

TEST_F(ReplayAccess, more_memory_never_reads_more) {
  for (uint32_t wave = 0; wave < 8; ++wave) {
    log_.facts.scene.samples_per_pixel = 8;
    add_wave({{{RayKind::camera, {wave % 2, 2, 3}, {}}, 100}});
  }
  uint64_t before = UINT64_MAX;
  for (uint64_t pages = 2; pages <= 4; ++pages) {
    const uint64_t bytes = replay(pages * kPage).page_bytes;
    EXPECT_LE(bytes, before) << pages;
    before = bytes;
  }
  EXPECT_EQ(before, 4 * kPage);
}

// Compute is the log's without what logging took, waits are those of the log, or what its probe says of other reads.
TEST_F(ReplayAccess, seconds_of_the_run_that_was_logged_are_its_own) {
  add_two_waves(100);
  log_.waves[0].read_pages = {0, 1}, log_.waves[1].read_pages = {2};
  log_.facts.page_bytes_read = 3 * kPage;
  log_.facts.seconds = 10, log_.facts.log_seconds = 2, log_.facts.page_wait_seconds = 1;
  log_.facts.probe_bytes = kPage, log_.facts.probe_seconds = 5;
  EXPECT_DOUBLE_EQ(replay(kAll).seconds, 8);
  EXPECT_DOUBLE_EQ(replay(kRing).seconds, 7 + 1 + 5);  // page 0 again
  EXPECT_DOUBLE_EQ(replay(kRing, {.disk_bytes_per_second = kPage}).seconds, 7 + 4);
  log_.facts.probe_cpu_seconds = 4, log_.facts.threads = 2;
  EXPECT_DOUBLE_EQ(replay(kRing).seconds, 7 + 1 + 5 + 2);
}

}  // namespace
}  // namespace spillway::pipeline
