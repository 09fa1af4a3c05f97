// Watertightness in numbers: rays from near the origin at vertices and edges that triangles of axis-aligned walls share,
// ten kilometres away. Every ray must hit.
//
//   walls_bench [--rays N] [--threads N]

#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <chrono>

#include "cache/base/parallel.h"
#include "tests/support/kernel_scene.h"

int main(int argc, char** argv) {
  using namespace spillway;
  size_t rays = 100'000'000;
  int threads = 2;
  CLI::App app("Rays at shared edges of walls ten kilometres away.");
  app.add_option("--rays", rays);
  app.add_option("--threads", threads);
  CLI11_PARSE(app, argc, argv);
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
  const test::Walls walls(256, 10000, 300);
  std::atomic<uint64_t> missed{0}, let_through{0};
  const auto start = std::chrono::steady_clock::now();
  parallel_blocks(rays, 1 << 14, [&](size_t block, size_t first, size_t last) {
    test::Random random(block);
    uint64_t misses = 0, passes = 0;
    for (size_t i = first; i < last; ++i) {
      const cache::TraceRay ray = walls.ray_to_an_edge(random);
      misses += walls.scene.trace(ray).prim == PrimId::kNone;
      passes += (walls.scene.trace<cache::TraceMode::occlusion>(ray).flags & cache::kHitOccluded) == 0;
    }
    missed += misses, let_through += passes;
  });
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  fmt::print("{} rays at shared edges and vertices of 3 x 256 x 256 quads, 10 km away, {:.1f} s: {} closest-hit rays missed, "
             "{} occlusion rays passed\n",
             rays, seconds, missed.load(), let_through.load());
  return missed + let_through == 0 ? 0 : 1;
}
