// How well lights are chosen, on a store, in one run:
//
//   light_bench STORE [--receivers N] [--threads N] [--seed N] [--up x|y|z] [--costs-only]
//
// 1. What a selection costs, by the tree, by power and uniformly, at the receivers.
// 2. Against the optimum: at street receivers (below lamps, facing up) every light is enumerated. The variance of one
//    light sample is that of the tree's chances over that of chances in proportion to the unoccluded contribution; both
//    with the same places on the lights, and the same shadows.

#include <CLI/CLI.hpp>
#include <chrono>
#include <random>

#include "cache/base/parallel.h"
#include "pipeline/render/select_lights.h"
#include "tests/support/reference_integrator.h"

namespace spillway::bench {
namespace {

using namespace pipeline;
using Clock = std::chrono::steady_clock;

struct Arguments {
  std::filesystem::path store;
  size_t receivers = 1000;
  int threads = 2;
  uint64_t seed = 1;
  std::string up = "z";
  bool costs_only = false;
};

// Contributions below this part of the whole are not worth a shadow ray; they count as seen.
constexpr double kWorthARay = 1e-6;
constexpr float kReach = 15;  // from a lamp to its receivers, sideways and down

struct Random {
  explicit Random(uint64_t seed) : engine(seed) {}
  float unit() { return static_cast<float>(engine() >> 40) * 0x1p-24f; }
  double fine() { return static_cast<double>(engine() >> 11) * 0x1p-53; }
  std::mt19937_64 engine;
};

struct Standing {
  uint32_t instance, emitter;
};

std::vector<Standing> standing_emitters(const Store& store) {
  std::vector<std::vector<uint32_t>> of_object(store.page_tree().objects.size());
  for (const Mesh& mesh : store.meshes())
    for (uint32_t f = 0; mesh.light_base != LightId::kNone && f < mesh.face_count; ++f)
      of_object[mesh.object].push_back(mesh.light_base + f);
  std::vector<Standing> all;
  for (uint32_t i = 0; i < store.instances().size(); ++i)
    for (const uint32_t e : of_object[store.instances()[i].object]) all.push_back({i, e});
  return all;
}

// Points on what lies below lamps, facing up.
std::vector<Float3> street_receivers(const shading::LightTable& lights, const test::Tracer& tracer,
                                     const std::vector<Standing>& standing, const Arguments& arguments) {
  const int up = arguments.up[0] - 'x';
  Random random(arguments.seed);
  std::vector<Float3> receivers;
  for (size_t tries = 0; receivers.size() < arguments.receivers && tries < 1000 * arguments.receivers; ++tries) {
    const Standing& lamp = standing[static_cast<size_t>(random.fine() * static_cast<double>(standing.size()))];
    Float3 p = shading::emitter_in_world(lights, lamp.instance, lamp.emitter).position;
    for (int a = 0; a < 3; ++a)
      if (a != up) p[a] += (2 * random.unit() - 1) * kReach;
    p[up] -= 0.5f;
    Float3 down{0, 0, 0};
    down[up] = -1;
    const cache::TraceHit hit = tracer.nearest({p, kReach, down, 0});
    if (hit.prim != PrimId::kNone && hit.t > 2) receivers.push_back(p + down * (hit.t * 0.9999f));
  }
  return receivers;
}

struct Moments {
  double first = 0, tree = 0, best = 0;  // sum of what arrives; second moments of both ways to choose
  [[nodiscard]] double ratio() const { return (tree - first * first) / (best - first * first); }
};

// Enumerates every light: its irradiance without shadows, its chance, and one place on it with its shadow.
Moments enumerate(const shading::LightTable& lights, const test::Tracer& tracer, const std::vector<Standing>& standing,
                  const shading::LightReceiver& receiver, Float3 up, Random random) {
  struct Sampled {
    double value = 0, unshadowed = 0;  // of one place: radiance cosine / density; what the whole light would bring
    double pmf = 0;
    Float3 point{0, 0, 0};
  };
  std::vector<Sampled> sampled;
  const shading::LightChances chances(lights.tree, receiver);
  double whole = 0;
  for (const auto& [instance, emitter] : standing) {
    const shading::TriangleShape shape = shading::emitter_in_world(lights, instance, emitter);
    const shading::Emission& emission = lights.emissions[lights.emitters[emitter].emission];
    const auto value_at = [&](Float2 u, Float3& point) {
      const shading::TrianglePoint place = shading::sample_triangle(shape, receiver.position_world, u);
      point = place.point;
      const Float3 w = normalize(point - receiver.position_world);
      if (!(place.pdf_solid_angle > 0) || dot(w, up) <= 0) return 0.0;
      return double{luminance(shading::emitter_radiance(shape, emission, w))} * dot(w, up) / place.pdf_solid_angle;
    };
    Sampled s;
    Float3 ignored;
    s.unshadowed = (value_at({0.25f, 0.5f}, ignored) + value_at({0.75f, 0.5f}, ignored)) / 2;
    const float x = random.unit();
    s.value = value_at({x, random.unit()}, s.point);
    if (s.value == 0 && s.unshadowed == 0) continue;
    s.unshadowed = std::max(s.unshadowed, 1e-3 * s.value);
    s.pmf = chances.of_emitter(instance, emitter);
    whole += s.unshadowed;
    sampled.push_back(s);
  }
  Moments m;
  for (const Sampled& s : sampled) {
    if (s.value == 0) continue;
    const Float3 to = s.point - receiver.position_world;
    const bool worth = s.value > kWorthARay * whole;
    if (worth && (tracer.occlusion({receiver.position_world, 0.999f, to, 0}).flags & cache::kHitOccluded) != 0)
      continue;
    m.first += s.value;
    m.best += s.value * s.value * whole / s.unshadowed;
    if (s.pmf > 0) m.tree += s.value * s.value / s.pmf;
  }
  return m;
}

void against_the_optimum(const shading::LightTable& lights, const test::Tracer& tracer,
                         const std::vector<Standing>& standing, const std::vector<Float3>& receivers,
                         const Arguments& arguments) {
  Float3 up{0, 0, 0};
  up[arguments.up[0] - 'x'] = 1;
  const uint16_t packed = shading::pack_receiver_normal(up);
  std::vector<Moments> moments(receivers.size());
  parallel_blocks(receivers.size(), 1, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i)
      moments[i] = enumerate(lights, tracer, standing, {receivers[i], packed}, up, Random(arguments.seed + i));
  });
  std::vector<double> ratios;
  for (const Moments& m : moments)
    if (m.first > 0) ratios.push_back(m.ratio());
  std::sort(ratios.begin(), ratios.end());
  const auto at = [&](double part) {
    return ratios[static_cast<size_t>(part * static_cast<double>(ratios.size() - 1))];
  };
  if (ratios.empty()) return;
  fmt::print("variance over the optimum's at {} receivers: median {:.2f}, 90 % {:.2f}, 99 % {:.2f}, largest {:.2f}\n",
             ratios.size(), at(0.5), at(0.9), at(0.99), ratios.back());
}

