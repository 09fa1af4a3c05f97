#include "shading/sample_triangle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "tests/support/random.h"

namespace spillway::shading {
namespace {

struct Double3 {
  double x, y, z;
};
double dot(Double3 a, Double3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Double3 cross(Double3 a, Double3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
Double3 towards(Float3 p, Float3 from) {
  const Double3 d{double{p.x} - from.x, double{p.y} - from.y, double{p.z} - from.z};
  const double size = std::sqrt(dot(d, d));
  return {d.x / size, d.y / size, d.z / size};
}

// Van Oosterom and Strackee 1983.
double solid_angle(Float3 p0, Float3 p1, Float3 p2, Float3 receiver) {
  const Double3 a = towards(p0, receiver), b = towards(p1, receiver), c = towards(p2, receiver);
  return 2 * std::atan2(std::fabs(dot(a, cross(b, c))), 1 + dot(a, b) + dot(b, c) + dot(c, a));
}
double solid_angle(const TriangleShape& t, Float3 receiver) {
  return solid_angle(t.position, t.position + t.edge1, t.position + t.edge2, receiver);
}

// Sixteen parts of a triangle, and in which of them a point lies.
struct Parts {
  explicit Parts(const TriangleShape& triangle) : t(triangle) {}
  [[nodiscard]] Float3 corner(int i, int j) const {
    return t.position + t.edge1 * (0.25f * static_cast<float>(i)) + t.edge2 * (0.25f * static_cast<float>(j));
  }
  [[nodiscard]] std::vector<double> expected(Float3 receiver) const {
    std::vector<double> share(32);
    double sum = 0;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4 - i; ++j) {
        share[8 * i + 2 * j] = solid_angle(corner(i, j), corner(i + 1, j), corner(i, j + 1), receiver);
        if (i + j < 3)
          share[8 * i + 2 * j + 1] = solid_angle(corner(i + 1, j + 1), corner(i + 1, j), corner(i, j + 1), receiver);
      }
    for (const double s : share) sum += s;
    for (double& s : share) s /= sum;
    return share;
  }
  [[nodiscard]] int part(Float3 p) const {
    const Double3 e1{t.edge1.x, t.edge1.y, t.edge1.z}, e2{t.edge2.x, t.edge2.y, t.edge2.z};
    const Float3 d = p - t.position;
    const Double3 v{d.x, d.y, d.z};
    const double a = dot(e1, e1), b = dot(e1, e2), c = dot(e2, e2), determinant = a * c - b * b;
    const double b1 = (c * dot(v, e1) - b * dot(v, e2)) / determinant,
                 b2 = (a * dot(v, e2) - b * dot(v, e1)) / determinant;
    const int i = std::clamp(static_cast<int>(b1 * 4), 0, 3), j = std::clamp(static_cast<int>(b2 * 4), 0, 3 - i);
    const bool upper = b1 * 4 - i + (b2 * 4 - j) > 1 && i + j < 3;
    return 8 * i + 2 * j + (upper ? 1 : 0);
  }
  TriangleShape t;
};

struct Case {
  TriangleShape triangle;
  Float3 receiver;
};
const Case kNear[] = {
    {{{-1, -1, 1}, {2, 0, 0}, {0, 2, 0}}, {0, 0, 0}},              // at arm's length
    {{{-1, -1, 0.05f}, {2, 0, 0}, {0, 2, 0}}, {-0.5f, -0.5f, 0}},  // nearly a hemisphere
    {{{-1, 0, 0.2f}, {2, 0, 0}, {0, 3, 0}}, {0, -1, 0.1f}},        // grazing
    {{{5, 1, 0}, {0.1f, 0, 0}, {0, 0.01f, 3}}, {4, 0.5f, 1}},      // a sliver
    {{{100, 200, 50}, {30, 5, 1}, {3, 40, -2}}, {110, 190, 30}},   // large, far from the origin
};

TEST(SampleTriangle, near_triangles_are_sampled_evenly_over_their_solid_angle) {
  test::Random u(7);
  for (const Case& c : kNear) {
    const double expected_angle = solid_angle(c.triangle, c.receiver);
    ASSERT_NEAR(sampled_solid_angle(c.triangle, c.receiver) / expected_angle, 1, 2e-5);
    const Parts parts(c.triangle);
    const std::vector<double> expected = parts.expected(c.receiver);
    std::vector<int> seen(32);
    constexpr int kSamples = 200000;
    for (int i = 0; i < kSamples; ++i) {
      const float x = u();
      const TrianglePoint got = sample_triangle(c.triangle, c.receiver, {x, u()});
      ASSERT_EQ(got.pdf_solid_angle, triangle_pdf_solid_angle(c.triangle, c.receiver, got.point));
      ++seen[parts.part(got.point)];
    }
    double chi_square = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      if (expected[i] == 0) {
        EXPECT_EQ(seen[i], 0);
        continue;
      }
      const double mean = expected[i] * kSamples;
      chi_square += (seen[i] - mean) * (seen[i] - mean) / mean;
    }
    EXPECT_LT(chi_square, 44.3);  // 15 degrees of freedom: one in ten thousand
  }
}

TEST(SampleTriangle, far_ones_are_sampled_evenly_over_their_area) {
  const TriangleShape t{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const Float3 receiver{3, 2, 12};
  EXPECT_EQ(sampled_solid_angle(t, receiver), 0);
  test::Random u(7);
  double sum = 0;
  Float3 mean{0, 0, 0};
  constexpr int kSamples = 100000;
  for (int i = 0; i < kSamples; ++i) {
    const float x = u();
    const TrianglePoint got = sample_triangle(t, receiver, {x, u()});
    sum += 1 / static_cast<double>(got.pdf_solid_angle);
    mean += got.point * (1.0f / kSamples);
  }
  EXPECT_NEAR(sum / kSamples / solid_angle(t, receiver), 1, 1e-3);  // deviates by less than 4 % a sample here
  EXPECT_NEAR(mean.x, 1.0 / 3, 0.004);                              // five deviations of 0.236 / sqrt(samples)
  EXPECT_NEAR(mean.y, 1.0 / 3, 0.004);
}

// What a receiver in the way of nothing can meet: no density may be NaN or negative, no point away from the triangle.
TEST(SampleTriangle, degenerate_receivers_get_finite_numbers) {
  const TriangleShape t{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, point{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}},
      line{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, tiny{{1e-20f, 0, 0}, {1e-20f, 0, 0}, {0, 1e-20f, 0}};
  const Float3 receivers[] = {{0, 0, 0},    {1, 0, 0}, {0.3f, 0.3f, 0}, {0.5f, 0, 0}, {5, 5, 0}, {0.3f, 0.3f, 1e-30f},
                              {1e18f, 0, 1}};
  test::Random u(7);
  for (const TriangleShape& shape : {t, point, line, tiny})
    for (const Float3 receiver : receivers)
      for (int i = 0; i < 100; ++i) {
        const float x = u();
        const TrianglePoint got = sample_triangle(shape, receiver, {x, u()});
        ASSERT_GE(got.pdf_solid_angle, 0);
        ASSERT_TRUE(is_finite(got.point));
        ASSERT_LE(max_abs(got.point), 3);
      }
}

// Of all sizes, near and far, edge-on, without area, and from a corner.
std::vector<TriangleQuery> queries_of_all_kinds() {
  test::Random random(11);
  std::vector<TriangleQuery> queries;
  for (int i = 0; i < 20011; ++i) {
    const float size = std::ldexp(1.0f, static_cast<int>(random.below(24)) - 16);
    TriangleQuery q{{random.point(1), random.point(size), random.point(size)}, random.point(1), {random(), random()}};
    if (i % 50 == 1) q.receiver = q.triangle.position + q.triangle.edge1 * 0.25f;
    if (i % 50 == 2) q.triangle.edge2 = q.triangle.edge1;
    if (i % 50 == 3) q.receiver = q.triangle.position;
    if (i % 50 == 4) q.triangle.position.x = 1e30f;
    queries.push_back(q);
  }
  return queries;
}

TEST(SampleTriangle, several_at_once_have_the_bits_of_each_alone) {
  const std::vector<TriangleQuery> queries = queries_of_all_kinds();
  std::vector<TrianglePoint> points(queries.size());
  sample_triangles(queries, points);
  size_t by_angle = 0;
  for (size_t i = 0; i < queries.size(); ++i) {
    const TriangleQuery& q = queries[i];
    const TrianglePoint alone = sample_triangle(q.triangle, q.receiver, q.u);
    ASSERT_EQ(std::memcmp(&alone, &points[i], sizeof alone), 0) << i;
    by_angle += sampled_solid_angle(q.triangle, q.receiver) > 0 ? 1 : 0;
  }
  EXPECT_GT(by_angle, queries.size() / 10);
  EXPECT_LT(by_angle, queries.size() * 9 / 10);
}

}  // namespace
}  // namespace spillway::shading
