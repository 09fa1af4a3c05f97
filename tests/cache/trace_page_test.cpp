#include "cache/trace_page.h"

#include <gtest/gtest.h>

#include <cstring>

#include "cache/base/hash.h"
#include "tests/support/kernel_scene.h"

namespace spillway::cache {
namespace {

using test::PackTriangle;
using test::Random;

// Two levels of nodes, and a micromap.
std::vector<std::byte> small_page() {
  Random random(1);
  std::vector<PackTriangle> triangles;
  for (uint32_t i = 0; i < 40; ++i) {
    const Float3 p = random.point(5);
    triangles.push_back({{p, p + random.point(1), p + random.point(1)}, i});
  }
  std::vector<std::vector<std::byte>> maps(triangles.size());
  maps[7].resize(sizeof(OpacityMicromap) + 4);  // 16 micro-triangles
  const uint32_t level = 2;
  std::memcpy(maps[7].data(), &level, sizeof level);
  const Buffer<std::byte> built = pipeline::build_trace_page(triangles, maps, {});
  return {built.begin(), built.end()};
}

void seal(std::vector<std::byte>& page) {
  constexpr size_t kCovered = offsetof(TracePageHeader, size_bytes);
  const uint64_t sum = checksum(page.data() + kCovered, page.size() - kCovered);
  std::memcpy(page.data() + offsetof(TracePageHeader, checksum), &sum, sizeof sum);
}

// Memory of its own, exactly as large as the page, so that a sanitizer sees every read beyond it.
Status validate(const std::vector<std::byte>& page) { return validate_trace_page(page, "pages.trace: part 3"); }

void trace_through(const std::vector<std::byte>& bytes) {
  const TracePageView page = trace_page_view(bytes);
  const PageObject world{kLeafBit, 0, {page.header->lower, page.header->upper}};
  const PageTreeEntry entry{0, 0};
  const Instance identity{};
  const PageTree tree{{}, {&entry, 1}, {&world, 1}, {&identity, 1}, 10};
  Random random(2);
  for (int i = 0; i < 20; ++i) {
    const TraceRay ray = test::ray_from_to(random.point(8), random.point(4));
    TraceHit hit = no_hit(ray);
    TraceCounters work;
    trace_page<TraceMode::nearest>(page, 0, tree, ray, hit, work);
    hit = no_hit(ray);
    trace_page<TraceMode::occlusion>(page, 0, tree, ray, hit, work);
    ASSERT_LT(work.nodes, 10000u);
  }
}

TEST(TracePage, a_good_page_is_valid_and_traced) {
  const auto page = small_page();
  const Status valid = validate(page);
  ASSERT_TRUE(valid) << valid.error().message;
  EXPECT_GT(trace_page_view(page).header->node_count, 1u);
  trace_through(page);
}

TEST(TracePage, every_prefix_is_refused_by_name) {
  const auto page = small_page();
  for (size_t size = 0; size < page.size(); size += size < 256 ? 1 : 61) {
    const Status valid = validate({page.begin(), page.begin() + static_cast<ptrdiff_t>(size)});
    ASSERT_FALSE(valid) << size;
    ASSERT_NE(valid.error().message.find("pages.trace: part 3"), std::string::npos);
  }
}

TEST(TracePage, every_flipped_byte_is_refused) {
  auto page = small_page();
  for (size_t i = 0; i < page.size(); ++i) {
    page[i] ^= std::byte{0x40};
    ASSERT_FALSE(validate(page)) << i;
    page[i] ^= std::byte{0x40};
  }
}

TEST(TracePage, flipped_bits_under_a_right_checksum_are_refused_or_can_be_traced) {
  const auto good = small_page();
  int refused = 0, traced = 0;
  const TracePageHeader& header = *trace_page_view(good).header;
  const size_t used = sizeof(TracePageHeader) + header.node_count * sizeof(TraceNode) + header.leaf_count * sizeof(TraceLeaf) + 512;
  for (size_t i = 0; i < std::min(good.size(), used); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      auto page = good;
      page[i] ^= std::byte(1 << bit);
      seal(page);
      if (!validate(page)) {
        ++refused;
        continue;
      }
      ++traced;
      trace_through(page);
    }
  EXPECT_GT(refused, 500);
  EXPECT_GT(traced, 500);
}

TEST(TracePage, what_the_kernel_would_follow_astray_is_refused) {
  const auto good = small_page();
  const auto refused = [&](auto&& damage) {
    auto page = good;
    const TracePageView view = trace_page_view(page);
    damage(const_cast<TracePageHeader&>(*view.header), const_cast<TraceNode*>(view.nodes), const_cast<TraceLeaf*>(view.leaves));
    seal(page);
    return !validate(page);
  };
  const auto& n = trace_page_view(good);
  ASSERT_FALSE(n.nodes[0].child[0] & kLeafBit && n.nodes[0].child[1] & kLeafBit);
  EXPECT_FALSE(refused([](auto&, auto*, auto*) {}));
  EXPECT_TRUE(refused([](auto&, TraceNode* nodes, auto*) { nodes[0].child[0] = 0; })) << "a node is its own child";
  EXPECT_TRUE(refused([](auto&, TraceNode* nodes, auto*) { nodes[0].child[0] = nodes[0].child[1]; })) << "a child twice";
  EXPECT_TRUE(refused([](auto& header, TraceNode* nodes, auto*) { nodes[0].child[0] = header.node_count; }));
  EXPECT_TRUE(refused([](auto& header, TraceNode* nodes, auto*) { nodes[0].child[0] = kLeafBit | header.leaf_count; }));
  EXPECT_TRUE(refused([](auto&, TraceNode* nodes, auto*) { nodes[0].child_count = 9; }));
  EXPECT_TRUE(refused([](auto&, TraceNode* nodes, auto*) { nodes[0].child_count = 0; }));
  EXPECT_TRUE(refused([](auto&, TraceNode* nodes, auto*) { nodes[0].scale[1] = NAN; }));
  EXPECT_TRUE(refused([](auto&, auto*, TraceLeaf* leaves) { leaves[0].vertex[1][2][0] = INFINITY; }));
  EXPECT_TRUE(refused([](auto& header, auto*, auto*) { header.root = header.node_count; }));
  EXPECT_TRUE(refused([](auto& header, auto*, auto*) { header.leaf_count = 0x7fffffff; }));
  EXPECT_TRUE(refused([](auto& header, auto*, auto*) { header.node_count = 0xffffffff; }));
  EXPECT_TRUE(refused([](auto& header, auto*, auto*) { header.flags |= 0x80; }));
  EXPECT_TRUE(refused([](auto& header, auto*, auto*) { header.version += 1; }));
}

TEST(TracePage, the_same_triangles_make_the_same_bytes) { EXPECT_EQ(small_page(), small_page()); }

}  // namespace
}  // namespace spillway::cache
