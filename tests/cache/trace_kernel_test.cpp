#include "cache/trace_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "tests/support/kernel_scene.h"

namespace spillway::cache {
namespace {

using test::KernelScene;
using test::PackTriangle;
using test::Random;
using test::ray_from_to;

bool same_bits(const TraceHit& a, const TraceHit& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

std::vector<PackTriangle> soup(uint32_t count, float size, float triangle_size, uint32_t seed, uint32_t first_prim = 0) {
  Random random(seed);
  std::vector<PackTriangle> triangles;
  for (uint32_t i = 0; i < count; ++i) {
    const Float3 p = random.point(size);
    triangles.push_back({{p, p + random.point(triangle_size), p + random.point(triangle_size)}, first_prim + i});
  }
  return triangles;
}

// Every `page` triangles a page.
KernelScene scene_of(std::span<const PackTriangle> triangles, size_t page, test::BuildOptions options = {}) {
  KernelScene scene(options);
  for (size_t first = 0; first < triangles.size(); first += page)
    scene.add_page(triangles.subspan(first, std::min(page, triangles.size() - first)));
  scene.finish();
  return scene;
}

struct DoubleHit {
  double t = INFINITY;
  uint32_t prim = PrimId::kNone;
};

// Moeller and Trumbore 1997, in double precision.
DoubleHit brute_force(std::span<const PackTriangle> triangles, const TraceRay& ray) {
  struct D3 {
    double x, y, z;
  };
  const auto to_double = [](Float3 v) { return D3{v.x, v.y, v.z}; };
  const auto minus = [](D3 a, D3 b) { return D3{a.x - b.x, a.y - b.y, a.z - b.z}; };
  const auto cross = [](D3 a, D3 b) { return D3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; };
  const auto dot = [](D3 a, D3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
  DoubleHit best;
  const D3 o = to_double(ray.origin_world), d = to_double(ray.direction_world);
  for (const PackTriangle& triangle : triangles) {
    const D3 p0 = to_double(triangle.vertex[0]);
    const D3 e1 = minus(to_double(triangle.vertex[1]), p0), e2 = minus(to_double(triangle.vertex[2]), p0);
    const D3 p = cross(d, e2);
    const double det = dot(e1, p);
    if (det == 0) continue;
    const D3 s = minus(o, p0);
    const double u = dot(s, p) / det;
    const D3 q = cross(s, e1);
    const double v = dot(d, q) / det, t = dot(e2, q) / det;
    if (u >= 0 && v >= 0 && u + v <= 1 && t > 0 && t <= ray.t_max && t < best.t) best = {t, triangle.prim};
  }
  return best;
}

TEST(TraceKernel, nearest_hits_are_those_of_brute_force_in_double_precision) {
  const auto triangles = soup(2000, 10, 1.5f, 1);
  const KernelScene scene = scene_of(triangles, 130);
  Random random(2);
  int hits = 0;
  for (int i = 0; i < 5000; ++i) {
    const TraceRay ray = ray_from_to(random.point(12), random.point(8));
    const DoubleHit expected = brute_force(triangles, ray);
    const TraceHit hit = scene.trace(ray);
    // Within 20 roundings of a coordinate the two may choose differently at an edge or between neighbours.
    if (hit.prim != expected.prim) {
      ASSERT_NEAR(hit.t, expected.t, 20 * 0x1p-24 * 24) << i;
      continue;
    }
    if (hit.prim == PrimId::kNone) continue;
    ++hits;
    EXPECT_NEAR(hit.t, expected.t, 1e-5 * std::max(1.0, expected.t)) << i;
  }
  EXPECT_GT(hits, 3000);
}

TEST(TraceKernel, occlusion_is_whether_there_is_a_nearest_hit) {
  const auto triangles = soup(2000, 10, 1.0f, 3);
  const KernelScene scene = scene_of(triangles, 200);
  Random random(4);
  int blocked = 0;
  for (int i = 0; i < 20000; ++i) {
    TraceRay ray = ray_from_to(random.point(12), random.point(12));
    ray.t_max = random.in(0.05f, 1);
    const bool occluded = (scene.trace<TraceMode::occlusion>(ray).flags & kHitOccluded) != 0;
    ASSERT_EQ(occluded, scene.trace(ray).prim != PrimId::kNone) << i;
    blocked += occluded;
  }
  EXPECT_GT(blocked, 4000);
  EXPECT_LT(blocked, 16000);
}

TEST(TraceKernel, a_hit_gives_the_point_it_names) {
  const auto triangles = soup(500, 10, 3, 5);
  const KernelScene scene = scene_of(triangles, 100);
  Random random(6);
  for (int i = 0; i < 5000; ++i) {
    const TraceRay ray = ray_from_to(random.point(12), random.point(8));
    const TraceHit hit = scene.trace(ray);
    if (hit.prim == PrimId::kNone) continue;
    const Float3* v = triangles[hit.prim].vertex;
    const Float3 by_uv = v[0] * (1 - hit.u - hit.v) + v[1] * hit.u + v[2] * hit.v;
    const Float3 along = ray.origin_world + ray.direction_world * hit.t;
    ASSERT_LT(length(by_uv - along), 2e-4f) << i;  // grazing hits of triangles of size 3, coordinates up to 15
  }
}

TEST(TraceKernel, no_ray_slips_between_triangles_of_walls_ten_kilometres_away) {
  const test::Walls walls(64, 10000, 300);
  Random random(7);
  for (int i = 0; i < 1000000; ++i) {
    const TraceRay ray = walls.ray_to_an_edge(random);
    ASSERT_NE(walls.scene.trace(ray).prim, PrimId::kNone) << i;
    ASSERT_TRUE(walls.scene.trace<TraceMode::occlusion>(ray).flags & kHitOccluded) << i;
  }
}

// The rounding of t knows no bound at grazing angles: whether such a hit counts may not depend on the boxes above it.
TEST(TraceKernel, every_tree_over_the_same_triangles_gives_the_same_bits) {
  std::vector<PackTriangle> triangles = soup(300, 10, 12, 8);
  Random random(9);
  for (uint32_t i = 0; i < 300; ++i) {  // slivers, as bevels are
    const Float3 p = random.point(10), along = random.point(12);
    triangles.push_back({{p, p + along, p + along + random.point(1e-3f)}, 300 + i});
  }
  const KernelScene wide = scene_of(triangles, 600), narrow = scene_of(triangles, 7, {.branching = 2, .leaf_fill = 1}),
                    other = scene_of(triangles, 53, {.branching = 5, .leaf_fill = 3});
  int hits = 0;
  for (int i = 0; i < 300000; ++i) {
    // From beside a long edge, away from the triangle at whatever angle: a sliver's t is then off by more than its width.
    const Float3* v = triangles[random.below(600)].vertex;
    const Float3 along = normalize(v[1] - v[0]), normal = normalize(cross(along, v[2] - v[1]));
    const Float3 outward = cross(along, normal) * (dot(cross(along, normal), v[2] - v[1]) > 0 ? -1.0f : 1.0f);
    const Float3 origin = v[0] + (v[1] - v[0]) * random.in(0, 1) + outward * std::exp2(random.in(-22, -12));
    const Float3 away = along * random.in(-1, 1) + outward * random.in(-0.1f, 0.6f) + normal * random.in(-0.3f, 0.3f);
    const TraceRay ray{origin, INFINITY, away, 0};
    const TraceHit hit = wide.trace(ray);
    hits += hit.prim != PrimId::kNone;
    ASSERT_TRUE(same_bits(hit, narrow.trace(ray))) << i;
    ASSERT_TRUE(same_bits(hit, other.trace(ray))) << i;
    ASSERT_EQ(wide.trace<TraceMode::occlusion>(ray).flags, narrow.trace<TraceMode::occlusion>(ray).flags) << i;
  }
  EXPECT_GT(hits, 100000);
}

// Roundings of the largest coordinate, in which the box is padded and the point below computed.
bool lies_in_box_of(const PackTriangle& triangle, const TraceRay& ray, float t) {
  Bounds3 box;
  for (const Float3& v : triangle.vertex) box.grow(v);
  const double margin = 16 * 0x1p-24 * std::max({max_abs(ray.origin_world), max_abs(box.lower), max_abs(box.upper)});
  for (int a = 0; a < 3; ++a) {
    const double at = static_cast<double>(ray.origin_world[a]) + static_cast<double>(t) * ray.direction_world[a];
    if (at < box.lower[a] - margin || at > box.upper[a] + margin) return false;
  }
  return true;
}

TEST(TraceKernel, a_grazing_hit_lies_in_the_box_of_its_triangle) {
  Random random(14);
  int hits = 0;
  for (int i = 0; i < 20000; ++i) {
    const Float3 p = random.point(10);
    const PackTriangle triangle{{p, p + random.point(3), p + random.point(3)}, 0};
    const KernelScene scene = scene_of({&triangle, 1}, 1);
    const Float3 along = triangle.vertex[1] - triangle.vertex[0], across = triangle.vertex[2] - triangle.vertex[0];
    const Float3 inside = triangle.vertex[0] + along * 0.3f + across * 0.3f, normal = normalize(cross(along, across));
    const Float3 direction = along * random.in(-1, 1) + across * random.in(-1, 1) + normal * std::exp2(random.in(-24, -12));
    const TraceRay ray{inside - direction * 3, INFINITY, direction, 0};
    const TraceHit hit = scene.trace(ray);
    if (hit.prim == PrimId::kNone) continue;
    ++hits;
    ASSERT_TRUE(lies_in_box_of(triangle, ray, hit.t)) << i;
  }
  EXPECT_GT(hits, 5000);
}

// Found in a real scene: bevels half a millimetre wide and metres long, and rays that leave beside them. The rounding of t
// exceeds the distance: alone (no box above it) the triangle was hit, below the boxes of a tree it was not.
TEST(TraceKernel, a_sliver_alone_and_in_a_tree_is_hit_alike) {
  struct Case {
    PackTriangle sliver;
    TraceRay ray;
  };
  const Case cases[] = {
      {{{{-2.447899103f, 0.7250559926f, -1.943112016f}, {-0.1824149936f, 0.7250559926f, -1.943112016f}, {-0.1824149936f, 0.7252029777f, -1.942183971f}}, 0},
       {{-1.95154369f, 0.725050449f, -1.94304752f}, INFINITY, {-0.758479178f, -0.249853149f, -0.601899266f}, 0}},
      {{{{-2.447899103f, 0.7271289825f, -1.94025898f}, {-0.1824149936f, 0.7280560136f, -1.940111995f}, {-2.447899103f, 0.7280560136f, -1.940111995f}}, 0},
       {{-0.785308778f, 0.727995932f, -1.94009101f}, INFINITY, {-0.692670822f, -0.278584599f, 0.665280104f}, 0}},
      {{{{-2.497999907f, 2.79094696f, -0.1859859973f}, {2.497999907f, 2.790431023f, -0.1859100014f}, {-2.497999907f, 2.790431023f, -0.1859100014f}}, 0},
       {{-1.22384644f, 2.79042602f, -0.185913831f}, INFINITY, {-0.900604248f, -0.415685654f, -0.126954362f}, 0}}};
  for (const Case& c : cases) {
    // Others in the same corner, on the other side of the ray, so that boxes are small.
    std::vector<PackTriangle> triangles{c.sliver};
    for (uint32_t i = 1; i < 9; ++i) {
      triangles.push_back({{c.sliver.vertex[0], c.sliver.vertex[1], c.sliver.vertex[2]}, i});
      for (Float3& v : triangles.back().vertex) v.z += 0.1f * static_cast<float>(i) * (c.ray.direction_world.z > 0 ? -1.0f : 1.0f);
    }
    const KernelScene alone = scene_of({&c.sliver, 1}, 1), together = scene_of(triangles, 9, {.branching = 8, .leaf_fill = 1});
    const TraceHit a = alone.trace(c.ray), b = together.trace(c.ray);
    EXPECT_TRUE(same_bits(a, b)) << a.prim << ' ' << a.t << " and " << b.prim << ' ' << b.t;
  }
}

TEST(TraceKernel, of_coincident_walls_the_smallest_instance_and_prim_wins_whatever_the_order_of_pages) {
  const std::vector<PackTriangle> wall = soup(40, 3, 4, 10);
  std::vector<std::vector<PackTriangle>> copies(3, wall);
  for (uint32_t c = 0; c < 3; ++c)
    for (PackTriangle& triangle : copies[c]) triangle.prim += 1000 * (2 - c);
  std::vector<int> order{0, 1, 2};
  do {
    KernelScene scene;
    for (const int c : order) scene.add_page(copies[static_cast<size_t>(c)]);
    scene.add_page(wall, 1);
    scene.add_instance(1, Affine3{});
    scene.finish();
    Random random(11);
    int hits = 0;
    for (int i = 0; i < 2000; ++i) {
      const TraceHit hit = scene.trace(ray_from_to(random.point(8), random.point(3)));
      if (hit.prim == PrimId::kNone) continue;
      ++hits;
      ASSERT_EQ(hit.instance, 0u);
      ASSERT_LT(hit.prim, 40u);
    }
    EXPECT_GT(hits, 1000);
  } while (std::next_permutation(order.begin(), order.end()));
}

TEST(TraceKernel, an_instance_is_hit_where_its_moved_triangles_would_be) {
  const std::vector<PackTriangle> triangles = soup(400, 2, 1, 12);
  Affine3 mirrored{};  // scaled unevenly, sheared, mirrored, moved
  const float rows[3][4] = {{-1.5f, 0.2f, 0, 4}, {0.1f, 0.5f, 0, -3}, {0, 0.3f, 2.5f, 1}};
  std::memcpy(mirrored.m, rows, sizeof rows);
  std::vector<PackTriangle> moved = triangles;
  for (PackTriangle& triangle : moved)
    for (Float3& v : triangle.vertex) v = mirrored.point(v);
  KernelScene instanced;
  instanced.add_page(triangles, 1);
  instanced.add_instance(1, mirrored);
  instanced.finish();
  const KernelScene flat = scene_of(moved, 1000);
  Random random(13);
  int hits = 0, differences = 0;
  for (int i = 0; i < 20000; ++i) {
    const TraceRay ray = ray_from_to(random.point(15), mirrored.point(random.point(2)));
    const TraceHit a = instanced.trace(ray), b = flat.trace(ray);
    differences += a.prim != b.prim;
    if (a.prim == PrimId::kNone || a.prim != b.prim) continue;
    ++hits;
    EXPECT_EQ(a.instance, 1u);
    ASSERT_NEAR(a.t, b.t, 1e-3f * b.t) << i;
  }
  EXPECT_GT(hits, 5000);
  EXPECT_LT(differences, 20);  // at silhouettes, where the moved vertices were rounded
}

TEST(TraceKernel, rays_along_axes_and_ends_of_rays_are_exact) {
  const std::vector<PackTriangle> floor{{{{-1, 0, -1}, {1, 0, -1}, {1, 0, 1}}, 0}, {{{-1, 0, -1}, {1, 0, 1}, {-1, 0, 1}}, 1}};
  const KernelScene scene = scene_of(floor, 10);
  const TraceRay down{{0.25f, 2, 0.5f}, INFINITY, {0, -1, 0}, 0};
  EXPECT_EQ(scene.trace(down).t, 2);
  TraceRay ends_there = down;
  ends_there.t_max = 2;  // the end belongs to the ray
  EXPECT_EQ(scene.trace(ends_there).t, 2);
  ends_there.t_max = std::nextafter(2.0f, 0.0f);
  EXPECT_EQ(scene.trace(ends_there).prim, PrimId::kNone);
  EXPECT_EQ(scene.trace(ends_there).t, ends_there.t_max);
  TraceRay starts_there = down;
  starts_there.origin_world.y = 0;  // its beginning does not
  EXPECT_EQ(scene.trace(starts_there).prim, PrimId::kNone);
  TraceRay along{{-5, 0, 0.1f}, INFINITY, {1, 0, 0}, 0};  // in the plane: no area to be hit
  EXPECT_EQ(scene.trace(along).prim, PrimId::kNone);
  TraceRay twice_as_long = down;
  twice_as_long.direction_world = {0, -2, 0};  // t counts in lengths of the direction
  EXPECT_EQ(scene.trace(twice_as_long).t, 1);
}

std::vector<std::byte> micromap(std::initializer_list<Opacity> states) {  // of level 1
  std::vector<std::byte> bytes(sizeof(OpacityMicromap) + 1);
  const uint32_t level = 1;
  std::memcpy(bytes.data(), &level, sizeof level);
  uint8_t packed = 0;
  int shift = 0;
  for (const Opacity state : states) packed = static_cast<uint8_t>(packed | static_cast<uint8_t>(state) << (2 * std::exchange(shift, shift + 1)));
  bytes.back() = std::byte{packed};
  return bytes;
}

TEST(TraceKernel, micro_triangles_let_through_stop_or_ask) {
  // v = 0 row: upright at u 0, inverted, upright at u 1; then the one of v > 1/2.
  const std::vector<PackTriangle> triangles{{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, 0}, {{{0, 0, -1}, {1, 0, -1}, {0, 1, -1}}, 1}};
  const std::vector<std::vector<std::byte>> maps{
      micromap({Opacity::opaque, Opacity::clear, Opacity::unknown, Opacity::clear}), {}};
  KernelScene scene;
  scene.add_page(triangles, 0, maps);
  scene.finish();
  const auto towards = [](float u, float v) { return TraceRay{{u, v, 1}, INFINITY, {0, 0, -1}, 0}; };
  const TraceHit opaque = scene.trace(towards(0.15f, 0.15f)), clear = scene.trace(towards(0.3f, 0.3f)),
                 unknown = scene.trace(towards(0.7f, 0.1f)), above = scene.trace(towards(0.1f, 0.7f));
  EXPECT_EQ(opaque.prim, 0u);
  EXPECT_EQ(opaque.flags, 0u);
  EXPECT_EQ(clear.prim, 1u);
  EXPECT_EQ(unknown.prim, 0u);
  EXPECT_EQ(unknown.flags, kHitAlphaUnknown);
  EXPECT_EQ(above.prim, 1u);
  const auto shadow = [&](float u, float v, float t_max) {
    TraceRay ray = towards(u, v);
    ray.t_max = t_max;
    return scene.trace<TraceMode::occlusion>(ray);
  };
  EXPECT_TRUE(shadow(0.15f, 0.15f, 1.5f).flags & kHitOccluded);
  EXPECT_FALSE(shadow(0.3f, 0.3f, 1.5f).flags & kHitOccluded);
  EXPECT_EQ(shadow(0.7f, 0.1f, 1.5f).flags, kHitAlphaUnknown);
  EXPECT_TRUE(shadow(0.7f, 0.1f, 5).flags & kHitOccluded);  // what is opaque behind it stops for good
}

}  // namespace
}  // namespace spillway::cache
