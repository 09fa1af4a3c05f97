// Light trees of lamps built in code: every law that selection obeys.

#include "pipeline/pack/build_light_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "pipeline/pack/pack_page_tree.h"
#include "shading/light.h"
#include "tests/support/small_scene.h"

namespace spillway::pipeline {
namespace {

using shading::kNoLightNode;
using shading::LightChild;
using shading::LightReceiver;

class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}
  float unit() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }
  double fine() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }
  Float3 point(Float3 size) {
    const float x = unit(), y = unit();
    return {(2 * x - 1) * size.x, (2 * y - 1) * size.y, (2 * unit() - 1) * size.z};
  }
  Float3 direction() {
    while (true) {
      const Float3 d = point({1, 1, 1});
      if (const float s = length_squared(d); s > 0.01f && s < 1) return normalize(d);
    }
  }

 private:
  std::mt19937_64 engine_;
};

// Everything a light table of a tree needs, owned.
struct Lamps {
  std::vector<shading::Emitter> emitters;
  std::vector<shading::Emission> emissions;
  std::vector<shading::Light> lights;
  std::vector<std::vector<uint32_t>> objects{{}};  // emitters of each; [0] the world
  std::vector<shading::LightInstance> instances{{}};
  std::vector<float> cdf{0, 1};
  LightTrees trees;

  void add(uint32_t object, const shading::TriangleShape& shape, Rgb radiance, bool two_sided = false) {
    if (objects.size() <= object) objects.resize(object + 1);
    objects[object].push_back(static_cast<uint32_t>(emitters.size()));
    emitters.push_back({shape, static_cast<uint32_t>(emissions.size())});
    emissions.push_back({radiance, two_sided ? 1u : 0u});
  }
  void add_point(Float3 position, float intensity) {
    shading::Light light{};
    light.kind = shading::LightKind::point;
    light.position = position, light.radiance = {intensity, intensity, intensity};
    lights.push_back(light);
    cdf.push_back(1);  // no share beside the tree
  }
  void stand(uint32_t object, const Affine3& t) {
    shading::LightInstance instance{t, {}, object};
    EXPECT_TRUE(invert(t, instance.object_from_world));
    instances.push_back(instance);
  }
  Bounds3 box(uint32_t object) const {
    Bounds3 b;
    for (const uint32_t e : objects[object]) b.grow(emitter_item(emitters[e].shape, emissions[0], 0).box);
    return b;
  }

  Status build(BuildLightTreeOptions options = {}) {
    LightTreeBuilder builder(static_cast<uint32_t>(objects.size()), emitters.size(), instances.size() - 1, options);
    std::vector<LightTreeBuilder::Object> built(objects.size());
    for (uint32_t o = static_cast<uint32_t>(objects.size()); o-- > 0;) {
      std::vector<LightItem> more;
      Bounds3 all = box(o);
      for (uint32_t i = 0; o == 0 && i < lights.size(); ++i) more.push_back(light_item(lights[i], i));
      for (uint32_t i = 1; o == 0 && i < instances.size(); ++i) {
        const auto& object = built[instances[i].object];
        more.push_back(instance_item(object.bounds, object.moments, instances[i].world_from_object, i));
      }
      for (const LightItem& item : more) all.grow(item.box);
      builder.begin(o, all);
      for (const uint32_t e : objects[o])
        SPILLWAY_TRY(builder.add(emitter_item(emitters[e].shape, emissions[emitters[e].emission], e)));
      for (const LightItem& item : more) SPILLWAY_TRY(builder.add(item));
      SPILLWAY_ASSIGN(built[o], builder.end());
    }
    trees = builder.take();
    return {};
  }

  [[nodiscard]] shading::LightTable table() const {
    shading::LightTable t;
    t.emitters = emitters, t.emissions = emissions, t.lights = lights, t.cdf = cdf;
    t.first_infinite = static_cast<uint32_t>(lights.size());
    t.tree.nodes = trees.nodes, t.tree.roots = trees.roots;
    t.tree.emitter_leaves = trees.emitter_leaves, t.tree.instance_leaves = trees.instance_leaves;
    t.tree.instances = {instances.data(), sizeof(shading::LightInstance)};
    return t;
  }
  // Every emitter where it stands.
  struct Standing {
    uint32_t instance, emitter;
  };
  [[nodiscard]] std::vector<Standing> standing() const {
    std::vector<Standing> all;
    for (const uint32_t e : objects[0]) all.push_back({0, e});
    for (uint32_t i = 1; i < instances.size(); ++i)
      for (const uint32_t e : objects[instances[i].object]) all.push_back({i, e});
    return all;
  }
};

