// No toll when it fits, and the kernel beside Embree, in one run on one store:
//   pure Embree (robust) on recorded rays | our kernel on the same rays | depth-first path tracer on Embree | streamed.
//
//   render_bench STORE [--spp N] [--threads N] [--repeat N] [--rays N] [--kernel-only]
//
// Every figure is the best of the repetitions, which alternate; ratios above one favour us.


#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>

#include "bench/support/compare_hits.h"
#include "bench/support/embree_tracer.h"
#include "cache/base/parallel.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/sort_rays.h"

namespace spillway::bench {
namespace {

using namespace pipeline;
using Clock = std::chrono::steady_clock;

struct Arguments {
  std::filesystem::path store;
  uint32_t spp = 4;
  int threads = 2, repeat = 5;
  size_t rays = 10'000'000;
  bool kernel_only = false;
};

// Passes rays on, and keeps the first `limit` of each kind.
class Recorder final : public test::Tracer {
 public:
  Recorder(const test::Tracer& tracer, size_t limit) : tracer_(tracer), nearest_(limit), occlusion_(limit) {}
  cache::TraceHit nearest(const cache::TraceRay& ray) const override {
    nearest_.keep(ray);
    return tracer_.nearest(ray);
  }
  cache::TraceHit occlusion(const cache::TraceRay& ray) const override {
    occlusion_.keep(ray);
    return tracer_.occlusion(ray);
  }
  struct Rays {
    explicit Rays(size_t limit) : rays(limit) {}
    void keep(const cache::TraceRay& ray) {
      if (const size_t at = count++; at < rays.size()) rays[at] = ray;
    }
    std::vector<cache::TraceRay> take() {
      rays.resize(std::min(count.load(), rays.size()));
      return std::move(rays);
    }
    std::vector<cache::TraceRay> rays;
    std::atomic<size_t> count{0};
  };
  Rays& nearest_rays() { return nearest_; }
  Rays& occlusion_rays() { return occlusion_; }
  [[nodiscard]] size_t ray_count() const { return nearest_.count + occlusion_.count; }

