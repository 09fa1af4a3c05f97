// A planned city, said to a sink.

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <memory>

#include "cache/base/check.h"
#include "tools/city/city.h"
#include "tools/city/ground.h"
#include "tools/city/waterfront.h"

namespace spillway::tools::city {
namespace {

constexpr int kLandParts = 16;

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

// The meshes of a geometry, one a surface, into the world or an object. Material ids are surface numbers.
Status add_meshes(pipeline::SceneSink& sink, const Geometry& g, const std::string& name, uint32_t object, TimeOfDay time) {
  for (size_t s = 0; s < kSurfaceCount; ++s) {
    const auto surface = static_cast<Surface>(s);
    const SurfaceMesh& mesh = g.mesh(surface);
    if (mesh.indices.empty()) continue;
    pipeline::MeshInput input;
    input.name = fmt::format("{}_{}", name, city::name(surface));
    input.positions = mesh.positions, input.normals = mesh.normals, input.indices = mesh.indices;
    input.material = MaterialId{static_cast<uint32_t>(s)};
    input.object = object;
    input.emission = emission_of(surface, time);
    input.emits = !is_black(input.emission);
    SPILLWAY_TRY(sink.add_mesh(input));
  }
  return {};
}

uint64_t mesh_count(const Geometry& g) {
  uint64_t count = 0;
  for (size_t s = 0; s < kSurfaceCount; ++s) count += g.triangle_count(static_cast<Surface>(s)) > 0;
  return count;
}

template <class Make>
Geometry made(Geometry::Mode mode, const Make& make) {
  Geometry g(mode);
  make(g);
  return g;
}

}  // namespace

struct City::Made {
  Geometry geometry;
  std::vector<Standing> lamps, trees, cars;
};

// Calls visit(name, member, make) for each prototype that stands somewhere; member is its place in a ByPrototype.
template <class Numbers, class Visit>
Status visit_prototypes(const CityCounts& counts, Numbers& numbers, const Visit& visit) {
  for (size_t k = 0; k < kLampKinds && counts.street_lights > 0; ++k)
    SPILLWAY_TRY(visit(fmt::format("lamp{}", k), numbers.lamps[k], [k](Geometry& g) { lamp_post(g, static_cast<LampKind>(k)); }));
  for (size_t k = 0; k < kTreeKinds && counts.trees > 0; ++k)
    for (size_t v = 0; v < kTreeVariants; ++v)
      SPILLWAY_TRY(visit(fmt::format("tree{}_{}", k, v), numbers.trees[k][v],
                         [k, v](Geometry& g) { tree(g, static_cast<TreeKind>(k), static_cast<int>(v)); }));
  for (size_t k = 0; k < kCarKinds && counts.cars > 0; ++k)
    for (size_t v = 0; v < kCarPaints; ++v)
      SPILLWAY_TRY(visit(fmt::format("car{}_{}", k, v), numbers.cars[k][v],
                         [k, v](Geometry& g) { car(g, static_cast<CarKind>(k), static_cast<int>(v)); }));
  if (counts.sea_tiles == 0) return {};
  return visit("sea", numbers.sea, sea_tile);
}

Status City::emit_prototypes(pipeline::SceneSink& sink, Objects& objects) const {
  return visit_prototypes(counts_, objects, [&](const std::string& name, uint32_t& object, const auto& make) {
    object = sink.begin_object(name);
    Geometry g = made(Geometry::Mode::keep, make);
    if (g.mesh(Surface::water).normals.empty()) g.weld();
    return add_meshes(sink, g, name, object, TimeOfDay::day);
  });
}

ByPrototype<uint64_t> City::count_prototypes() {
  ByPrototype<uint64_t> sizes;
  CityCounts all;  // whatever may stand somewhere: what is planned is known
  all.street_lights = all.trees = all.cars = 0;
  for (const Row& row : rows_) all.street_lights += row.lamps, all.trees += row.trees, all.cars += row.cars;
  all.sea_tiles = counts_.sea_tiles = sea_places(terrain_).size();
  const Status counted = visit_prototypes(all, sizes, [&](const std::string&, uint64_t& size, const auto& make) -> Status {
    const Geometry g = made(Geometry::Mode::count, make);
    size = g.triangle_count();
    counts_.prototype_triangles += size, counts_.meshes += mesh_count(g);
    return {};
  });
  SPILLWAY_CHECK(static_cast<bool>(counted), ==, true);
  counts_.instanced_triangles = sizes.sea * counts_.sea_tiles;
  return sizes;
}

void City::make_land(Geometry& g, int part) const {
  land(g, terrain_, options_.seed, part, kLandParts);
  if (options_.buildings > 0) waterfront(g, terrain_, options_.seed, options_.time, part, kLandParts);
}

void City::count_land() {
  for (int part = 0; part < kLandParts; ++part) {
    const Geometry g = made(Geometry::Mode::count, [&](Geometry& into) { make_land(into, part); });
    for (size_t s = 0; s < kSurfaceCount; ++s)
      if (const auto surface = static_cast<Surface>(s); !is_black(emission_of(surface, options_.time)))
        counts_.light_triangles += g.triangle_count(surface);
    counts_.ground_triangles += g.triangle_count(), counts_.meshes += mesh_count(g);
  }
}

City::Made City::make_tile(size_t tile) const {
  Made made;
  for (size_t i = tiles_[tile].first_block; i < tiles_[tile].last_block; ++i) {
    const Contents contents = City::contents(i);
    make_buildings(made.geometry, contents);
    make_ground(made.geometry, i, contents);
    made.lamps.insert(made.lamps.end(), contents.lamps.begin(), contents.lamps.end());
    made.trees.insert(made.trees.end(), contents.trees.begin(), contents.trees.end());
    made.cars.insert(made.cars.end(), contents.cars.begin(), contents.cars.end());
  }
  made.geometry.weld();
  return made;
}

Status City::emit_tiles(pipeline::SceneSink& sink, const Objects& objects) const {
  size_t next = 0, said = 0;
  Status status;
  const auto say = [&](const Made& tile) -> Status {
    SPILLWAY_TRY(add_meshes(sink, tile.geometry, fmt::format("tile{:05}", said), 0, options_.time));
    for (const Standing& s : tile.lamps) SPILLWAY_TRY(sink.add_instance(objects.lamps[s.kind], affine(s.frame, s.scale)));
    for (const Standing& s : tile.trees) SPILLWAY_TRY(sink.add_instance(objects.trees[s.kind][s.variant], affine(s.frame, s.scale)));
    for (const Standing& s : tile.cars) SPILLWAY_TRY(sink.add_instance(objects.cars[s.kind][s.variant], affine(s.frame, s.scale)));
    return {};
  };
  using Handed = std::shared_ptr<Made>;
  const auto tokens = static_cast<size_t>(std::clamp(2 * tbb::this_task_arena::max_concurrency(), 2, 16));
  tbb::parallel_pipeline(
      tokens, tbb::make_filter<void, size_t>(tbb::filter_mode::serial_in_order,
                                             [&](tbb::flow_control& control) {
                                               if (next == tiles_.size() || !status) control.stop();
                                               return next++;
                                             }) &
                  tbb::make_filter<size_t, Handed>(tbb::filter_mode::parallel,
                                                   [&](size_t tile) { return std::make_shared<Made>(make_tile(tile)); }) &
                  tbb::make_filter<Handed, void>(tbb::filter_mode::serial_in_order, [&](const Handed& tile) {
                    if (status) status = say(*tile);
                    ++said;
                  }));
  return status;
}

Status City::emit_land(pipeline::SceneSink& sink, const Objects& objects) const {
  for (int part = 0; part < kLandParts; ++part) {
    Geometry g = made(Geometry::Mode::keep, [&](Geometry& into) { make_land(into, part); });
    g.weld();
    SPILLWAY_TRY(add_meshes(sink, g, fmt::format("land{:02}", part), 0, options_.time));
  }
  for (const Vec2 at : sea_places(terrain_)) SPILLWAY_TRY(sink.add_instance(objects.sea, affine({{at.x, at.y, 0}}, 1)));
  return {};
}

Status City::emit(pipeline::SceneSink& sink, const std::filesystem::path& sky) const {
  for (size_t s = 0; s < kSurfaceCount; ++s) {
    const auto surface = static_cast<Surface>(s);
    SPILLWAY_ASSIGN(const MaterialId id, sink.add_material(material_of(surface), std::string(name(surface))));
    if (id.value != s) return error("material {} was given number {}", name(surface), id.value);
  }
  sink.set_settings(settings_of(view(options_.camera, options_.flight_part)));
  SPILLWAY_TRY(add_light(sink, options_.time, sky));
  Objects objects;
  SPILLWAY_TRY(emit_prototypes(sink, objects));
  SPILLWAY_TRY(emit_land(sink, objects));
  return emit_tiles(sink, objects);
}

}  // namespace spillway::tools::city