Affine3 placed(Float3 x, Float3 y, Float3 z, Float3 at) {
  Affine3 t;
  for (int a = 0; a < 3; ++a) t.m[a][0] = x[a], t.m[a][1] = y[a], t.m[a][2] = z[a], t.m[a][3] = at[a];
  return t;
}

shading::TriangleShape any_triangle(Random& random, Float3 size, float edge) {
  return {random.point(size), random.direction() * (edge * (0.2f + random.unit())),
          random.direction() * (edge * (0.2f + random.unit()))};
}

// Windows in the world, lamps of two kinds as instances: turned, scaled, mirrored, sheared.
Lamps street(uint32_t windows, uint32_t lamps, uint64_t seed) {
  Random random(seed);
  Lamps s;
  s.objects.resize(3);
  for (uint32_t i = 0; i < windows; ++i) {
    const float strength = std::exp(4 * random.unit() - 2);
    s.add(0, any_triangle(random, {40, 40, 10}, 0.8f), {strength, strength, strength}, i % 5 == 0);
  }
  for (int i = 0; i < 12; ++i) s.add(1, any_triangle(random, {0.4f, 0.4f, 0.1f}, 0.2f), {9, 8, 7});
  for (int i = 0; i < 3; ++i) s.add(2, {{0.1f * static_cast<float>(i), 0, 0}, {0, 0.3f, 0}, {0.3f, 0, 0}}, {5, 5, 5});
  for (uint32_t i = 0; i < lamps; ++i) {
    const Float3 x = random.direction(), helper = random.direction(), y = normalize(cross(x, helper)), z = cross(x, y);
    const float size = 0.5f + random.unit(), mirror = i % 3 == 1 ? -1.0f : 1.0f;
    Affine3 t = placed(x * size, y * size, z * (size * mirror), random.point({40, 40, 6}));
    if (i % 4 == 2) t.m[0][1] += 0.7f, t.m[2][2] *= 1.5f;
    s.stand(1 + i % 2, t);
  }
  return s;
}

std::vector<LightReceiver> receivers(const Lamps& s, Random& random) {
  std::vector<LightReceiver> all;
  for (int i = 0; i < 12; ++i)
    all.push_back(
        {random.point({50, 50, 15}), i % 4 == 0 ? uint16_t{0} : shading::pack_receiver_normal(random.direction())});
  const uint16_t up = shading::pack_receiver_normal({0, 0, 1}), down = shading::pack_receiver_normal({0, 0, -1});
  for (const uint16_t normal : {up, down}) {
    all.push_back({{0, 0, 100}, normal});   // above all, looking away, then back
    all.push_back({{1e6f, 0, 0}, normal});  // so far that all are one
    all.push_back({s.emitters[0].shape.position, normal});
  }
  return all;
}

TEST(LightTree, chances_of_all_lights_sum_to_one_everywhere) {
  Random random(1);
  for (const auto& [windows, lamps] : {std::pair{1u, 0u}, {2, 1}, {9, 0}, {100, 17}, {0, 40}, {3000, 300}}) {
    Lamps s = street(windows, lamps, 11);
    ASSERT_TRUE(s.build());
    const shading::LightTable table = s.table();
    for (const LightReceiver& receiver : receivers(s, random)) {
      double sum = 0;
      for (const auto& [instance, emitter] : s.standing()) {
        const float pmf = shading::emitter_pmf(table.tree, receiver, instance, emitter);
        ASSERT_GE(pmf, 0);
        sum += pmf;
      }
      EXPECT_NEAR(sum, 1, 2e-5) << windows << ' ' << lamps;
    }
  }
}

