#include "tools/city/city.h"

#include <algorithm>
#include <mutex>

#include "cache/base/parallel.h"
#include "tools/city/ground.h"
#include "tools/city/lanterns.h"
#include "tools/city/prototype_buildings.h"
#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

constexpr double kBuildingGround_m2 = 620;  // with its share of streets; where it is too little the plan is made anew
constexpr double kLeastRadius_m = 320;
constexpr uint64_t kMostBuildings = 20'000'000;
constexpr uint64_t kTileTriangles = 250'000;
constexpr double kMostDetail = 6;
constexpr double kLampRatio = 216.0 / 83.0;
constexpr uint64_t kLampSpacing_cm = 200;

// Bits of x at even places.
uint64_t spread(uint64_t x) {
  x = (x | x << 16) & 0x0000ffff0000ffffull;
  x = (x | x << 8) & 0x00ff00ff00ff00ffull;
  x = (x | x << 4) & 0x0f0f0f0f0f0f0f0full;
  x = (x | x << 2) & 0x3333333333333333ull;
  return (x | x << 1) & 0x5555555555555555ull;
}

// Neighbours on the ground are neighbours in the order: tiles, meshes and pages are then compact.
uint64_t morton(Vec2 at, double radius_m) {
  const auto cell = [&](double v) {
    return static_cast<uint64_t>(std::clamp((v / radius_m + 2) * 8192, 0.0, 65535.0));
  };
  return spread(cell(at.x)) | spread(cell(at.y)) << 1;
}

// The share of the block that ends at `cumulative` when `count` things are spread over `whole`; exact, monotonic.
uint64_t spread_until(uint64_t count, uint64_t cumulative, uint64_t whole) {
  return whole == 0 ? 0 : count / whole * cumulative + count % whole * cumulative / whole;
}

Standing standing_design(const Building& b, const Terrain& terrain) {
  const Vec2 corner = b.footprint[0].at;
  const Frame frame{{corner.x, corner.y, ground_of(b, terrain).floor_z}, normalize(b.footprint[1].at - corner)};
  return {frame, 1, kFirstDesign + b.design};
}

}  // namespace

Ground ground_of(const Building& building, const Terrain& terrain) {
  return {terrain.highest(building.footprint) + kKerbHeight_m + 0.12, terrain.lowest(building.footprint) - 0.6};
}

Result<City> City::plan(const CityOptions& options) {
  if (options.geometry_bytes == 0) return plan_once(options);
  // What a building takes is known once a city has been planned: from there it is a rule of three, and once more.
  CityOptions wanted = options;
  const bool by_detail = options.buildings && !options.detail_triangles;
  for (int attempt = 0;; ++attempt) {
    SPILLWAY_ASSIGN(City city, plan_once(wanted));
    const double ratio =
        static_cast<double>(options.geometry_bytes) / static_cast<double>(city.predicted_store_bytes());
    if (std::fabs(ratio - 1) < 0.02 || attempt == 4) {
      if (std::fabs(ratio - 1) < 0.1) return city;
      return error(
          "--geometry of {:.2f} GiB: a city with these counts takes {:.2f} GiB; leave --buildings or --detail open",
          static_cast<double>(options.geometry_bytes) / 0x1p30,
          static_cast<double>(city.predicted_store_bytes()) / 0x1p30);
    }
    if (options.buildings && options.detail_triangles)
      attempt = 3;  // nothing is left to choose
    else if (by_detail)
      wanted.detail_triangles = std::max(1.0, wanted.detail_triangles.value_or(kUsualDetail) * ratio);
    else
      wanted.buildings = static_cast<uint64_t>(std::llround(static_cast<double>(city.counts().buildings) * ratio));
  }
}

Result<City> City::plan_once(const CityOptions& options) {
  const uint64_t count = options.buildings.value_or(kUsualBuildings);
  if (count > kMostBuildings) return error("{} buildings: at most {} can be planned", count, kMostBuildings);
  double radius = std::max(kLeastRadius_m, std::sqrt(static_cast<double>(count) * kBuildingGround_m2 / M_PI));
  for (int attempt = 0; attempt < 16; ++attempt) {
    City city(options, Terrain({options.hills, options.bay, radius, options.seed}));
    city.plan_options_ = {{options.seed, radius},
                          options.unique,
                          options.unique < 1 ? design_buildings(options.seed) : std::vector<Building>{}};
    city.build_options_.time = options.time;
    const std::optional<double> reach = city.lay_out();
    // Districts lie at parts of the radius, so that it must be where the buildings end.
    const bool is_loose = reach && *reach < 0.9 * radius && radius > kLeastRadius_m && attempt < 8;
    if (!reach || is_loose) {
      radius = std::max(kLeastRadius_m, reach ? *reach * 1.05 : radius * 1.12);
      continue;
    }
    SPILLWAY_TRY(city.furnish());
    SPILLWAY_TRY(city.calibrate_detail());
    city.survey();
    SPILLWAY_TRY(city.choose_texels());
    return city;
  }
  return error("{} buildings found no room; try another seed", count);
}

