#pragma once

// What the kinds of buildings share: a building under construction, and the parts they are put together from.

#include "tools/city/facade.h"
#include "tools/city/massing.h"
#include "tools/city/solids.h"

namespace spillway::tools::city {

enum class Facade { punched, ribbon, curtain, shop, house, garage, blank };

struct Mason {
  Geometry& g;
  const Building& b;
  FacadeStyle style;
  Random random;
  double z;  // of the ground floor

  // The rectangle's front left corner, x along the front, at height z. For rectangular footprints.
  [[nodiscard]] Frame front_frame(double at_z) const;
  [[nodiscard]] bool is_party_wall(const Polygon& footprint, size_t edge) const;

  // Facades on every edge; party walls are blank. Returns the height of the top.
  double storeys(const Polygon& footprint, double z0, int floors, double floor_m, Facade facade, bool party_walls);
  void facade(const Wall& wall, Facade facade);
  void facade_on(const Wall& wall, Facade facade);  // its geometry
  // A roof with a parapet around it, and what stands on roofs.
  void flat_roof(const Polygon& footprint, double z0, double parapet_m, double clutter);
  void cornice(const Polygon& footprint, double z0, double out_m, double height_m, bool all_edges);
  void clutter(const Polygon& roof, double z0, double amount);
  void water_tower(Vec2 at, double z0);
  void spire(Vec2 at, double z0, double height_m);
  // A box about a point of the plan, turned as the front is.
  void block(Surface surface, Vec2 at, double width, double depth, double z0, double z1);
  [[nodiscard]] Vec2 front_axis() const;
};

// ---- the kinds ----

void build_glass_tower(Mason& m);
void build_setback_tower(Mason& m);
void build_art_deco(Mason& m);
void build_podium_tower(Mason& m);
void build_slab(Mason& m);
void build_office_block(Mason& m);
void build_walk_up(Mason& m);
void build_loft(Mason& m);
void build_corner_shop(Mason& m);
void build_row_house(Mason& m);
void build_villa(Mason& m);
void build_cottage(Mason& m);
void build_warehouse(Mason& m);
void build_factory(Mason& m);
void build_parking_garage(Mason& m);
void build_church(Mason& m);
void build_domed_hall(Mason& m);
void build_pagoda(Mason& m);

}  // namespace spillway::tools::city
