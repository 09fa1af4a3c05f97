#pragma once

// A city as a function of its options: planned first, then counted, then said to a sink tile by tile.
//
// Owns: the plan: a row a block. What stands on a block is made again whenever it is needed.
// Memory: some hundred bytes a block; while emitting, as many tiles as there are threads, twice, of at most a few
// hundred
//         thousand triangles each. Independent of the number of triangles.
// Threads: plan() and emit() use all threads of the current arena; the sink hears one caller, tiles in order.
// Order: nothing depends on the number of threads.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "pipeline/pack/scene_sink.h"
#include "tools/city/air.h"
#include "tools/city/furniture.h"
#include "tools/city/massing.h"
#include "tools/city/view.h"

namespace spillway::tools::city {

inline constexpr double kUsualDetail = 1900;
inline constexpr uint32_t kTessellation = 4;  // pieces an edge
inline constexpr uint32_t kFlightFrames = 240;
inline constexpr uint64_t kUsualBuildings = 1000;

struct CityOptions {
  std::optional<uint64_t> buildings;      // else kUsualBuildings
  std::optional<uint64_t> street_lights;  // else 216 for 83 buildings, as in the city that is the measure
  std::optional<uint64_t> trees, cars;    // else what there is room for, in parts
  uint64_t seed = 1;
  std::optional<double> detail_triangles;  // mean of a building; else kUsualDetail, or what comes nearest
  double unique = 1;                       // share of buildings with geometry of their own; the others are instances
  bool tessellate = false;                 // cages as triangles, at a fixed rate: scenes without extensions
  uint64_t geometry_bytes = 0;  // of the store; 0: what comes of it. Else the buildings, or their detail, follow
  double texels_per_metre = 0;  // of face textures; 0: nothing is painted. Never with tessellate
  uint64_t texture_bytes = 0;   // 0: what comes of it. Else texels_per_metre follows
  bool hills = true, bay = true;
  TimeOfDay time = TimeOfDay::day;
  CameraKind camera = CameraKind::aerial;
  uint32_t first_frame = 1, last_frame = 1;  // of a flight of kFlightFrames
  AirKinds air;                              // what hangs in it
  uint32_t air_cells = kAirCells;            // of its grid, along the radius; more: a larger file
};

// Exact: counted by making everything once.
struct CityCounts {
  uint64_t buildings = 0, blocks = 0, lots = 0, street_lights = 0, trees = 0, cars = 0, lanterns = 0;
  uint64_t boats = 0, sea_tiles = 0;
  std::array<uint64_t, kKindCount> kinds{};
  std::array<uint64_t, static_cast<size_t>(District::count)> districts{};  // buildings
  uint64_t floors = 0;                                                     // of all buildings
  uint64_t instanced_buildings = 0;                                        // of all buildings
  uint64_t building_triangles = 0, ground_triangles = 0, light_triangles = 0, prototype_triangles = 0;
  uint64_t cages = 0, cage_faces = 0;  // Catmull-Clark; triangles only when they are tessellated
  uint64_t instances = 0, instanced_triangles = 0;
  uint64_t plumes = 0, media = 0, hull_triangles = 0;  // of smoke; hulls are where its media begin
  [[nodiscard]] uint64_t unique_triangles() const {
    return building_triangles + ground_triangles + prototype_triangles + hull_triangles;
  }
};

class City {
 public:
  // Fails when the options ask for what cannot be: the message says what could.
  static Result<City> plan(const CityOptions& options);

  [[nodiscard]] const CityCounts& counts() const { return counts_; }
  [[nodiscard]] double radius_m() const { return terrain_.radius_m(); }
  [[nodiscard]] double detail() const { return build_options_.detail; }
  [[nodiscard]] View view(uint32_t frame) const;
  // Of geometry, as packed, from the counts; within some percent.
  [[nodiscard]] uint64_t predicted_store_bytes() const;
  // Of face textures, as packed, from the exact number of texels; within some percent. 0: nothing is painted.
  [[nodiscard]] uint64_t predicted_texture_bytes() const { return texture_bytes_at(options_.texels_per_metre); }
  [[nodiscard]] FaceSizes::Texels painted() const { return sizes_->at(options_.texels_per_metre); }
  [[nodiscard]] double texels_per_metre() const { return options_.texels_per_metre; }