// Takes the blocks nearest to the centre that hold the buildings. Returns how far they reach; none when the land is too
// small.
std::optional<double> City::lay_out() {
  blocks_ = street_plan(plan_options_.streets, terrain_);
  std::vector<uint64_t> lots(blocks_.size());
  parallel_blocks(blocks_.size(), 16, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) lots[i] = make_lots(blocks_[i]).size();
  });
  uint64_t built = 0;
  size_t taken = 0;
  std::vector<std::pair<Block, Row>> kept;
  for (; taken < blocks_.size() && built < building_count(); ++taken) {
    Row row;
    row.buildings = std::min(lots[taken], building_count() - built);
    built += row.buildings;
    kept.emplace_back(std::move(blocks_[taken]), row);
  }
  if (built < building_count()) return std::nullopt;
  const double reach = kept.empty() ? radius_m() : kept.back().first.remoteness;
  std::stable_sort(kept.begin(), kept.end(), [&](const auto& a, const auto& b) {
    return morton(centroid(a.first.cell), radius_m()) < morton(centroid(b.first.cell), radius_m());
  });
  blocks_.clear();
  for (auto& [block, row] : kept) blocks_.push_back(std::move(block)), rows_.push_back(row);
  return reach;
}

Status City::furnish() {
  std::vector<Room> rooms(blocks_.size());
  parallel_blocks(blocks_.size(), 16, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) rooms[i] = room_of(blocks_[i], make_lots(blocks_[i]));
  });
  Room whole;
  for (const Room& room : rooms)
    whole.kerb_cm += room.kerb_cm, whole.tree_count += room.tree_count, whole.car_count += room.car_count;
  const uint64_t most_lamps = whole.kerb_cm / kLampSpacing_cm, most_trees = 3 * whole.tree_count;
  const auto usual_lamps = static_cast<uint64_t>(std::llround(static_cast<double>(building_count()) * kLampRatio));
  const uint64_t lamp_count = options_.street_lights.value_or(std::min(usual_lamps, most_lamps));
  const uint64_t tree_count = options_.trees.value_or(whole.tree_count * 4 / 5);
  const uint64_t car_count = options_.cars.value_or(whole.car_count * 11 / 20);
  if (lamp_count > most_lamps)
    return error("{} street lights: the kerbs of {} buildings are {} m long and take at most {}", lamp_count,
                 building_count(), whole.kerb_cm / 100, most_lamps);
  if (tree_count > most_trees)
    return error("{} trees: a city of {} buildings has room for at most {}", tree_count, building_count(), most_trees);
  if (car_count > whole.car_count)
    return error("{} cars: the streets of {} buildings have {} places", car_count, building_count(), whole.car_count);
  Room sum;
  for (size_t i = 0; i < rows_.size(); ++i) {
    const Room before = sum;
    sum.kerb_cm += rooms[i].kerb_cm, sum.tree_count += rooms[i].tree_count, sum.car_count += rooms[i].car_count;
    const auto share = [&](uint64_t count, uint64_t Room::*what) {
      return spread_until(count, sum.*what, whole.*what) - spread_until(count, before.*what, whole.*what);
    };
    rows_[i].lamps = share(lamp_count, &Room::kerb_cm);
    rows_[i].trees = share(tree_count, &Room::tree_count);
    rows_[i].cars = share(car_count, &Room::car_count);
  }
  return {};
}

City::Contents City::contents(size_t index) const {
  const Block& block = blocks_[index];
  const Row& row = rows_[index];
  Contents contents;
  contents.lots = make_lots(block);
  contents.buildings = plan_buildings(block, contents.lots, plan_options_);
  contents.buildings.resize(row.buildings);
  contents.lamps = lamps(block, row.lamps, terrain_);
  contents.trees = trees(block, contents.lots, contents.buildings, row.trees, terrain_);
  contents.cars = cars(block, row.cars, terrain_);
  for (const LanternString& string : lantern_strings(block, terrain_)) {
    const std::vector<Standing> hanging = lanterns_on(string, key_of(block.key, contents.lanterns.size()));
    contents.lanterns.insert(contents.lanterns.end(), hanging.begin(), hanging.end());
  }
  for (const Building& b : contents.buildings)
    if (b.design != kNoDesign) contents.instanced_buildings.push_back(standing_design(b, terrain_));
  return contents;
}

