#include "pipeline/render/track_media.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "cache/trace_kernel.h"
#include "pipeline/pack/cut_bricks.h"
#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

// A cloud in the lattice box [-20, 70)^3, of one channel or of three.
class Cloud final : public SampleSource {
 public:
  explicit Cloud(std::vector<float> channels = {1}) : channels_(std::move(channels)) {}
  static float value(int32_t x, int32_t y, int32_t z) {
    const auto wave = [](int32_t i) { return std::sin(0.3 * i); };
    const double v = wave(x) + wave(y) * wave(z) - 0.4;
    return v > 0 ? static_cast<float>(v) : 0;
  }
  [[nodiscard]] LatticeBox bounds() const override { return {{-20, -20, -20}, {70, 70, 70}}; }
  [[nodiscard]] bool is_half() const override { return false; }
  [[nodiscard]] uint32_t channels() const override { return static_cast<uint32_t>(channels_.size()); }
  Status load(const LatticeBox&) override { return {}; }
  void copy(const std::array<int32_t, 3>& corner, int32_t side, std::span<float> samples) const override {
    size_t at = 0;
    const auto inside = [](int32_t i) { return i >= -20 && i < 70; };
    for (const float scale : channels_)
      for (int32_t z = corner[2]; z < corner[2] + side; ++z)
        for (int32_t y = corner[1]; y < corner[1] + side; ++y)
          for (int32_t x = corner[0]; x < corner[0] + side; ++x)
            samples[at++] = inside(x) && inside(y) && inside(z) ? scale * value(x, y, z) : 0;
  }

 private:
  std::vector<float> channels_;
};

constexpr Rgb kTotal{1, 0.5f, 0.25f}, kScattered{0.75f, 0.5f, 0.0625f};  // of colour grids, times the cloud

// The cloud, cut and opened; ten lattice units are a world unit.
class CloudScene {
 public:
  CloudScene(int32_t brick_voxels, uint64_t memory_limit_bytes, Medium medium = grey()) : medium_(medium) {
    const bool colored = medium.kind == MediumKind::color_grid;
    auto file = cache::WriteFile::create(directory_.path() / "volumes.bricks", cache::IoPurpose::pack);
    EXPECT_TRUE(file);
    std::vector<cache::Part> parts;
    const auto add = [&](Cloud cloud) {
      tables_.begin_grid({-21, -21, -21}, {70, 70, 70}, brick_voxels);
      EXPECT_TRUE(cut_bricks(cloud, brick_voxels, "cloud", [&](std::span<const std::byte> brick) -> Status {
        SPILLWAY_TRY(tables_.add_brick(cache::VolumeBrickView(brick), {file->size_bytes(), brick.size()}, "cloud"));
        parts.push_back({file->size_bytes(), brick.size()});
        return file->append(brick);
      }));
    };
    add(colored ? Cloud({kTotal.r, kTotal.g, kTotal.b}) : Cloud());
    if (colored) add(Cloud({kScattered.r, kScattered.g, kScattered.b}));
    EXPECT_TRUE(file->commit());
    cache::PartStore::Options options;
    options.tag = MemoryTag::volumes, options.memory_limit_bytes = memory_limit_bytes;
    const uint64_t smallest = cache::PartStore::smallest_limit_bytes(parts);
    options.memory_limit_bytes = std::max(options.memory_limit_bytes, 2 * smallest);
    auto store =
        cache::PartStore::open(directory_.path() / "volumes.bricks", parts, options, cache::validate_volume_brick);
    EXPECT_TRUE(store) << store.error().message;
    volumes_ = std::make_unique<VolumeStore>(std::move(*store));
    if (!colored) medium_.kind = MediumKind::grid;
    medium_.density_volume = 0, medium_.glow_volume = 0;
    if (colored) medium_.scatter_volume = 1;
    for (Affine3* to_lattice : {&medium_.density_from_world, &medium_.glow_from_world})
      for (int a = 0; a < 3; ++a) to_lattice->m[a][a] = 10;
    for (uint32_t c = 0; c < kBlackBodyEntries; ++c)
      black_bodies_.push_back(Rgb{1, 0.5f, 0.25f} * (static_cast<float>(c) / 1000));
  }
  static Medium grey() {
    Medium medium;
    medium.sigma_a = {0.1f, 0.1f, 0.1f}, medium.sigma_s = {0.9f, 0.9f, 0.9f};
    return medium;
  }
  [[nodiscard]] MediaInputs inputs() const {
    return {{{&medium_, 1}, tables_.view(), black_bodies_}, volumes_.get(), 5};
  }
  void load_all() const {
    std::vector<uint32_t> all(tables_.bricks.size());
    for (uint32_t i = 0; i < all.size(); ++i) all[i] = i;
    EXPECT_TRUE(volumes_->parts().sweep(all, [](uint32_t, std::span<const std::byte>) -> Status { return {}; }));
  }
  [[nodiscard]] cache::PartStore& parts() const { return volumes_->parts(); }

