// The machine does not leak into the image. Every performance field is varied, each limit is seen to bite in
// the counters, and the streamed image equals that of the depth-first reference integrator, bit for bit.

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "cache/base/parallel.h"
#include "cache/trace_log.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/select_lights.h"
#include "tests/support/reference_integrator.h"
#include "tests/support/small_scene.h"

namespace spillway::test {
namespace {

using namespace pipeline;

class SameBits : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    directory_ = std::make_unique<TemporaryDirectory>();
    auto store = pack_small_scene(directory_->path(), "scene", {});
    ASSERT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
    const auto image = render(options(), 2);
    hash_ = image.report.image_hash;
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
  static RenderedImage render(const RenderOptions& o, int threads) { return render(o, threads, *store_); }

  static uint64_t trace_bytes() {
    uint64_t bytes = 0;
    for (const auto& page : store_->pages()) bytes += page.size_bytes;
    return bytes;
  }
  static uint64_t attribute_bytes() {
    uint64_t bytes = 0;
    for (const auto& block : store_->attributes()) bytes += block.size_bytes;
    return bytes;
  }

  static std::unique_ptr<TemporaryDirectory> directory_;
  static std::unique_ptr<Store> store_;
  static std::string hash_;
};

std::unique_ptr<TemporaryDirectory> SameBits::directory_;
std::unique_ptr<Store> SameBits::store_;
std::string SameBits::hash_;

TEST_F(SameBits, the_scene_has_pages_textures_alpha_and_light) {
  const RenderedImage image = render(options(), 2);
  EXPECT_GT(store_->pages().size(), 8u);
  EXPECT_GT(image.report.textures.lookups, 1000u);
  EXPECT_GT(image.report.shade.let_through_count, 100u);
  EXPECT_GT(image.report.route.alpha_shadow_count, 100u);
  EXPECT_GT(image.report.route.arrived_count, 1000u);
  EXPECT_FALSE(image.report.faults.any());
  Rgb sum{0, 0, 0};
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 48; ++x) sum += image.film->pixel(x, y);
  EXPECT_GT(luminance(sum) / (32 * 48), 0.02f);
}

TEST_F(SameBits, the_streamed_image_is_that_of_the_depth_first_reference) {
  const auto tracer = kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = render_reference(*store_, **tracer, {store_->settings(), false});
  ASSERT_TRUE(film) << film.error().message;
  EXPECT_EQ((*film)->hash(), hash_);
}

TEST_F(SameBits, for_any_way_of_choosing_lights_with_and_without_a_tree) {
  SmallSceneOptions few;
  few.has_lamps = false;
  const auto without = pack_small_scene(directory_->path(), "few", few);
  ASSERT_TRUE(without) << without.error().message;
  EXPECT_TRUE(without->light_table().tree.empty());
  EXPECT_FALSE(store_->light_table().tree.empty());
  std::map<std::string, int> hashes;
  for (const Store* store : {static_cast<const Store*>(store_.get()), &*without})
    for (const LightSelection selection : {LightSelection::tree, LightSelection::power, LightSelection::uniform}) {
      RenderOptions o = options();
      o.settings.render.light_selection = selection;
      o.plan.wave_paths = 1000;
      const RenderedImage image = render(o, 2, *store);
      const auto tracer = kernel_tracer(*store);
      ASSERT_TRUE(tracer) << tracer.error().message;
      const auto film = render_reference(*store, **tracer, {o.settings, false});
      ASSERT_TRUE(film) << film.error().message;
      EXPECT_EQ((*film)->hash(), image.report.image_hash);
      ++hashes[image.report.image_hash];
    }
  EXPECT_EQ(hashes.size(), 5u);  // without a tree, `tree` is by power
}

