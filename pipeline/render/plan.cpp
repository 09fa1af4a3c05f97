#include "pipeline/render/plan.h"

#include <algorithm>
#include <optional>

namespace spillway::pipeline {
namespace {

constexpr uint64_t kMiB = 1 << 20;

// Bytes a path of a wave takes; the sum of both kinds of rays it may have (records.h, ray.h).
constexpr uint64_t kHotBytesPerPath = 2 * (32 + 24 + 4);    // rays, results, order of a path and its shadow ray
constexpr uint64_t kNextHotBytesPerPath = 2 * 32;           // what shade_hits writes while hits are still held
constexpr uint64_t kSortBytesPerPath = 2 * 16;              // keys and indices of sort_rays, twice
constexpr uint64_t kPairBytesPerPath = 40;                  // of a sweep: two rays that need two or three pages each
constexpr uint64_t kSpilledPairBytesPerPath = 12;           // less than that: a sweep in several windows
// Of the lot (park_rays.h), a path and a shadow ray: rays, results, records, slots; and while they are swept, order,
// keys and indices of their sort, and pairs.
// As many as a wave has paths, when pages are missing; where these weigh gigabytes a million. The lot is swept when it is
// full and once for every bounce at the end of a frame, and reads nearly all of them each time. A city of 154 million
// triangles within 1 GiB, 16 samples: 51 GiB in waves and lots of 512 Ki, 45 GiB with lots of 1 Mi and waves of 128 to
// 512 Ki, 47 GiB with lots of 2 Mi.
constexpr uint64_t kParkedOfLarge = 1 << 20;
constexpr uint64_t kLargeMissingBytes = 2ull << 30;
constexpr uint64_t kParkedBytes = 2 * (32 + 24 + 4) + 52 + 24 + 2 * (4 + 16) + kPairBytesPerPath;
constexpr uint64_t kColdBytesPerPath = 52 + 24;             // path and shadow record, of one wave
constexpr uint64_t kHitBytesPerPath = 96 + 3 * 16;          // record, key, order and its scratch
// Written and read again for every step of a spilled path: two cold records, and a hit with its key where hits spill too.
constexpr uint64_t kColdSpillBytesPerStep = 2 * kColdBytesPerPath;
constexpr uint64_t kHitSpillBytesPerStep = 2 * (96 + 16);

constexpr uint64_t kSmallestWavePaths = 32 << 10;
constexpr uint64_t kLargestWavePaths = 32ull << 20;
// Where everything is in memory. A wave begins with geometry gone from the processor's caches, and its rays lie nearer to each
// other the more it has: a frame of `bathroom` takes 2.4 % less than with 64 Ki paths at 128 Ki, 3.5 % at 256 Ki, and no less at
// 512 Ki; the courtyard takes the same.
constexpr uint64_t kLargestInCoreWavePaths = 256 << 10;
// Batches of route_hits and shade_hits, thread scratch.
constexpr uint64_t kStageBytes = 12 * kMiB;
// What the allocator, the task scheduler and the image library hold outside every tag.
constexpr uint64_t kSlackBytes = 24 * kMiB;
// Hits of a spilled wave that are to stay in memory: of all its paths, of shadow rays that meet masks, of a batch of rays
// that might all hit; and behind paths that are read ahead into their memory two blocks of these.
constexpr uint64_t hits_of_all(uint64_t paths) { return paths + paths / 16 + (64 << 10); }
// Write-behind and read-ahead blocks of the three spilled streams and the sort, and the smallest hit sort of use.
constexpr uint64_t kSpillBufferBytes = 48 * kMiB;
constexpr uint64_t kSmallestHitSortBytes = 32 * kMiB;
constexpr uint64_t kSmallestTextureBytes = 16 * kMiB;
constexpr uint64_t kReadAheadParts = 4;
// A page is read for this wave when so many bytes of it serve a visit. 1 to 8 KiB are alike within 6 %, from the air.
constexpr uint64_t kPageBytesPerPair = 4 << 10;
// Mean number of vertices of a path; only its order of magnitude matters here: 1.6 in a city's street, 3 in a room.
constexpr double kStepsPerPath = 3;
// Waves are pieces of the picture, and rays that begin near each other end near each other: a wave meets half of the pages
// when it has so many paths a page. Measured: about 1 Ki on a city from the air, 10 Ki in its streets.
constexpr double kPathsAPageAtHalf = 1024;
// Of pages, read for each vertex of a path, were none resident, when rays are parked. Measured from the air, with 28 to 72 %
// of the pages missing: 120 to 290; waves of 64 to 256 Ki paths are alike.
constexpr double kParkedBytesPerStep = 256;
// A scene that may have to be swept begins with epochs of so many samples: a city from the air, a quarter of it in memory,
// read 0.6 of the bytes that epochs of 1, 2, 4 and 1 samples read. Smaller scenes begin with one: they may stop sooner.
constexpr uint64_t kLargeSceneBytes = 64 * kMiB;
constexpr uint32_t kLargeSceneEpochSamples = 8;

// Tops of pages: some 64 nodes of one of two MiB. From the air, with half of a city in memory, they left 0.6 of the pairs
// of rays and pages, and 0.9 of the pages read; eight times as many nodes 0.5 and 0.9.
constexpr uint64_t kTopShare = 256;

uint64_t swept_minimum(uint64_t total, uint64_t largest_part) { return std::min(total, (kReadAheadParts + 1) * largest_part); }

// What media did to a path and its shadow ray.
constexpr uint64_t kMediaBytesPerPath = 2 * 28;
// What tracing a path and its shadow ray took, when pixel costs are counted.
constexpr uint64_t kCostBytesPerPath = 2 * 8;
// Where on its light a shadow ray ends, of two waves, when that is looked up; and the blocks of that column's stream.
constexpr uint64_t kLightPlaceBytesPerPath = 2 * 12;
constexpr uint64_t kLightPlaceBufferBytes = 16 * kMiB;
// Segments that wait for bricks of grids, and the points they ask for: some hundred thousand at a time share a sweep.
constexpr uint64_t kRunBytes = 64 * kMiB;

struct Smallest {
  uint64_t pages, attributes, textures, volumes;
  [[nodiscard]] uint64_t sum() const { return pages + attributes + textures + volumes; }
};

Smallest smallest_caches(const SceneFacts& f, const PlanOptions& o) {
  return {o.page_bytes ? o.page_bytes : swept_minimum(f.trace_bytes, f.largest_page_bytes),
          o.attribute_bytes ? o.attribute_bytes : swept_minimum(f.attribute_bytes, f.largest_attribute_block_bytes),
          o.texture_bytes ? o.texture_bytes : std::min(f.texture_bytes, kSmallestTextureBytes),
          o.volume_bytes ? o.volume_bytes : swept_minimum(f.volume_bytes, f.largest_brick_bytes)};
}

uint64_t fixed_bytes(const SceneFacts& f, const PlanOptions& o) {
  return o.floor_bytes + f.table_bytes + f.film_bytes + f.trace_bytes / kTopShare + kStageBytes + kSlackBytes +
         (f.volume_bytes > 0 ? kRunBytes : 0);
}

// How rays go through a frame: what plans choose between.
struct Way {
  uint64_t paths;         // of a wave
  bool spills;
  uint64_t parked_rays;   // of each kind
};

uint64_t wave_bytes(const SceneFacts& f, const Way& way) {
  const auto [paths, spills, parked] = way;
  const uint64_t media = paths * ((f.has_media ? kMediaBytesPerPath : 0) + (f.has_costs ? kCostBytesPerPath : 0) +
                                  (f.looks_up_emission ? kLightPlaceBytesPerPath : 0)) +
                         (f.looks_up_emission && spills ? kLightPlaceBufferBytes : 0);
  // A spilled wave may give back what sorting took before it traces, and all but the rays before it shades.
  if (spills) return media + paths * (kHotBytesPerPath + kSpilledPairBytesPerPath) + kSpillBufferBytes + kSmallestHitSortBytes;
  return media + paths * (kHotBytesPerPath + kSortBytesPerPath + kPairBytesPerPath + kNextHotBytesPerPath + 2 * kColdBytesPerPath +
                  kHitBytesPerPath) +
         parked * (kParkedBytes + (f.has_costs ? kCostBytesPerPath : 0) +
                   (f.looks_up_emission ? kLightPlaceBytesPerPath / 2 : 0));
}

// Gives what is left beyond the smallest shares to the caches: pages first, for they are swept; then attributes, textures.
void share_out(uint64_t left, const SceneFacts& f, const PlanOptions& o, Smallest& share) {
  const auto give = [&](uint64_t& to, uint64_t wanted, uint64_t fixed) {
    if (fixed != 0 || to >= wanted) return;
    const uint64_t more = std::min(left, wanted - to);
    to += more, left -= more;
  };
  give(share.textures, std::min<uint64_t>(f.texture_bytes, share.textures + left / 4), o.texture_bytes);
  give(share.attributes, std::min<uint64_t>(f.attribute_bytes, share.attributes + left / 4), o.attribute_bytes);
  give(share.volumes, std::min<uint64_t>(f.volume_bytes, share.volumes + left / 4), o.volume_bytes);
  give(share.pages, f.trace_bytes, o.page_bytes);
  give(share.attributes, f.attribute_bytes, o.attribute_bytes);
  give(share.textures, f.texture_bytes, o.texture_bytes);
  give(share.volumes, f.volume_bytes, o.volume_bytes);
}

double frame_steps(const SceneFacts& f) {
  const double depth = std::min<double>(kStepsPerPath, f.max_depth + 1);
  return static_cast<double>(f.pixel_count) * f.samples_per_pixel * depth;
}

void predict(const SceneFacts& f, const Rates& r, Plan& plan) {
  const double steps = std::max(1.0, frame_steps(f));
  const double waves = steps / static_cast<double>(plan.wave_paths) + f.max_depth;
  const auto missed = [](uint64_t total, uint64_t share) { return total > share ? total - share : 0; };
  const double pages = f.largest_page_bytes > 0 ? static_cast<double>(f.trace_bytes) / static_cast<double>(f.largest_page_bytes) : 0;
  const auto paths = static_cast<double>(plan.wave_paths);
  const double met = paths / (paths + kPathsAPageAtHalf * pages);
  const auto pages_missed = static_cast<double>(missed(f.trace_bytes, plan.page_bytes));
  double pages_read = waves * met * pages_missed;
  if (plan.parked_rays > 0)
    pages_read = std::min(pages_read, steps * kParkedBytesPerStep * pages_missed / static_cast<double>(f.trace_bytes));
  const double swept = met * static_cast<double>(missed(f.attribute_bytes, plan.attribute_bytes)) +
                       static_cast<double>(missed(f.texture_bytes, plan.texture_bytes) + missed(f.volume_bytes, plan.volume_bytes));
  const double page_bytes = pages_read + waves * swept + static_cast<double>(f.trace_bytes + f.attribute_bytes);
  const bool hits_spill = plan.hit_bytes < plan.wave_paths * kHitBytesPerPath;
  const double spill_bytes = plan.spills ? steps * (kColdSpillBytesPerStep + (hits_spill ? kHitSpillBytesPerStep : 0)) : 0;
  const double compute = steps / r.path_steps_per_second + waves * r.wave_overhead_seconds +
                         (plan.pages_fit ? 0 : waves * r.sweep_overhead_seconds);
  const double reading = page_bytes / r.read_bytes_per_second, spilling = spill_bytes / r.spill_bytes_per_second;
  plan.predicted_waves = static_cast<uint64_t>(waves), plan.predicted_steps = steps;
  plan.predicted_page_bytes = static_cast<uint64_t>(page_bytes);
  plan.predicted_spill_bytes = static_cast<uint64_t>(spill_bytes);
  plan.predicted_scratch_bytes = plan.spills ? plan.wave_paths * (2 * kColdBytesPerPath + 96 + 16) : 0;
  // Pages are read while others are traced; what is waited for all the same came to their bytes at the rate of the disk.
  plan.predicted_seconds = compute + reading + spilling;
}

Plan shape(const SceneFacts& f, const PlanOptions& o, const Way& way, uint64_t budget) {
  const auto [paths, spills, parked] = way;
  Smallest share = smallest_caches(f, o);
  const uint64_t needed = fixed_bytes(f, o) + wave_bytes(f, way) + share.sum();
  share_out(budget - needed, f, o, share);
  Plan plan;
  plan.wave_paths = paths, plan.spills = spills;
  plan.page_bytes = share.pages, plan.attribute_bytes = share.attributes, plan.texture_bytes = share.textures;
  plan.pages_fit = share.pages >= f.trace_bytes, plan.attributes_fit = share.attributes >= f.attribute_bytes;
  plan.textures_fit = share.textures >= f.texture_bytes;
  plan.volume_bytes = share.volumes, plan.volumes_fit = share.volumes >= f.volume_bytes;
  plan.run_bytes = f.volume_bytes > 0 ? kRunBytes : 0;
  plan.read_ahead_bytes = kReadAheadParts * f.largest_page_bytes;
  plan.pair_bytes = std::max({paths * (spills ? kSpilledPairBytesPerPath : kPairBytesPerPath), parked * kPairBytesPerPath, kMiB});
  plan.page_top_bytes = f.trace_bytes / kTopShare;
  plan.parked_rays = plan.pages_fit ? 0 : parked;
  plan.park_pairs = o.park_pairs != 0 ? o.park_pairs : f.largest_page_bytes / kPageBytesPerPair;
  plan.ray_bytes = paths * (kHotBytesPerPath + kNextHotBytesPerPath);
  plan.cold_bytes = spills ? 0 : UINT64_MAX;
  plan.hit_bytes = spills ? kSmallestHitSortBytes : UINT64_MAX;
  plan.epoch_samples = 16;
  // A wave must not starve on two open epochs: each fills one, the first ones too. Else a wave drains before the next two
  // open, and every bounce of the few paths that are left is a sweep.
  while (uint64_t{plan.epoch_samples} * f.pixel_count < paths && plan.epoch_samples < (1u << 16)) plan.epoch_samples *= 2;
  while (uint64_t{plan.first_epoch_samples} * f.pixel_count < paths && plan.first_epoch_samples < plan.epoch_samples)
    plan.first_epoch_samples *= 2;
  // The more samples a pixel gets at once, the smaller the piece of the picture that a wave is, and the fewer pages it meets.
  // By what the scene weighs, not by what fits: the waves of a frame, and so its access log, are the same for any budget.
  if (f.trace_bytes >= kLargeSceneBytes)
    plan.first_epoch_samples = std::max(plan.first_epoch_samples, std::min(plan.epoch_samples, kLargeSceneEpochSamples));
  plan.memory_bytes = fixed_bytes(f, o) + wave_bytes(f, way) + share.sum();
  if (spills) {
    const auto give = [&](uint64_t& to, uint64_t wanted) {
      const uint64_t more = std::min(budget - plan.memory_bytes, wanted);
      to += more, plan.memory_bytes += more;
    };
    // What the caches leave: sweeps in one window, then a sort of hits in memory, which saves most of what spills.
    if (!plan.pages_fit) give(plan.pair_bytes, paths * (kPairBytesPerPath - kSpilledPairBytesPerPath));
    const uint64_t of_all = hits_of_all(paths) * kHitBytesPerPath;
    give(plan.hit_bytes, of_all - std::min(of_all, plan.hit_bytes));
    const uint64_t kept = paths * kSortBytesPerPath;
    plan.gives_back = budget - plan.memory_bytes < kept;
    if (!plan.gives_back) plan.memory_bytes += kept;
  }
  return plan;
}

bool fits(const SceneFacts& f, const PlanOptions& o, const Way& way, uint64_t budget) {
  return fixed_bytes(f, o) + wave_bytes(f, way) + smallest_caches(f, o).sum() <= budget;
}

bool keeps_all(const Plan& plan) {
  return !plan.spills && plan.pages_fit && plan.attributes_fit && plan.textures_fit && plan.volumes_fit;
}

}  // namespace

Result<Plan> plan_render(const SceneFacts& facts, const PlanOptions& options, const Rates& rates) {
  const uint64_t budget = options.memory_bytes ? options.memory_bytes : UINT64_MAX / 2;
  const bool has_room = fits(facts, options, {kInCoreWavePaths, false, 0}, budget);
  const uint64_t first = options.wave_paths ? options.wave_paths : has_room ? kInCoreWavePaths : kSmallestWavePaths;
  const uint64_t last = options.wave_paths ? options.wave_paths : kLargestWavePaths;
  std::optional<Plan> best;
  const auto consider = [&](const Way& way) {
    if (!fits(facts, options, way, budget)) return;
    Plan plan = shape(facts, options, way, budget);
    predict(facts, rates, plan);
    const bool evicts_nothing = best && way.parked_rays == 0 && way.paths <= kLargestInCoreWavePaths &&
                                keeps_all(*best) && keeps_all(plan);
    // Beyond, the smaller wave unless a larger one is clearly faster: it holds less, and stays nearer to the caches.
    if (!best || evicts_nothing || plan.predicted_seconds < 0.97 * best->predicted_seconds) best = plan;
  };
  for (uint64_t paths = first; paths <= last; paths *= 2) {
    for (const bool spills : {false, true}) {
      if (options.spill >= 0 && spills != (options.spill == 1)) continue;
      const bool parks = options.parks && !spills;
      if (!parks || options.parked_rays == 0) consider({paths, spills, 0});
      if (!parks) continue;
      if (options.parked_rays != 0) {
        consider({paths, spills, options.parked_rays});
        continue;
      }
      // Where it fits it stands for the other one: the prediction does not know what a lot is worth.
      const Way large{paths, spills, std::max(paths, kParkedOfLarge)};
      const bool misses_much = facts.trace_bytes > budget && facts.trace_bytes - budget >= kLargeMissingBytes;
      if (misses_much && fits(facts, options, large, budget)) {
        consider(large);
        continue;
      }
      consider({paths, spills, paths});
    }
  }
  if (best) return *best;
  const bool may_spill = options.spill != 0;
  const uint64_t smallest =
      fixed_bytes(facts, options) + smallest_caches(facts, options).sum() +
      std::min(options.spill == 1 ? UINT64_MAX : wave_bytes(facts, {first, false, 0}), may_spill ? wave_bytes(facts, {first, true, 0}) : UINT64_MAX);
  // What the process holds before it begins differs from run to run: under the address sanitizer by 5 MiB of 278.
  const uint64_t enough = smallest + kMiB + options.floor_bytes / 32;
  return error("--memory {}: this frame needs at least {} ({} before anything is loaded, {} film, {} tables); raise it",
               bytes_text(budget), bytes_text(enough), bytes_text(options.floor_bytes),
               bytes_text(facts.film_bytes), bytes_text(facts.table_bytes));
}

uint64_t budget_for_textures(const SceneFacts& facts, PlanOptions options, uint64_t texture_bytes) {
  const auto is_enough = [&](uint64_t budget) {
    options.memory_bytes = budget;
    const Result<Plan> plan = plan_render(facts, options);
    return plan && plan->texture_bytes >= texture_bytes;
  };
  constexpr uint64_t kMost = uint64_t{1} << 50;
  uint64_t enough = kMiB;
  while (enough < kMost && !is_enough(enough)) enough *= 2;
  if (enough == kMost) return 0;
  for (uint64_t step = enough / 4; step >= kMiB; step /= 2)
    if (is_enough(enough - step)) enough -= step;
  return enough;
}

std::string bytes_text(uint64_t bytes) {
  if (bytes >= (1ull << 30)) return fmt::format("{:.2f} GiB", static_cast<double>(bytes) / (1ull << 30));
  if (bytes >= kMiB) return fmt::format("{:.1f} MiB", static_cast<double>(bytes) / kMiB);
  if (bytes >= 1024) return fmt::format("{:.1f} KiB", static_cast<double>(bytes) / 1024);
  return fmt::format("{} B", bytes);
}

std::string describe(const Plan& p) {
  const auto share = [](uint64_t bytes, bool all) {
    return fmt::format("{}{}", bytes_text(bytes), all ? " (all of it)" : " (the rest is swept)");
  };
  return fmt::format(
      "wave          {} paths, {}\n{}"
      "pages         {}\n"
      "attributes    {}\n"
      "textures      {}\n{}"
      "rays          {}\n"
      "memory        {}\n"
      "predicted     {:.1f} s, {} waves, {} of pages, {} spilled, {} of scratch\n",
      p.wave_paths, p.spills ? "spilled to scratch" : "in memory",
      p.parked_rays > 0 ? fmt::format("parked        {} rays of each kind may wait for pages\n", p.parked_rays) : "",
      share(p.page_bytes, p.pages_fit), share(p.attribute_bytes, p.attributes_fit), share(p.texture_bytes, p.textures_fit),
      p.volume_bytes > 0 ? fmt::format("volumes       {}\n", share(p.volume_bytes, p.volumes_fit)) : "", bytes_text(p.ray_bytes),
      bytes_text(p.memory_bytes), p.predicted_seconds, p.predicted_waves, bytes_text(p.predicted_page_bytes),
      bytes_text(p.predicted_spill_bytes), bytes_text(p.predicted_scratch_bytes));
}

}  // namespace spillway::pipeline
