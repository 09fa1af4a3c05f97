// What pixels cost: counts that add up, that no number of threads changes, and that cost nothing in the picture.

#include "pipeline/render/pixel_costs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "cache/base/parallel.h"
#include "pipeline/evaluate_texture.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/shade_path.h"
#include "tests/support/small_scene.h"

namespace spillway::test {
namespace {

using namespace pipeline;

class PixelCostsTest : public testing::TestWithParam<bool> {
 protected:
  PixelCostsTest() {
    SmallSceneOptions scene;
    scene.has_media = GetParam();
    auto store = pack_small_scene(directory_.path(), "scene", scene);
    EXPECT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
    options_.settings = store_->settings();
    options_.scratch_directory = directory_.path();
    options_.cost_layers = true;
    for (const auto& page : store_->pages()) paged_.page_bytes += page.size_bytes / 4;
  }
  RenderedImage render(const RenderOptions& o, int threads = 2) const {
    Result<RenderedImage> image = on_threads(threads, [&] { return render_image(*store_, o); });
    EXPECT_TRUE(image) << image.error().message;
    return image ? std::move(*image) : RenderedImage{};
  }
  static std::vector<uint64_t> layer(const RenderedImage& image, Cost cost) {
    std::vector<uint64_t> values;
    for (uint32_t y = 0; y < 32; ++y)
      for (uint32_t x = 0; x < 48; ++x) values.push_back(image.costs->at(x, y, cost));
    return values;
  }
  static void expect_same(const RenderedImage& a, const RenderedImage& b, std::initializer_list<Cost> costs) {
    for (const Cost cost : costs) EXPECT_EQ(layer(a, cost), layer(b, cost)) << name(cost);
    EXPECT_TRUE(std::ranges::equal(a.costs->by_mesh(), b.costs->by_mesh()));
  }