// Also in gas, with tables that the settings change.
TEST_F(SameBits, for_every_estimator_filter_and_bound_of_media) {
  SmallSceneOptions with_media;
  with_media.has_media = true;
  with_media.volume_brick_voxels = 16;  // of eight cells
  const auto store = pack_small_scene(directory_->path(), "gas", with_media);
  ASSERT_TRUE(store) << store.error().message;
  const auto tracer = kernel_tracer(*store);
  ASSERT_TRUE(tracer) << tracer.error().message;
  std::map<std::string, int> hashes;
  const auto compare = [&](const auto& change) {
    RenderOptions o = options();
    o.settings = store->settings();
    change(o.settings.render);
    o.plan.wave_paths = 1000;
    const RenderedImage image = render(o, 2, *store);
    const auto film = render_reference(*store, **tracer, {o.settings, false});
    ASSERT_TRUE(film) << film.error().message;
    EXPECT_EQ((*film)->hash(), image.report.image_hash);
    ++hashes[image.report.image_hash];
  };
  for (uint32_t e = 0; e <= static_cast<uint32_t>(Estimator::hemisphere); ++e)
    compare([&](RenderSettings& s) { s.estimator = static_cast<Estimator>(e); });
  compare([](RenderSettings& s) { s.roulette = 0; });
  compare([](RenderSettings& s) { s.texture_filter = TextureFilter::point; });
  compare([](RenderSettings& s) { s.texture_filter = TextureFilter::trilinear; });
  compare([](RenderSettings& s) { s.majorants = MajorantExtent::brick; });
  compare([](RenderSettings& s) { s.majorants = MajorantExtent::grid; });
  EXPECT_EQ(hashes.size(), 11u);
}

TEST_F(SameBits, layers_are_those_of_the_reference_too) {
  RenderOptions o = options();
  o.aov_layers = true;
  const auto tracer = kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = render_reference(*store_, **tracer, {store_->settings(), true});
  ASSERT_TRUE(film) << film.error().message;
  EXPECT_EQ((*film)->hash(), render(o, 2).report.image_hash);
  EXPECT_NE((*film)->hash(), hash_);
}

TEST_F(SameBits, independent_samples_are_another_image_and_streamed_like_the_reference) {
  RenderOptions o = options();
  o.settings.render.sampler = shading::SamplerKind::independent;
  const auto tracer = kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = render_reference(*store_, **tracer, {o.settings, false});
  ASSERT_TRUE(film) << film.error().message;
  EXPECT_EQ((*film)->hash(), render(o, 2).report.image_hash);
  EXPECT_NE((*film)->hash(), hash_);
}

TEST_F(SameBits, for_any_number_of_threads) {
  for (const int threads : {1, 2, 7}) EXPECT_EQ(render(options(), threads).report.image_hash, hash_) << threads;
}

TEST_F(SameBits, for_any_wave_size) {
  for (const uint64_t paths : {1, 37, 1000, 100000}) {
    RenderOptions o = options();
    if (paths == 1) o.settings.film = {10, 10, 14, 12, 1};
    o.plan.wave_paths = paths;
    const RenderedImage image = render(o, 2);
    if (paths == 1) {
      RenderOptions whole = options();
      whole.settings.film = o.settings.film;
      EXPECT_EQ(image.report.image_hash, render(whole, 2).report.image_hash);
    } else {
      EXPECT_EQ(image.report.image_hash, hash_) << paths;
    }
  }
}

TEST_F(SameBits, when_rays_are_not_sorted) {
  RenderOptions o = options();
  o.sort_rays = false;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
}

// Then each batch asks for blocks and tiles that others have asked for.
TEST_F(SameBits, when_hits_are_not_sorted) {
  RenderOptions o = options();
  o.settings.render.samples_per_pixel = 64;  // waves of several batches
  o.plan.wave_paths = 100'000;
  for (const uint64_t part : {1, 4}) {
    o.plan.attribute_bytes = attribute_bytes() / part, o.plan.texture_bytes = 1 << 16;
    o.sort_hits = true;
    const RenderReport sorted = render(o, 2).report;
    o.sort_hits = false;
    const RenderReport unsorted = render(o, 2).report;
    EXPECT_EQ(unsorted.image_hash, sorted.image_hash) << part;
    EXPECT_GT(unsorted.textures.tiles_read, 3 * sorted.textures.tiles_read / 2);
    if (part > 1) {
      EXPECT_GT(unsorted.shade.attribute_blocks_touched, sorted.shade.attribute_blocks_touched);
    }
    EXPECT_EQ(unsorted.shade.shaded_count, sorted.shade.shaded_count);
  }
  o.settings.render.samples_per_pixel = options().settings.render.samples_per_pixel;
  o.plan.spill = 1, o.hit_sort_bytes = 100 << 10;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
}

