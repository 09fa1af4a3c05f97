// What it costs to find the texel of an environment map that a direction meets: in memory, as lights keep it, or
// through the tile cache after the shadow ray arrived, in the order of arrival or sorted by tile.
//
//   environment_bench [--sizes 1024,2048,4096] [--samples N] [--threads N] [--scratch DIR]

#include <OpenImageIO/imageio.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <numeric>
#include <random>

#include "bench/support/or_give_up.h"
#include "cache/base/parallel.h"
#include "cache/texture_cache.h"
#include "pipeline/pack/scene_packer.h"
#include "pipeline/store.h"
#include "shading/environment.h"

namespace spillway {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

// A sky with clouds of some contrast, and a sun of some thousand times the sky that holds half of the light.
void write_sky(const fs::path& path, uint32_t size) {
  std::vector<float> texels(size_t{size} * size * 3);
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0, 1);
  for (uint32_t y = 0; y < size; ++y)
    for (uint32_t x = 0; x < size; ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(size),
                  v = static_cast<float>(y) / static_cast<float>(size);
      const float cloud = 1 + 0.6f * std::sin(37 * u) * std::cos(29 * v) + 0.2f * unit(random);
      const float off = std::hypot(u - 0.6f, v - 0.55f);
      const float light = off < 0.006f ? 9000.0f : cloud;
      for (uint32_t c = 0; c < 3; ++c)
        texels[(size_t{y} * size + x) * 3 + c] = light * (1 + 0.1f * static_cast<float>(c));
    }
  const auto output = OIIO::ImageOutput::create(path.string());
  const auto edge = static_cast<int>(size);
  if (!output || !output->open(path.string(), OIIO::ImageSpec(edge, edge, 3, OIIO::TypeFloat)) ||
      !output->write_image(OIIO::TypeFloat, texels.data()) || !output->close())
    give_up(error("{}: cannot be written", path.string()));
}

pipeline::Store pack_sky(const fs::path& folder, uint32_t size) {
  write_sky(folder / "sky.exr", size);
  const auto packer = value_of(pipeline::ScenePacker::create(folder / "sky.store", {}));
  packer->set_settings({});
  const ImageId image = value_of(packer->add_image(folder / "sky.exr", cache::TexelEncoding::linear));
  shading::Light light{};
  light.kind = shading::LightKind::infinite, light.radiance = {1, 1, 1}, light.image = 1;
  light.position = {1, 0, 0}, light.edge1 = {0, 1, 0}, light.edge2 = {0, 0, 1};
  check(packer->add_environment(light, image));
  check(packer->finish());
  return value_of(pipeline::Store::open(folder / "sky.store"));
}

constexpr size_t kBlock = 256;

// Best of three, ns a sample.
template <class Work>
double ns_of(size_t samples, const Work& work) {
  double best = INFINITY;
  for (int i = 0; i < 3; ++i) {
    const auto start = Clock::now();
    work();
    best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count());
  }
  return best / static_cast<double>(samples) * 1e9;
}

struct Samples {
  std::vector<Float3> directions;
  std::vector<Rgb> radiance;
  std::vector<float> pdf;
};

double in_memory(const shading::EnvironmentMap& map, Samples& s) {
  return ns_of(s.directions.size(), [&] {
    parallel_blocks(s.directions.size(), kBlock, [&](size_t, size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) {
        const auto [radiance, pdf] = shading::environment_value(map, s.directions[i]);
        s.radiance[i] = radiance, s.pdf[i] = pdf;
      }
    });
  });
}