 private:
  test::TemporaryDirectory directory_;
  cache::VolumeTablesBuilder tables_;
  std::unique_ptr<VolumeStore> volumes_;
  Medium medium_;
  std::vector<Rgb> black_bodies_;
};

struct Rays {
  std::vector<cache::TraceRay> rays;
  std::vector<cache::TraceHit> hits;
  cache::RecordStream<PathRecord> paths{cache::StreamOptions{}};
  cache::RecordStream<ShadowRecord> shadows{cache::StreamOptions{}};
};

// Rays from a ball around the cloud, some of them short, some outside of media.
void make_rays(Rays& rays, int count) {
  std::mt19937 random(12);
  std::uniform_real_distribution<float> u(-1, 1);
  for (int i = 0; i < count; ++i) {
    const Float3 from{2.5f + 8 * u(random), 2.5f + 8 * u(random), 2.5f + 8 * u(random)};
    const Float3 to{2.5f + 3 * u(random), 2.5f + 3 * u(random), 2.5f + 3 * u(random)};
    rays.rays.push_back({from, i % 3 == 0 ? 0.7f : INFINITY, to - from, 0});
    rays.hits.push_back(cache::no_hit(rays.rays.back()));
    if (i % 4 == 0) rays.hits.back().t = 0.9f, rays.hits.back().prim = 3;
    PathRecord path{};
    path.sink = static_cast<uint32_t>(i), path.throughput = {1, 0.5f, 0.25f};
    path.medium = i % 7 == 0 ? kNoMedium : 0;
    ASSERT_TRUE(rays.paths.append({&path, 1}));
    const ShadowRecord shadow{path.sink, 0, path.medium, 2, {1, 1, 1}};
    ASSERT_TRUE(rays.shadows.append({&shadow, 1}));
  }
  ASSERT_TRUE(rays.paths.finish() && rays.shadows.finish());
}

struct Tracked {
  TrackMediaScratch results;
  TrackMediaReport report;
};

Tracked track(const CloudScene& scene, const Rays& rays, uint64_t run_limit_bytes = 64 << 20) {
  Tracked tracked;
  TrackMediaOptions options;
  options.run_limit_bytes = run_limit_bytes;
  const Status status = track_media(scene.inputs(), {rays.rays, rays.hits, &rays.paths},
                                    {rays.rays, rays.hits, &rays.shadows}, options, tracked.results, tracked.report);
  EXPECT_TRUE(status) << status.error().message;
  return tracked;
}

void expect_same(const Buffer<SegmentResult>& a, const Buffer<SegmentResult>& b) {
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size_bytes()), 0);
}

Medium coloured_fire() {
  Medium medium;
  medium.sigma_a = {0.5f, 0.25f, 0.125f}, medium.sigma_s = {1, 0.5f, 2};
  medium.glow_kind = GlowKind::temperature, medium.glow = {2, 2, 2}, medium.kelvin_scale = 5000;
  return medium;
}

Medium color_grid() {
  Medium medium;
  medium.kind = MediumKind::color_grid;
  medium.sigma_a = {0, 0, 0}, medium.sigma_s = {1.5f, 1.5f, 1.5f};
  medium.glow_kind = GlowKind::colors, medium.glow = {2, 1, 3};
  return medium;
}

