#include "pipeline/render/trace_rays.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <numeric>
#include <random>
#include <set>

#include "pipeline/pack/build_trees.h"
#include "pipeline/render/sort_rays.h"

namespace spillway::pipeline {
namespace {

using cache::PageTree;
using cache::PartStore;
using cache::TraceHit;
using cache::TraceMode;
using cache::TraceRay;

class Random {
 public:
  explicit Random(uint32_t seed) : engine_(seed) {}
  uint32_t below(uint32_t n) { return static_cast<uint32_t>(engine_()) % n; }
  float in(float lower, float upper) { return lower + (upper - lower) * static_cast<float>(engine_() >> 8) * 0x1p-24f; }
  Float3 point(float size) { return {in(-size, size), in(-size, size), in(-size, size)}; }

 private:
  std::mt19937 engine_;
};

std::vector<std::byte> uniform_micromap(cache::Opacity opacity) {
  std::vector<std::byte> bytes(sizeof(cache::OpacityMicromap) + 1);  // level 0: one micro-triangle
  bytes.back() = std::byte(static_cast<uint8_t>(opacity));
  return bytes;
}

// A soup in many small pages, and two prototypes of several pages that stand in many overlapping places.
class Scene {
 public:
  explicit Scene(uint32_t seed, bool instances = true) : random_(seed) {
    std::string name = (std::filesystem::temp_directory_path() / "spillway_pages_XXXXXX").string();
    directory_ = mkdtemp(name.data());
    objects_.resize(instances ? 3 : 1);
    add_soup(0, 3000, 10, 1.5f);
    // The far wall twice, in other pages, with other ids: ties.
    const size_t wall = triangles_.size();
    add_wall();
    for (size_t i = wall; i < wall + 32; ++i) triangles_.push_back({triangles_[i].vertex, next_prim_++, 0});
    write_object(0);
    for (uint32_t object = 1; object < objects_.size(); ++object) {
      add_soup(object, 500, 1, 0.3f);
      write_object(object);
    }
    instances_.push_back({{}, {}, 0, 0, {}});
    for (int i = 0; i < (instances ? 40 : 0); ++i) add_instance(1 + random_.below(2));
    std::ofstream(path(), std::ios::binary).write(reinterpret_cast<const char*>(file_.data()), std::ssize(file_));
    build_tree();
  }
  ~Scene() { std::filesystem::remove_all(directory_); }

  [[nodiscard]] std::filesystem::path path() const { return directory_ / "pages.trace"; }
  [[nodiscard]] PageTree tree() const { return {nodes_, entries_, objects_, instances_, extent_}; }
  [[nodiscard]] std::span<const cache::Instance> instances() const { return instances_; }
  [[nodiscard]] Bounds3 bounds() const { return objects_[0].bounds_object; }
  [[nodiscard]] cache::TracePageView view(size_t page) const {
    return cache::trace_page_view({file_.data() + parts[page].offset_bytes, parts[page].size_bytes});
  }
  std::unique_ptr<PartStore> open(uint64_t limit, std::function<void(uint32_t, bool)> log = {}) const {
    PartStore::Options options;
    options.memory_limit_bytes = limit;
    options.read_ahead_bytes = 0;  // two pages: most of the limit is for residents
    options.access_log = std::move(log);
    auto store = PartStore::open(path(), parts, options, cache::validate_trace_page);
    EXPECT_TRUE(store) << store.error().message;
    return std::move(store).value();
  }

  std::vector<cache::Part> parts;
  std::vector<uint32_t> page_object;

 private:
  struct Triangle {
    std::array<Float3, 3> vertex;
    uint32_t prim;
    uint32_t opacity;  // 0: opaque, 1: clear, 2: unknown
  };

  void add_soup(uint32_t object, int count, float size, float edge) {
    for (int i = 0; i < count; ++i) {
      const Float3 p = random_.point(size);
      const uint32_t dice = object == 0 ? random_.below(10) : 9;
      triangles_.push_back({{p, p + random_.point(edge), p + random_.point(edge)}, next_prim_++, dice < 3 ? dice : 0});
    }
  }
  void add_wall() {
    for (int i = 0; i < 32; ++i) {
      const float x = static_cast<float>(i % 4) * 4 - 8, y = static_cast<float>(i / 8) * 4 - 8;
      const Float3 a{x, y, 12}, b{x + 4, y, 12}, c{x, y + 4, 12}, d{x + 4, y + 4, 12};
      triangles_.push_back({(i / 4) % 2 == 0 ? std::array{a, b, d} : std::array{a, d, c}, next_prim_++, 0});
    }
  }

