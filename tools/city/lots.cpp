#include "tools/city/lots.h"

#include <algorithm>

#include "tools/city/random.h"

namespace spillway::tools::city {
namespace {

constexpr double kLeastWidth_m = 5.0, kLeastDepth_m = 6.5;

Interval lot_width_m(District district) {
  switch (district) {
    case District::downtown:
      return {24, 46};
    case District::midtown:
      return {15, 28};
    case District::old_town:
      return {8.5, 15};
    case District::rowhouses:
      return {6.2, 8.6};
    case District::suburb:
      return {14.5, 21};
    case District::hillside:
      return {16, 26};
    case District::industry:
      return {36, 68};
    case District::harbour:
      return {34, 60};
    case District::count:
      break;
  }
  return {15, 20};
}

// Turns the polygon so that the street edge that looks most along `outwards` comes first; empty without a street edge.
Polygon with_front(const Polygon& polygon, Vec2 outwards) {
  size_t best = polygon.size();
  double score = 0.3;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec2 along = next_corner(polygon, i).at - polygon[i].at;
    if (polygon[i].street <= 0 || length(along) < kLeastWidth_m) continue;
    const double facing = -dot(normalize(left_of(along)), outwards);
    if (facing > score) score = facing, best = i;
  }
  if (best == polygon.size()) return {};
  Polygon turned(polygon.begin() + static_cast<long>(best), polygon.end());
  turned.insert(turned.end(), polygon.begin(), polygon.begin() + static_cast<long>(best));
  return turned;
}

struct Row {
  Polygon polygon;
  Vec2 along, outwards;
};

void slice_row(const Row& row, District district, uint64_t key, std::vector<Lot>& lots) {
  const Interval width = lot_width_m(district), reach = extent(row.polygon, row.along);
  Random random(key);
  Polygon rest = row.polygon;
  double at = reach.low;
  while (!rest.empty()) {
    at += random.between(width.low, width.high);
    Polygon piece = rest;
    if (reach.high - at > 0.6 * width.low) {
      const Line line{row.along * at, left_of(row.along)};
      piece = left_part(rest, line, 0), rest = right_part(rest, line, 0);
    } else {
      rest.clear();
    }
    const Polygon lot = piece.empty() ? Polygon{} : with_front(piece, row.outwards);
    if (!lot.empty() && !front_rectangle(lot, 0, 0.2, 1e9).empty()) lots.push_back({key_of(key, lots.size()), lot});
  }
}

// Where a horizontal line meets the polygon, in the frame of the front.
Interval cross_section(const std::vector<Vec2>& local, double y) {
  Interval x{1e30, -1e30};
  for (size_t i = 0; i < local.size(); ++i) {
    const Vec2 a = local[i], b = local[(i + 1) % local.size()];
    if (std::min(a.y, b.y) > y || std::max(a.y, b.y) < y) continue;
    for (const double t : {a.y == b.y ? 0.0 : (y - a.y) / (b.y - a.y), a.y == b.y ? 1.0 : (y - a.y) / (b.y - a.y)}) {
      x.low = std::min(x.low, a.x + (b.x - a.x) * t);
      x.high = std::max(x.high, a.x + (b.x - a.x) * t);
    }
  }
  return x;
}

}  // namespace

std::vector<Lot> make_lots(const Block& block) {
  std::vector<Lot> lots;
  if (block.use != BlockUse::built) return lots;
  const Polygon inner = inset(block.cell, [](const Corner& c) { return c.street + kPavement_m; });
  if (inner.empty()) return lots;
  Vec2 along = block.grid_axis;
  if (extent(inner, along).size() < extent(inner, left_of(along)).size()) along = left_of(along);
  const Vec2 across = left_of(along);
  const Interval depth = extent(inner, across);
  if (depth.size() < 2 * 15) {
    slice_row({inner, along, across * -1}, block.district, key_of(block.key, 11), lots);
    return lots;
  }
  const Line middle{across * depth.middle(), along};
  const Polygon near = right_part(inner, middle, 0), far = left_part(inner, middle, 0);
  if (!near.empty()) slice_row({near, along, across * -1}, block.district, key_of(block.key, 11), lots);
  if (!far.empty()) slice_row({far, along, across}, block.district, key_of(block.key, 12), lots);
  return lots;
}

Polygon front_rectangle(const Polygon& lot, double setback_m, double margin_m, double most_depth_m) {
  const Polygon inside = inset(lot, [&](const Corner& c) { return c.street > 0 ? 0.05 : margin_m; });
  if (inside.empty()) return {};
  const Vec2 origin = lot[0].at, along = normalize(next_corner(lot, 0).at - origin);
  std::vector<Vec2> local;
  double back = 0;
  for (const Corner& c : inside) {
    local.push_back({dot(c.at - origin, along), dot(c.at - origin, left_of(along))});
    back = std::max(back, local.back().y);
  }
  const double y0 = setback_m + 0.06;
  constexpr int kSteps = 14;
  Interval best{0, 0};
  double best_depth = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double depth = std::min((back - y0) * (i - 0.02) / kSteps, most_depth_m);
    const Interval a = cross_section(local, y0), b = cross_section(local, y0 + depth);
    const Interval x{std::max(a.low, b.low), std::min(a.high, b.high)};
    if (x.size() < kLeastWidth_m || depth < kLeastDepth_m || x.size() * depth <= best.size() * best_depth) continue;
    best = x, best_depth = depth;
  }
  if (best_depth == 0) return {};
  return rectangle(origin + along * best.low + left_of(along) * y0, along, best.size(), best_depth);
}

}  // namespace spillway::tools::city
