#include "tools/city/street_plan.h"

#include <algorithm>

#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

constexpr double kLeastBlock_m2 = 350;
constexpr double kQuay_m = 16, kLeastQuay_m = 5, kPromenade_m = 7;  // of streets from the water; half width
constexpr double kAvenue_m = 13, kArterial_m = 10.5, kStreet_m = 6.5, kLane_m = 4.6;  // half widths

struct GridSize {
  double depth_m, length_m, street_m;  // across and along; half width of its streets
};

GridSize grid_of(District district) {
  switch (district) {
    case District::downtown:
      return {84, 118, 7.5};
    case District::midtown:
      return {80, 150, kStreet_m};
    case District::old_town:
      return {58, 92, kLane_m};
    case District::rowhouses:
      return {64, 160, 5.2};
    case District::suburb:
      return {84, 190, kLane_m};
    case District::hillside:
      return {92, 170, kLane_m};
    case District::industry:
      return {120, 200, kStreet_m};
    case District::harbour:
      return {110, 170, kStreet_m};
    case District::count:
      break;
  }
  return {80, 150, kStreet_m};
}

class Planner {
 public:
  Planner(const StreetPlanOptions& options, const Terrain& terrain) : options_(options), terrain_(terrain) {}

  std::vector<Block> plan() {
    const double half = 1.32 * options_.radius_m;
    const Polygon land = rectangle({-half, -half}, {1, 0}, 2 * half, 2 * half);
    const Line avenue{{0.02 * options_.radius_m, 0}, direction_of(0.62)};
    cut_quarter(left_part(land, avenue, kAvenue_m), key_of(options_.seed, 1), 1);
    cut_quarter(right_part(land, avenue, kAvenue_m), key_of(options_.seed, 2), 1);
    std::stable_sort(blocks_.begin(), blocks_.end(),
                     [](const Block& a, const Block& b) { return a.remoteness < b.remoteness; });
    return std::move(blocks_);
  }

 private:
  [[nodiscard]] double quarter_area_m2(Vec2 at) const {
    const double edge = std::clamp(options_.radius_m / 3.2, 240.0, 700.0);
    const double near = 0.45 + 0.55 * smoothstep(0, 0.6 * options_.radius_m, length(at));
    return edge * edge * near;
  }

  // Arterials: across the longer side, a little askew, near the middle.
  void cut_quarter(const Polygon& quarter, uint64_t key, int depth) {
    if (quarter.empty() || !has_land(quarter)) return;
    const Vec2 middle = centroid(quarter);
    if (area(quarter) < 1.6 * quarter_area_m2(middle)) return fill_quarter(quarter, key);
    Random random(key);
    const size_t edge = longest_edge(quarter);
    const Vec2 along = normalize(next_corner(quarter, edge).at - quarter[edge].at);
    const Vec2 across = left_of(along), turn = direction_of(random.between(-0.2, 0.2));
    const Vec2 direction = across * turn.x + along * turn.y;
    const Line line{middle + along * (random.between(-0.12, 0.12) * extent(quarter, along).size()), direction};
    const double street = depth < 4 ? kAvenue_m : kArterial_m;
    cut_quarter(left_part(quarter, line, street), key_of(key, 1), depth + 1);
    cut_quarter(right_part(quarter, line, street), key_of(key, 2), depth + 1);
  }

  [[nodiscard]] bool has_land(const Polygon& quarter) const {
    if (!terrain_.has_bay()) return true;
    return std::any_of(quarter.begin(), quarter.end(), [&](const Corner& c) { return terrain_.inland(c.at) > 0; });
  }

  // The character of a quarter, outside of the centre.
  [[nodiscard]] District quarter_district(Vec2 at, uint64_t key) const {
    Random random(key_of(key, 77));
    const double r = centrality_radius(options_, at), x = at.x / options_.radius_m;
    const bool near_water = terrain_.has_bay() && terrain_.inland(at) < 0.17 * options_.radius_m;
    if (near_water && x > 0.2) return District::harbour;
    if (x > 0.35 && std::fabs(at.y) < 0.3 * options_.radius_m && random.chance(0.6)) return District::industry;
    if (terrain_.height(at) > 30 && random.chance(0.7)) return District::hillside;
    if (r < 0.70) return random.chance(0.12) ? District::midtown : District::rowhouses;
    return random.chance(0.12) ? District::rowhouses : District::suburb;
  }

  // Downtown, midtown around it, the old town on its west side; else the quarter's.
  [[nodiscard]] District district_of(Vec2 at, District quarter) const {
    const double r = centrality_radius(options_, at), x = at.x / options_.radius_m, y = at.y / options_.radius_m;
    if (r < 0.165) return District::downtown;
    if (quarter == District::harbour && r > 0.24) return quarter;
    if (r < 0.36 && x < -0.1 && y < 0.12) return District::old_town;
    return r < 0.36 ? District::midtown : quarter;
  }

