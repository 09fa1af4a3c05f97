#pragma once

// Blocks cut into lots: one or two rows along the block, each row in slices of the district's width. Every lot has a
// front on a street.

#include <vector>

#include "tools/city/street_plan.h"

namespace spillway::tools::city {

struct Lot {
  uint64_t key = 0;
  Polygon polygon;  // its first edge is the front, on a street
};

// Only of blocks that are built; in the order along the rows.
[[nodiscard]] std::vector<Lot> make_lots(const Block& block);

// The largest rectangle, by area, that stands on the front edge moved inwards by `setback` and lies in the polygon,
// sides and back at least `margin` from its edges. Its first edge is its front. Empty when there is none.
[[nodiscard]] Polygon front_rectangle(const Polygon& lot, double setback_m, double margin_m, double most_depth_m);

}  // namespace spillway::tools::city
