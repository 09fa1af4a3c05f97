// The plan of a city: nothing stands in anything else, neighbours differ, counts are what was asked for.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tools/city/city.h"
#include "tools/city/lots.h"

namespace spillway::tools::city {
namespace {

City planned(uint64_t buildings, uint64_t seed, std::optional<uint64_t> lamps = {}) {
  CityOptions options;
  options.buildings = buildings, options.seed = seed, options.street_lights = lamps;
  Result<City> city = City::plan(options);
  EXPECT_TRUE(city) << city.error().message;
  return std::move(*city);
}

struct Everything {
  std::vector<Lot> lots;
  std::vector<Building> buildings;
  std::vector<Polygon> cells;
};
Everything everything_of(const City& city) {
  Everything all;
  for (size_t i = 0; i < city.block_count(); ++i) {
    const City::Contents contents = city.contents(i);
    all.lots.insert(all.lots.end(), contents.lots.begin(), contents.lots.end());
    all.buildings.insert(all.buildings.end(), contents.buildings.begin(), contents.buildings.end());
    all.cells.push_back(city.block(i).cell);
  }
  return all;
}

// Pairs whose boxes meet, by sweeping along x.
template <class Visit>
void visit_near(const std::vector<Polygon>& polygons, const Visit& visit) {
  std::vector<std::pair<Interval, size_t>> order;
  for (size_t i = 0; i < polygons.size(); ++i) order.push_back({extent(polygons[i], {1, 0}), i});
  std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) { return a.first.low < b.first.low; });
  for (size_t i = 0; i < order.size(); ++i)
    for (size_t j = i + 1; j < order.size() && order[j].first.low <= order[i].first.high; ++j)
      visit(order[i].second, order[j].second);
}

TEST(CityLayout, footprints_do_not_intersect) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Everything all = everything_of(planned(2500, seed));
    std::vector<Polygon> footprints;
    for (const Building& b : all.buildings) footprints.push_back(b.footprint);
    ASSERT_EQ(footprints.size(), 2500u);
    size_t pairs = 0;
    visit_near(footprints, [&](size_t a, size_t b) {
      ++pairs;
      EXPECT_FALSE(intersect(footprints[a], footprints[b])) << "seed " << seed << ": " << a << " and " << b;
    });
    EXPECT_GT(pairs, 10000u);
  }
}

TEST(CityLayout, instanced_buildings_stand_as_apart_as_others) {
  CityOptions options;
  options.buildings = 1500, options.unique = 0.2, options.seed = 6;
  const Result<City> city = City::plan(options);
  ASSERT_TRUE(city) << city.error().message;
  EXPECT_GT(city->counts().instanced_buildings, 600u);
  EXPECT_LT(city->counts().instanced_buildings, 1300u);
  std::vector<Polygon> footprints;
  for (size_t i = 0; i < city->block_count(); ++i) {
    const City::Contents c = city->contents(i);
    for (size_t a = 0; a < c.buildings.size(); ++a) {
      footprints.push_back(c.buildings[a].footprint);
      for (size_t b = 0; b < a; ++b)
        if (adjacent(c.lots[a], c.lots[b])) {
          EXPECT_NE(c.buildings[a].wall, c.buildings[b].wall);
        }
    }
  }
  visit_near(footprints, [&](size_t a, size_t b) { EXPECT_FALSE(intersect(footprints[a], footprints[b])); });
}

TEST(CityLayout, overlaps_would_be_noticed) {
  const Polygon a = rectangle({0, 0}, {1, 0}, 4, 3);
  EXPECT_TRUE(intersect(a, rectangle({3.99, 1}, {1, 0}, 4, 3)));
  EXPECT_TRUE(intersect(a, rectangle({1, 1}, direction_of(0.7), 0.5, 0.5)));
  EXPECT_FALSE(intersect(a, rectangle({4.001, 1}, {1, 0}, 4, 3)));
  EXPECT_FALSE(intersect(a, rectangle({5.5, 2}, direction_of(0.785), 3, 3)));  // their boxes meet
}

TEST(CityLayout, buildings_stand_on_their_lots_and_lots_on_their_blocks) {
  const City city = planned(1500, 5);
  for (size_t i = 0; i < city.block_count(); ++i) {
    const City::Contents contents = city.contents(i);
    for (size_t k = 0; k < contents.buildings.size(); ++k) {
      const Polygon& footprint = contents.buildings[k].footprint;
      ASSERT_GE(footprint.size(), 3u);
      EXPECT_GT(area(footprint), 25) << name(contents.buildings[k].kind);
      for (const Corner& c : footprint) {
        EXPECT_TRUE(contains(contents.lots[k].polygon, c.at)) << name(contents.buildings[k].kind);
        EXPECT_TRUE(contains(city.block(i).kerb, c.at));
      }
    }
  }
}

TEST(CityLayout, cells_do_not_overlap) {
  const std::vector<Polygon> cells = everything_of(planned(2000, 4)).cells;
  visit_near(cells, [&](size_t a, size_t b) {
    // They share edges: a millimetre less and they are apart.
    const Polygon inner = inset_by(cells[a], 0.001);
    EXPECT_FALSE(!inner.empty() && intersect(inner, inset_by(cells[b], 0.001))) << a << " and " << b;
  });
}

TEST(CityLayout, neighbours_differ) {
  size_t neighbours = 0;
  for (const uint64_t seed : {1, 2}) {
    const City city = planned(3000, seed);
    for (size_t i = 0; i < city.block_count(); ++i) {
      const City::Contents c = city.contents(i);
      for (size_t a = 0; a < c.buildings.size(); ++a)
        for (size_t b = 0; b < a; ++b) {
          if (!adjacent(c.lots[a], c.lots[b])) continue;
          ++neighbours;
          EXPECT_NE(c.buildings[a].wall, c.buildings[b].wall);
          EXPECT_NE(c.buildings[a].key, c.buildings[b].key);
        }
    }
  }
  EXPECT_GT(neighbours, 4000u);
}