TEST(LightTree, the_chance_of_a_chance_hit_is_that_of_sampling_bit_for_bit) {
  Lamps s = street(400, 60, 12);
  ASSERT_TRUE(s.build());
  const shading::LightTable table = s.table();
  Random random(2);
  int compared = 0, of_instances = 0;
  for (int i = 0; i < 20000; ++i) {
    LightReceiver receiver{random.point({45, 45, 12}), shading::pack_receiver_normal(random.direction())};
    if (i % 7 == 0) receiver.packed_normal = 0;
    const shading::LightPick pick = shading::pick_light(table.tree, receiver, random.fine());
    ASSERT_EQ(pick.kind, LightChild::emitter);
    ASSERT_EQ(shading::emitter_pmf(table.tree, receiver, pick.instance, pick.index), pick.pmf);
    of_instances += pick.instance != 0;
    const float select = random.unit(), x = random.unit();
    const Float2 u{select, random.unit()};
    const shading::LightSample sample = shading::sample_light(table, receiver, u, {x, random.unit()});
    const shading::LightPick again = shading::pick_light(table.tree, receiver, double{u.x} + double{u.y} * 0x1p-24);
    if (!(sample.pdf_solid_angle > 0)) continue;
    const shading::TriangleShape shape = shading::emitter_in_world(table, again.instance, again.index);
    ASSERT_EQ(shading::emitter_pdf_solid_angle(table, receiver, again.instance, again.index, shape, sample.point_world),
              sample.pdf_solid_angle);
    ++compared;
  }
  EXPECT_GT(compared, 19000);
  EXPECT_GT(of_instances, 2000);
}