TEST(TrackMedia, the_same_for_bricks_of_every_size_resident_or_not_in_any_number_of_rounds) {
  for (const Medium& medium : {CloudScene::grey(), coloured_fire(), color_grid()}) {
    Rays rays;
    make_rays(rays, 3000);
    const CloudScene all(32, UINT64_MAX, medium);
    all.load_all();
    ASSERT_TRUE(all.parts().all_resident());
    const Tracked wanted = track(all, rays);
    EXPECT_GT(wanted.report.collision_count, 500u);
    EXPECT_EQ(wanted.report.bricks_touched, 0u);
    uint64_t emitting = 0;
    for (const SegmentResult& result : wanted.results.path_results) emitting += is_black(result.emitted) ? 0 : 1;
    EXPECT_EQ(emitting > 0, medium.glow_kind != GlowKind::none);
    for (const int32_t voxels : {8, 16, 32, 64}) {
      const CloudScene few(voxels, 0, medium);
      const Tracked swept = track(few, rays, 30'000);
      EXPECT_GT(swept.report.round_count, 5u);
      EXPECT_EQ(swept.report.step_count, wanted.report.step_count);
      EXPECT_GT(few.parts().counters().parts_evicted, 0u);
      expect_same(wanted.results.path_results, swept.results.path_results);
      expect_same(wanted.results.shadow_results, swept.results.shadow_results);
    }
  }
}

TEST(TrackMedia, each_round_reads_a_brick_once) {
  Rays rays;
  make_rays(rays, 2000);
  const CloudScene few(16, 0);
  const Tracked swept = track(few, rays);
  EXPECT_GE(swept.report.round_count, 1u);  // the first tells most of it, the others what went on
  EXPECT_LE(swept.report.round_count, 4u);
  EXPECT_LE(few.parts().counters().parts_read, swept.report.bricks_touched);
}

// A ray through a thin gas passes most bricks without a step; what it does not ask for is not read.
TEST(TrackMedia, bricks_without_a_point_are_not_read) {
  Medium thin = CloudScene::grey();
  thin.sigma_a = {1e-6f, 1e-6f, 1e-6f}, thin.sigma_s = {1e-6f, 1e-6f, 1e-6f};
  Rays rays;
  make_rays(rays, 2000);
  const CloudScene scene(16, 0, thin);
  const Tracked tracked = track(scene, rays);
  EXPECT_GT(tracked.report.segment_count, 1000u);
  EXPECT_LE(scene.parts().counters().parts_read, tracked.report.step_count);
  EXPECT_LT(tracked.report.step_count, 20u);
}

TEST(TrackMedia, rays_outside_of_media_are_left_alone) {
  Rays rays;
  make_rays(rays, 70);
  const CloudScene scene(32, UINT64_MAX);
  const Tracked tracked = track(scene, rays);
  for (size_t i = 0; i < 70; i += 7) {
    EXPECT_EQ(tracked.results.path_results[i].distance, INFINITY);
    EXPECT_EQ(tracked.results.path_results[i].weight, (Rgb{1, 1, 1}));
    EXPECT_EQ(tracked.results.shadow_results[i].weight, (Rgb{1, 1, 1}));
  }
}

// Trilinear density along a line, integrated finely in double precision.
double optical_depth(Float3 from, Float3 along, float end) {
  constexpr int kSteps = 4000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double s = (i + 0.5) * end / kSteps;
    const double p[3] = {10 * (from.x + along.x * s), 10 * (from.y + along.y * s), 10 * (from.z + along.z * s)};
    for (int corner = 0; corner < 8; ++corner) {
      double weight = 1;
      int32_t at[3];
      for (int a = 0; a < 3; ++a) {
        const double whole = std::floor(p[a]), f = p[a] - whole;
        at[a] = static_cast<int32_t>(whole) + (corner >> a & 1);
        weight *= corner >> a & 1 ? f : 1 - f;
      }
      bool inside = true;
      for (const int32_t i3 : at) inside = inside && i3 >= -20 && i3 < 70;
      if (inside) sum += weight * Cloud::value(at[0], at[1], at[2]) * end / kSteps;
    }
  }
  return sum;
}

TEST(TrackMedia, transmittance_and_collisions_are_those_of_quadrature) {
  const CloudScene scene(32, UINT64_MAX);
  scene.load_all();
  const Float3 lines[][2] = {{{-3, 2, 3}, {1, 0.1f, 0.05f}}, {{9, 9, 8}, {-1, -0.9f, -0.8f}}, {{2, 3, 4}, {0, 0, 1}}};
  for (const auto& line : lines) {
    constexpr float kEnd = 6;
    constexpr int kSamples = 20000;
    double passed = 0, squares = 0;
    int reached = 0;
    for (uint32_t i = 0; i < kSamples; ++i) {
      MediumSegment segment;
      const MediaInputs inputs = scene.inputs();
      segment.medium = inputs.tables.media.data();
      segment.origin_world = line[0], segment.direction_world = normalize(line[1]), segment.end = kEnd;
      segment.key = {{i, 0, 0}, 9};
      const float through = track_segment(inputs, segment, true).weight.r;
      passed += through, squares += through * through;
      reached += track_segment(inputs, segment, false).distance == INFINITY ? 1 : 0;
    }
    const double wanted = std::exp(-optical_depth(line[0], normalize(line[1]), kEnd));
    const double mean = passed / kSamples;
    EXPECT_NEAR(mean, wanted, 4 * std::sqrt((squares / kSamples - mean * mean) / kSamples) + 1e-4);
    EXPECT_NEAR(static_cast<double>(reached) / kSamples, wanted,
                4 * std::sqrt(wanted * (1 - wanted) / kSamples) + 1e-4);
  }
}