// What is in memory at the end of a wave is asked for first in the next one: fewer tiles are read, as many blocks.
TEST_F(SameBits, whether_or_not_every_other_wave_shades_its_hits_backwards) {
  RenderOptions o = options();
  o.settings.render.samples_per_pixel = 64;
  o.plan.wave_paths = 20'000;
  o.plan.attribute_bytes = attribute_bytes() / 4, o.plan.texture_bytes = 1 << 16;
  // By one thread: which tiles a cache forgets depends on who asks first.
  const RenderReport turned = render(o, 1).report;
  o.turn_hits = false;
  const RenderReport straight = render(o, 1).report;
  EXPECT_EQ(turned.image_hash, straight.image_hash);
  EXPECT_LT(turned.textures.tiles_read, straight.textures.tiles_read * 9 / 10);
  EXPECT_EQ(turned.textures.wave_tiles_touched, straight.textures.wave_tiles_touched);
  EXPECT_EQ(turned.shade.attribute_blocks_touched, straight.shade.attribute_blocks_touched);
  EXPECT_EQ(turned.attributes.bytes_read, straight.attributes.bytes_read);
  o = options();
  o.plan.wave_paths = 1500, o.plan.spill = 1, o.hit_sort_bytes = 60 << 10;
  o.plan.attribute_bytes = attribute_bytes() / 8;
  const RenderedImage spilled = render(o, 2);
  EXPECT_EQ(spilled.report.image_hash, hash_);
  EXPECT_GT(spilled.report.shade.partition_count, spilled.report.waves.size() + 10);
  o.turn_hits = false;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
}

TEST_F(SameBits, within_the_texture_share_that_a_thrashing_render_is_advised_to_take) {
  RenderOptions o = options();
  o.settings.render.samples_per_pixel = 64;
  o.plan.wave_paths = 100'000, o.plan.texture_bytes = 1 << 16;
  o.sort_hits = false;
  const RenderReport thrashing = render(o, 2).report;
  EXPECT_GT(thrashing.textures.tiles_read_again, thrashing.textures.wave_tiles_touched / 20);
  uint64_t mib = 0;
  ASSERT_EQ(std::sscanf(thrashing.texture_advice.c_str(), "--texture-share %luMiB", &mib), 1)
      << thrashing.texture_advice;
  EXPECT_NE(report_table(thrashing).find(thrashing.texture_advice + " would stop it"), std::string::npos);
  o.plan.texture_bytes = mib << 20;
  const RenderReport advised = render(o, 2).report;
  EXPECT_EQ(advised.image_hash, thrashing.image_hash);
  EXPECT_LE(advised.textures.tiles_read_again, advised.textures.wave_tiles_touched / 20);
  EXPECT_EQ(advised.texture_advice, "");
  EXPECT_EQ(report_table(advised).find("would stop it"), std::string::npos);
}

TEST_F(SameBits, when_few_hits_are_sorted_together) {
  RenderOptions o = options();
  o.plan.attribute_bytes = attribute_bytes() / 4;
  const uint64_t sorted = render(o, 2).report.shade.attribute_blocks_touched;
  o.hit_batch_rays = 500;
  const RenderedImage image = render(o, 2);
  EXPECT_EQ(image.report.image_hash, hash_);
  EXPECT_GT(image.report.shade.attribute_blocks_touched, 2 * sorted);  // each batch asks for its blocks
  o.plan.attribute_bytes = 0;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
}