// ---- counting ----

// Every so many-th block stands for all of them.
uint64_t City::sample_triangles(double detail) const {
  const size_t step = std::max<size_t>(1, blocks_.size() / 96);
  const size_t count = (blocks_.size() + step - 1) / step;
  std::vector<uint64_t> triangles(count), buildings(count);
  BuildOptions options = build_options_;
  options.detail = detail;
  parallel_blocks(count, 1, [&](size_t, size_t first, size_t last) {
    for (size_t i = first; i < last; ++i) {
      Geometry g = geometry(Geometry::Mode::count);
      std::vector<Building> all = plan_buildings(blocks_[i * step], make_lots(blocks_[i * step]), plan_options_);
      all.resize(rows_[i * step].buildings);
      for (const Building& b : all) build(g, b, {1, 0}, options);
      triangles[i] = g.triangle_count(), buildings[i] = all.size();
    }
  });
  uint64_t sum = 0, houses = 0;
  for (size_t i = 0; i < count; ++i) sum += triangles[i], houses += buildings[i];
  return houses == 0 ? 0 : sum / houses;
}

Status City::calibrate_detail() {
  const double wanted = options_.detail_triangles.value_or(kUsualDetail);
  const uint64_t least = sample_triangles(0), most = sample_triangles(kMostDetail);
  const bool is_out = wanted < 0.8 * static_cast<double>(least) || wanted > 1.25 * static_cast<double>(most);
  if (options_.detail_triangles && is_out && building_count() > 0)
    return error("{:.0f} triangles a building: these {} buildings can have {} to {}", wanted, building_count(), least,
                 most);
  double low = 0, high = kMostDetail;
  for (int i = 0; i < 9; ++i) {
    const double middle = (low + high) / 2;
    (static_cast<double>(sample_triangles(middle)) < wanted ? low : high) = middle;
  }
  build_options_.detail = (low + high) / 2;
  return {};
}

void City::make_buildings(Geometry& g, const Contents& contents) const {
  for (const Building& b : contents.buildings)
    if (b.design == kNoDesign) build(g, b, ground_of(b, terrain_), build_options_);
}

void City::make_ground(Geometry& g, size_t index, const Contents& contents) const {
  block_ground(g, blocks_[index], contents.lots, terrain_);
  for (const LanternString& string : lantern_strings(blocks_[index], terrain_)) string_cable(g, string);
}

void City::count_surfaces(CityCounts& counts, const Geometry& g) const {
  counts.cages += g.cage_count(), counts.cage_faces += g.cage_face_count();
  for (size_t s = 0; s < kSurfaceCount; ++s)
    if (const auto surface = static_cast<Surface>(s); !is_black(emission_of(surface, options_.time)))
      counts.light_triangles += g.triangle_count(surface);
}

Geometry City::counting() const {
  Geometry g = geometry(Geometry::Mode::count);
  if (paints()) g.count_faces();
  return g;
}

City::BlockCounts City::count_block(size_t index, FaceSizes& sizes) {
  BlockCounts block;
  CityCounts& c = block.counts;
  const Contents contents = City::contents(index);
  Geometry g = counting();
  make_buildings(g, contents);
  c.building_triangles = g.triangle_count();
  make_ground(g, index, contents);
  c.ground_triangles = g.triangle_count() - c.building_triangles;
  count_surfaces(c, g);
  c.lots = contents.lots.size(), c.buildings = contents.buildings.size();
  c.street_lights = contents.lamps.size(), c.trees = contents.trees.size(), c.cars = contents.cars.size();
  c.lanterns = contents.lanterns.size(), c.instanced_buildings = contents.instanced_buildings.size();
  block.used.resize(kFirstDesign + plan_options_.designs.size());
  for (const auto* standing : {&contents.lamps, &contents.trees, &contents.cars, &contents.lanterns, &contents.instanced_buildings})
    for (const Standing& s : *standing) ++block.used[s.prototype];
  for (const Building& b : contents.buildings) {
    ++c.kinds[static_cast<size_t>(b.kind)], ++c.districts[static_cast<size_t>(b.district)];
    c.floors += static_cast<uint64_t>(b.floors);
  }
  if (options_.air.smoke) block.chimneys = g.chimneys();
  if (g.face_sizes()) sizes.add(*g.face_sizes());
  rows_[index].triangles = g.triangle_count();
  return block;
}

