// Where rays go that were traced: to the hits, or to the film.

#include "pipeline/render/route_hits.h"

#include <gtest/gtest.h>

#include "tests/support/small_scene.h"

namespace spillway::test {
namespace {

using namespace pipeline;

constexpr uint32_t kWidth = 64, kHeight = 128;

Film make_film() {
  auto film = Film::create({kWidth, kHeight, {0, 0, kWidth, kHeight}, 0, 0}, {});
  EXPECT_TRUE(film) << film.error().message;
  return std::move(film).value();
}

// Camera rays in gas that glows, one a pixel, in front of an even sky. Every other one hits something.
class RouteHits : public testing::Test {
 protected:
  static constexpr size_t kRays = kWidth * kHeight;
  static constexpr float kGlow = 0.25f, kSky = 0.5f;

  RouteHits() : rays_(kRays), hits_(kRays), media_(kRays) {
    sky_.kind = shading::LightKind::infinite, sky_.radiance = {kSky, kSky, kSky};
    settings_.lights.lights = {&sky_, 1}, settings_.lights.cdf = cdf_;
    std::vector<PathRecord> paths(kRays);
    for (uint32_t i = 0; i < kRays; ++i) {
      paths[i] = {.sink = i, .sample = 0, .bounce = 0, .normal_previous = 0, .pdf_previous = 0,
                  .throughput = {1, 1, 1}, .cone_width = 0, .cone_spread = 0, .eta_scale = 1, .position_previous = {}};
      rays_[i] = {{0, 0, 0}, INFINITY, {0, 0, 1}, 0};
      hits_[i].prim = i % 2 == 0 ? kRays - i : PrimId::kNone;
      media_[i].emitted = {kGlow, kGlow, kGlow};
    }
    EXPECT_TRUE(records_.append(paths));
    EXPECT_TRUE(records_.finish() && shadows_.finish());
  }

  Status route(cache::ExternalSort<HitRecord>& sort, Film& film) {
    RouteHitsScratch scratch;
    return route_hits(settings_, {rays_, hits_, &records_, media_}, {{}, {}, &shadows_}, sort, film, scratch, report_);
  }

  shading::Light sky_{};
  const float cdf_[2] = {0, 1};
  PathSettings settings_;
  std::vector<cache::TraceRay> rays_;
  std::vector<cache::TraceHit> hits_;
  std::vector<SegmentResult> media_;
  cache::RecordStream<PathRecord> records_{{}};
  cache::RecordStream<ShadowRecord> shadows_{{}};
  RouteHitsReport report_;
};

// A ray may bring light twice: what its medium emits, and what lies behind.
TEST_F(RouteHits, glow_and_sky_both_reach_the_film) {
  Film film = make_film();
  cache::ExternalSort<HitRecord> sort{{}};
  ASSERT_TRUE(route(sort, film));
  film.set_half_samples(0, 1);
  for (uint32_t i = 0; i < kRays; ++i)
    EXPECT_EQ(film.half_pixel(0, i % kWidth, i / kWidth).g, i % 2 == 0 ? kGlow : kGlow + kSky) << i;
  EXPECT_EQ(report_.escaped_count, kRays / 2);
}

TEST_F(RouteHits, hits_come_by_triangle_however_many_fit_in_memory) {
  test::TemporaryDirectory directory;
  auto scratch = cache::Scratch::create(directory.path(), 0);
  ASSERT_TRUE(scratch);
  for (const uint64_t memory : {UINT64_MAX, uint64_t{64} << 10}) {
    Film film = make_film();
    cache::ExternalSort<HitRecord> sort{{.memory_limit_bytes = memory, .block_bytes = 1 << 14, .scratch = scratch->get()}};
    report_ = {};
    ASSERT_TRUE(route(sort, film) && sort.finish());
    EXPECT_EQ(sort.spilled_bytes() > 0, memory != UINT64_MAX);
    EXPECT_EQ(report_.hit_count, kRays / 2);
    uint32_t expected = 2;
    for (size_t p = 0; p < sort.partition_count(); ++p) {
      const auto part = sort.partition(p);
      ASSERT_TRUE(part);
      for (size_t i = 0; i < part->size(); ++i, expected += 2) {
        EXPECT_EQ((*part)[i].hit.prim, expected);
        EXPECT_EQ((*part)[i].path.sink, kRays - expected);
      }
    }
    EXPECT_EQ(expected, kRays + 2);
  }
}

}  // namespace
}  // namespace spillway::test
