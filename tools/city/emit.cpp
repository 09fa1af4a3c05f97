// A planned city, said to a sink.

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <memory>

#include "cache/base/check.h"
#include "tools/city/cage.h"
#include "tools/city/city.h"
#include "tools/city/ground.h"
#include "tools/city/waterfront.h"

namespace spillway::tools::city {
namespace {

constexpr int kLandParts = 16;
constexpr double kFoundation_m = -7;  // of designs, which stand on slopes of any kind

Affine3 affine(const Frame& frame, double scale) {
  const auto x = static_cast<float>(frame.x_axis.x * scale), y = static_cast<float>(frame.x_axis.y * scale);
  const auto z = static_cast<float>(scale);
  const Float3 at = frame.point({0, 0, 0});
  return {{{x, -y, 0, at.x}, {y, x, 0, at.y}, {0, 0, z, at.z}}};
}

Status add_light(pipeline::SceneSink& sink, TimeOfDay time, const std::filesystem::path& sky) {
  SPILLWAY_ASSIGN(const ImageId image, sink.add_image(sky, cache::TexelEncoding::linear));
  shading::Light light{};
  light.kind = shading::LightKind::infinite;
  light.radiance = {1, 1, 1};
  light.position = {1, 0, 0}, light.edge1 = {0, 1, 0}, light.edge2 = {0, 0, 1};
  light.has_image = 1;
  SPILLWAY_TRY(sink.add_environment(light, image));
  return sink.add_light(sun(time));
}

// Where a geometry goes: the world, or an object; lights do not shine in objects.
struct Place {
  std::string name;
  uint32_t object;
  TimeOfDay time;
};

pipeline::MeshInput input_of(const Place& place, Surface surface) {
  pipeline::MeshInput input;
  input.name = fmt::format("{}_{}", place.name, city::name(surface));
  input.material = MaterialId{static_cast<uint32_t>(surface)};
  input.object = place.object;
  input.emission = emission_of(surface, place.time);
  input.emits = !is_black(input.emission);
  return input;
}

Status add_mesh(pipeline::SceneSink& sink, pipeline::MeshInput input, const SurfaceMesh& mesh) {
  input.positions = mesh.positions, input.normals = mesh.normals, input.indices = mesh.indices;
  return sink.add_mesh(input);
}

Status add_cages(pipeline::SceneSink& sink, const Geometry& g, const Place& place) {
  for (size_t i = 0; i < g.cages().size(); ++i) {
    const Cage& cage = g.cages()[i];
    pipeline::SubdivisionInput input;
    input.cage = input_of({fmt::format("{}_cage{}", place.name, i), place.object, place.time}, cage.surface);
    if (g.tessellation() > 0) {
      SPILLWAY_ASSIGN(const SurfaceMesh mesh, tessellated(cage, g.tessellation()));
      SPILLWAY_TRY(add_mesh(sink, input.cage, mesh));
      continue;
    }
    const std::vector<uint32_t> corners(cage.indices.size() / 4, 4);
    input.cage.positions = cage.positions, input.cage.indices = cage.indices;
    input.corner_counts = corners, input.sharp_edges = cage.sharp_edges, input.holes = cage.holes;
    SPILLWAY_TRY(sink.add_subdivision(input));
  }
  return {};
}

// The meshes of a geometry, one a surface, and its cages. Material ids are surface numbers.
Status add_geometry(pipeline::SceneSink& sink, const Geometry& g, const Place& place) {
  for (size_t s = 0; s < kSurfaceCount; ++s) {
    const auto surface = static_cast<Surface>(s);
    const SurfaceMesh& mesh = g.mesh(surface);
    if (mesh.indices.empty()) continue;
    SPILLWAY_TRY(add_mesh(sink, input_of(place, surface), mesh));
  }
  return add_cages(sink, g, place);
}

Standing standing_design(const Building& b, const Terrain& terrain) {
  const Vec2 corner = b.footprint[0].at;
  return {{{corner.x, corner.y, ground_of(b, terrain).floor_z}, normalize(b.footprint[1].at - corner)}, 1, b.design, 0};
}

}  // namespace

struct City::Made {
  Geometry geometry;
  std::vector<Standing> lamps, trees, cars, buildings;  // kind of a building: its design
};

// Calls visit(name, member, make) for each prototype that stands somewhere; member is its place in a ByPrototype.
template <class Numbers, class Visit>
Status visit_prototypes(const CityCounts& counts, const std::vector<Building>& designs, const BuildOptions& options,
                        Numbers& numbers, const Visit& visit) {
  for (size_t k = 0; k < kLampKinds && counts.street_lights > 0; ++k)
    SPILLWAY_TRY(visit(fmt::format("lamp{}", k), numbers.lamps[k],
                       [k](Geometry& g) { lamp_post(g, static_cast<LampKind>(k)); }));
  for (size_t k = 0; k < kTreeKinds && counts.trees > 0; ++k)
    for (size_t v = 0; v < kTreeVariants; ++v)
      SPILLWAY_TRY(visit(fmt::format("tree{}_{}", k, v), numbers.trees[k][v],
                         [k, v](Geometry& g) { tree(g, static_cast<TreeKind>(k), static_cast<int>(v)); }));
  for (size_t k = 0; k < kCarKinds && counts.cars > 0; ++k)
    for (size_t v = 0; v < kCarPaints; ++v)
      SPILLWAY_TRY(visit(fmt::format("car{}_{}", k, v), numbers.cars[k][v],
                         [k, v](Geometry& g) { car(g, static_cast<CarKind>(k), static_cast<int>(v)); }));
  if (counts.sea_tiles > 0) SPILLWAY_TRY(visit("sea", numbers.sea, sea_tile));
  numbers.buildings.resize(designs.size());
  for (size_t i = 0; i < designs.size(); ++i)
    SPILLWAY_TRY(visit(fmt::format("{}{}", name(designs[i].kind), i), numbers.buildings[i], [&](Geometry& g) {
      build(g, designs[i], {0, kFoundation_m}, options);
    }));
  return {};
}

// What is instanced does not shine yet: lights have their own places.
BuildOptions City::design_options() const {
  BuildOptions options = build_options_;
  options.time = TimeOfDay::day;
  return options;
}

Status City::emit_prototypes(pipeline::SceneSink& sink, Objects& objects) const {
  return visit_prototypes(counts_, plan_options_.designs, design_options(), objects,
                          [&](const std::string& name, uint32_t& object, const auto& make) {
                            object = sink.begin_object(name);
                            Geometry g = geometry(Geometry::Mode::keep);
                            make(g);
                            if (g.mesh(Surface::water).normals.empty()) g.weld();
                            return add_geometry(sink, g, {name, object, TimeOfDay::day});
                          });
}

ByPrototype<uint64_t> City::count_prototypes() {
  ByPrototype<uint64_t> sizes;
  CityCounts all;  // whatever may stand somewhere: what is planned is known
  all.street_lights = all.trees = all.cars = 0;
  for (const Row& row : rows_) all.street_lights += row.lamps, all.trees += row.trees, all.cars += row.cars;
  all.sea_tiles = counts_.sea_tiles = sea_places(terrain_).size();
  const Status counted = visit_prototypes(all, plan_options_.designs, design_options(), sizes,
                                          [&](const std::string&, uint64_t& size, const auto& make) -> Status {
                                            Geometry g = geometry(Geometry::Mode::count);
                                            make(g);
                                            size = g.triangle_count();
                                            counts_.prototype_triangles += size, counts_.cages += g.cage_count(),
                                                counts_.cage_faces += g.cage_face_count();
                                            return {};
                                          });
  SPILLWAY_CHECK(static_cast<bool>(counted), ==, true);
  counts_.instanced_triangles = sizes.sea * counts_.sea_tiles;
  return sizes;
}

void City::make_land(Geometry& g, int part) const {
  land(g, terrain_, options_.seed, part, kLandParts);
  if (building_count() > 0) waterfront(g, terrain_, options_.seed, options_.time, part, kLandParts);
}

void City::count_land() {
  for (int part = 0; part < kLandParts; ++part) {
    Geometry g = geometry(Geometry::Mode::count);
    make_land(g, part);
    counts_.ground_triangles += g.triangle_count();
    count_surfaces(counts_, g);
  }
}

City::Made City::make_tile(size_t tile) const {
  Made made{geometry(Geometry::Mode::keep), {}, {}, {}, {}};
  for (size_t i = tiles_[tile].first_block; i < tiles_[tile].last_block; ++i) {
    const Contents contents = City::contents(i);
    make_buildings(made.geometry, contents);
    make_ground(made.geometry, i, contents);
    made.lamps.insert(made.lamps.end(), contents.lamps.begin(), contents.lamps.end());
    made.trees.insert(made.trees.end(), contents.trees.begin(), contents.trees.end());
    for (const Building& b : contents.buildings)
      if (b.design != kNoDesign) made.buildings.push_back(standing_design(b, terrain_));
    made.cars.insert(made.cars.end(), contents.cars.begin(), contents.cars.end());
  }
  made.geometry.weld();
  return made;
}

Status City::emit_tiles(pipeline::SceneSink& sink, const Objects& objects) const {
  size_t next = 0, said = 0;
  Status status;
  const auto say = [&](const Made& tile) -> Status {
    SPILLWAY_TRY(add_geometry(sink, tile.geometry, {fmt::format("tile{:05}", said), 0, options_.time}));
    for (const Standing& s : tile.lamps)
      SPILLWAY_TRY(sink.add_instance(objects.lamps[s.kind], affine(s.frame, s.scale)));
    for (const Standing& s : tile.trees)
      SPILLWAY_TRY(sink.add_instance(objects.trees[s.kind][s.variant], affine(s.frame, s.scale)));
    for (const Standing& s : tile.cars)
      SPILLWAY_TRY(sink.add_instance(objects.cars[s.kind][s.variant], affine(s.frame, s.scale)));
    for (const Standing& s : tile.buildings)
      SPILLWAY_TRY(sink.add_instance(objects.buildings[s.kind], affine(s.frame, s.scale)));
    return {};
  };
  using Handed = std::shared_ptr<Made>;
  const auto tokens = static_cast<size_t>(std::clamp(2 * tbb::this_task_arena::max_concurrency(), 2, 16));
  tbb::parallel_pipeline(
      tokens, tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order, [&](tbb::flow_control& control) {
                if (next == tiles_.size() || !status) control.stop();
                return next++;
              }) & tbb::make_filter<size_t, Handed>(tbb::filter_mode::parallel, [&](size_t tile) {
                return std::make_shared<Made>(make_tile(tile));
              }) & tbb::make_filter<Handed, void>(tbb::filter_mode::serial_in_order, [&](const Handed& tile) {
                if (status) status = say(*tile);
                ++said;
              }));
  return status;
}