TEST_F(SameBits, without_reading_ahead) {
  RenderOptions o = options();
  o.read_ahead = false;
  o.plan.page_bytes = trace_bytes() / 4, o.plan.attribute_bytes = attribute_bytes() / 4;
  const RenderedImage image = render(o, 2);
  EXPECT_EQ(image.report.image_hash, hash_);
  EXPECT_GT(image.report.pages.parts_read_again, 0u);
  EXPECT_GT(image.report.pages.wait_seconds, 0);
}

TEST_F(SameBits, when_resident_pages_are_swept_with_the_others) {
  RenderOptions o = options();
  o.plan.page_bytes = trace_bytes() / 2;
  const uint64_t pairs = render(o, 2).report.trace.pair_count;
  o.resident_first = false;
  const RenderedImage limited = render(o, 2);
  EXPECT_EQ(limited.report.image_hash, hash_);
  EXPECT_GT(limited.report.trace.pair_count, pairs);
  o.plan.page_bytes = 0;
  const RenderedImage whole = render(o, 2);
  EXPECT_EQ(whole.report.image_hash, hash_);
  EXPECT_GT(whole.report.trace.pair_count, whole.report.trace.ray_count / 2);
}

TEST_F(SameBits, when_rays_that_wait_for_pages_are_parked_and_when_not) {
  RenderOptions o = options();
  o.plan.wave_paths = 1000;
  EXPECT_EQ(render(o, 2).report.trace.parked_count, 0u);  // everything fits
  o.plan.page_bytes = trace_bytes() * 3 / 4;
  o.park_rays = false;
  const RenderedImage swept = render(o, 2);
  EXPECT_EQ(swept.report.image_hash, hash_);
  EXPECT_EQ(swept.report.trace.parked_count, 0u);
  o.park_rays = true;
  // All that wait, and only those that wait for pages that few others need; in lots that are swept often and once.
  for (const uint64_t pairs : {uint64_t{1} << 40, uint64_t{50}}) {
    for (const uint64_t rays : {300, 1000, 100000}) {
      SCOPED_TRACE(fmt::format("pages read for {} visits, a lot of {} rays", pairs, rays));
      o.plan.parked_rays = rays, o.plan.park_pairs = pairs;
      const RenderedImage parked = render(o, 2);
      EXPECT_EQ(parked.report.image_hash, hash_);
      EXPECT_GT(parked.report.trace.parked_count, 100u);
      EXPECT_EQ(parked.report.route.parked_count, parked.report.trace.parked_count);
      EXPECT_EQ(swept.report.trace.ray_count, parked.report.trace.ray_count);
      EXPECT_EQ(swept.report.route.escaped_count, parked.report.route.escaped_count);
      EXPECT_EQ(swept.report.route.arrived_count, parked.report.route.arrived_count);
      // A smaller lot than a wave is swept with nearly every one.
      if (rays >= 1000) {
        EXPECT_GT(swept.report.trace.pages_touched, parked.report.trace.pages_touched);
      }
    }
  }
  o.page_tops = false;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
  o.page_tops = true, o.top_up_waves = false;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
  o.top_up_waves = true, o.resident_first = false;
  const RenderedImage all_swept = render(o, 2);
  EXPECT_EQ(all_swept.report.image_hash, hash_);
  EXPECT_GT(all_swept.report.trace.parked_count, 100u);
  o.cost_layers = true;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
}

