#include "pipeline/pack/dice_grid.h"

namespace spillway::pipeline {
namespace {

// Where point i of 0..grid lies on a side of fewer pieces; in the middle between two it goes towards the nearer end.
uint32_t snapped(uint32_t i, uint32_t grid, uint32_t side) {
  const uint32_t step = grid / side, rest = i % step;
  const bool up = 2 * rest > step || (2 * rest == step && 2 * i > grid);
  return i - rest + (up ? step : 0);
}

class QuadDicer {
 public:
  QuadDicer(const QuadRates& rates, std::vector<uint32_t>& corners) : rates_(rates), corners_(corners) {}

  void dice() {
    for (uint32_t j = 0; j < rates_.v(); ++j)
      for (uint32_t i = 0; i < rates_.u(); ++i) cell(i, j);
  }

 private:
  [[nodiscard]] uint32_t point(uint32_t i, uint32_t j) const {
    if (j == 0) i = snapped(i, rates_.u(), rates_.side[0]);
    if (j == rates_.v()) i = snapped(i, rates_.u(), rates_.side[2]);
    if (i == 0) j = snapped(j, rates_.v(), rates_.side[3]);
    if (i == rates_.u()) j = snapped(j, rates_.v(), rates_.side[1]);
    return rates_.grid_index(i, j);
  }
  void cell(uint32_t i, uint32_t j) {
    const uint32_t a = point(i, j), b = point(i + 1, j), c = point(i + 1, j + 1), d = point(i, j + 1);
    if ((2 * i < rates_.u()) == (2 * j < rates_.v())) {
      add(a, b, c), add(a, c, d);
    } else {
      add(a, b, d), add(b, c, d);
    }
  }
  void add(uint32_t a, uint32_t b, uint32_t c) {
    if (a != b && b != c && c != a) corners_.insert(corners_.end(), {a, b, c});
  }

  const QuadRates& rates_;
  std::vector<uint32_t>& corners_;
};

}  // namespace

// Each point that is taken to another loses its side one triangle.
uint64_t triangle_count(const QuadRates& rates) {
  const uint64_t u = rates.u(), v = rates.v();
  return 2 * u * v - (2 * u - rates.side[0] - rates.side[2]) - (2 * v - rates.side[1] - rates.side[3]);
}

void dice_quad(const QuadRates& rates, std::vector<uint32_t>& corners) { QuadDicer(rates, corners).dice(); }

}  // namespace spillway::pipeline