  TemporaryDirectory directory_;
  std::unique_ptr<Store> store_;
  RenderOptions options_;
  PlanOptions paged_;
};

TEST_P(PixelCostsTest, leave_the_picture_alone_and_are_not_there_unless_asked_for) {
  const auto film_bytes = [](const RenderedImage& image) {
    return image.report.memory[static_cast<size_t>(MemoryTag::film)].peak_bytes;
  };
  RenderedImage image = render(options_);
  const std::string hash = image.report.image_hash;
  const uint64_t tiles = cache::TextureCache::tile_count(store_->images(), store_->face_containers());
  const uint64_t with = film_bytes(image);
  const uint64_t costs = PixelCosts::bytes(image.film->shape(), store_->meshes().size(), tiles);
  image = {};  // whose film would count in the next one's
  RenderOptions plain = options_;
  plain.cost_layers = false;
  image = render(plain);
  EXPECT_EQ(image.report.image_hash, hash);
  EXPECT_FALSE(image.costs);
  EXPECT_TRUE(image.report.costs.empty() && image.report.dearest_meshes.empty());
  EXPECT_EQ(with, film_bytes(image) + costs);
}

TEST_P(PixelCostsTest, add_up_to_the_counters_of_the_stages) {
  const RenderedImage image = render(options_);
  const RenderReport& report = image.report;
  const PixelCosts& costs = *image.costs;
  EXPECT_EQ(costs.total(Cost::rays), report.trace.ray_count);
  EXPECT_EQ(costs.total(Cost::tree_steps), report.trace.work.nodes + report.trace.work.leaves);
  EXPECT_LE(costs.total(Cost::pages_waited), report.trace.pair_count);
  EXPECT_EQ(costs.total(Cost::texture_lookups), report.textures.lookups);
  EXPECT_EQ(costs.total(Cost::tiles_missed), report.textures.wave_tiles_touched);
  EXPECT_GT(report.textures.wave_tiles_touched, report.textures.tiles_touched);  // in more than one wave
  EXPECT_GT(report.textures.lookups, 1000u);
  const uint64_t of_meshes = std::accumulate(costs.by_mesh().begin(), costs.by_mesh().end(), uint64_t{0});
  EXPECT_EQ(costs.total(Cost::scatterings), of_meshes + (GetParam() ? report.route.medium_count : 0));
  ASSERT_FALSE(report.dearest_meshes.empty());
  EXPECT_LE(report.dearest_meshes.size(), 10u);
  EXPECT_EQ(report.dearest_meshes.front().count, std::ranges::max(costs.by_mesh()));
  EXPECT_FALSE(report.dearest_textures.empty());
}

TEST_P(PixelCostsTest, are_the_same_for_any_number_of_threads_in_and_out_of_core) {
  const auto all = {Cost::tree_steps,  Cost::pages_waited, Cost::texture_lookups,
                    Cost::scatterings, Cost::rays,         Cost::tiles_missed};
  const RenderedImage whole = render(options_);
  for (const int threads : {1, 7}) expect_same(render(options_, threads), whole, all);
  RenderOptions o = options_;
  o.plan.page_bytes = paged_.page_bytes;
  o.read_ahead = false;
  const RenderedImage paged = render(o);
  for (const int threads : {1, 7}) expect_same(render(o, threads), paged, all);
  EXPECT_GT(paged.costs->total(Cost::pages_waited),
            2 * whole.costs->total(Cost::pages_waited));  // the first wave reads
  EXPECT_LE(paged.costs->total(Cost::pages_waited), paged.report.trace.pair_count);
  EXPECT_EQ(paged.report.image_hash, whole.report.image_hash);
}

TEST_P(PixelCostsTest, of_paths_are_the_same_for_any_waves_and_memory) {
  const RenderedImage whole = render(options_);
  RenderOptions o = options_;
  o.plan.page_bytes = paged_.page_bytes, o.plan.texture_bytes = 1 << 16, o.plan.spill = 1, o.plan.wave_paths = 1000;
  expect_same(render(o, 3), whole, {Cost::texture_lookups, Cost::scatterings, Cost::rays});
  o = options_;
  o.sort_rays = false;
  expect_same(render(o), whole, {Cost::tree_steps, Cost::texture_lookups, Cost::scatterings, Cost::rays});
}

// Whichever of a wave's hits in order was the first: no matter what is read when, and how hits are cut into pieces.
TEST_P(PixelCostsTest, missed_tiles_are_the_same_for_any_memory_with_the_same_waves) {
  RenderOptions o = options_;
  o.plan.wave_paths = 1000, o.park_rays = false;
  const RenderedImage whole = render(o);
  EXPECT_GT(std::ranges::count_if(layer(whole, Cost::tiles_missed), [](uint64_t count) { return count > 0; }), 10);
  o.plan.texture_bytes = 1 << 16, o.plan.attribute_bytes = 1 << 16, o.plan.spill = 1, o.hit_sort_bytes = 1 << 16;
  const RenderedImage paged = render(o, 3);
  EXPECT_GT(paged.report.shade.partition_count, whole.report.shade.partition_count);
  EXPECT_GT(paged.report.attributes.bytes_read, whole.report.attributes.bytes_read);
  expect_same(paged, whole, {Cost::tiles_missed, Cost::texture_lookups, Cost::scatterings, Cost::rays});
}

// When all is in memory, as in a session's second frame, a ray's steps are its own too. Of large pages, which every crop
// needs: one that nobody waited for is not there, and what occludes a shadow ray may then be a triangle of another.
TEST_P(PixelCostsTest, of_a_crop_are_those_of_its_pixels) {
  SmallSceneOptions scene;
  scene.has_media = GetParam(), scene.max_triangles_per_page = 1 << 16;
  const auto store = pack_small_scene(directory_.path(), "of large pages", scene);
  ASSERT_TRUE(store) << store.error().message;
  const auto second_frame = [&](const RenderOptions& o) {
    return on_threads(2, [&] {
      auto session = RenderSession::open(*store, o);
      EXPECT_TRUE(session && session->render(o.settings.camera, o.settings.render.camera_medium));
      auto image = session->render(o.settings.camera, o.settings.render.camera_medium);
      EXPECT_TRUE(image);
      return std::move(*image);
    });
  };
  const RenderedImage whole = second_frame(options_);
  EXPECT_EQ(whole.costs->total(Cost::pages_waited), 0u);
  RenderOptions o = options_;
  o.settings.film = {11, 9, 33, 20, 1};
  const RenderedImage crop = second_frame(o);
  for (uint32_t c = 0; c < kCostCount; ++c) {
    if (static_cast<Cost>(c) == Cost::tiles_missed) continue;  // a neighbour may have been the first
    for (uint32_t y = 9; y < 20; ++y)
      for (uint32_t x = 11; x < 33; ++x)
        ASSERT_EQ(crop.costs->at(x, y, static_cast<Cost>(c)), whole.costs->at(x, y, static_cast<Cost>(c)))
            << name(static_cast<Cost>(c)) << ' ' << x << ' ' << y;
  }
}

// The scenes' materials look at an image each; a graph may look at several.
TEST(LookupTally, counts_every_image_of_a_graph_for_the_point_that_asks) {
  const TemporaryDirectory directory;
  const auto store = pack_small_scene(directory.path(), "scene", {});
  ASSERT_TRUE(store) << store.error().message;
  const auto images =
      cache::TextureCache::open(store->textures_path(), store->images(), {.memory_limit_bytes = 1 << 24});
  ASSERT_TRUE(images) << images.error().message;
  std::vector<TextureNode> nodes(store->textures().begin(), store->textures().end());
  const auto image =
      static_cast<uint32_t>(std::ranges::find(nodes, TextureKind::image, &TextureNode::kind) - nodes.begin());
  ASSERT_LT(image, nodes.size());
  TextureNode square, grey;
  square.kind = TextureKind::scale, square.child[0] = square.child[1] = image;
  nodes.push_back(square), nodes.push_back(grey);
  const auto graph = static_cast<uint32_t>(nodes.size() - 2), constant = graph + 1;

  const std::vector<ShadingPoint> points(3);
  std::vector<uint32_t> counts(points.size());
  const TextureQuery queries[] = {{graph, {0.3f, 0.2f}, 0, &points[2]},
                                  {image, {0.3f, 0.2f}, 0, &points[0]},
                                  {constant, {0.3f, 0.2f}, 0, &points[1]},
                                  {graph, {0.7f, 0.1f}, 0, &points[2]}};
  cache::Texel values[4];
  TextureEvaluator::Scratch scratch;
  const std::vector<uint64_t> users{5, 9, 3};
  std::vector<uint64_t> first_users(cache::TextureCache::tile_count(store->images(), {}), 8);
  (*images)->note_first_users(first_users);
  scratch.tally = {points.data(), counts, users};
  const TextureEvaluator evaluator(nodes, images->get());
  ASSERT_TRUE(evaluator.evaluate(queries, values, scratch));
  EXPECT_EQ(counts, (std::vector<uint32_t>{1, 0, 4}));
  std::ranges::sort(first_users);
  EXPECT_EQ(first_users.front(), 3u);  // of both that looked into the tile, and whoever was there before, the least
  EXPECT_EQ(first_users.back(), 8u);   // nobody looked into the others
  EXPECT_EQ(values[0].value[0], values[1].value[0] * values[1].value[0]);
}

TEST(TilesMissed, go_to_the_pixel_of_the_first_hit_and_waves_begin_anew) {
  PixelCosts costs({.full_width = 4, .full_height = 1, .window = {0, 0, 4, 1}}, 1, 70);
  const std::vector<uint64_t> touched{uint64_t{1} << 5, uint64_t{1} << 2};
  for (uint64_t wave = 0; wave < 2; ++wave) {
    const std::span<uint64_t> first = costs.first_users();
    EXPECT_EQ(std::ranges::min(first), UINT64_MAX);
    first[5] = PixelCosts::tile_user(7, 1), first[66] = PixelCosts::tile_user(uint64_t{1} << 30, 3);
    costs.add_tiles_missed(touched);
    EXPECT_EQ(costs.at(1, 0, Cost::tiles_missed), wave + 1);
    EXPECT_EQ(costs.at(3, 0, Cost::tiles_missed), wave + 1);
    EXPECT_EQ(costs.total(Cost::tiles_missed), 2 * wave + 2);
  }
  EXPECT_LT(PixelCosts::tile_user(1, 9), PixelCosts::tile_user(2, 3));  // hits have the say, not pixels
}

INSTANTIATE_TEST_SUITE_P(Scenes, PixelCostsTest, testing::Values(false, true),
                         [](const auto& p) { return p.param ? "media" : "surfaces"; });

}  // namespace
}  // namespace spillway::test
