// What a pbrt scene says of a grid of colours and of a cloud, among many lamps: streamed as the depth-first reference.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <random>

#include "cache/base/parallel.h"
#include "pipeline/pack/scene_packer.h"
#include "tests/support/reference_integrator.h"
#include "tests/support/small_scene.h"
#include "tests/tools/import_text.h"

namespace spillway::tools {
namespace {

using pipeline::RenderedImage;
using pipeline::RenderOptions;

constexpr size_t kLamps = 900;

// Fifty-two cells an edge: some of the bricks are cut by the grid's sides.
std::string colors(uint32_t seed, double most) {
  std::mt19937 random(seed);
  std::string text = "[";
  for (int i = 0; i < 3 * 52 * 52 * 52; ++i) text += fmt::format("{:.2f} ", most * (random() % 100) / 100);
  return text + "]";
}

// A cloud fills what is seen, a ball of colours is nested in it; the lamps hang everywhere, some in the ball.
std::string scene() {
  std::string text =
      "MakeNamedMedium \"cloud\" \"string type\" \"cloud\" \"point3 p0\" [-3 -3 -3] \"point3 p1\" [3 3 3] "
      "\"float density\" 2 \"float frequency\" 0.4 \"rgb sigma_a\" [0.1 0.1 0.1] \"rgb sigma_s\" [0.4 0.5 0.6]\n"
      "LookAt 0 -4 1 0 0 0 0 0 1\nMediumInterface \"\" \"cloud\"\nCamera \"perspective\" \"float fov\" 50\n"
      "Film \"rgb\" \"integer xresolution\" 40 \"integer yresolution\" 30\n"
      "Sampler \"sobol\" \"integer pixelsamples\" 4\nIntegrator \"volpath\" \"integer maxdepth\" 8\nWorldBegin\n"
      "LightSource \"infinite\" \"rgb L\" [0.1 0.1 0.2]\nMediumInterface \"cloud\" \"cloud\"\n"
      "Material \"diffuse\" \"rgb reflectance\" [0.5 0.4 0.3]\n"
      "Shape \"trianglemesh\" \"point3 P\" [-9 -9 -1.5 9 -9 -1.5 9 9 -1.5 -9 9 -1.5] \"integer indices\" [0 1 2 0 2 "
      "3]\n";
  text +=
      "MakeNamedMedium \"colors\" \"string type\" \"rgbgrid\" \"integer nx\" 52 \"integer ny\" 52 \"integer nz\" 52 "
      "\"point3 p0\" [-1.2 -1.2 -1.2] \"point3 p1\" [1.2 1.2 1.2] \"float g\" 0.3\n";
  text +=
      fmt::format("\"rgb sigma_a\" {} \"rgb sigma_s\" {} \"rgb Le\" {}\n", colors(1, 1), colors(2, 4), colors(3, 0.2));
  text += "AttributeBegin MediumInterface \"colors\" \"cloud\" Material \"interface\" Shape \"sphere\" AttributeEnd\n";
  text += "AreaLightSource \"diffuse\" \"rgb L\" [40 35 30]\n";
  std::mt19937 random(4);
  const auto place = [&] { return static_cast<double>(random() % 4000) / 1000 - 2; };
  for (size_t i = 0; i < kLamps; ++i) {
    const double x = place(), y = place(), z = place() / 2;
    text += fmt::format("Shape \"trianglemesh\" \"point3 P\" [{0} {1} {2} {3} {1} {2} {0} {4} {5}]\n", x, y, z,
                        x + 0.02, y + 0.02, z + 0.01);
  }
  return text;
}

TEST(MediaBits, colours_and_a_cloud_among_many_lamps_are_the_reference_at_any_volume_budget) {
  const test::TemporaryDirectory directory;
  const auto packer = pipeline::ScenePacker::create(directory.path() / "a.store", {.volume_brick_voxels = 16});
  ASSERT_TRUE(packer) << packer.error().message;
  ImportReport report;
  const Status imported = import_pbrt(write_file("scene.pbrt", scene()), **packer, {}, report);
  ASSERT_TRUE(imported) << imported.error().message;
  const Status packed = (*packer)->finish();
  ASSERT_TRUE(packed) << packed.error().message;
  const auto store = pipeline::Store::open(directory.path() / "a.store");
  ASSERT_TRUE(store) << store.error().message;
  RenderOptions options;
  options.settings = store->settings();
  options.scratch_directory = directory.path();
  const auto render = [&] {
    Result<RenderedImage> image = on_threads(2, [&] { return render_image(*store, options); });
    EXPECT_TRUE(image) << image.error().message;
    return image ? std::move(*image) : RenderedImage{};
  };
  const auto tracer = test::kernel_tracer(*store);
  ASSERT_TRUE(tracer) << tracer.error().message;
  const auto film = test::render_reference(*store, **tracer, {store->settings(), false});
  ASSERT_TRUE(film) << film.error().message;
  const RenderedImage whole = render();
  EXPECT_EQ(whole.report.image_hash, (*film)->hash());
  EXPECT_GT(whole.report.track.collision_count, 1000u);
  EXPECT_EQ(whole.report.shade.other_medium_count, 0u);
  EXPECT_EQ(store->emitters().size(), kLamps);
  EXPECT_FALSE(store->light_table().tree.empty());
  uint64_t brick_bytes = 0;
  for (const auto& brick : store->medium_tables().volumes.bricks) brick_bytes += brick.size_bytes;
  for (const uint64_t part : {8, 16, 64}) {
    options.plan.volume_bytes = brick_bytes / part;
    options.plan.wave_paths = 1000;
    const RenderedImage limited = render();
    EXPECT_EQ(limited.report.image_hash, (*film)->hash()) << part;
    EXPECT_GT(limited.report.volumes.parts_evicted, 0u) << part;
  }
}

}  // namespace
}  // namespace spillway::tools