// What is parked keeps the medium that it is in, and where on its light it ends.
TEST_F(SameBits, when_rays_are_parked_in_media_and_on_their_way_to_images) {
  SmallSceneOptions scene;
  scene.has_media = scene.emits_image = true;
  const auto store = pack_small_scene(directory_->path(), "parked", scene);
  ASSERT_TRUE(store) << store.error().message;
  EXPECT_FALSE(SelectedLights(*store, store->settings().render).table().places.empty());
  RenderOptions o = options();
  o.settings = store->settings();
  o.plan.wave_paths = 1000;
  const auto tracer = kernel_tracer(*store);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = render_reference(*store, **tracer, {o.settings, false});
  ASSERT_TRUE(film) << film.error().message;
  o.plan.page_bytes = trace_bytes() / 2;
  o.park_rays = false;
  const RenderedImage swept = render(o, 2, *store);
  EXPECT_EQ(swept.report.image_hash, (*film)->hash());
  o.park_rays = true;
  for (const uint64_t rays : {300, 1000, 100000}) {
    o.plan.parked_rays = rays;
    const RenderedImage parked = render(o, 2, *store);
    EXPECT_EQ(parked.report.image_hash, (*film)->hash());
    EXPECT_GT(parked.report.trace.parked_count, 100u);
    EXPECT_EQ(parked.report.route.parked_count, parked.report.trace.parked_count);
    EXPECT_EQ(parked.report.track.segment_count, swept.report.track.segment_count);
    EXPECT_EQ(parked.report.track.collision_count, swept.report.track.collision_count);
    EXPECT_GT(parked.report.track.collision_count, 1000u);
    EXPECT_EQ(parked.report.shade.shaded_count, swept.report.shade.shaded_count);  // lamps that are looked up included
  }
}

TEST_F(SameBits, when_waves_are_not_topped_up) {
  RenderOptions o = options();
  o.plan.wave_paths = 2000;
  const size_t waves = render(o, 2).report.waves.size();
  o.top_up_waves = false;
  const RenderedImage image = render(o, 2);
  EXPECT_EQ(image.report.image_hash, hash_);
  EXPECT_GT(image.report.waves.size(), waves);
}

TEST_F(SameBits, while_an_access_log_is_written) {
  RenderOptions o = options();
  o.plan.wave_paths = 1500;
  AccessLog whole, limited;
  o.access_log = &whole;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
  o.access_log = &limited;
  o.park_rays = false;  // the same waves
  o.plan.page_bytes = trace_bytes() / 4, o.plan.attribute_bytes = attribute_bytes() / 4;
  o.plan.texture_bytes = 1 << 16;
  const RenderedImage image = render(o, 2);
  EXPECT_EQ(image.report.image_hash, hash_);
  // What is needed is the rays' affair: the same for any budget. What is read is what the counters say.
  ASSERT_EQ(whole.waves.size(), limited.waves.size());
  EXPECT_TRUE(whole.sample_bytes == limited.sample_bytes);
  uint64_t pages_read = 0, blocks_read = 0;
  for (size_t w = 0; w < whole.waves.size(); ++w) {
    const WaveAccess &a = whole.waves[w], &b = limited.waves[w];
    EXPECT_TRUE(a.camera_pages == b.camera_pages && a.continued_pages == b.continued_pages &&
                a.shadow_pages == b.shadow_pages && a.camera_boxes == b.camera_boxes &&
                a.later_boxes == b.later_boxes && a.attribute_blocks == b.attribute_blocks)
        << w;
    for (const uint32_t page : b.read_pages) pages_read += limited.page_bytes[page];
    for (const uint32_t block : b.read_attribute_blocks) blocks_read += limited.attribute_bytes[block];
  }
  EXPECT_EQ(pages_read, image.report.pages.bytes_read);
  EXPECT_EQ(blocks_read, image.report.attributes.bytes_read);
  EXPECT_GT(image.report.pages.parts_read_again, 0u);
}

TEST_F(SameBits, while_costs_are_counted) {
  RenderOptions o = options();
  o.cost_layers = true;
  o.plan.page_bytes = trace_bytes() / 4;
  const RenderedImage image = render(o, 2);
  EXPECT_EQ(image.report.image_hash, hash_);
  EXPECT_EQ(image.costs->total(Cost::rays), image.report.trace.ray_count);
}

TEST_F(SameBits, for_fractions_of_the_pages) {
  for (const uint64_t part : {2, 8}) {
    RenderOptions o = options();
    o.plan.page_bytes = trace_bytes() / part;
    const RenderedImage image = render(o, 2);
    EXPECT_EQ(image.report.image_hash, hash_) << part;
    EXPECT_GT(image.report.pages.parts_evicted, 0u);
    EXPECT_GT(image.report.pages.parts_read_again, 0u);
    EXPECT_GT(image.report.trace.pair_count, 0u);
  }
}

