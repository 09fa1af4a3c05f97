#include "pipeline/pack/build_trees.h"

#include <gtest/gtest.h>

#include <cmath>

namespace spillway::pipeline {
namespace {

// The best tree of triangles that shrink by halves is a chain, deeper than the kernel's stack with two children a node.
TEST(build_trees, what_would_be_too_deep_is_cut_into_halves) {
  std::vector<PackTriangle> triangles;
  for (uint32_t i = 0; i < 110; ++i) {
    const float size = std::ldexp(1.0f, 10 - static_cast<int>(i));
    triangles.push_back({{{0, 0, 0}, {size, 0, 0}, {0, size, size}}, i});
  }
  for (const uint32_t branching : {2u, 8u}) {
    const Buffer<std::byte> page = build_trace_page(triangles, {}, {.branching = branching, .leaf_fill = 1});
    const Status status = cache::validate_trace_page(page, "test");
    EXPECT_TRUE(status) << (status ? "" : status.error().message);
  }
}

// A chain that is too long for the builder, with more at its end than the depth that is left can part.
TEST(build_trees, what_the_builder_gives_up_is_cut_into_halves) {
  std::vector<PackTriangle> triangles;
  for (uint32_t i = 0; i < 60; ++i) {
    const float size = std::ldexp(1.0f, 60 - static_cast<int>(i));
    triangles.push_back({{{size, size, 0}, {1.5f * size, size, 0}, {size, 1.5f * size, size}}, i});
  }
  for (uint32_t i = 60; i < 60000; ++i) {
    const float x = 1e-5f * static_cast<float>(i);
    triangles.push_back({{{x, 0, 0}, {x + 1e-5f, 0, 0}, {x, 0, 1e-5f}}, i});
  }
  const Buffer<std::byte> page = build_trace_page(triangles, {}, {});
  const Status status = cache::validate_trace_page(page, "test");
  EXPECT_TRUE(status) << (status ? "" : status.error().message);
  EXPECT_EQ(cache::trace_page_view(page).header->triangle_count, triangles.size());
}

}  // namespace
}  // namespace spillway::pipeline