  // What hangs in the air, as a .vdb file: a grid of the whole, and one a plume.
  [[nodiscard]] bool has_air() const { return counts_.media > 0; }
  Status write_air(const std::filesystem::path& file) const;
  // Everything but finish(). `sky`: the image of the sky, `air`: the file of write_air() where the city has any; both
  // already written.
  Status emit(pipeline::SceneSink& sink, const std::filesystem::path& sky, const std::filesystem::path& air = {}) const;

  // What stands on one block: for tests and pictures of the plan.
  struct Contents {
    std::vector<Lot> lots;
    std::vector<Building> buildings;  // of the first lots
    std::vector<Standing> lamps, trees, cars, lanterns;
    std::vector<Standing> instanced_buildings;
  };
  [[nodiscard]] size_t block_count() const { return blocks_.size(); }
  [[nodiscard]] const Block& block(size_t index) const { return blocks_[index]; }
  [[nodiscard]] Contents contents(size_t index) const;

 private:
  struct Row {
    uint64_t buildings = 0, lamps = 0, trees = 0, cars = 0, triangles = 0;
  };
  struct Tile {
    size_t first_block, last_block;
  };
  using Objects = std::vector<uint32_t>;  // by number in the catalogue; 0 for what stands nowhere
  struct Made;
  struct BlockCounts {
    CityCounts counts;
    std::vector<uint64_t> used;  // by number in the catalogue
    std::vector<Chimney> chimneys;
  };

  [[nodiscard]] Geometry geometry(Geometry::Mode mode) const {
    return Geometry(mode, {options_.tessellate ? kTessellation : 0, paints() ? options_.texels_per_metre : 0});
  }
  [[nodiscard]] bool paints() const {
    return !options_.tessellate && (options_.texels_per_metre > 0 || options_.texture_bytes > 0);
  }
  [[nodiscard]] Geometry counting() const;
  [[nodiscard]] uint64_t texture_bytes_at(double texels_per_metre) const;
  Status choose_texels();
  // What a geometry has that shines, and cages.
  void count_surfaces(CityCounts& counts, const Geometry& g) const;
  [[nodiscard]] uint64_t building_count() const { return options_.buildings.value_or(kUsualBuildings); }
  City(const CityOptions& options, const Terrain& terrain) : options_(options), terrain_(terrain) {
    if (options_.tessellate) options_.texels_per_metre = 0, options_.texture_bytes = 0;
  }
  std::optional<double> lay_out();
  Status furnish();
  static Result<City> plan_once(const CityOptions& options);
  Status calibrate_detail();
  void survey();
  void make_buildings(Geometry& g, const Contents& contents) const;
  void make_ground(Geometry& g, size_t index, const Contents& contents) const;
  [[nodiscard]] uint64_t sample_triangles(double detail) const;
  [[nodiscard]] std::vector<Standing> at_sea() const;
  void count_prototypes();
  void make_land(Geometry& g, int part) const;
  void count_land();
  [[nodiscard]] BlockCounts count_block(size_t index, FaceSizes& sizes);
  void cut_tiles();
  void raise_smoke(std::vector<Chimney> chimneys);
  [[nodiscard]] Air air() const { return {terrain_, options_.seed, options_.air, options_.air_cells}; }
  void emit_cameras(pipeline::SceneSink& sink, uint32_t medium) const;
  Result<uint32_t> emit_air(pipeline::SceneSink& sink, const std::filesystem::path& file) const;
  Status emit_prototypes(pipeline::SceneSink& sink, Objects& objects) const;
  Status emit_tiles(pipeline::SceneSink& sink, const Objects& objects) const;
  [[nodiscard]] Made make_tile(size_t tile) const;
  Status emit_land(pipeline::SceneSink& sink, const Objects& objects) const;

  CityOptions options_;
  Terrain terrain_;
  BuildOptions build_options_;
  BuildingPlan plan_options_;
  std::vector<Block> blocks_;
  std::vector<Row> rows_;
  std::vector<uint64_t> used_;  // how often each of the catalogue stands somewhere
  std::vector<Tile> tiles_;
  std::vector<Plume> plumes_;
  CityCounts counts_;
  std::unique_ptr<FaceSizes> sizes_ = std::make_unique<FaceSizes>();  // of faces that can be painted, when they are
};

}  // namespace spillway::tools::city