TEST_F(SameBits, for_fractions_of_the_attributes) {
  for (const uint64_t part : {2, 8}) {
    RenderOptions o = options();
    o.plan.attribute_bytes = attribute_bytes() / part;
    const RenderedImage image = render(o, 2);
    EXPECT_EQ(image.report.image_hash, hash_) << part;
    EXPECT_GT(image.report.attributes.parts_evicted, 0u);
    EXPECT_GT(image.report.attributes.parts_read_again, 0u);
  }
}

TEST_F(SameBits, for_small_textures) {
  RenderOptions o = options();
  o.plan.texture_bytes = 1 << 16;
  for (const bool read_ahead : {true, false}) {
    o.read_ahead_textures = read_ahead;
    const RenderedImage image = render(o, 2);
    EXPECT_EQ(image.report.image_hash, hash_) << read_ahead;
    EXPECT_GT(image.report.by_texture.back().counters.lookups, 500u);  // the painted wall
    EXPECT_GT(image.report.textures.tiles_read, image.report.textures.tiles_touched);
  }
}

// The wall is small in this picture, so that its lookups stay within a tile of each class; larger faces are looked up in
// cache/face_lookup_test.cpp.
TEST_F(SameBits, for_any_size_of_tiles_of_face_textures) {
  for (const uint32_t tile_log2 : {5u, 7u}) {
    SmallSceneOptions scene;
    scene.face_tile_log2 = tile_log2;
    const auto store = pack_small_scene(directory_->path(), fmt::format("tiles_{}", tile_log2), scene);
    ASSERT_TRUE(store) << store.error().message;
    cache::FaceTexFormat format;
    format.type = cache::FaceTexelType::float32, format.tile_log2 = tile_log2;
    ASSERT_EQ(store->face_containers()[0].tile_bytes, format.tile_bytes());
    RenderOptions o = options();
    o.plan.texture_bytes = 1 << 16;
    const RenderedImage image = render(o, 2, *store);
    EXPECT_EQ(image.report.image_hash, hash_) << tile_log2;
    EXPECT_GT(image.report.by_texture.back().counters.lookups, 500u);  // the painted wall
  }
}

TEST_F(SameBits, when_everything_is_spilled) {
  RenderOptions o = options();
  o.plan.spill = 1;
  o.plan.wave_paths = 4096;
  o.spill_block_bytes = 1 << 14;
  o.hit_sort_bytes = 100 << 10;
  o.plan.page_bytes = trace_bytes() / 8;
  const RenderedImage image = render(o, 2);
  EXPECT_EQ(image.report.image_hash, hash_);
  EXPECT_GT(image.report.spilled_bytes, 1u << 20);
  EXPECT_GT(image.report.shade.partition_count, 2 * image.report.waves.size());
  // What the report says was read and written is what the system says, within two percent.
  double read = static_cast<double>(image.report.textures.bytes_read), written = 0;
  for (const cache::IoUse& use : image.report.io)
    read += static_cast<double>(use.read_bytes), written += static_cast<double>(use.written_bytes);
  EXPECT_NEAR(read / static_cast<double>(image.report.process_io.read_chars), 1, 0.02);
  EXPECT_NEAR(written / static_cast<double>(image.report.process_io.written_chars), 1, 0.02);
}

TEST_F(SameBits, while_a_timeline_is_written) {
  RenderOptions o = options();
  o.plan.page_bytes = trace_bytes() / 8;
  cache::trace_log_start();
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
  const std::filesystem::path file = directory_->path() / "trace.json";
  const Status written = cache::trace_log_write(file);
  ASSERT_TRUE(written) << written.error().message;
  std::ifstream stream(file);
  std::map<std::string, int> spans;
  const nlohmann::json log = nlohmann::json::parse(stream);
  for (const auto& event : log["traceEvents"])
    if (event["ph"] == "X") ++spans[event["cat"].get<std::string>() + ' ' + event["name"].get<std::string>()];
  for (const char* name : {"wave wave", "stage generate_rays", "stage sort_rays", "stage trace_rays", "stage route_hits",
                           "stage shade_hits", "sweep page", "read pages", "read attributes"})
    EXPECT_GT(spans[name], 0) << name;
}

