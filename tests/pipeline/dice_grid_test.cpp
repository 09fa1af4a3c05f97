#include "pipeline/pack/dice_grid.h"

#include <gtest/gtest.h>

#include <map>
#include <utility>

namespace spillway::pipeline {
namespace {

constexpr uint32_t kRates[] = {1, 2, 4, 8, 32};

template <class Body>
void for_all_rates(const Body& body) {
  for (const uint32_t a : kRates)
    for (const uint32_t b : kRates)
      for (const uint32_t c : kRates)
        for (const uint32_t d : kRates) body(QuadRates{{a, b, c, d}});
}

struct Parameters {
  double u, v;
};

Parameters place(const QuadRates& rates, uint32_t point) {
  const uint32_t row = rates.u() + 1;
  return {static_cast<double>(point % row) / rates.u(), static_cast<double>(point / row) / rates.v()};
}

TEST(dice_grid, triangles_cover_the_quad_once_and_none_turns_over) {
  for_all_rates([](const QuadRates& rates) {
    std::vector<uint32_t> corners;
    dice_quad(rates, corners);
    double area = 0;
    for (size_t i = 0; i < corners.size(); i += 3) {
      const Parameters a = place(rates, corners[i]), b = place(rates, corners[i + 1]), c = place(rates, corners[i + 2]);
      const double twice = (b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v);
      ASSERT_GT(twice, 0) << rates.side[0] << ' ' << rates.side[1] << ' ' << rates.side[2] << ' ' << rates.side[3];
      area += twice / 2;
    }
    ASSERT_EQ(area, 1);  // sums of powers of two
    ASSERT_EQ(corners.size() / 3, triangle_count(rates));
  });
}

TEST(dice_grid, sides_have_their_own_pieces_and_inner_edges_two_triangles) {
  for_all_rates([](const QuadRates& rates) {
    std::vector<uint32_t> corners;
    dice_quad(rates, corners);
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (size_t i = 0; i < corners.size(); ++i) ++edges[{corners[i], corners[i % 3 == 2 ? i - 2 : i + 1]}];
    for (uint32_t side = 0; side < 4; ++side)
      for (uint32_t i = 0; i < rates.side[side]; ++i) {
        const auto point = [&](uint32_t k) {
          const uint32_t u = k * rates.u() / rates.side[side], v = k * rates.v() / rates.side[side];
          return side == 0   ? rates.grid_index(u, 0)
                 : side == 1 ? rates.grid_index(rates.u(), v)
                 : side == 2 ? rates.grid_index(rates.u() - u, rates.v())
                             : rates.grid_index(0, rates.v() - v);
        };
        const auto found = edges.find({point(i), point(i + 1)});
        ASSERT_TRUE(found != edges.end() && found->second == 1);
        edges.erase(found);
      }
    for (const auto& [edge, count] : edges) {
      ASSERT_EQ(count, 1);
      ASSERT_EQ(edges.count({edge.second, edge.first}), 1u);
    }
  });
}

}  // namespace
}  // namespace spillway::pipeline