  // Clusters along x, so that pages overlap in y and z and rays meet several.
  void write_object(uint32_t object) {
    std::ranges::stable_sort(triangles_, {}, [](const Triangle& t) { return t.vertex[0].x; });
    std::vector<Bounds3> boxes;
    for (size_t first = 0; first < triangles_.size(); first += 100) {
      const size_t last = std::min(first + 100, triangles_.size());
      entries_of_.push_back({object, {0, static_cast<uint32_t>(parts.size())}});
      boxes.push_back(write_page({triangles_.data() + first, last - first}));
      page_object.push_back(object);
      objects_[object].bounds_object.grow(boxes.back());
    }
    triangles_.clear();
    boxes_.resize(objects_.size());
    boxes_[object] = boxes;
  }
  Bounds3 write_page(std::span<const Triangle> triangles) {
    std::vector<PackTriangle> pack;
    std::vector<std::vector<std::byte>> micromaps;
    Bounds3 bounds;
    for (const Triangle& t : triangles) {
      pack.push_back({{t.vertex[0], t.vertex[1], t.vertex[2]}, t.prim});
      micromaps.push_back(t.opacity == 0 ? std::vector<std::byte>{}
                                         : uniform_micromap(static_cast<cache::Opacity>(t.opacity)));
      for (const Float3& v : t.vertex) bounds.grow(v);
    }
    const Buffer<std::byte> page = build_trace_page(pack, micromaps, {});
    parts.push_back({file_.size(), page.size()});
    file_.insert(file_.end(), page.begin(), page.end());
    return bounds;
  }

  void add_instance(uint32_t object) {
    const Float3 at = random_.point(9);
    const float s = random_.in(0.5f, 3.0f);
    const float c = std::cos(at.x), n = std::sin(at.x);
    cache::Instance instance{};
    instance.object = object;
    instance.world_from_object = {{{s * c, -s * n, 0, at.x}, {s * n, s * c, 0, at.y}, {0, 0, s, at.z}}};
    const float q = 1 / s;
    Affine3 back = {{{q * c, q * n, 0, 0}, {-q * n, q * c, 0, 0}, {0, 0, q, 0}}};
    const Float3 moved = back.vector(at);
    for (int a = 0; a < 3; ++a) back.m[a][3] = -moved[a];
    instance.object_from_world = back;
    instances_.push_back(instance);
  }
  [[nodiscard]] Bounds3 bounds_of(const cache::Instance& instance) const {
    const Bounds3& b = objects_[instance.object].bounds_object;
    Bounds3 bounds;
    for (int i = 0; i < 8; ++i)
      bounds.grow(instance.world_from_object.point({(i & 1) != 0 ? b.upper.x : b.lower.x,
                                                    (i & 2) != 0 ? b.upper.y : b.lower.y,
                                                    (i & 4) != 0 ? b.upper.z : b.lower.z}));
    // Rounding of the two transforms, generously: 1e-3 against coordinates of 10.
    return {bounds.lower - Float3{1e-3f, 1e-3f, 1e-3f}, bounds.upper + Float3{1e-3f, 1e-3f, 1e-3f}};
  }

  void build_tree() {
    for (uint32_t object = 0; object < objects_.size(); ++object) {
      const auto base = static_cast<uint32_t>(entries_.size());
      std::vector<Bounds3> boxes = boxes_[object];
      for (const auto& [owner, entry] : entries_of_)
        if (owner == object) entries_.push_back(entry);
      for (uint32_t i = 1; object == 0 && i < instances_.size(); ++i) {
        entries_.push_back({1, i});
        boxes.push_back(bounds_of(instances_[i]));
        objects_[0].bounds_object.grow(boxes.back());
      }
      BoxTree built = build_box_tree(boxes, static_cast<uint32_t>(nodes_.size()), {});
      for (cache::TraceNode& node : built.nodes) {
        for (uint32_t& child : node.child)
          if (child != cache::kNoChild && (child & cache::kLeafBit) != 0) child += base;
        nodes_.push_back(node);
      }
      objects_[object].root = built.root;
    }
    extent_ = std::max(max_abs(bounds().lower), max_abs(bounds().upper));
    EXPECT_TRUE(cache::validate_page_tree(tree(), parts.size(), "test"));
  }