TEST(LightTree, lights_are_chosen_as_often_as_their_chance_says) {
  Lamps s = street(60, 20, 13);
  ASSERT_TRUE(s.build());
  const shading::LightTable table = s.table();
  const auto standing = s.standing();
  Random random(3);
  for (const LightReceiver& receiver : receivers(s, random)) {
    std::vector<double> expected(standing.size());
    std::vector<std::vector<uint32_t>> number(s.instances.size(), std::vector<uint32_t>(s.emitters.size(), 0));
    constexpr int kSamples = 100000;
    for (uint32_t i = 0; i < standing.size(); ++i) {
      number[standing[i].instance][standing[i].emitter] = i;
      expected[i] = kSamples * static_cast<double>(shading::emitter_pmf(table.tree, receiver, standing[i].instance,
                                                                        standing[i].emitter));
    }
    std::vector<int> seen(standing.size());
    for (int i = 0; i < kSamples; ++i) {
      const shading::LightPick pick = shading::pick_light(table.tree, receiver, random.fine());
      ++seen[number[pick.instance][pick.index]];
    }
    double chi_square = 0, rare_expected = 0, rare_seen = 0;
    int cells = 0;
    for (size_t i = 0; i < seen.size(); ++i) {
      if (expected[i] < 5) {
        rare_expected += expected[i], rare_seen += seen[i];
        continue;
      }
      chi_square += (seen[i] - expected[i]) * (seen[i] - expected[i]) / expected[i], ++cells;
    }
    if (rare_expected >= 5)
      chi_square += (rare_seen - rare_expected) * (rare_seen - rare_expected) / rare_expected, ++cells;
    // Wilson and Hilferty: a chi square of k - 1 degrees, brought to a normal deviate; five is one in three million.
    const double k = std::max(1, cells - 1);
    const double deviate = (std::cbrt(chi_square / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
    EXPECT_LT(deviate, 5) << cells;
  }
}

// Zero only where nothing can arrive; chance hits would still find such a light, but a point light would be lost.
TEST(LightTree, whatever_shines_on_a_receiver_has_a_chance) {
  Lamps s = street(300, 60, 14);
  for (int i = 0; i < 20; ++i) s.add_point({static_cast<float>(i) * 3 - 30, 5, 4}, 2);
  ASSERT_TRUE(s.build());
  const shading::LightTable table = s.table();
  Random random(4);
  for (int i = 0; i < 300; ++i) {
    const Float3 n = random.direction();
    const LightReceiver receiver{random.point({45, 45, 12}), shading::pack_receiver_normal(n)};
    for (const auto& [instance, emitter] : s.standing()) {
      const shading::TriangleShape shape = shading::emitter_in_world(table, instance, emitter);
      const Float3 to = shape.position + (shape.edge1 + shape.edge2) * (1.0f / 3) - receiver.position_world;
      const shading::Emission& emission = s.emissions[s.emitters[emitter].emission];
      if (dot(to, n) <= 0 || is_black(shading::emitter_radiance(shape, emission, normalize(to)))) continue;
      ASSERT_GT(shading::emitter_pmf(table.tree, receiver, instance, emitter), 0);
    }
  }
}

// Irradiance of a polygon by Lambert's formula, whole above the horizon of the receiver.
double polygon_irradiance(const shading::TriangleShape& t, Float3 receiver, Float3 n) {
  const Float3 corner[3] = {t.position, t.position + t.edge1, t.position + t.edge2};
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    const Float3 a = normalize(corner[i] - receiver), b = normalize(corner[(i + 1) % 3] - receiver);
    const Float3 c = cross(a, b);
    const double sine = length(c), angle = std::atan2(sine, static_cast<double>(dot(a, b)));
    if (sine > 0) sum += angle * dot(c, n) / sine;
  }
  return std::fabs(sum) / 2;
}

TEST(LightTree, the_mean_of_what_is_sampled_is_the_light_of_all_lamps) {
  Lamps s;
  s.objects.resize(2);
  Random random(5);
  // Two triangles that look down, as a lamp head; instances of it, some mirrored, some stretched; windows beside them.
  for (const float side : {-1.0f, 1.0f})
    s.add(1, {{0, 0, 0}, {0, side * 0.3f, 0}, {side * 0.4f, 0, 0}}, {6, 6, 6}, side < 0);
  for (int i = 0; i < 50; ++i) {
    const float size = 0.5f + 2 * random.unit();
    const Float3 at = Float3{0, 0, 6} + random.point({30, 30, 1});
    s.stand(1, placed({i % 2 ? -size : size, 0, 0}, {0.2f, size, 0}, {0, 0, 1}, at));
  }
  for (int i = 0; i < 200; ++i)
    s.add(0, {random.point({30, 30, 0}) + Float3{0, 0, 4}, {0.5f, 0, 0}, {0, 0, 1}}, {2, 2, 2}, true);
  for (int i = 0; i < 30; ++i) s.add_point(random.point({30, 30, 0}) + Float3{0, 0, 5}, 3);
  ASSERT_TRUE(s.build());
  const shading::LightTable table = s.table();
  const Float3 n{0, 0, 1};
  for (int r = 0; r < 5; ++r) {
    const Float3 p = random.point({25, 25, 0});
    double exact = 0;
    for (const auto& [instance, emitter] : s.standing()) {
      const shading::TriangleShape shape = shading::emitter_in_world(table, instance, emitter);
      const shading::Emission& emission = s.emissions[s.emitters[emitter].emission];
      const Rgb seen = shading::emitter_radiance(shape, emission, normalize(shape.position - p));
      exact += polygon_irradiance(shape, p, n) * seen.g;
    }
    for (const shading::Light& light : s.lights) {
      const Float3 to = light.position - p;
      exact += light.radiance.g * to.z / (length_squared(to) * length(to));
    }
    double sum = 0, squares = 0;
    constexpr int kSamples = 200000;
    for (int i = 0; i < kSamples; ++i) {
      const float a = random.unit(), b = random.unit(), x = random.unit();
      const shading::LightSample got =
          shading::sample_light(table, {p, shading::pack_receiver_normal(n)}, {a, b}, {x, random.unit()});
      const double value =
          got.pdf_solid_angle > 0 ? got.radiance.g * std::max(0.0f, got.w_next_world.z) / got.pdf_solid_angle : 0;
      sum += value, squares += value * value;
    }
    const double mean = sum / kSamples, deviation = std::sqrt((squares / kSamples - mean * mean) / kSamples);
    EXPECT_NEAR(mean, exact, 4.5 * deviation);
    EXPECT_LT(deviation, 0.02 * exact);
  }
}

// A street of lamps that hang over it, and windows in walls beside it.
Lamps night_street(uint64_t seed) {
  Random random(seed);
  Lamps s;
  s.objects.resize(2);
  for (const float side : {-1.0f, 1.0f})
    s.add(1, {{0, 0, 0}, {0, side * 0.15f, 0}, {side * 0.2f, 0, 0}}, {200, 200, 200}, side < 0);
  for (int i = 0; i < 1500; ++i) {
    const Float3 at =
        Float3{static_cast<float>(i % 40) * 20, static_cast<float>(i) / 40 * 15, 6} + random.point({3, 3, 0.5f});
    s.stand(1, placed({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, at));
  }
  for (int i = 0; i < 4000; ++i) {
    const Float3 at = Float3{400, 280, 10} + random.point({420, 300, 9});
    const Float3 along = i % 2 ? Float3{1.2f, 0, 0} : Float3{0, 1.2f, 0};
    s.add(0, {at, along, {0, 0, 1.5f}}, {2, 2, 2});
  }
  return s;
}

// The variance of one sample, of the tree's chances over that of chances in proportion to what each light brings where
// nothing is in the way; half of the lights are hidden.
double variance_over_the_best(const shading::LightTable& table, const std::vector<Lamps::Standing>& standing,
                              Float3 place, Random& random) {
  const Float3 up{0, 0, 1};
  const shading::LightChances chances(table.tree, {place, shading::pack_receiver_normal(up)});
  double whole = 0, seen = 0, of_tree = 0, of_best = 0;
  std::vector<double> visible;
  for (const auto& [instance, emitter] : standing) {
    const shading::TriangleShape shape = shading::emitter_in_world(table, instance, emitter);
    const Float3 to = shape.position + (shape.edge1 + shape.edge2) * (1.0f / 3) - place, w = normalize(to);
    const double radiance = shading::emitter_radiance(shape, table.emissions[table.emitters[emitter].emission], w).g;
    const double area = 0.5 * std::fabs(dot(cross(shape.edge1, shape.edge2), w));
    const double value = radiance * area * std::max(0.0f, w.z) / length_squared(to);
    whole += value;
    if (!(value > 0) || random.unit() < 0.5f) continue;
    seen += value;
    of_tree += value * value / static_cast<double>(chances.of_emitter(instance, emitter));
    visible.push_back(value);
  }
  for (const double value : visible) of_best += value * whole;
  return (of_tree - seen * seen) / (of_best - seen * seen);
}

// Wanted: 4 and 20. Here the optimum's own variance is at least what hidden lights cause.
TEST(LightTree, selection_is_nearly_as_good_as_knowing_what_each_light_brings) {
  Lamps s = night_street(21);
  ASSERT_TRUE(s.build());
  const shading::LightTable table = s.table();
  const auto standing = s.standing();
  Random random(22);
  std::vector<double> ratios;
  for (int i = 0; i < 400; ++i)
    ratios.push_back(
        variance_over_the_best(table, standing, Float3{400, 280, 0} + random.point({380, 270, 0}), random));
  std::sort(ratios.begin(), ratios.end());
  EXPECT_LT(ratios[200], 2);
  EXPECT_LT(ratios[396], 8);
}

TEST(LightTree, bounds_of_an_instance_hold_its_lights) {
  Random random(6);
  for (int round = 0; round < 200; ++round) {
    Lamps s;
    s.objects.resize(2);
    const Float3 axis = random.direction();
    for (int i = 0; i < 20; ++i) {  // normals within a cone of 60 degrees or so
      const Float3 n = normalize(axis + random.direction() * (0.8f * static_cast<float>(round % 3) / 2));
      const Float3 t = normalize(cross(n, random.direction()));
      s.add(1, {random.point({1, 1, 1}), t, cross(n, t)}, {1, 1, 1});
    }
    Affine3 t =
        placed(random.direction() * 2, random.direction(), random.direction() * (0.3f + random.unit()), {5, 6, 7});
    const bool keeps_angles = round % 2 == 0;
    if (keeps_angles) {
      const Float3 x = random.direction(), y = normalize(cross(x, random.direction()));
      t = placed(x * 3, y * 3, cross(x, y) * (round % 4 == 0 ? 3.0f : -3.0f), {1, 2, 3});
    }
    s.stand(1, t);
    std::vector<LightItem> items;
    NormalMoments moments;
    for (uint32_t e = 0; e < 20; ++e)
      items.push_back(emitter_item(s.emitters[e].shape, s.emissions[e], e)), moments.add(items.back());
    const LightItem bounds = instance_item(bounds_of(items), moments, t, 1);
    const shading::LightTable table = [&] {
      EXPECT_TRUE(s.build());
      return s.table();
    }();
    double energy = 0;
    for (uint32_t e = 0; e < 20; ++e) {
      const LightItem item = emitter_item(shading::emitter_in_world(table, 1, e), s.emissions[e], e);
      energy += item.energy;
      // Corners and normals here are rounded, to 32 bits.
      for (int a = 0; a < 3; ++a) {
        EXPECT_GE(item.box.lower[a], bounds.box.lower[a] - 2e-6f);
        EXPECT_LE(item.box.upper[a], bounds.box.upper[a] + 2e-6f);
      }
      EXPECT_GE(dot(item.axis, bounds.axis), bounds.cos_cone - 1e-6f);
    }
    EXPECT_GE(bounds.energy, energy * (1 - 1e-5));
    if (keeps_angles) {
      EXPECT_NEAR(bounds.energy / energy, 1, 1e-5);
      EXPECT_NEAR(bounds.cos_cone, bounds_of(items).cos_cone, 1e-4);
    }
  }
}

TEST(LightTree, memory_does_not_show_and_chunks_obey_the_same_laws) {
  test::TemporaryDirectory directory;
  auto scratch = cache::Scratch::create(directory.path());
  ASSERT_TRUE(scratch);
  Lamps s = street(5000, 100, 15);
  const auto nodes = [&](uint64_t memory, uint32_t chunk) {
    EXPECT_TRUE(s.build({.scratch = scratch->get(), .memory_limit_bytes = memory, .chunk_lights = chunk}));
    return std::string(reinterpret_cast<const char*>(s.trees.nodes.data()),
                       s.trees.nodes.size() * sizeof(shading::LightNode));
  };
  const std::string whole = nodes(64 << 20, 1 << 17), large = nodes(64 << 20, 256);
  const uint64_t before = (*scratch)->peak_bytes();
  EXPECT_TRUE(nodes(64 << 10, 256) == large);
  EXPECT_GT((*scratch)->peak_bytes(), before);  // the limit bites
  EXPECT_FALSE(whole == large);
  const shading::LightTable table = s.table();
  Random random(7);
  for (const LightReceiver& receiver : receivers(s, random)) {
    double sum = 0;
    for (const auto& [instance, emitter] : s.standing())
      sum += shading::emitter_pmf(table.tree, receiver, instance, emitter);
    EXPECT_NEAR(sum, 1, 2e-5);
  }
}

TEST(LightTree, nodes_are_full_and_never_deep) {
  Lamps many = street(20000, 0, 16);
  ASSERT_TRUE(many.build());
  // Seven children a node besides its own place, were all full.
  EXPECT_LT(static_cast<double>(many.trees.nodes.size()), 20000 / 5.5);
  // Each next lamp twice as far away: cuts by cost take one off at a time.
  Lamps far;
  for (int i = 0; i < 3000; ++i)
    far.add(0, {{std::exp2(static_cast<float>(i % 60)), static_cast<float>(i), 0}, {0, 1, 0}, {0, 0, 1}}, {1, 1, 1});
  ASSERT_TRUE(far.build());
  for (const uint32_t leaf : far.trees.emitter_leaves) {
    uint32_t depth = 0;
    for (uint32_t place = leaf; place != kNoLightNode; place = far.trees.nodes[place / 8].parent) ++depth;
    ASSERT_LE(depth, 24u);
  }
}

TEST(LightTree, packed_normals_are_near_and_never_none) {
  Random random(8);
  float worst = 1;
  for (int i = 0; i < 100000; ++i) {
    const Float3 n = random.direction();
    const uint16_t packed = shading::pack_receiver_normal(n);
    ASSERT_NE(packed, 0);
    worst = std::min(worst, dot(n, shading::unpack_receiver_normal(packed)));
  }
  for (const Float3 n : {Float3{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, -1, 0}})
    EXPECT_GT(dot(n, shading::unpack_receiver_normal(shading::pack_receiver_normal(n))), 0.99999f);
  EXPECT_GT(worst, std::cos(0.0175f));  // what the tree's weights allow for
}

}  // namespace
}  // namespace spillway::pipeline