 private:
  const test::Tracer& tracer_;
  mutable Rays nearest_, occlusion_;
};

double seconds_of(const auto& work) {
  const auto start = Clock::now();
  work();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Waves of 64 Ki rays, each in the order that sort_rays gives it.
void sort_in_waves(std::vector<cache::TraceRay>& rays, const Bounds3& bounds) {
  constexpr size_t kWave = 64 << 10;
  std::vector<uint32_t> order;
  std::vector<cache::TraceRay> sorted;
  SortRaysScratch scratch;
  for (size_t first = 0; first < rays.size(); first += kWave) {
    const std::span wave(rays.data() + first, std::min(kWave, rays.size() - first));
    order.resize(wave.size()), sorted.resize(wave.size());
    sort_rays(wave, {}, bounds, order, {}, scratch);
    for (size_t i = 0; i < wave.size(); ++i) sorted[i] = wave[order[i]];
    std::copy(sorted.begin(), sorted.end(), wave.begin());
  }
}

template <bool occlusion>
double trace_seconds(const test::Tracer& tracer, const std::vector<cache::TraceRay>& rays,
                     std::vector<cache::TraceHit>& hits) {
  hits.resize(rays.size());
  return seconds_of([&] {
    parallel_blocks(rays.size(), 512, [&](size_t, size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) hits[i] = occlusion ? tracer.occlusion(rays[i]) : tracer.nearest(rays[i]);
    });
  });
}

template <bool occlusion>
double compare_kernels(const char* what, const Store& store, const test::Tracer& ours, const test::Tracer& embree,
                       const std::vector<cache::TraceRay>& rays, int repeat) {
  double best_ours = 1e30, best_embree = 1e30;
  std::vector<cache::TraceHit> a, b;
  for (int i = 0; i < repeat; ++i) {
    best_embree = std::min(best_embree, trace_seconds<occlusion>(embree, rays, b));
    best_ours = std::min(best_ours, trace_seconds<occlusion>(ours, rays, a));
  }
  const double mrays = static_cast<double>(rays.size()) * 1e-6;
  fmt::print("{:<22} Embree robust {:7.2f} M rays/s | ours {:7.2f} M rays/s | ratio {:.3f}\n", what, mrays / best_embree,
             mrays / best_ours, best_embree / best_ours);
  if constexpr (!occlusion) {
    if (const Status compared = compare_hits(store, rays, a, b); !compared) fmt::print("{}\n", compared.error().message);
  }
  return best_embree;
}

Status run(const Arguments& arguments) {
  SPILLWAY_ASSIGN(const Store store, Store::open(arguments.store));
  RenderOptions options;
  options.settings = store.settings();
  options.settings.render.samples_per_pixel = arguments.spp;
  const test::ReferenceOptions reference{options.settings, false};
  SPILLWAY_ASSIGN(const auto embree, embree_tracer(store));
  SPILLWAY_ASSIGN(const auto kernel, test::kernel_tracer(store));

  Recorder recorder(*embree, arguments.rays / 2);
  SPILLWAY_TRY(test::render_reference(store, recorder, reference));
  const auto total_rays = static_cast<double>(recorder.ray_count());
  std::vector<cache::TraceRay> nearest = recorder.nearest_rays().take(), shadow = recorder.occlusion_rays().take();
  fmt::print("{}: {} triangles, {} spp, {} threads, {:.1f} M rays a frame\n", arguments.store.string(),
             store.settings().statistics.triangle_count, arguments.spp, arguments.threads, total_rays * 1e-6);
  const double pure = (compare_kernels<false>("closest hit, unsorted", store, *kernel, *embree, nearest, arguments.repeat) +
                       compare_kernels<true>("occlusion, unsorted", store, *kernel, *embree, shadow, arguments.repeat)) /
                      static_cast<double>(nearest.size() + shadow.size());
  sort_in_waves(nearest, store.settings().statistics.bounds_world);
  sort_in_waves(shadow, store.settings().statistics.bounds_world);
  compare_kernels<false>("closest hit, sorted", store, *kernel, *embree, nearest, arguments.repeat);
  compare_kernels<true>("occlusion, sorted", store, *kernel, *embree, shadow, arguments.repeat);
  if (arguments.kernel_only) return {};

  double best_embree = 1e30, best_kernel = 1e30, best_streamed = 1e30;
  for (int i = 0; i < arguments.repeat; ++i) {
    Status status;
    best_embree = std::min(best_embree, seconds_of([&] {
      if (auto film = test::render_reference(store, *embree, reference); !film) status = film.error();
    }));
    best_kernel = std::min(best_kernel, seconds_of([&] {
      if (auto film = test::render_reference(store, *kernel, reference); !film) status = film.error();
    }));
    best_streamed = std::min(best_streamed, seconds_of([&] {
      if (auto image = render_image(store, options); !image) status = image.error();
    }));
    SPILLWAY_TRY(status);
  }
  fmt::print("depth-first on Embree  {:7.2f} s | {:.2f} of pure Embree on its own rays\n", best_embree,
             pure * total_rays / best_embree);
  fmt::print("depth-first, our kernel{:7.2f} s | ratio {:.3f}\n", best_kernel, best_embree / best_kernel);
  fmt::print("streamed               {:7.2f} s | ratio {:.3f}\n", best_streamed, best_embree / best_streamed);
  return {};
}

}  // namespace
}  // namespace spillway::bench

int main(int argc, char** argv) {
  spillway::bench::Arguments arguments;
  CLI::App app("The renderer beside Embree, everything in memory.");
  app.add_option("store", arguments.store)->required();
  app.add_option("--spp", arguments.spp);
  app.add_option("--threads", arguments.threads);
  app.add_option("--repeat", arguments.repeat);
  app.add_option("--rays", arguments.rays);
  app.add_flag("--kernel-only", arguments.kernel_only);
  CLI11_PARSE(app, argc, argv);
  const auto status = spillway::on_threads(arguments.threads, [&] { return spillway::bench::run(arguments); });
  if (!status) fmt::print(stderr, "render_bench: {}\n", status.error().message);
  return status ? 0 : 1;
}
