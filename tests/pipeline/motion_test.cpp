// A scene in which all moves that can: the same bits however it is rendered, and every hit shaded where it was found.

#include <gtest/gtest.h>

#include <cmath>

#include "cache/base/parallel.h"
#include "pipeline/render/attribute_store.h"
#include "pipeline/render/generate_rays.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/shade_hits.h"
#include "tests/support/kernel_scene.h"
#include "tests/support/reference_integrator.h"
#include "tests/support/small_scene.h"

namespace spillway::test {
namespace {

using namespace pipeline;

class MovingScene : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = std::make_unique<TemporaryDirectory>();
    auto store = pack_small_scene(directory_->path(), "scene", {.moves = true});
    ASSERT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
    hash_ = render(options(), 2, *store_).report.image_hash;
  }
  static void TearDownTestSuite() { store_.reset(), directory_.reset(); }

  static RenderOptions options() {
    RenderOptions o;
    o.settings = store_->settings();
    o.scratch_directory = directory_->path();
    return o;
  }
  static RenderedImage render(const RenderOptions& o, int threads, const Store& store) {
    Result<RenderedImage> image = on_threads(threads, [&] { return render_image(store, o); });
    EXPECT_TRUE(image) << image.error().message;
    return image ? std::move(*image) : RenderedImage{};
  }

  static std::unique_ptr<TemporaryDirectory> directory_;
  static std::unique_ptr<Store> store_;
  static std::string hash_;
};

std::unique_ptr<TemporaryDirectory> MovingScene::directory_;
std::unique_ptr<Store> MovingScene::store_;
std::string MovingScene::hash_;

TEST_F(MovingScene, has_motions_and_another_picture_than_the_still_one) {
  EXPECT_EQ(store_->motions().size(), 6u);  // four balls, a gate, the camera
  EXPECT_NE(store_->settings().camera.motion, 0u);
  const auto still = pack_small_scene(directory_->path(), "still", {});
  ASSERT_TRUE(still) << still.error().message;
  EXPECT_TRUE(still->motions().empty());
  RenderOptions o = options();
  o.settings = still->settings();
  EXPECT_NE(render(o, 2, *still).report.image_hash, hash_);
}

TEST_F(MovingScene, streamed_is_the_depth_first_reference) {
  const auto tracer = kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = render_reference(*store_, **tracer, {store_->settings(), false});
  ASSERT_TRUE(film) << film.error().message;
  EXPECT_EQ((*film)->hash(), hash_);
}

TEST_F(MovingScene, has_the_same_bits_for_any_wave_threads_memory_and_spilling) {
  uint64_t page_bytes = 0;
  for (const auto& page : store_->pages()) page_bytes += page.size_bytes;
  RenderOptions small = options(), spilled = options();
  small.plan.wave_paths = 999, small.plan.page_bytes = page_bytes / 8;
  spilled.plan.spill = 1, spilled.plan.wave_paths = 4096, spilled.spill_block_bytes = 1 << 14;
  spilled.hit_sort_bytes = 100 << 10;
  const RenderedImage swept = render(small, 7, *store_);
  EXPECT_EQ(swept.report.image_hash, hash_);
  EXPECT_GT(swept.report.trace.pair_count, 0u);
  EXPECT_EQ(render(spilled, 2, *store_).report.image_hash, hash_);
}

TEST_F(MovingScene, has_the_same_bits_for_another_layout) {
  SmallSceneOptions scene{.moves = true};
  scene.max_triangles_per_page = 43, scene.max_faces_per_attribute_block = 100;
  scene.tree.branching = 3, scene.tree.leaf_fill = 2;
  const auto other = pack_small_scene(directory_->path(), "other", scene);
  ASSERT_TRUE(other) << other.error().message;
  EXPECT_EQ(render(options(), 1, *other).report.image_hash, hash_);
}

struct Attributes {
  std::vector<std::vector<std::byte>> blocks;
  [[nodiscard]] std::span<const std::byte> of(const Store& store, uint32_t prim) const {
    size_t b = 0;
    while (b + 1 < blocks.size() && store.attributes()[b + 1].first_prim <= prim) ++b;
    return blocks[b];
  }
};

Result<Attributes> read_attributes(const Store& store) {
  Attributes all;
  SPILLWAY_ASSIGN(const cache::ReadFile file, cache::ReadFile::open(store.attributes_path(), {}));
  for (const AttributeLocation& location : store.attributes()) {
    all.blocks.emplace_back(location.size_bytes);
    SPILLWAY_TRY(file.read(location.offset_bytes, all.blocks.back()));
  }
  return all;
}

TEST_F(MovingScene, shoots_while_the_shutter_is_open) {
  const SceneSettings& settings = store_->settings();
  CameraRays camera(settings.camera, settings.filter, {0, 0, 48, 32}, settings.render.seed, settings.render.sampler,
                    ray_times(*store_, settings));
  camera.begin({0, 0, 8});
  std::vector<cache::TraceRay> rays(48 * 32 * 8);
  std::vector<PathRecord> paths(rays.size());
  ASSERT_EQ(camera.generate_rays(rays.size(), rays.data(), paths.data()), rays.size());
  int at_rest = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    ASSERT_TRUE(rays[i].time >= 0.25f && rays[i].time <= 1);  // opens at a quarter of the way
    ASSERT_EQ(rays[i].time, ray_time(shutter_of(settings), sample_key(paths[i], settings.render.seed)));
    at_rest += rays[i].time == 1;
  }
  EXPECT_NEAR(at_rest / static_cast<double>(rays.size()), 0.25, 0.01);  // all has arrived in the last quarter
}

TEST_F(MovingScene, shades_each_hit_where_and_when_it_was_found) {
  const auto tracer = kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const Result<Attributes> attributes = read_attributes(*store_);
  ASSERT_TRUE(attributes) << attributes.error().message;
  ShadeInputs inputs;
  inputs.settings = {store_->light_table(), 5, 0, shading::SamplerKind::independent, shutter_of(store_->settings())};
  inputs.instances = store_->instances(), inputs.motions = store_->motions();
  Random random(1);
  int moving = 0;
  for (uint32_t i = 0; i < 5000; ++i) {
    PathRecord path{};
    path.sink = i;
    const float time = ray_time(inputs.settings.shutter, sample_key(path, 0, shading::SamplerKind::independent));
    const Motion& motion = store_->motions()[1 + random.below(static_cast<uint32_t>(store_->motions().size()) - 1)];
    const Float3 target = transform_at(motion, time).point(random.point(0.2f));
    cache::TraceRay ray = ray_from_to(target + normalize(random.point(1)), target);
    ray.time = time;
    const cache::TraceHit found = (*tracer)->nearest(ray);
    if (found.prim == PrimId::kNone) continue;
    moving += store_->instances()[found.instance].motion != 0;
    const HitRecord hit{found, ray.direction_world, ray.t_max, path, 0};
    Pose moved;
    const InstanceTransform transform = instance_transform(inputs, hit, moved);
    ASSERT_EQ(transform.time, time);
    const auto triangle = cache::triangle_attributes(attributes->of(*store_, found.prim), PrimId{found.prim});
    const ShadingPoint point = shading_point(triangle, hit, transform, false);
    ASSERT_EQ(point.time, time);
    const Float3 along = ray.origin_world + ray.direction_world * found.t;
    ASSERT_LT(length(point.position - along), 1e-4f) << i;  // roundings of coordinates of up to 4, at grazing angles
  }
  EXPECT_GT(moving, 2000);
}

}  // namespace
}  // namespace spillway::test