// Absorbed, scattered and emitted of each channel, in proportions that are the same everywhere.
TEST(TrackMedia, color_grids_do_to_each_channel_what_quadrature_says) {
  Medium medium = color_grid();
  medium.glow_kind = GlowKind::constant;
  const CloudScene scene(32, UINT64_MAX, medium);
  scene.load_all();
  const MediaInputs inputs = scene.inputs();
  const Float3 from{-3, 2, 3}, along = normalize(Float3{1, 0.1f, 0.05f});
  constexpr int kSamples = 40000;
  double sums[4][3] = {}, squares[4][3] = {};
  for (uint32_t i = 0; i < kSamples; ++i) {
    MediumSegment segment;
    segment.medium = inputs.tables.media.data(), segment.shares = {1, 2, 0.5f};
    segment.origin_world = from, segment.direction_world = along, segment.end = 6, segment.key = {{i, 0, 0}, 9};
    const SegmentResult end = track_segment(inputs, segment, false);
    const bool reached = end.distance == INFINITY;
    const Rgb none{0, 0, 0};
    const Rgb values[4] = {track_segment(inputs, segment, true).weight, reached ? end.weight : none,
                           reached ? none : end.weight, end.emitted};
    for (int v = 0; v < 4; ++v)
      for (int c = 0; c < 3; ++c) {
        const double x = c == 0 ? values[v].r : c == 1 ? values[v].g : values[v].b;
        sums[v][c] += x, squares[v][c] += x * x;
      }
  }
  const double depth = 1.5 * optical_depth(from, along, 6);
  for (int c = 0; c < 3; ++c) {
    const double total[] = {1, 0.5, 0.25}, albedo[] = {0.75, 1, 0.25}, glow[] = {2, 1, 3};
    const double through = std::exp(-total[c] * depth);
    const double wanted[] = {through, through, (1 - through) * albedo[c], (1 - through) * (1 - albedo[c]) * glow[c]};
    for (int v = 0; v < 4; ++v) {
      const double mean = sums[v][c] / kSamples;
      EXPECT_NEAR(mean, wanted[v], 4 * std::sqrt((squares[v][c] / kSamples - mean * mean) / kSamples) + 1e-4)
          << v << ' ' << c;
    }
  }
}

TEST(TrackMedia, homogeneous_emission_is_the_closed_form) {
  Medium medium;
  medium.sigma_a = {0.5f, 1, 2}, medium.sigma_s = {0, 0, 0};
  medium.glow_kind = GlowKind::constant, medium.glow = {3, 2, 1};
  const MediaInputs inputs{{{&medium, 1}, {}, {}}, nullptr, 1};
  double sum[3] = {0, 0, 0};
  constexpr int kSamples = 100000;
  constexpr float kEnd = 1.2f;
  for (uint32_t i = 0; i < kSamples; ++i) {
    MediumSegment segment;
    segment.medium = &medium, segment.end = kEnd, segment.key = {{i, 0, 0}, 9};
    const Rgb e = track_segment(inputs, segment, false).emitted;
    sum[0] += e.r, sum[1] += e.g, sum[2] += e.b;
  }
  EXPECT_NEAR(sum[0] / kSamples, 3 * (1 - std::exp(-0.5 * kEnd)), 0.03);  // four standard errors of a bounded estimate
  EXPECT_NEAR(sum[1] / kSamples, 2 * (1 - std::exp(-1.0 * kEnd)), 0.03);
  EXPECT_NEAR(sum[2] / kSamples, 1 * (1 - std::exp(-2.0 * kEnd)), 0.03);
}

}  // namespace
}  // namespace spillway::pipeline