// Densities from memory, texels by blocks; sorted: by their tile over all samples first.
double by_tiles(const shading::EnvironmentMap& map, Samples& s, cache::TextureCache& textures, bool is_sorted) {
  const float tiles = static_cast<float>(map.size / cache::kTileSize);
  return ns_of(s.directions.size(), [&] {
    textures.begin_wave();
    std::vector<uint64_t> order(s.directions.size());
    parallel_blocks(order.size(), kBlock, [&](size_t, size_t first, size_t last) {
      for (size_t i = first; i < last; ++i) {
        const Float2 square = shading::equal_area_square(s.directions[i]);
        const auto tile = static_cast<uint64_t>(square.y * tiles) << 16 | static_cast<uint64_t>(square.x * tiles);
        order[i] = (is_sorted ? tile << 32 : 0) | i;
        s.pdf[i] = shading::environment_value(map, s.directions[i]).pdf_solid_angle;
      }
    });
    if (is_sorted) std::sort(order.begin(), order.end());
    parallel_blocks(order.size(), kBlock, [&](size_t, size_t first, size_t last) {
      std::array<cache::TextureRequest, kBlock> requests;
      std::array<cache::Texel, kBlock> texels;
      for (size_t k = first; k < last; ++k) {
        const Float2 square = shading::equal_area_square(s.directions[order[k] & 0xffffffff]);
        requests[k - first] = {0, cache::WrapMode::clamp, cache::TexelFilter::point, square.x, 1 - square.y, 0};
      }
      const size_t count = last - first;
      check(textures.look_up(std::span(requests).first(count), std::span(texels).first(count)));
      for (size_t k = first; k < last; ++k) {
        const float* value = texels[k - first].value;
        s.radiance[order[k] & 0xffffffff] = {value[0], value[1], value[2]};
      }
    });
  });
}

void print_line(uint32_t size, const char* what, double ns, double base, uint64_t bytes, double read) {
  fmt::print("| {} | {} | {:.0f} | {:.1f} | {:.0f} | {:.0f} |\n", size, what, ns, ns / base,
             static_cast<double>(bytes) / (1 << 20), read / (1 << 20));
}

void measure(const fs::path& folder, uint32_t size, size_t count) {
  const pipeline::Store store = pack_sky(folder, size);
  const shading::EnvironmentMap& map = store.light_table().environment;
  Samples s;
  s.radiance.resize(count), s.pdf.resize(count);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> unit(0, 0x1.fffffep-1f);
  for (size_t i = 0; i < count; ++i)
    s.directions.push_back(shading::sample_environment(map, {unit(random), unit(random)}));
  const uint64_t texels = uint64_t{size} * size, tables = texels * sizeof(float);
  const double base = in_memory(map, s);
  print_line(size, "in memory", base, base, tables + texels * sizeof(Rgb), 0);
  const std::vector<Rgb> right = s.radiance;
  const uint64_t all = cache::TextureCache::bytes_for_all(store.images());
  for (const uint64_t share : {1, 4})
    for (const bool is_sorted : {false, true}) {
      const auto textures = value_of(
          cache::TextureCache::open(store.textures_path(), store.images(), {.memory_limit_bytes = all / share}));
      const double ns = by_tiles(map, s, *textures, is_sorted);
      const std::string what = fmt::format("tiles, {} in memory, {}", share == 1 ? "all" : "a quarter",
                                           is_sorted ? "sorted" : "as they arrive");
      print_line(size, what.c_str(), ns, base, tables + all / share,
                 static_cast<double>(textures->counters().bytes_read) / 3);
      size_t others = 0;
      for (size_t i = 0; i < count; ++i) others += s.radiance[i].r != right[i].r;
      if (others * 1000 > count) give_up(error("{} of {} texels are others", others, count));
    }
}

}  // namespace
}  // namespace spillway

int main(int argc, char** argv) {
  using namespace spillway;
  std::vector<uint32_t> sizes{1024, 2048, 4096};
  size_t samples = 1 << 20;
  int threads = 2;
  std::string scratch = std::filesystem::temp_directory_path();
  CLI::App app("Texels of an environment map: in memory, or through the tile cache.");
  app.add_option("--sizes", sizes)->delimiter(',')->check(CLI::Range(64u, 8192u));
  app.add_option("--samples", samples);
  app.add_option("--threads", threads);
  app.add_option("--scratch", scratch);
  CLI11_PARSE(app, argc, argv);
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
  const std::filesystem::path folder = std::filesystem::path(scratch) / "environment_bench";
  std::filesystem::create_directories(folder);
  fmt::print("| edge | texels | ns a sample | of memory | MiB held | MiB read a wave |\n|---|---|---|---|---|---|\n");
  for (const uint32_t size : sizes) measure(folder, size, samples);
  std::filesystem::remove_all(folder);
  return 0;
}
