#include "tests/support/failure_scene.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "cache/base/parallel.h"
#include "pipeline/pack/scene_packer.h"
#include "tests/support/reference_integrator.h"
#include "tools/import/import_pbrt.h"
#include "tools/metrics/statistical_equality.h"

namespace spillway::test {

using namespace pipeline;

namespace {

#ifdef __SANITIZE_ADDRESS__  // under which the samples that statistics need would take minutes
constexpr uint32_t kThinning = 16;
#else
constexpr uint32_t kThinning = 1;
#endif

Result<Store> packed(const std::filesystem::path& text, const std::filesystem::path& directory, uint32_t page) {
  PackOptions options;
  options.max_triangles_per_page = page, options.max_faces_per_attribute_block = 4 * page;
  options.volume_brick_voxels = 8;
  SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(directory, options));
  tools::ImportReport report;
  SPILLWAY_TRY(tools::import_pbrt(text, *packer, {}, report));
  SPILLWAY_TRY(packer->finish());
  return Store::open(directory);
}

// A quarter of the parts, but the largest of them.
template <class Parts>
uint64_t a_quarter(const Parts& parts) {
  uint64_t bytes = 0, largest = 0;
  for (const auto& part : parts) bytes += part.size_bytes, largest = std::max<uint64_t>(largest, part.size_bytes);
  return std::max(bytes / 4, 2 * ((largest + 4095) / 4096 * 4096));
}

Frame frame_of(RenderedImage image) {
  Frame frame;
  const FilmWindow& window = image.film->shape().window;
  for (uint32_t y = window.y0; y < window.y1; ++y)
    for (uint32_t x = window.x0; x < window.x1; ++x) {
      frame.pixels.push_back(image.film->pixel(x, y));
      frame.mean += luminance(frame.pixels.back());
    }
  frame.mean /= static_cast<double>(frame.pixels.size());
  frame.report = std::move(image.report);
  return frame;
}

std::string numbers(Vec v) { return fmt::format("{:.17g} {:.17g} {:.17g}", v.x, v.y, v.z); }
std::string grey(double value) { return fmt::format("[{0:.17g} {0:.17g} {0:.17g}]", value); }
Vec plus(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }

std::string film(int max_depth, int pixels) {
  return fmt::format(
      "Film \"rgb\" \"integer xresolution\" {0} \"integer yresolution\" {0} PixelFilter \"box\"\n"
      "Integrator \"volpath\" \"integer maxdepth\" {1}\nWorldBegin\n",
      pixels, max_depth);
}

}  // namespace

FailureScene::FailureScene(const std::string& text, const MakeFiles& make_files, uint32_t triangles_per_page) {
  if (make_files) make_files(directory_.path());
  const std::filesystem::path file = directory_.path() / "scene.pbrt";
  std::ofstream(file) << text;
  Result<Store> store =
      on_threads(2, [&] { return packed(file, directory_.path() / "scene.store", triangles_per_page); });
  if (!store)
    error_ = store.error().message;
  else
    store_ = std::make_unique<Store>(std::move(*store));
}

RenderOptions FailureScene::options(uint32_t seed, uint32_t samples) const {
  RenderOptions o;
  o.settings = store_->settings();
  o.settings.render.estimator = estimator_;
  o.settings.render.seed = seed, o.settings.render.samples_per_pixel = samples;
  o.scratch_directory = directory_.path();
  return o;
}

RenderOptions FailureScene::starved(RenderOptions o) const {
  o.plan.page_bytes = a_quarter(store_->pages()), o.plan.attribute_bytes = a_quarter(store_->attributes());
  o.plan.texture_bytes = 1 << 16, o.plan.volume_bytes = 1 << 14;
  o.plan.wave_paths = 777, o.plan.spill = 1;
  o.spill_block_bytes = 1 << 14, o.hit_sort_bytes = 100 << 10;
  return o;
}

Frame FailureScene::render(const RenderOptions& o, int threads) const {
  Result<RenderedImage> image = on_threads(threads, [&] { return render_image(*store_, o); });
  EXPECT_TRUE(image) << image.error().message;
  return image ? frame_of(std::move(*image)) : Frame{};
}

Frame FailureScene::render(uint32_t seed, uint32_t samples) const { return render(options(seed, samples), 2); }

Frame FailureScene::render_independent(uint32_t seed, uint32_t samples) const {
  RenderOptions o = options(seed, samples);
  o.settings.render.sampler = shading::SamplerKind::independent;
  return render(o, 2);
}

