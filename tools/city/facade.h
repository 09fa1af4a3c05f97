#pragma once

// Walls with windows: bays across, floors up.
//
// A wall's frame has its origin at the lower left corner seen from the street, x along the wall, y into the building, z
// up. `level` says how far a window is worked out: 0 panes on the wall; 1 openings with reveals; 2 sills; 3 frames and
// bars, lintels; 4 and 5 frames and bars of boxes. Which panes are lit is drawn per building and per floor.

#include "tools/city/geometry.h"
#include "tools/city/random.h"

namespace spillway::tools::city {

struct Wall {
  Frame frame;
  double width_m = 0;
  double floor_m = 3;
  int floors = 1;
};

// How light falls out of a building: the share of lit panes, and whether whole floors are lit.
struct Lighting {
  bool on = false;  // dusk and night
  double share = 0.25;
  bool by_floor = false;
  Surface usual = Surface::lit_warm;
};

struct FacadeStyle {
  Surface wall = Surface::brick_red, trim = Surface::trim_stone, glass = Surface::glass_dark;
  int level = 1;
  double bay_m = 3;                            // wanted; bays fill the wall evenly
  double window_share = 0.45;                  // of the bay's width
  double sill_share = 0.28, head_share = 0.8;  // of the floor's height
  double recess_m = 0.18;
  bool bars = true;           // level 3: sashes
  double balcony_chance = 0;  // of a bay column
  bool shutters = false;
  Lighting lighting;
};

// Windows one by one, in openings.
void punched_facade(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random);
// Bands of glass between bands of wall.
void ribbon_facade(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random);
// Glass from floor to floor behind mullions; panes a little out of true, as real ones are.
void curtain_facade(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random);
// Shop windows, doors, a band for the sign, awnings; one floor.
void shop_front(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random);
// One door with steps, windows beside it; one floor.
void house_front(Geometry& g, const Wall& wall, const FacadeStyle& style, Random random);
// Open decks behind parapets.
void garage_facade(Geometry& g, const Wall& wall, const FacadeStyle& style);
void blank_facade(Geometry& g, const Wall& wall, Surface surface);

// The pane's surface: glass, or light.
[[nodiscard]] Surface pane_surface(Surface glass, const Lighting& lighting, Random& random);

}  // namespace spillway::tools::city