TEST_F(SameBits, with_direct_io) {
  RenderOptions o = options();
  o.direct_io = true;
  o.plan.page_bytes = trace_bytes() / 4;
  EXPECT_EQ(render(o, 2).report.image_hash, hash_);
}

TEST_F(SameBits, for_another_layout_of_pages_and_trees) {
  SmallSceneOptions scene;
  scene.max_triangles_per_page = 43;
  scene.max_faces_per_attribute_block = 100;
  scene.tree.branching = 3;
  scene.tree.leaf_fill = 2;
  const auto other = pack_small_scene(directory_->path(), "other", scene);
  ASSERT_TRUE(other) << other.error().message;
  EXPECT_GT(other->pages().size(), 2 * store_->pages().size());
  EXPECT_EQ(render(options(), 2, *other).report.image_hash, hash_);
  EXPECT_EQ(film_identity(*other, options().settings).settings_key, film_identity(*store_, options().settings).settings_key);
}

TEST_F(SameBits, films_of_another_exposure_or_medium_are_no_parts_of_the_same_image) {
  SceneSettings exposed = options().settings;
  exposed.film.exposure_scale *= 2;
  EXPECT_NE(film_identity(*store_, exposed).settings_key, film_identity(*store_, options().settings).settings_key);
  SmallSceneOptions scene;
  scene.has_media = true;
  const auto hazy = pack_small_scene(directory_->path(), "hazy", scene);
  ASSERT_TRUE(hazy) << hazy.error().message;
  EXPECT_NE(film_identity(*hazy, options().settings).settings_key,
            film_identity(*store_, options().settings).settings_key);
}

TEST_F(SameBits, a_crop_has_the_pixels_of_the_full_frame) {
  const RenderedImage whole = render(options(), 2);
  RenderOptions o = options();
  o.settings.film = {5, 7, 33, 20, 1};
  const RenderedImage crop = render(o, 2);
  for (uint32_t y = 7; y < 20; ++y)
    for (uint32_t x = 5; x < 33; ++x) ASSERT_EQ(crop.film->pixel(x, y), whole.film->pixel(x, y)) << x << ' ' << y;
}

TEST_F(SameBits, a_render_that_is_stopped_equals_one_of_as_many_samples) {
  RenderOptions o = options();
  o.settings.render.samples_per_pixel = 64;
  o.plan.wave_paths = 512;
  std::atomic<bool> stop{false};
  o.stop = &stop;
  int waves = 0;
  o.on_progress = [&](const RenderProgress&) { stop = ++waves >= 10; };
  const RenderedImage stopped = render(o, 2);
  EXPECT_TRUE(stopped.report.stopped_early());
  const uint32_t samples = stopped.report.samples_per_pixel;
  EXPECT_GT(samples, 0u);
  EXPECT_LT(samples, 64u);
  RenderOptions whole = options();
  whole.settings.render.samples_per_pixel = samples;
  EXPECT_EQ(stopped.report.image_hash, render(whole, 2).report.image_hash);
}

TEST_F(SameBits, another_seed_is_another_image) {
  RenderOptions o = options();
  o.settings.render.seed = 1;
  EXPECT_NE(render(o, 2).report.image_hash, hash_);
}