  Random random_;
  std::filesystem::path directory_;
  uint32_t next_prim_ = 0;
  std::vector<Triangle> triangles_;
  std::vector<std::byte> file_;
  std::vector<std::vector<Bounds3>> boxes_;
  std::vector<std::pair<uint32_t, cache::PageTreeEntry>> entries_of_;
  std::vector<cache::TraceNode> nodes_;
  std::vector<cache::PageTreeEntry> entries_;
  std::vector<cache::PageObject> objects_;
  std::vector<cache::Instance> instances_;
  float extent_ = 0;
};

struct Rays {
  Rays(size_t path_count, size_t shadow_count, uint32_t seed) : paths(path_count), shadows(shadow_count) {
    Random random(seed);
    for (TraceRay& ray : paths) ray = {random.point(11), INFINITY, random.point(1), 0};
    // Rays that leave the soup through the doubled wall, so that ties happen.
    for (size_t i = 0; i < paths.size(); i += 3)
      paths[i] = {{random.in(-8, 8), random.in(-8, 8), 11.9f}, 50, {0, 0, 1}, 0};
    for (TraceRay& ray : shadows) ray = {random.point(11), random.in(0.2f, 6), random.point(1), 0};
    order.resize(path_count + shadow_count);
    std::iota(order.begin(), order.end(), 0u);
  }
  std::vector<TraceRay> paths, shadows;
  std::vector<uint32_t> order;
};

struct Hits {
  std::vector<TraceHit> paths, shadows;
  bool operator==(const Hits& other) const {
    return std::memcmp(paths.data(), other.paths.data(), paths.size() * sizeof(TraceHit)) == 0 &&
           std::memcmp(shadows.data(), other.shadows.data(), shadows.size() * sizeof(TraceHit)) == 0;
  }
};

// Every ray through every page from every instance of its object: no page tree, no store.
template <TraceMode mode>
std::vector<TraceHit> through_everything(const Scene& scene, const std::vector<TraceRay>& rays) {
  std::vector<TraceHit> hits;
  cache::TraceCounters work;
  for (const TraceRay& ray : rays) {
    TraceHit hit = cache::no_hit(ray);
    for (size_t page = scene.parts.size(); page-- > 0;)
      for (uint32_t i = 0; i < scene.instances().size() && (hit.flags & cache::kHitOccluded) == 0; ++i)
        if (scene.instances()[i].object == scene.page_object[page])
          cache::trace_page<mode>(scene.view(page), i, scene.tree(), ray, hit, work);
    if ((hit.flags & cache::kHitOccluded) != 0) hit = {0, 0, 0, PrimId::kNone, 0, cache::kHitOccluded};
    hits.push_back(hit);
  }
  return hits;
}

Hits reference(const Scene& scene, const Rays& rays) {
  return {through_everything<TraceMode::nearest>(scene, rays.paths),
          through_everything<TraceMode::occlusion>(scene, rays.shadows)};
}

// A store under a limit, its views, and a log of what each call visited and read.
struct PagedRun {
  PagedRun(const Scene& s, uint64_t limit, uint32_t top_nodes = 0)
      : scene(s),
        store(s.open(limit, [this](uint32_t page, bool read) { log.emplace_back(page, read); })),
        views(*store, top_nodes) {}

