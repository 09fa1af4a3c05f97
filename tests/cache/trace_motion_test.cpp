// The kernel on instances that move: at every time they are where a still instance would be.

#include <gtest/gtest.h>

#include <cstring>

#include "pipeline/pack/make_motion.h"
#include "tests/support/kernel_scene.h"
#include "tests/support/random_motion.h"

namespace spillway::cache {
namespace {

using test::KernelScene;
using test::PackTriangle;
using test::Random;
using test::random_affine;
using test::ray_from_to;

std::vector<PackTriangle> soup(uint32_t count, Random& random) {
  std::vector<PackTriangle> triangles;
  for (uint32_t i = 0; i < count; ++i) {
    const Float3 p = random.point(2);
    triangles.push_back({{p, p + random.point(1), p + random.point(1)}, i});
  }
  return triangles;
}

// Far away, and in the world: so that there is a node whose boxes decide.
void finish_with_landmark(KernelScene& scene) {
  const PackTriangle landmark{{{40, 40, 40}, {41, 40, 40}, {40, 41, 40}}, 1000};
  scene.add_page({&landmark, 1});
  scene.finish();
}

bool same_bits(const TraceHit& a, const TraceHit& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

TEST(TraceMotion, a_moving_instance_is_hit_where_a_still_one_would_be_at_that_time) {
  Random random(1);
  int hits = 0;
  for (int i = 0; i < 40; ++i) {
    const std::vector<PackTriangle> triangles = soup(80, random);
    const bool mirrored = i % 3 == 0;
    const Result<Motion> motion =
        pipeline::make_motion(random_affine(random, mirrored), random_affine(random, mirrored));
    ASSERT_TRUE(motion) << motion.error().message;
    KernelScene moving;
    moving.add_page(triangles, 1);
    moving.add_moving_instance(1, *motion);
    finish_with_landmark(moving);
    for (const float time : {0.0f, random.in(0, 1), random.in(0, 1), 1.0f}) {
      KernelScene still;
      const Affine3 place = transform_at(*motion, time);
      still.add_page(triangles, 1);
      still.add_instance(1, place);
      finish_with_landmark(still);
      for (int k = 0; k < 500; ++k) {
        TraceRay ray = ray_from_to(random.point(15), place.point(random.point(2)));
        ray.time = time;
        const TraceHit hit = moving.trace(ray), wanted = still.trace(ray);
        ASSERT_TRUE(same_bits(hit, wanted)) << i << ' ' << time << ' ' << k << ": " << hit.prim << ' ' << wanted.prim;
        ASSERT_EQ(moving.trace<TraceMode::occlusion>(ray).flags, still.trace<TraceMode::occlusion>(ray).flags);
        hits += hit.prim != PrimId::kNone;
      }
    }
  }
  EXPECT_GT(hits, 20000);
}

// Moller and Trumbore in double, on the triangle at the time of the ray.
double distance(const PackTriangle& triangle, const Affine3& place, const TraceRay& ray) {
  struct D3 {
    double x, y, z;
  };
  const auto at = [&](int i) {
    const Float3 p = place.point(triangle.vertex[i]);
    return D3{p.x, p.y, p.z};
  };
  const auto minus = [](D3 a, D3 b) { return D3{a.x - b.x, a.y - b.y, a.z - b.z}; };
  const auto cross = [](D3 a, D3 b) { return D3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; };
  const auto dot = [](D3 a, D3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
  const D3 o{ray.origin_world.x, ray.origin_world.y, ray.origin_world.z};
  const D3 d{ray.direction_world.x, ray.direction_world.y, ray.direction_world.z};
  const D3 e1 = minus(at(1), at(0)), e2 = minus(at(2), at(0)), p = cross(d, e2), s = minus(o, at(0)), q = cross(s, e1);
  const double det = dot(e1, p), u = dot(s, p) / det, v = dot(d, q) / det, t = dot(e2, q) / det;
  return det != 0 && u >= 0 && v >= 0 && u + v <= 1 && t > 0 ? t : INFINITY;
}

TEST(TraceMotion, hits_at_random_times_are_those_of_brute_force) {
  Random random(2);
  const std::vector<PackTriangle> triangles = soup(200, random);
  const Result<Motion> motion = pipeline::make_motion(random_affine(random, false), random_affine(random, false));
  ASSERT_TRUE(motion) << motion.error().message;
  KernelScene scene;
  scene.add_page(triangles, 1);
  scene.add_moving_instance(1, *motion);
  finish_with_landmark(scene);
  int hits = 0, differences = 0;
  for (int i = 0; i < 5000; ++i) {
    const float time = random.in(0, 1);
    const Affine3 place = transform_at(*motion, time);
    TraceRay ray = ray_from_to(random.point(15), place.point(random.point(2)));
    ray.time = time;
    double wanted = INFINITY;
    for (const PackTriangle& triangle : triangles) wanted = std::min(wanted, distance(triangle, place, ray));
    const TraceHit hit = scene.trace(ray);
    if (hit.prim == PrimId::kNone || std::isinf(wanted)) {
      differences += (hit.prim == PrimId::kNone) != std::isinf(wanted);
      continue;
    }
    ++hits;
    ASSERT_NEAR(hit.t, wanted, 1e-3 * wanted) << i;
  }
  EXPECT_GT(hits, 3000);
  EXPECT_LT(differences, 10);  // at silhouettes, where the moved vertices were rounded
}

}  // namespace
}  // namespace spillway::cache