TEST(CityLayout, lamps_stand_on_kerbs_and_trees_in_no_house) {
  const City city = planned(800, 7);
  size_t lamps = 0;
  for (size_t i = 0; i < city.block_count(); ++i) {
    const City::Contents c = city.contents(i);
    const Polygon& kerb = city.block(i).kerb;
    for (const Standing& lamp : c.lamps) {
      const Vec2 at{lamp.frame.origin.x, lamp.frame.origin.y};
      ++lamps;
      EXPECT_TRUE(contains(kerb, at));
      EXPECT_NEAR(distance_to_boundary(kerb, at), kLampFromKerb_m, 0.01);
      // Its arm reaches over the street.
      EXPECT_FALSE(contains(kerb, at + lamp.frame.x_axis));
    }
    for (const Standing& tree : c.trees)
      for (const Building& b : c.buildings)
        EXPECT_FALSE(contains(b.footprint, {tree.frame.origin.x, tree.frame.origin.y})) << name(b.kind);
    for (const Standing& car : c.cars)
      EXPECT_FALSE(contains(kerb, {car.frame.origin.x, car.frame.origin.y})) << "a car on the pavement";
  }
  EXPECT_EQ(lamps, city.counts().street_lights);
}

TEST(CityLayout, counts_are_what_was_asked_for) {
  for (const uint64_t buildings : {0, 1, 2, 49, 777}) {
    const City city = planned(buildings, 3);
    EXPECT_EQ(city.counts().buildings, buildings);
    EXPECT_EQ(everything_of(city).buildings.size(), buildings);
  }
  EXPECT_EQ(planned(300, 3, 1234).counts().street_lights, 1234u);
  EXPECT_EQ(planned(300, 3, 0).counts().street_lights, 0u);
}

TEST(CityLayout, what_cannot_be_is_refused_with_what_could) {
  CityOptions options;
  options.buildings = 10, options.street_lights = 1'000'000;
  const Result<City> lamps = City::plan(options);
  ASSERT_FALSE(lamps);
  EXPECT_NE(lamps.error().message.find("at most"), std::string::npos) << lamps.error().message;
  options.street_lights.reset(), options.cars = 1'000'000;
  EXPECT_FALSE(City::plan(options));
  options.cars.reset(), options.trees = 1'000'000'000;
  EXPECT_FALSE(City::plan(options));
  options.trees.reset(), options.buildings = UINT64_MAX;
  EXPECT_FALSE(City::plan(options));
}

TEST(CityLayout, many_kinds_and_districts_are_there) {
  const CityCounts counts = planned(6000, 1).counts();
  const auto present = [](const auto& numbers) {
    return std::count_if(numbers.begin(), numbers.end(), [](uint64_t n) { return n > 0; });
  };
  EXPECT_GE(present(counts.kinds), 16);
  EXPECT_GE(present(counts.districts), 6);
}

TEST(CityLayout, towers_stand_in_the_middle_and_houses_at_the_edge) {
  const City city = planned(6000, 1);
  struct Sum {
    double floors = 0, logarithms = 0, squares = 0;
    size_t count = 0;
    void add(double f) { floors += f, logarithms += std::log(f), squares += std::log(f) * std::log(f), ++count; }
    [[nodiscard]] double mean() const { return floors / static_cast<double>(count); }
    [[nodiscard]] double sigma() const {
      const double m = logarithms / static_cast<double>(count);
      return std::sqrt(squares / static_cast<double>(count) - m * m);
    }
  };
  std::array<Sum, static_cast<size_t>(District::count)> sums;
  for (size_t i = 0; i < city.block_count(); ++i)
    for (const Building& b : city.contents(i).buildings) sums[static_cast<size_t>(b.district)].add(b.floors);
  const auto of = [&](District d) { return sums[static_cast<size_t>(d)]; };
  ASSERT_GT(of(District::downtown).count, 30u);
  EXPECT_GT(of(District::downtown).mean(), 2.0 * of(District::midtown).mean());
  EXPECT_GT(of(District::midtown).mean(), 1.5 * of(District::rowhouses).mean());
  EXPECT_GT(of(District::rowhouses).mean(), of(District::suburb).mean());
  // Log-normal: the spread of the logarithm is what was put in, widened by the fall from the centre, cut by limits.
  EXPECT_GT(of(District::downtown).sigma(), 0.25);
  EXPECT_LT(of(District::downtown).sigma(), 0.7);
}

TEST(CityLayout, blocks_have_the_size_of_blocks) {
  const City city = planned(6000, 2);
  std::vector<double> areas;
  std::set<int> headings;
  for (size_t i = 0; i < city.block_count(); ++i) {
    if (city.block(i).use != BlockUse::built) continue;
    areas.push_back(area(city.block(i).kerb));
    const Vec2 axis = city.block(i).grid_axis;
    headings.insert(
        static_cast<int>(std::lround(std::fmod(std::atan2(axis.y, axis.x) + 2 * M_PI, M_PI / 2) * 18 / M_PI)));
  }
  std::sort(areas.begin(), areas.end());
  EXPECT_GT(areas[areas.size() / 2], 2500);  // half a hectare, give or take
  EXPECT_LT(areas[areas.size() / 2], 16000);
  EXPECT_GE(headings.size(), 4u);  // no single grid
}

}  // namespace
}  // namespace spillway::tools::city
