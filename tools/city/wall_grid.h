#pragma once

// Where the windows of a wall are, for what rain, soot and feet leave on it. Coordinates of the wall: s along it, t up.

#include <cstdint>

#include "tools/city/frame.h"

namespace spillway::tools::city {

struct WallGrid {
  Frame frame;         // its lower left corner, seen from the street
  double base_z = 0;   // of the ground before the building
  double width_m = 0;  // 0: no wall, but the rest of a building
  double top_m = 0;    // above the frame's origin
  double floor_m = 3;
  double bay_m = 0;  // 0: no windows
  double half_window_m = 0;
  double sill_m = 0, head_m = 0;  // above the floor
  uint32_t key = 0;               // of the building
};

}  // namespace spillway::tools::city
