// A small city at night, rendered: the same bits as the depth-first reference, whatever fits in memory.

#include <gtest/gtest.h>

#include "cache/base/parallel.h"
#include "pipeline/pack/scene_packer.h"
#include "pipeline/render/render_image.h"
#include "tests/support/reference_integrator.h"
#include "tests/support/small_scene.h"
#include "tools/city/city.h"

namespace spillway::tools::city {
namespace {

using namespace pipeline;

class CityRender : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = std::make_unique<test::TemporaryDirectory>();
    CityOptions options;
    options.buildings = 40, options.detail_triangles = 900, options.trees = 60, options.cars = 30, options.seed = 4;
    options.time = TimeOfDay::night, options.unique = 0.7, options.texels_per_metre = 1.5;
    const auto city = City::plan(options);
    ASSERT_TRUE(city) << city.error().message;
    const auto sky = directory_->path() / "sky.exr";
    ASSERT_TRUE(write_sky(sky, options.time));
    auto packer = ScenePacker::create(directory_->path() / "city.store", {.max_triangles_per_page = 4096});
    ASSERT_TRUE(packer);
    ASSERT_TRUE(city->emit(**packer, sky));
    const Status finished = (*packer)->finish();
    ASSERT_TRUE(finished) << finished.error().message;
    auto store = Store::open(directory_->path() / "city.store");
    ASSERT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
  }
  static void TearDownTestSuite() { store_.reset(), directory_.reset(); }

  static RenderOptions options() {
    RenderOptions o;
    o.settings = store_->settings();
    const float aspect = 64.0f / 36.0f;
    o.settings.camera.resolution_x_px = 64, o.settings.camera.resolution_y_px = 36;
    o.settings.camera.tan_half_fov_x = o.settings.camera.tan_half_fov_y * aspect;
    o.settings.render.samples_per_pixel = 4;
    o.scratch_directory = directory_->path();
    return o;
  }
  static RenderedImage render(const RenderOptions& o, int threads) {
    Result<RenderedImage> image = on_threads(threads, [&] { return render_image(*store_, o); });
    EXPECT_TRUE(image) << image.error().message;
    return image ? std::move(*image) : RenderedImage{};
  }

  static std::unique_ptr<test::TemporaryDirectory> directory_;
  static std::unique_ptr<Store> store_;
};

std::unique_ptr<test::TemporaryDirectory> CityRender::directory_;
std::unique_ptr<Store> CityRender::store_;

TEST_F(CityRender, has_the_bits_of_the_reference_with_any_memory_and_threads) {
  const auto tracer = test::kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = test::render_reference(*store_, **tracer, {options().settings, false});
  ASSERT_TRUE(film) << film.error().message;
  const std::string hash = (*film)->hash();
  EXPECT_EQ(render(options(), 2).report.image_hash, hash);
  RenderOptions small = options();
  small.plan.texture_bytes = 4 << 20;
  small.plan.page_bytes = 1 << 20, small.plan.wave_paths = 1500, small.plan.spill = 1;
  const RenderedImage image = render(small, 3);
  EXPECT_EQ(image.report.image_hash, hash);
  EXPECT_GT(image.report.pages.parts_evicted, 10u);
  EXPECT_FALSE(image.report.faults.any());
}

TEST_F(CityRender, the_picture_is_lit_by_windows_and_lamps) {
  const RenderedImage image = render(options(), 2);
  float brightest = 0;
  double sum = 0;
  for (uint32_t y = 0; y < 36; ++y)
    for (uint32_t x = 0; x < 64; ++x) {
      const float here = luminance(image.film->pixel(x, y));
      brightest = std::max(brightest, here), sum += here;
    }
  EXPECT_GT(brightest, 0.3f);         // a pane or a lamp is seen
  EXPECT_GT(sum / (64 * 36), 0.003);  // and the night is not black
  EXPECT_LT(sum / (64 * 36), 0.5);
}

// Fog, a cloud and a plume: bricks come and go.
TEST(CityRenderInFog, has_the_bits_of_the_reference_with_any_memory_and_threads) {
  const test::TemporaryDirectory directory;
  CityOptions said;
  said.buildings = 260, said.detail_triangles = 700, said.trees = 0, said.cars = 0, said.seed = 5;
  said.time = TimeOfDay::dusk, said.street_lights = 100, said.air = {true, true, true}, said.air_cells = 40;
  const auto city = City::plan(said);
  ASSERT_TRUE(city) << city.error().message;
  ASSERT_GT(city->counts().plumes, 0u);
  const auto sky = directory.path() / "sky.exr", air = directory.path() / "air.vdb";
  ASSERT_TRUE(write_sky(sky, said.time));
  ASSERT_TRUE(city->write_air(air));
  auto packer = ScenePacker::create(directory.path() / "city.store", {.max_triangles_per_page = 8192});
  ASSERT_TRUE(packer);
  ASSERT_TRUE(city->emit(**packer, sky, air));
  const Status finished = (*packer)->finish();
  ASSERT_TRUE(finished) << finished.error().message;
  const auto store = Store::open(directory.path() / "city.store");
  ASSERT_TRUE(store) << store.error().message;
  RenderOptions options;
  options.settings = store->settings();
  options.settings.camera.resolution_x_px = 48, options.settings.camera.resolution_y_px = 27;
  options.settings.render.samples_per_pixel = 2;
  options.scratch_directory = directory.path();
  const auto tracer = test::kernel_tracer(*store);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = test::render_reference(*store, **tracer, {options.settings, false});
  ASSERT_TRUE(film) << film.error().message;
  const std::string hash = (*film)->hash();
  const auto render = [&](int threads) {
    auto image = on_threads(threads, [&] { return render_image(*store, options); });
    EXPECT_TRUE(image) << image.error().message;
    EXPECT_EQ(image->report.image_hash, hash);
    return std::move(image->report);
  };
  const RenderReport whole = render(2);
  EXPECT_GT(whole.track.collision_count, 1000u);
  options.plan.volume_bytes = 2 << 20, options.plan.wave_paths = 1000;
  const RenderReport small = render(3);
  EXPECT_GT(small.volumes.parts_evicted + small.volumes.parts_read_again, 10u);
  EXPECT_FALSE(small.faults.any());
}

}  // namespace
}  // namespace spillway::tools::city