  Hits trace(const Rays& rays, const TraceRaysOptions& options = {}) {
    log.clear();
    const uint64_t read_before = store->counters().parts_read;
    Hits hits{std::vector<TraceHit>(rays.paths.size()), std::vector<TraceHit>(rays.shadows.size())};
    const TraceBatch batch{rays.paths, rays.shadows, hits.paths, hits.shadows, rays.order};
    PairMemory memory;
    const Status status = trace_rays(scene.tree(), views, batch, options, memory, report);
    EXPECT_TRUE(status) << status.error().message;
    check_log(store->counters().parts_read - read_before);
    return hits;
  }
  // Each page that was touched was read, once.
  void check_log(uint64_t parts_read) const {
    std::set<uint32_t> pages;
    for (const auto& [page, read] : log) {
      EXPECT_TRUE(read) << "page " << page << " was swept although it was resident";
      EXPECT_TRUE(pages.insert(page).second) << "page " << page << " was read twice";
    }
    EXPECT_EQ(parts_read, log.size());
    EXPECT_EQ(report.pages_touched, log.size());
  }

  const Scene& scene;
  std::vector<std::pair<uint32_t, bool>> log;
  std::unique_ptr<PartStore> store;
  PageViews views;
  TraceRaysReport report;
};

uint64_t whole(const Scene& scene) { return PartStore::whole_bytes(scene.parts); }

TEST(TraceRays, the_test_scene_has_what_it_claims) {
  const Scene scene(1);
  const Rays rays(3000, 3000, 2);
  const Hits hits = reference(scene, rays);
  const auto count = [](const auto& all, auto predicate) { return std::ranges::count_if(all, predicate); };
  EXPECT_GT(scene.parts.size(), 35u);
  EXPECT_GT(count(hits.paths, [](const TraceHit& h) { return h.prim != PrimId::kNone; }), 1000);
  EXPECT_GT(count(hits.paths, [](const TraceHit& h) { return h.instance != 0; }), 100);
  EXPECT_GT(count(hits.paths, [](const TraceHit& h) { return (h.flags & cache::kHitAlphaUnknown) != 0; }), 50);
  EXPECT_GT(count(hits.shadows, [](const TraceHit& h) { return (h.flags & cache::kHitOccluded) != 0; }), 500);
  EXPECT_GT(count(hits.shadows, [](const TraceHit& h) { return (h.flags & cache::kHitAlphaUnknown) != 0; }), 30);
  EXPECT_GT(count(hits.shadows, [](const TraceHit& h) { return h.flags == 0; }), 500);
}

TEST(TraceRays, hits_are_the_same_for_every_memory_limit_and_pair_limit) {
  const Scene scene(1);
  const Rays rays(3000, 3000, 2);
  const Hits expected = reference(scene, rays);
  const uint64_t least = PartStore::smallest_limit_bytes(scene.parts);
  for (const uint64_t limit : {whole(scene), whole(scene) / 2, std::max(least, whole(scene) / 8), least}) {
    for (const uint64_t pair_limit : {uint64_t{64} << 20, uint64_t{40000}, uint64_t{0}}) {
      SCOPED_TRACE(fmt::format("limit {} of {}, pairs {}", limit, whole(scene), pair_limit));
      PagedRun run(scene, limit);
      // The second wave finds some pages resident.
      for (int wave = 0; wave < 3; ++wave) {
        EXPECT_TRUE(run.trace(rays, {.pair_limit_bytes = pair_limit, .block_rays = 64}) == expected) << "wave " << wave;
        EXPECT_EQ(run.report.ray_count, 6000u);
        const bool swept = limit < whole(scene) || wave == 0;
        EXPECT_EQ(run.report.window_count > 0, swept);
        EXPECT_EQ(run.report.resident_only_count < 6000, swept);
        if (swept && pair_limit == 40000) {
          EXPECT_GT(run.report.window_count, 1u);
        }
        if (swept && pair_limit > 40000) {
          EXPECT_EQ(run.report.window_count, 1u);
        }
        run.store->rebalance();
      }
      EXPECT_EQ(run.store->counters().parts_evicted > 0, limit < whole(scene));
      EXPECT_EQ(run.store->all_resident(), limit == whole(scene));
    }
  }
}

TEST(TraceRays, hits_are_the_same_for_every_thread_count_and_order) {
  const Scene scene(3);
  Rays rays(2000, 2000, 4);
  const Hits expected = reference(scene, rays);
  const std::vector<uint32_t> identity = rays.order;
  // Seven threads even where the machine has fewer.
  const tbb::global_control threads_allowed(tbb::global_control::max_allowed_parallelism, 7);
  // A library that limits the whole process would make this test blind.
  ASSERT_EQ(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism), 7u);
  for (const int threads : {1, 2, 7}) {
    for (const int ordering : {0, 1, 2}) {
      SCOPED_TRACE(fmt::format("{} threads, order {}", threads, ordering));
      rays.order = identity;
      SortRaysScratch scratch;
      if (ordering == 1) std::shuffle(rays.order.begin(), rays.order.end(), std::mt19937(5));
      if (ordering == 2) sort_rays(rays.paths, rays.shadows, scene.bounds(), rays.order, {}, scratch);
      tbb::task_arena arena(threads);
      arena.execute([&] {
        PagedRun run(scene, whole(scene) / 3);
        for (int wave = 0; wave < 2; ++wave)
          EXPECT_TRUE(run.trace(rays, {.pair_limit_bytes = 100000, .block_rays = 1}) == expected);
        EXPECT_GT(run.store->counters().parts_evicted, 0u);
      });
    }
  }
}

// Tops of one node, of a part of each page's tree, and of all of it.
TEST(TraceRays, the_tops_of_pages_let_rays_pass_that_miss_and_change_no_hit) {
  const Scene scene(14);
  Rays rays(300, 300, 15);
  const Hits expected = reference(scene, rays);
  uint64_t pairs_before = UINT64_MAX, pages_before = UINT64_MAX;
  for (const uint32_t top_nodes : {0u, 1u, 4u, 100u}) {
    SCOPED_TRACE(fmt::format("{} nodes", top_nodes));
    PagedRun run(scene, whole(scene) / 3, top_nodes);
    uint64_t pairs = 0, pages = 0;
    for (int wave = 0; wave < 3; ++wave) {
      EXPECT_TRUE(run.trace(rays, {.block_rays = 64}) == expected) << "wave " << wave;
      if (wave > 0) pairs += run.report.pair_count, pages += run.report.pages_touched;
      // Every pair finds its pages again, too, where pairs are not kept.
      EXPECT_TRUE(run.trace(rays, {.pair_limit_bytes = 1000, .block_rays = 64}) == expected) << "wave " << wave;
    }
    EXPECT_GT(run.store->counters().parts_evicted, 0u);
    EXPECT_LT(pairs, pairs_before);
    EXPECT_LE(pages, pages_before);
    pairs_before = pairs, pages_before = pages;
  }
}

TEST(TraceRays, few_rays_that_wait_are_marked_and_nothing_is_read) {
  const Scene scene(16);
  const Rays rays(300, 300, 17);
  const Hits expected = reference(scene, rays);
  PagedRun run(scene, whole(scene) * 2 / 3);
  run.trace(rays);
  const Hits hits = run.trace(rays, {.park_paths = 300, .park_shadows = 300});
  EXPECT_EQ(run.log.size(), 0u);
  uint64_t waiting = 0;
  for (size_t i = 0; i < 300; ++i) {
    const bool waits = (hits.paths[i].flags & cache::kHitWaits) != 0;
    waiting += waits;
    EXPECT_TRUE(waits || std::memcmp(&hits.paths[i], &expected.paths[i], sizeof(TraceHit)) == 0) << i;
  }
  for (const TraceHit& hit : hits.shadows) waiting += (hit.flags & cache::kHitWaits) != 0;
  EXPECT_GT(waiting, 50u);
  EXPECT_EQ(run.report.parked_count, waiting);
  EXPECT_EQ(run.report.ray_count, 600 - waiting);
  // One too many of either kind, and the pages are read.
  EXPECT_TRUE(run.trace(rays, {.park_paths = 300}) == expected);
  EXPECT_GT(run.log.size(), 0u);
}

// Then the rest goes on from where it is, beside other residents than before.
TEST(TraceRays, pages_that_many_rays_wait_for_are_read_and_the_other_rays_wait) {
  const Scene scene(16);
  Rays rays(300, 300, 17);
  const Hits expected = reference(scene, rays);
  PagedRun run(scene, whole(scene) * 2 / 3);
  run.trace(rays);
  run.views.keep();
  run.trace(rays, {.park_paths = 300, .park_shadows = 300});
  const uint64_t waiting_for_all = run.report.parked_count;
  Hits hits = run.trace(rays, {.park_paths = 300, .park_shadows = 300, .park_pairs = 80});
  EXPECT_GT(run.log.size(), 0u);
  EXPECT_GE(run.report.pair_count, 80 * run.log.size());
  EXPECT_GT(run.report.parked_count, 10u);
  EXPECT_LT(run.report.parked_count, waiting_for_all);
  const auto waits = [](const TraceHit& hit) { return (hit.flags & cache::kHitWaits) != 0; };
  Rays rest(0, 0, 1);
  Hits later;
  for (size_t i = 0; i < 300; ++i) {
    if (waits(hits.paths[i])) rest.paths.push_back(rays.paths[i]), later.paths.push_back(hits.paths[i]);
    if (waits(hits.shadows[i])) rest.shadows.push_back(rays.shadows[i]), later.shadows.push_back(hits.shadows[i]);
  }
  EXPECT_EQ(rest.paths.size() + rest.shadows.size(), run.report.parked_count);
  rest.order.resize(rest.paths.size() + rest.shadows.size());
  std::iota(rest.order.begin(), rest.order.end(), 0u);
  const uint64_t evicted = run.store->counters().parts_evicted;
  for (uint32_t wave = 0; wave < 4; ++wave) {
    run.trace(Rays(30, 30, 100 + wave));
    run.store->rebalance();
  }
  EXPECT_GT(run.store->counters().parts_evicted, evicted);
  PairMemory memory;
  ASSERT_TRUE(trace_rays(scene.tree(), run.views, {rest.paths, rest.shadows, later.paths, later.shadows, rest.order},
                         {.goes_on = true}, memory, run.report));
  for (size_t i = 300, path = later.paths.size(), shadow = later.shadows.size(); i-- > 0;) {
    if (waits(hits.paths[i])) hits.paths[i] = later.paths[--path];
    if (waits(hits.shadows[i])) hits.shadows[i] = later.shadows[--shadow];
  }
  EXPECT_TRUE(hits == expected);
}

TEST(TraceRays, a_page_is_read_only_when_a_ray_still_needs_it) {
  const Scene scene(6);
  const Rays rays(40, 10, 7);  // few enough that some pages are met by none
  PagedRun run(scene, whole(scene) / 2);
  run.trace(rays);
  // Recomputed: what the resident pages leave open is met by the rays they leave open.
  std::set<uint32_t> needed;
  cache::TraceCounters work;
  std::vector<cache::PageVisit> visits(10000);
  const auto meet = [&]<TraceMode mode>(const TraceRay& ray) {
    TraceHit hit = cache::no_hit(ray);
    cache::DueVisits due;
    cache::trace_resident<mode>(scene.tree(), run.views.resident(), ray, hit, work, due);
    if ((hit.flags & cache::kHitOccluded) != 0) return;
    const auto pages = static_cast<uint32_t>(scene.parts.size());
    const size_t count = cache::pages_met(scene.tree(), run.views.resident(), 0, pages, mode, ray, hit, visits.data(),
                                          visits.size());
    for (size_t i = 0; i < count; ++i) needed.insert(visits[i].page);
  };
  for (const TraceRay& ray : rays.paths) meet.template operator()<TraceMode::nearest>(ray);
  for (const TraceRay& ray : rays.shadows) meet.template operator()<TraceMode::occlusion>(ray);
  run.trace(rays);
  std::set<uint32_t> read;
  for (const auto& [page, was_read] : run.log) read.insert(page);
  EXPECT_EQ(read, needed);
  EXPECT_GT(read.size(), 0u);
  EXPECT_LT(read.size(), scene.parts.size());
}

TEST(TraceRays, visits_that_were_due_are_asked_one_by_one_what_a_walk_says_of_all) {
  const Scene scene(6);
  PagedRun run(scene, whole(scene) / 2, 64);
  run.trace(Rays(3000, 3000, 7));  // so that the tops of all pages are known
  std::vector<cache::PageVisit> due_visits(10000), walked(10000);
  cache::TraceCounters work;
  size_t due_count = 0, kept_count = 0, walked_count = 0;
  const cache::ResidentPages resident = run.views.resident();
  for (const TraceRay& ray : Rays(500, 0, 8).paths) {
    TraceHit hit = cache::no_hit(ray);
    cache::DueVisits due{due_visits.data(), due_visits.size()};
    cache::trace_resident<TraceMode::nearest>(scene.tree(), resident, ray, hit, work, due);
    const std::span visits(due_visits.data(), due.count);
    for (const cache::PageVisit& visit : visits) ASSERT_NE(resident.view(visit.page).nodes, nullptr);
    const size_t ahead = cache::pages_met(scene.tree(), resident, 0, UINT32_MAX, TraceMode::nearest, ray, hit,
                                          walked.data(), walked.size());
    const size_t kept = cache::keep_visits_ahead(scene.tree(), resident, TraceMode::nearest, ray, hit, visits);
    for (size_t i = 0; i < ahead; ++i)
      EXPECT_TRUE(std::ranges::any_of(visits.first(kept), [&](const cache::PageVisit& visit) {
        return visit.page == walked[i].page && visit.instance == walked[i].instance;
      }));
    due_count += due.count, kept_count += kept, walked_count += ahead;
  }
  EXPECT_LT(kept_count, due_count);
  EXPECT_LE(kept_count, walked_count + walked_count / 100);
}

TEST(TraceRays, everything_resident_takes_no_memory_and_no_second_look) {
  const Scene scene(8);
  const Rays rays(1000, 1000, 9);
  PagedRun run(scene, UINT64_MAX);
  std::vector<uint32_t> all(scene.parts.size());
  std::iota(all.begin(), all.end(), 0u);
  ASSERT_TRUE(run.store->sweep(all, [](uint32_t, std::span<const std::byte>) { return Status(); }));
  memory_reset_peaks();
  const uint64_t before = memory_use(MemoryTag::rays).current_bytes;
  EXPECT_TRUE(run.trace(rays) == reference(scene, rays));
  EXPECT_EQ(memory_use(MemoryTag::rays).peak_bytes, before);
  EXPECT_EQ(run.report.resident_only_count, 2000u);
  EXPECT_EQ(run.report.pair_count, 0u);
  EXPECT_GT(run.report.work.pages, 0u);
}

TEST(TraceRays, pairs_stay_within_their_limit) {
  const Scene scene(8);
  const Rays rays(3000, 0, 9);
  const uint64_t limit = 60000;
  PagedRun run(scene, whole(scene) / 4);
  memory_reset_peaks();
  const uint64_t before = memory_use(MemoryTag::rays).current_bytes;
  run.trace(rays, {.pair_limit_bytes = limit, .block_rays = 64});
  EXPECT_GT(run.report.window_count, 1u);
  EXPECT_GT(run.report.pair_count * 8, limit);
  // Beside the pairs: a bit a ray, eight bytes a page and range of rays (3000 / 64 = 47), a view a page.
  const uint64_t tables = 3000 / 8 + 8 + scene.parts.size() * (8 * 47 + sizeof(cache::TracePageView));
  EXPECT_LE(memory_use(MemoryTag::rays).peak_bytes - before, limit + tables);
}

TEST(TraceRays, a_damaged_page_is_an_error_that_names_it) {
  const Scene scene(10);
  const Rays rays(500, 0, 11);
  {
    std::fstream file(scene.path(), std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(scene.parts[7].offset_bytes + 300));
    file.put('x');
  }
  const auto store = scene.open(whole(scene) / 2);
  PageViews views(*store);
  std::vector<TraceHit> hits(500);
  TraceRaysReport report;
  PairMemory memory;
  const Status status = trace_rays(scene.tree(), views, {rays.paths, {}, hits, {}, rays.order}, {}, memory, report);
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("part 7 at byte"), std::string::npos) << status.error().message;
  EXPECT_EQ(views.resident().view(7).header, nullptr);
}

TEST(TraceRays, no_rays_are_no_work) {
  const Scene scene(12, false);
  PagedRun run(scene, whole(scene) / 2);
  run.trace(Rays(0, 0, 1));
  EXPECT_EQ(run.report.ray_count, 0u);
  EXPECT_EQ(run.log.size(), 0u);
}

}  // namespace
}  // namespace spillway::pipeline