Status City::emit_land(pipeline::SceneSink& sink, const Objects& objects) const {
  for (int part = 0; part < kLandParts; ++part) {
    Geometry g = geometry(Geometry::Mode::keep);
    make_land(g, part);
    g.weld();
    SPILLWAY_TRY(add_geometry(sink, g, {fmt::format("land{:02}", part), 0, options_.time}));
  }
  for (const Vec2 at : sea_places(terrain_)) SPILLWAY_TRY(sink.add_instance(objects.sea, affine({{at.x, at.y, 0}}, 1)));
  return {};
}

View City::view(uint32_t frame) const {
  return view_of(options_.camera, static_cast<double>(frame - 1) / (kFlightFrames - 1), blocks_, terrain_);
}

void City::emit_cameras(pipeline::SceneSink& sink) const {
  sink.set_settings(settings_of(view(options_.first_frame)));
  if (options_.last_frame == options_.first_frame) return;
  std::vector<shading::Camera> cameras;
  for (uint32_t frame = options_.first_frame; frame <= options_.last_frame; ++frame)
    cameras.push_back(settings_of(view(frame)).camera);
  sink.set_camera_path(options_.first_frame, cameras);
}

Status City::emit(pipeline::SceneSink& sink, const std::filesystem::path& sky) const {
  for (size_t s = 0; s < kSurfaceCount; ++s) {
    const auto surface = static_cast<Surface>(s);
    SPILLWAY_ASSIGN(const MaterialId id, sink.add_material(material_of(surface), std::string(name(surface))));
    if (id.value != s) return error("material {} was given number {}", name(surface), id.value);
  }
  emit_cameras(sink);
  SPILLWAY_TRY(add_light(sink, options_.time, sky));
  Objects objects;
  SPILLWAY_TRY(emit_prototypes(sink, objects));
  SPILLWAY_TRY(emit_land(sink, objects));
  return emit_tiles(sink, objects);
}

}  // namespace spillway::tools::city