void cost_of_a_selection(const Store& store, const std::vector<Float3>& receivers) {
  const uint16_t up = shading::pack_receiver_normal({0, 0, 1});
  for (const auto& [name, selection] : {std::pair{"tree", LightSelection::tree},
                                        {"power", LightSelection::power},
                                        {"uniform", LightSelection::uniform}}) {
    RenderSettings settings;
    settings.light_selection = selection;
    const SelectedLights selected(store, settings);
    Random random(2);
    constexpr int kPicks = 400000;
    double best = 1e30;
    uint64_t sum = 0;
    for (int round = 0; round < 3; ++round) {
      const auto start = Clock::now();
      for (int i = 0; i < kPicks; ++i)
        sum += shading::pick_light(selected.table().tree, {receivers[i % receivers.size()], up}, random.fine()).index;
      best = std::min(best, std::chrono::duration<double>(Clock::now() - start).count());
    }
    fmt::print("{:<8} {:6.0f} ns a selection{}\n", name, best * 1e9 / kPicks, sum == 0 ? " (of one light)" : "");
  }
}

// What stays in memory of the lights, all of it of both levels of the tree.
void bytes_of_a_light(const shading::LightTable& lights, size_t standing) {
  const shading::LightTree& tree = lights.tree;
  const size_t nodes = tree.nodes.size_bytes(), leaves = tree.emitter_leaves.size_bytes();
  const size_t shapes = lights.emitters.size_bytes(), instances = tree.instance_leaves.size_bytes();
  const size_t rest = lights.emissions.size_bytes() + tree.roots.size_bytes() + lights.cdf.size_bytes();
  const auto stored = static_cast<double>(lights.emitters.size());
  const size_t all = nodes + leaves + shapes + instances + rest;
  fmt::print(
      "bytes a stored triangle: {:.1f} ({:.1f} shape, {:.1f} leaf, {:.1f} nodes, {:.1f} leaves of instances, {:.1f} "
      "meshes); "
      "{:.1f} a standing one\n",
      static_cast<double>(all) / stored, static_cast<double>(shapes) / stored, static_cast<double>(leaves) / stored,
      static_cast<double>(nodes) / stored, static_cast<double>(instances) / stored, static_cast<double>(rest) / stored,
      static_cast<double>(all) / static_cast<double>(standing));
}

Status run(const Arguments& arguments) {
  SPILLWAY_ASSIGN(const Store store, Store::open(arguments.store));
  const SelectedLights selected(store, RenderSettings{});
  const shading::LightTable& lights = selected.table();
  if (lights.tree.empty()) return error("{}: has so few lights that there is no tree", arguments.store.string());
  SPILLWAY_ASSIGN(const auto tracer, test::kernel_tracer(store));
  const std::vector<Standing> standing = standing_emitters(store);
  const double bytes = static_cast<double>(memory_use(MemoryTag::lights).current_bytes);
  const std::vector<Float3> receivers = street_receivers(lights, *tracer, standing, arguments);
  if (receivers.empty()) return error("{}: nothing lies below its lamps", arguments.store.string());
  fmt::print("{} emitting triangles stored, {} standing, {} nodes, {:.1f} MB of lights in all\n",
             lights.emitters.size(), standing.size(), lights.tree.nodes.size(), bytes * 1e-6);
  bytes_of_a_light(lights, standing.size());
  cost_of_a_selection(store, receivers);
  if (!arguments.costs_only) against_the_optimum(lights, *tracer, standing, receivers, arguments);
  return {};
}

}  // namespace
}  // namespace spillway::bench

int main(int argc, char** argv) {
  spillway::bench::Arguments arguments;
  CLI::App app("How well lights are chosen");
  app.add_option("store", arguments.store)->required();
  app.add_option("--receivers", arguments.receivers);
  app.add_option("--threads", arguments.threads);
  app.add_option("--seed", arguments.seed);
  app.add_option("--up", arguments.up, "the axis that points up")->check(CLI::IsMember({"x", "y", "z"}));
  app.add_flag("--costs-only", arguments.costs_only, "1. alone");
  CLI11_PARSE(app, argc, argv);
  const auto status = spillway::on_threads(arguments.threads, [&] { return spillway::bench::run(arguments); });
  if (!status) fmt::print(stderr, "light_bench: {}\n", status.error().message);
  return status ? 0 : 1;
}
