#include "pipeline/render/sort_rays.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

namespace spillway::pipeline {
namespace {

using cache::TraceRay;

std::vector<TraceRay> random_rays(size_t count, Float3 size, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1, 1);
  std::vector<TraceRay> rays(count);
  for (TraceRay& ray : rays)
    ray = {{unit(random) * size.x, unit(random) * size.y, unit(random) * size.z}, INFINITY,
           {unit(random), unit(random), unit(random)}, 0};
  return rays;
}

std::vector<uint32_t> sorted(std::span<const TraceRay> paths, std::span<const TraceRay> shadows, const Bounds3& bounds,
                             SortRaysOptions options = {}) {
  SortRaysScratch scratch;
  std::vector<uint32_t> order(paths.size() + shadows.size());
  sort_rays(paths, shadows, bounds, order, options, scratch);
  return order;
}

bool is_permutation_of_indices(std::vector<uint32_t> order) {
  std::ranges::sort(order);
  for (uint32_t i = 0; i < order.size(); ++i)
    if (order[i] != i) return false;
  return true;
}

// Mean distance between the origins of neighbours in the order.
double mean_step(std::span<const TraceRay> rays, std::span<const uint32_t> order) {
  double sum = 0;
  for (size_t i = 1; i < order.size(); ++i)
    sum += length(rays[order[i]].origin_world - rays[order[i - 1]].origin_world);
  return sum / static_cast<double>(order.size() - 1);
}

const Bounds3 kCube{{-1, -1, -1}, {1, 1, 1}};

TEST(SortRays, the_order_is_a_permutation_of_both_kinds) {
  const auto paths = random_rays(70001, {1, 1, 1}, 1), shadows = random_rays(30011, {1, 1, 1}, 2);
  EXPECT_TRUE(is_permutation_of_indices(sorted(paths, shadows, kCube)));
  EXPECT_TRUE(is_permutation_of_indices(sorted({}, shadows, kCube)));
  EXPECT_TRUE(is_permutation_of_indices(sorted(paths, {}, kCube)));
  EXPECT_TRUE(sorted({}, {}, kCube).empty());
}

TEST(SortRays, kinds_are_apart) {
  const auto paths = random_rays(5000, {1, 1, 1}, 1), shadows = random_rays(5000, {1, 1, 1}, 2);
  EXPECT_TRUE(std::ranges::is_partitioned(sorted(paths, shadows, kCube), [](uint32_t i) { return i < 5000; }));
}

TEST(SortRays, equal_rays_keep_their_order) {
  const std::vector<TraceRay> paths(5000, random_rays(1, {1, 1, 1}, 3)[0]);
  const std::vector<uint32_t> order = sorted(paths, paths, kCube);
  EXPECT_TRUE(std::ranges::is_sorted(order));
}

TEST(SortRays, octants_of_direction_are_apart_inside_a_coarse_cell) {
  // All origins lie in one of the 2^16 coarse cells, whose sides are 2 / 64 at the least.
  auto rays = random_rays(20000, {0.01f, 0.01f, 0.01f}, 4);
  for (TraceRay& ray : rays) ray.origin_world += Float3{0.015f, 0.015f, 0.015f};
  const auto octant = [&](uint32_t i) {
    const Float3 d = rays[i].direction_world;
    return std::signbit(d.x) * 4 + std::signbit(d.y) * 2 + std::signbit(d.z);
  };
  EXPECT_TRUE(std::ranges::is_sorted(sorted(rays, {}, kCube), {}, octant));
}

TEST(SortRays, neighbours_in_the_order_are_neighbours_in_space) {
  // A Morton curve through n points of a cube of side s takes steps of about s n^(-1/3) times a small constant:
  // 2 / 39 = 0.05 for 60000 points, against 1.32 in random order (mean distance of two random points). 0.1 allows a constant of
  // 2.6, and is out of reach without sorting by position.
  const auto cube = random_rays(60000, {1, 1, 1}, 5);
  std::vector<uint32_t> identity(cube.size());
  std::iota(identity.begin(), identity.end(), 0u);
  EXPECT_LT(mean_step(cube, sorted(cube, {}, kCube)), 0.1 * mean_step(cube, identity));
  // A flat city: cells must not be spent on its height. In two dimensions 2000 / 245 = 8 against 1043; with a third of
  // the coarse bits on the height, cells of 31 x 62 would hold 60 points each in random order: steps of 25 and more.
  const auto flat = random_rays(60000, {1000, 1000, 1}, 6);
  EXPECT_LT(mean_step(flat, sorted(flat, {}, {{-1000, -1000, -1}, {1000, 1000, 1}})), 0.02 * mean_step(flat, identity));
}

TEST(SortRays, threads_and_scratch_do_not_show) {
  const auto paths = random_rays(100000, {1, 1, 1}, 7), shadows = random_rays(100000, {1, 1, 1}, 8);
  const std::vector<uint32_t> expected = sorted(paths, shadows, kCube);
  SortRaysScratch scratch;
  for (const int threads : {1, 2, 7}) {
    std::vector<uint32_t> order(200000);
    tbb::task_arena(threads).execute([&] { sort_rays(paths, shadows, kCube, order, {}, scratch); });
    EXPECT_EQ(order, expected);
    // A larger wave's scratch serves a smaller one.
    std::vector<uint32_t> small(1000);
    sort_rays(std::span(paths).first(600), std::span(shadows).first(400), kCube, small, {}, scratch);
    EXPECT_TRUE(is_permutation_of_indices(small));
  }
}

TEST(SortRays, scratch_is_what_it_is_said_to_be) {
  const auto paths = random_rays(10000, {1, 1, 1}, 9);
  memory_reset_peaks();
  const uint64_t before = memory_use(MemoryTag::rays).current_bytes;
  sorted(paths, {}, kCube);
  EXPECT_EQ(memory_use(MemoryTag::rays).peak_bytes - before, sort_rays_scratch_bytes(10000));
}

TEST(SortRays, off_means_the_identity_without_memory) {
  const auto paths = random_rays(1000, {1, 1, 1}, 10);
  memory_reset_peaks();
  const uint64_t before = memory_use(MemoryTag::rays).current_bytes;
  const std::vector<uint32_t> order = sorted(paths, paths, kCube, {.enabled = false});
  EXPECT_EQ(memory_use(MemoryTag::rays).peak_bytes, before);
  for (uint32_t i = 0; i < order.size(); ++i) EXPECT_EQ(order[i], i);
}

TEST(SortRays, strange_origins_and_bounds_still_give_a_permutation) {
  auto rays = random_rays(1000, {100, 100, 100}, 11);  // mostly outside the bounds
  rays[3].origin_world.x = NAN;
  rays[4].origin_world.y = INFINITY;
  rays[5].origin_world.z = -INFINITY;
  EXPECT_TRUE(is_permutation_of_indices(sorted(rays, {}, kCube)));
  EXPECT_TRUE(is_permutation_of_indices(sorted(rays, {}, Bounds3{})));
  EXPECT_TRUE(is_permutation_of_indices(sorted(rays, {}, {{1, 1, 1}, {1, 1, 1}})));
  EXPECT_TRUE(is_permutation_of_indices(sorted(rays, {}, {{-3e38f, 0, 0}, {3e38f, 0, 1e-40f}})));
}

}  // namespace
}  // namespace spillway::pipeline
