#include "tools/city/boats.h"

#include "tools/city/cage.h"
#include "tools/city/facade.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {
namespace {

// From stern to bow; sections are keel, chine, gunwale and deck, on the right and back on the left.
void hull(Geometry& g, Surface surface, double length, double width, double height) {
  struct Section {
    double along, wide, keel, top;  // parts of length, half width, height
  };
  constexpr Section kSections[] = {{-0.50, 0.80, -0.25, 1.00}, {-0.46, 0.86, -0.45, 1.00}, {-0.10, 1.00, -0.60, 0.95},
                                   {0.20, 0.92, -0.60, 1.05},  {0.40, 0.50, -0.45, 1.25},  {0.50, 0.10, -0.05, 1.45}};
  RingStack stack;
  for (const Section& s : kSections) {
    const double x = s.along * length, w = s.wide * width / 2, low = s.keel * height, top = s.top * height;
    stack.rings.push_back({{x, w * 0.25, low}, {x, w * 0.85, low * 0.3}, {x, w, top}, {x, w * 0.88, top}, {x, -w * 0.88, top},
                           {x, -w, top}, {x, -w * 0.85, low * 0.3}, {x, -w * 0.25, low}});
  }
  stack.closed_low = stack.closed_high = true, stack.high_bulge = 0.02 * length;
  Cage cage = ring_cage(surface, {}, stack);
  for (const size_t point : {size_t{2}, size_t{3}, size_t{4}, size_t{5}}) crease_column(cage, stack, point, 0, 5, 10);
  crease_ring(cage, stack, 0, 4);
  g.add_cage(std::move(cage));
}

void sailboat(Geometry& g) {
  const Frame f;
  hull(g, Surface::trim_white, 10, 3, 1.1);
  beam(g, Surface::metal_light, f, {0.6, 0, 0.8}, {0.6, 0, 13}, 0.12);
  beam(g, Surface::metal_light, f, {0.6, 0, 2}, {-3.9, 0.5, 2}, 0.1);
  for (const double side : {-0.02, 0.02}) {
    g.triangle(Surface::trim_white, f.point({0.5, side, 2.2}), f.point({-3.8, 0.5 + side, 2.2}), f.point({0.5, side, 12.6}));
    g.triangle(Surface::trim_white, f.point({4.6, side, 1.5}), f.point({0.8, 0.4 + side, 1.9}), f.point({0.7, side, 11.5}));
  }
  box(g, Surface::door, f, {-2.4, -0.8, 1.0}, {0.2, 0.8, 1.6}, kStanding);
}

void trawler(Geometry& g, TimeOfDay time) {
  const Frame f;
  hull(g, Surface::awning_navy, 18, 5.2, 1.9);
  box(g, Surface::wood_white, f, {-5.5, -1.7, 1.8}, {-1.5, 1.7, 4.6}, kStanding);
  box(g, time == TimeOfDay::day ? Surface::glass_dark : Surface::lit_warm, f, {-5.6, -1.75, 3.3}, {-1.4, 1.75, 4.1}, kSides);
  box(g, Surface::awning_red, f, {-5.8, -1.9, 4.6}, {-1.2, 1.9, 4.8});
  beam(g, Surface::metal_dark, f, {-1, 0, 1.8}, {-1, 0, 10}, 0.2);
  beam(g, Surface::metal_dark, f, {-1, 0, 3}, {5, 0, 8.5}, 0.15);
  beam(g, Surface::metal_dark, f, {-7, 0, 2}, {-7, 0, 7}, 0.15);
}

void ferry(Geometry& g, TimeOfDay time) {
  const Frame f;
  hull(g, Surface::wood_green, 52, 13, 3.4);
  Random random(0xfe441);
  FacadeStyle style;
  style.wall = Surface::wood_white, style.trim = Surface::trim_white, style.level = 1, style.bay_m = 2.2;
  style.window_share = 0.7, style.sill_share = 0.35, style.lighting = {time != TimeOfDay::day, 0.75, false, Surface::lit_warm};
  for (int deck = 0; deck < 2; ++deck) {
    const double x0 = -21 + 3 * deck, x1 = 15 - 4 * deck, w = 5.2 - 0.8 * deck, z = 3.4 + 3 * deck;
    const Frame corner = f.at({x0, -w, z});
    const Wall walls[] = {{corner, x1 - x0, 2.8, 1}, {f.at({x1, -w, z}).turned(1.5707963), 2 * w, 2.8, 1},
                          {f.at({x1, w, z}).turned(3.1415927), x1 - x0, 2.8, 1}, {f.at({x0, w, z}).turned(-1.5707963), 2 * w, 2.8, 1}};
    for (const Wall& wall : walls) punched_facade(g, wall, style, Random(random.next()));
    box(g, Surface::trim_white, f, {x0 - 1, -w - 0.6, z + 2.8}, {x1 + 1, w + 0.6, z + 3.0}, kAllFaces);
  }
  box(g, Surface::wood_white, f, {6, -2.4, 9.4}, {9.5, 2.4, 11.8}, kStanding);
  box(g, Surface::glass_dark, f, {5.9, -2.5, 10.4}, {9.6, 2.5, 11.3}, kSides);
  cone(g, Surface::vermilion, f.at({-6, 0, 9.4}), 14, 1.6, 0, 1.3, 5.5);
  cone(g, Surface::trim_dark, f.at({-6, 0, 14.9}), 14, 1.3, 0, 1.25, 1);
}

}  // namespace

void boat(Geometry& g, BoatKind kind, TimeOfDay time) {
  switch (kind) {
    case BoatKind::trawler: return trawler(g, time);
    case BoatKind::ferry: return ferry(g, time);
    default: return sailboat(g);
  }
}

}  // namespace spillway::tools::city