void FailureScene::expect_same_bits() const {
  ASSERT_EQ(error_, "");
  const auto tracer = kernel_tracer(*store_);
  ASSERT_TRUE(tracer) << tracer.error().message;
  for (const auto& [seed, samples] : {std::pair(1u, 4u), std::pair(77u, 7u)}) {
    const RenderOptions o = options(seed, samples);
    const Frame whole = render(o, 1), small = render(starved(o), 3);
    const auto film = on_threads(2, [&] { return render_reference(*store_, **tracer, {o.settings, false}); });
    ASSERT_TRUE(film) << film.error().message;
    EXPECT_FALSE(whole.report.faults.any()) << whole.report.faults.not_finite_count << " not finite, "
                                            << whole.report.faults.out_of_range_count << " out of range";
    EXPECT_EQ(whole.report.image_hash, (*film)->hash());
    EXPECT_EQ(small.report.image_hash, (*film)->hash());
    for (const Rgb& pixel : whole.pixels) EXPECT_TRUE(is_finite(pixel));
  }
}

Estimate estimate(const FailureScene& scene, uint32_t first_seed, uint32_t seeds, uint32_t samples) {
  double sum = 0, squares = 0;
  for (uint32_t s = 0; s < seeds; ++s) {
    const Frame frame = scene.render(first_seed + s, samples);
    EXPECT_FALSE(frame.report.faults.any());
    sum += frame.mean, squares += frame.mean * frame.mean;
  }
  const double mean = sum / seeds, variance = std::max(0.0, squares / seeds - mean * mean);
  return {mean, std::sqrt(variance / (seeds - 1)), seeds};
}

void expect_unbiased(const FailureScene& scene, double answer, const Trust& trust) {
  ASSERT_EQ(scene.error(), "");
  for (const uint32_t samples : {trust.samples / 8, trust.samples}) {
    const Estimate e = estimate(scene, 1000 + samples, trust.seeds, std::max(1u, samples / kThinning));
    const double off = std::max(0.0, std::fabs(e.mean - answer) - trust.rounding * answer);
    const double t = off == 0 ? 0 : off / e.standard_error;
    EXPECT_GT(tools::student_two_sided(t, trust.seeds - 1), kFalseAlarm)
        << e.mean << " +- " << e.standard_error << " for " << answer << " at " << samples << " samples: t = " << t;
    if (kThinning == 1 && samples == trust.samples) {
      EXPECT_LE(e.standard_error, trust.largest_error * answer) << "says too little";
    }
  }
}

std::string view_down(double height, double half_width, int max_depth, int pixels) {
  return view_along({0, 0, height}, {0, 0, 0}, {0, 1, 0}, half_width, max_depth, pixels);
}

std::string view_along(Vec eye, Vec target, Vec up, double half_width, int max_depth, int pixels) {
  return fmt::format("LookAt {} {} {}\nCamera \"orthographic\" \"float screenwindow\" [-{} {} -{} {}]\n", numbers(eye),
                     numbers(target), numbers(up), half_width, half_width, half_width, half_width) +
         film(max_depth, pixels);
}

std::string view_from(Vec eye, Vec target, Vec up, double fov_deg, int max_depth, int pixels) {
  return fmt::format("LookAt {} {} {}\nCamera \"perspective\" \"float fov\" {}\n", numbers(eye), numbers(target),
                     numbers(up), fov_deg) +
         film(max_depth, pixels);
}

std::string sheet(Vec c, Vec e1, Vec e2) {
  return fmt::format("Shape \"trianglemesh\" \"point3 P\" [{} {} {} {}] \"integer indices\" [0 1 2 0 2 3]\n",
                     numbers(c), numbers(plus(c, e1)), numbers(plus(plus(c, e1), e2)), numbers(plus(c, e2)));
}

std::string room(Vec a, Vec b) {
  std::string points;
  for (int corner = 0; corner < 8; ++corner)
    points += numbers({corner & 1 ? b.x : a.x, corner & 2 ? b.y : a.y, corner & 4 ? b.z : a.z}) + "  ";
  return "Shape \"trianglemesh\" \"point3 P\" [" + points +
         "] \"integer indices\" [0 1 3 0 3 2  4 6 7 4 7 5  0 4 5 0 5 1  2 3 7 2 7 6  0 2 6 0 6 4  1 5 7 1 7 3]\n";
}

std::string diffuse(double reflectance) {
  return "Material \"diffuse\" \"rgb reflectance\" " + grey(reflectance) + "\n";
}

std::string emitter(double radiance, const std::string& shape) {
  return "AttributeBegin " + diffuse(0) + "AreaLightSource \"diffuse\" \"rgb L\" " + grey(radiance) + "\n" + shape +
         "AttributeEnd\n";
}

std::string sky(double radiance) { return "LightSource \"infinite\" \"rgb L\" " + grey(radiance) + "\n"; }

}  // namespace spillway::test
