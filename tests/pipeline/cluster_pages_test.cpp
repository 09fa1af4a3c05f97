#include "pipeline/pack/cluster_pages.h"

#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <random>

#include "cache/base/parallel.h"

namespace spillway::pipeline {
namespace {

// A triangle whose box is that of the two corners.
PackTriangle triangle_between(Float3 a, Float3 b, uint32_t prim) { return {{a, b, {a.x, b.y, a.z}}, prim}; }

std::vector<PackTriangle> random_items(uint32_t count, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-100, 100);
  std::vector<PackTriangle> items;
  for (uint32_t i = 0; i < count; ++i) {
    const Float3 p{place(random), place(random), place(random)};
    items.push_back(triangle_between(p, p + Float3{1, 0.5f, 0.25f}, i));
  }
  return items;
}

Bounds3 bounds_of(const PackTriangle& t) {
  Bounds3 b;
  for (const Float3& v : t.vertex) b.grow(v);
  return b;
}

struct Clustered {
  std::vector<uint32_t> begins, triangles;
  bool operator==(const Clustered&) const = default;
};

Clustered clustered(std::vector<PackTriangle> items, uint32_t page) {
  Clustered result;
  result.begins = cluster_pages(items, {.max_triangles_per_page = page});
  for (const PackTriangle& item : items) result.triangles.push_back(item.prim);
  return result;
}

uint32_t page_size(const Clustered& c, size_t page) {
  const size_t end = page + 1 < c.begins.size() ? c.begins[page + 1] : c.triangles.size();
  return static_cast<uint32_t>(end) - c.begins[page];
}

void expect_a_partition(const Clustered& c, uint32_t count, uint32_t page) {
  ASSERT_FALSE(c.begins.empty());
  EXPECT_EQ(c.begins[0], 0u);
  for (size_t p = 0; p < c.begins.size(); ++p) {
    EXPECT_GE(page_size(c, p), 1u);
    EXPECT_LE(page_size(c, p), page);
    const auto first = c.triangles.begin() + c.begins[p];
    EXPECT_TRUE(std::is_sorted(first, first + page_size(c, p)));
  }
  auto sorted = c.triangles;
  std::sort(sorted.begin(), sorted.end());
  for (uint32_t i = 0; i < count; ++i) ASSERT_EQ(sorted[i], i);
}

TEST(cluster_pages, nothing_makes_no_page) { EXPECT_TRUE(cluster_pages({}, {}).empty()); }

TEST(cluster_pages, every_triangle_is_in_one_page_and_no_page_is_too_large) {
  for (const uint32_t page : {1u, 7u, 1000u, 65536u}) {
    SCOPED_TRACE(page);
    expect_a_partition(clustered(random_items(5000, 1), page), 5000, page);
  }
}

TEST(cluster_pages, what_fits_is_one_page) { EXPECT_EQ(clustered(random_items(1000, 2), 1000).begins.size(), 1u); }

TEST(cluster_pages, coincident_triangles_still_make_full_pages) {
  std::vector<PackTriangle> items(1050);
  for (uint32_t i = 0; i < items.size(); ++i) items[i] = triangle_between({1, 2, 3}, {2, 3, 4}, i);
  const Clustered c = clustered(items, 100);
  expect_a_partition(c, 1050, 100);
  EXPECT_EQ(c.begins.size(), 11u);  // 10.5 rounded up
}

TEST(cluster_pages, neither_threads_nor_input_order_show) {
  auto items = random_items(200000, 3);
  const Clustered expected = on_threads(1, [&] { return clustered(items, 3000); });
  for (const int threads : {2, 7})
    EXPECT_TRUE(on_threads(threads, [&] { return clustered(items, 3000); }) == expected) << threads;
  std::shuffle(items.begin(), items.end(), std::mt19937(4));
  EXPECT_TRUE(clustered(items, 3000) == expected);
}

// Two far groups that do not fit together must not share a page, though the first page would have room.
TEST(cluster_pages, far_groups_are_parted) {
  auto items = random_items(1600, 5);
  for (uint32_t i = 800; i < 1600; ++i)
    for (Float3& v : items[i].vertex) v.x += 1e6f;
  const Clustered c = clustered(items, 1000);
  ASSERT_EQ(c.begins.size(), 2u);
  for (size_t i = 0; i < 1600; ++i) EXPECT_EQ(c.triangles[i] < 800, i < 800);
}

// In a uniform cloud: at least two thirds full (a plain median gives between half and all), and boxes of about the
// volume of the cloud in all, while random pages would each have the whole of it.
TEST(cluster_pages, pages_are_well_filled_and_compact) {
  const auto items = random_items(100000, 6);
  auto permuted = items;
  const auto begins = cluster_pages(permuted, {.max_triangles_per_page = 1000});
  EXPECT_LE(begins.size(), 150u);
  double area = 0;
  Bounds3 all;
  for (size_t p = 0; p < begins.size(); ++p) {
    Bounds3 page;
    const size_t end = p + 1 < begins.size() ? begins[p + 1] : permuted.size();
    for (size_t i = begins[p]; i < end; ++i) page.grow(bounds_of(permuted[i]));
    all.grow(page);
    area += page.half_area();
  }
  // n cubes that tile a cube have n^(1/3) times its surface: 5.3 for 150; half as much again for boxes that are not
  // cubes and triangles that stick out.
  EXPECT_LE(area / all.half_area(), 8);
}

TEST(cluster_pages, hugely_different_scales_end) {
  std::vector<PackTriangle> items(4000);
  float x = 1e-18f;
  for (uint32_t i = 0; i < items.size(); ++i) {
    items[i] = triangle_between({x, 0, 0}, {x, 0, 0}, i);
    if (i % 40 == 0) x *= 2.2f;
  }
  expect_a_partition(clustered(items, 10), 4000, 10);
}

// ---- sets that are not held ----

// Clusters a set through StreamedCuts, holding at most max_set triangles.
Clustered streamed(const std::vector<PackTriangle>& items, uint32_t page, uint64_t max_set, size_t& sets) {
  const ClusterPagesOptions options{.max_triangles_per_page = page};
  const auto pass = [&](const StreamedCuts::Visit& visit) -> Status {
    tbb::parallel_for(size_t{0}, items.size(), size_t{777},
                      [&](size_t i) { visit(std::span(items).subspan(i, std::min<size_t>(777, items.size() - i))); });
    return {};
  };
  const auto cuts = StreamedCuts::make(pass, items.size(), max_set, options);
  EXPECT_TRUE(cuts) << (cuts ? "" : cuts.error().message);
  Clustered result;
  sets = cuts->size();
  for (size_t s = 0; s < sets; ++s) {
    std::vector<PackTriangle> set;
    for (const PackTriangle& item : items)
      if (cuts->set_of(item) == s) set.push_back(item);
    EXPECT_EQ(set.size(), cuts->count(s));
    EXPECT_LE(set.size(), max_set);
    const auto before = static_cast<uint32_t>(result.triangles.size());
    for (const uint32_t begin : cluster_pages(set, options, cuts->depth(s))) result.begins.push_back(before + begin);
    for (const PackTriangle& item : set) result.triangles.push_back(item.prim);
  }
  return result;
}

TEST(cluster_pages, what_may_be_held_does_not_show) {
  const auto items = random_items(50000, 7);
  const Clustered expected = clustered(items, 500);
  for (const uint64_t max_set : {500u, 1700u, 20000u, 50000u}) {
    size_t sets = 0;
    EXPECT_TRUE(streamed(items, 500, max_set, sets) == expected) << max_set;
    EXPECT_GE(sets, 50000 / max_set);
  }
}

TEST(cluster_pages, more_triangles_in_one_place_than_may_be_held_are_an_error) {
  const std::vector<PackTriangle> items(2000, triangle_between({1, 2, 3}, {2, 3, 4}, 0));
  const auto pass = [&](const StreamedCuts::Visit& visit) -> Status {
    visit(items);
    return {};
  };
  const auto cuts = StreamedCuts::make(pass, items.size(), 1000, {.max_triangles_per_page = 100});
  ASSERT_FALSE(cuts);
  EXPECT_NE(cuts.error().message.find("--memory"), std::string::npos);
}

TEST(cluster_pages, a_pass_that_fails_ends_the_cutting) {
  const auto pass = [](const StreamedCuts::Visit&) -> Status { return error("the disk is gone"); };
  EXPECT_FALSE(StreamedCuts::make(pass, 1000, 100, {.max_triangles_per_page = 100}));
}

}  // namespace
}  // namespace spillway::pipeline