void City::survey() {
  std::vector<BlockCounts> parts(blocks_.size());
  std::mutex merging;  // of integers: in any order
  parallel_blocks(blocks_.size(), 4, [&](size_t, size_t first, size_t last) {
    FaceSizes sizes;
    for (size_t i = first; i < last; ++i) parts[i] = count_block(i, sizes);
    const std::scoped_lock lock(merging);
    sizes_->add(sizes);
  });
  used_.resize(kFirstDesign + plan_options_.designs.size());
  std::vector<Chimney> chimneys;
  for (const BlockCounts& part : parts) {
    const CityCounts& c = part.counts;
    chimneys.insert(chimneys.end(), part.chimneys.begin(), part.chimneys.end());
    for (const auto member : {&CityCounts::building_triangles, &CityCounts::ground_triangles, &CityCounts::light_triangles,
                              &CityCounts::cages, &CityCounts::cage_faces, &CityCounts::lots, &CityCounts::buildings,
                              &CityCounts::instanced_buildings, &CityCounts::street_lights, &CityCounts::trees,
                              &CityCounts::cars, &CityCounts::lanterns, &CityCounts::floors})
      counts_.*member += c.*member;
    for (size_t i = 0; i < kKindCount; ++i) counts_.kinds[i] += c.kinds[i];
    for (size_t i = 0; i < counts_.districts.size(); ++i) counts_.districts[i] += c.districts[i];
    for (size_t i = 0; i < used_.size(); ++i) used_[i] += part.used[i];
  }
  counts_.blocks = blocks_.size();
  count_land();
  count_prototypes();
  cut_tiles();
  raise_smoke(std::move(chimneys));
}

// Blocks that follow each other, until they hold enough.
void City::cut_tiles() {
  for (size_t first = 0; first < blocks_.size();) {
    size_t last = first;
    for (uint64_t sum = 0; last < blocks_.size() && (last == first || sum + rows_[last].triangles < kTileTriangles);
         ++last)
      sum += rows_[last].triangles;
    tiles_.push_back({first, last});
    first = last;
  }
}

uint64_t City::predicted_store_bytes() const {
  // Measured on cities of 300 to 6,000 buildings by day and by night: pages and attribute blocks a triangle, the manifest's
  // rows of instances and lights 165 and 85; a painted face adds 33 to the attributes. The sky's tables and what is diced
  // of cars, trees and domes hardly grow.
  constexpr double kPerTriangle = 59.8, kPerInstance = 165, kPerLight = 85, kPerPainted = 33, kFixed = 5e6;
  return static_cast<uint64_t>(kFixed + static_cast<double>(counts_.unique_triangles()) * kPerTriangle +
                               static_cast<double>(counts_.instances) * kPerInstance +
                               static_cast<double>(counts_.light_triangles) * kPerLight +
                               static_cast<double>(painted().faces) * kPerPainted);
}

uint64_t City::texture_bytes_at(double texels_per_metre) const {
  // Measured on cities of 1,000 buildings at 4 to 16 texels a metre: compressed bytes a texel, with its coarser levels;
  // of faces with few texels, which compress less, some more.
  constexpr double kPerTexel = 1.0, kPerFace = 476;
  const FaceSizes::Texels painted = sizes_->at(texels_per_metre);
  return static_cast<uint64_t>(static_cast<double>(painted.texels) * kPerTexel +
                               static_cast<double>(painted.faces) * kPerFace);
}

// The resolution at which textures take the bytes that are wanted; sizes are powers of two, but of many faces.
Status City::choose_texels() {
  if (options_.texture_bytes == 0) return {};
  double low = 0.05, high = 4096;
  for (int i = 0; i < 60; ++i) {
    const double middle = std::sqrt(low * high);
    (texture_bytes_at(middle) < options_.texture_bytes ? low : high) = middle;
  }
  options_.texels_per_metre = low;
  const double ratio =
      static_cast<double>(predicted_texture_bytes()) / static_cast<double>(options_.texture_bytes);
  if (ratio > 0.8 && ratio < 1.25) return {};
  return error("--textures of {:.3f} GiB: the nearest that this city can have are {:.3f} GiB",
               static_cast<double>(options_.texture_bytes) / 0x1p30,
               static_cast<double>(predicted_texture_bytes()) / 0x1p30);
}

}  // namespace spillway::tools::city