  // Parallel streets at the spacing of the district, cross streets that go through, some pieces left out.
  void fill_quarter(const Polygon& quarter, uint64_t key) {
    const District district = quarter_district(centroid(quarter), key);
    const GridSize size = grid_of(district_of(centroid(quarter), district));
    Random random(key_of(key, 3));
    const size_t edge = longest_edge(quarter);
    const Vec2 along = normalize(next_corner(quarter, edge).at - quarter[edge].at), across = left_of(along);
    const std::vector<double> rows = cuts(extent(quarter, across), size.depth_m, random);
    const std::vector<double> columns = cuts(extent(quarter, along), size.length_m, random);
    Polygon rest = quarter;
    for (size_t row = 0; row <= rows.size() && !rest.empty(); ++row) {
      Polygon strip = rest;
      if (row < rows.size()) {
        const Line line{across * rows[row], along};
        strip = right_part(rest, line, size.street_m), rest = left_part(rest, line, size.street_m);
      }
      cut_strip(strip, {along, columns, size, district}, key_of(key, 100 + row));
    }
  }

  // Where the interval is cut into pieces of about the length.
  static std::vector<double> cuts(Interval interval, double piece, Random& random) {
    const int count = std::max(1, static_cast<int>(std::lround(interval.size() / piece)));
    std::vector<double> at;
    for (int i = 1; i < count; ++i)
      at.push_back(interval.low + interval.size() * (i + random.between(-0.13, 0.13)) / count);
    return at;
  }

  struct Grid {
    Vec2 along;
    const std::vector<double>& columns;
    GridSize size;
    District district;
  };
  void cut_strip(const Polygon& strip, const Grid& grid, uint64_t key) {
    Random random(key);
    Polygon rest = strip;
    for (size_t column = 0; column <= grid.columns.size() && !rest.empty(); ++column) {
      Polygon cell = rest;
      if (column < grid.columns.size()) {
        if (random.chance(0.13)) continue;  // no street here: a longer block
        const Line line{grid.along * grid.columns[column], left_of(grid.along)};
        cell = left_part(rest, line, grid.size.street_m), rest = right_part(rest, line, grid.size.street_m);
      }
      add_block(cell, grid, key_of(key, column));
    }
  }

  // At the water the cell ends at a promenade along the quay.
  [[nodiscard]] Polygon ashore(const Polygon& cell) const {
    const auto reaches = [&](const Polygon& p, double inland_m) {
      return std::any_of(p.begin(), p.end(), [&](const Corner& c) { return terrain_.inland(c.at) < inland_m; });
    };
    if (!reaches(cell, kQuay_m)) return cell;
    const Polygon part = left_part(cell, terrain_.shore_line(centroid(cell).x, kQuay_m), kPromenade_m);
    return part.empty() || reaches(part, kLeastQuay_m) ? Polygon{} : part;
  }

  void add_block(const Polygon& whole, const Grid& grid, uint64_t key) {
    if (whole.empty()) return;
    const Polygon cell = ashore(whole);
    if (cell.empty()) return;
    Block block;
    block.key = key;
    block.cell = cell;
    block.kerb = chamfered(inset(cell, [](const Corner& c) { return c.street; }), 2.2);
    if (inset_by(block.kerb, 1.5).empty()) block.kerb.clear();  // all street
    block.district = district_of(centroid(cell), grid.district);
    block.grid_axis = grid.along;
    block.use = use_of(block);
    const Vec2 middle = centroid(cell);
    const double angle = std::atan2(middle.y, middle.x);
    block.remoteness = length(middle) * (1 + 0.10 * value_noise(options_.seed + 9, {angle * 2.2, 0.5}));
    blocks_.push_back(std::move(block));
  }

  [[nodiscard]] BlockUse use_of(const Block& block) const {
    if (block.kerb.empty() || area(block.kerb) < kLeastBlock_m2) return BlockUse::plaza;
    const Vec2 at = centroid(block.cell) * (1 / options_.radius_m);
    const Vec2 from_park = at - Vec2{-0.13, 0.27};
    if (std::fabs(from_park.x) < 0.13 && std::fabs(from_park.y) < 0.06 && options_.radius_m > 700)
      return BlockUse::park;
    Random random(key_of(block.key, 5));
    if (random.chance(0.028)) return BlockUse::park;
    if (block.district == District::downtown && random.chance(0.04)) return BlockUse::plaza;
    return BlockUse::built;
  }

  StreetPlanOptions options_;
  const Terrain& terrain_;
  std::vector<Block> blocks_;
};

}  // namespace

const char* name(District district) {
  switch (district) {
    case District::downtown:
      return "downtown";
    case District::midtown:
      return "midtown";
    case District::old_town:
      return "old_town";
    case District::rowhouses:
      return "rowhouses";
    case District::suburb:
      return "suburb";
    case District::hillside:
      return "hillside";
    case District::industry:
      return "industry";
    case District::harbour:
      return "harbour";
    case District::count:
      break;
  }
  return "?";
}

double centrality_radius(const StreetPlanOptions& options, Vec2 at) {
  const double r = length(at) / options.radius_m;
  return r * (1 + 0.22 * value_noise(options.seed + 4, at * (3.5 / options.radius_m)));
}

std::vector<Block> street_plan(const StreetPlanOptions& options, const Terrain& terrain) {
  return Planner(options, terrain).plan();
}

}  // namespace spillway::tools::city