// The same laws in media: haze, a fire of bricks, milk in glass, a grid of colours.
class SameBitsInMedia : public testing::Test {
 protected:
  SameBitsInMedia() {
    SmallSceneOptions scene;
    scene.has_media = true;
    auto store = pack_small_scene(directory_.path(), "media", scene);
    EXPECT_TRUE(store) << store.error().message;
    store_ = std::make_unique<Store>(std::move(*store));
    options_.settings = store_->settings();
    options_.scratch_directory = directory_.path();
  }
  static RenderedImage render(const RenderOptions& o, const Store& store, int threads = 2) {
    Result<RenderedImage> image = on_threads(threads, [&] { return render_image(store, o); });
    EXPECT_TRUE(image) << image.error().message;
    return image ? std::move(*image) : RenderedImage{};
  }

  TemporaryDirectory directory_;
  std::unique_ptr<Store> store_;
  RenderOptions options_;
};

TEST_F(SameBitsInMedia, as_the_depth_first_reference_for_any_memory_threads_waves_and_bricks) {
  const RenderedImage image = render(options_, *store_);
  EXPECT_GT(image.report.track.collision_count, 1000u);
  EXPECT_GT(image.report.track.step_count, 1000u);
  EXPECT_EQ(image.report.track.bounded_count, 0u);
  EXPECT_EQ(image.report.shade.other_medium_count, 0u);
  EXPECT_FALSE(image.report.faults.any());
  const auto tracer = kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = render_reference(*store_, **tracer, {store_->settings(), false});
  ASSERT_TRUE(film) << film.error().message;
  EXPECT_EQ((*film)->hash(), image.report.image_hash);

  for (const int threads : {1, 7}) EXPECT_EQ(render(options_, *store_, threads).report.image_hash, image.report.image_hash);
  RenderOptions o = options_;
  o.plan.wave_paths = 211;
  EXPECT_EQ(render(o, *store_).report.image_hash, image.report.image_hash);
  uint64_t brick_bytes = 0;
  for (const auto& brick : store_->medium_tables().volumes.bricks) brick_bytes += brick.size_bytes;
  uint64_t read = brick_bytes;
  for (const uint64_t part : {2, 4, 8}) {
    RenderOptions few = options_;
    few.plan.volume_bytes = brick_bytes / part;
    const RenderedImage limited = render(few, *store_);
    EXPECT_EQ(limited.report.image_hash, image.report.image_hash) << part;
    EXPECT_GT(limited.report.volumes.bytes_read, read) << part;
    read = limited.report.volumes.bytes_read;
  }
  o = options_;
  o.plan.volume_bytes = 1 << 16;
  o.plan.spill = 1;
  const RenderedImage swept = render(o, *store_);
  EXPECT_EQ(swept.report.image_hash, image.report.image_hash);
  o.turn_hits = false;
  EXPECT_EQ(render(o, *store_).report.image_hash, image.report.image_hash);
  o.sort_hits = false;
  EXPECT_EQ(render(o, *store_).report.image_hash, image.report.image_hash);
  EXPECT_GT(swept.report.volumes.parts_evicted, 0u);
  EXPECT_GT(swept.report.track.bricks_touched, 0u);
  EXPECT_GT(swept.report.spilled_bytes, 0u);
  for (const int32_t voxels : {16, 64}) {
    SmallSceneOptions scene;
    scene.has_media = true, scene.volume_brick_voxels = voxels;
    const auto other = pack_small_scene(directory_.path(), fmt::format("bricks{}", voxels), scene);
    ASSERT_TRUE(other) << other.error().message;
    EXPECT_NE(other->medium_tables().volumes.bricks.size(), store_->medium_tables().volumes.bricks.size());
    EXPECT_EQ(render(options_, *other).report.image_hash, image.report.image_hash) << voxels;
  }
}

TEST_F(SameBits, a_scene_without_media_runs_no_stage_for_them) {
  const RenderedImage image = render(options(), 2);
  EXPECT_FALSE(image.report.has_media);
  EXPECT_EQ(image.report.memory[static_cast<size_t>(MemoryTag::volumes)].peak_bytes, 0u);
  EXPECT_FALSE(std::filesystem::exists(store_->volumes_path()));
  EXPECT_EQ(image.report.track.segment_count, 0u);
}

}  // namespace
}  // namespace spillway::test
