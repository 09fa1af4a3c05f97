// A planned city, said to a sink.

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <memory>

#include "cache/base/parallel.h"
#include "tools/city/cage.h"
#include "tools/city/city.h"
#include "tools/city/ground.h"
#include "tools/city/paint.h"
#include "tools/city/random.h"
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
  light.image = 1;
  SPILLWAY_TRY(sink.add_environment(light, image));
  return sink.add_light(sun(time));
}

// Where a geometry goes: the world, or an object.
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

// ---- paint ----

constexpr size_t kPaintBatchTexels = 2 << 20;  // painted at once by all threads

std::vector<std::byte> texels_of(const Geometry& g, const PaintedMesh& mesh, const PaintedFace& face) {
  const std::array<Float3, 4> corners = {mesh.positions[face.corners[0]], mesh.positions[face.corners[1]],
                                         mesh.positions[face.corners[2]], mesh.positions[face.corners[3]]};
  return painted_texels(face, corners, g.walls()[face.wall]);
}

Status add_texels(pipeline::SceneSink& sink, const Geometry& g, const PaintedMesh& mesh) {
  for (size_t first = 0; first < mesh.faces.size();) {
    size_t last = first;
    for (size_t texels = 0; last < mesh.faces.size() && texels < kPaintBatchTexels; ++last)
      texels += size_t{1} << (mesh.faces[last].size.ulog2 + mesh.faces[last].size.vlog2);
    std::vector<std::vector<std::byte>> batch(last - first);
    parallel_blocks(batch.size(), 8, [&](size_t, size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) batch[i] = texels_of(g, mesh, mesh.faces[first + i]);
    });
    SPILLWAY_TRY(sink.add_faces(batch));
    first = last;
  }
  return {};
}

Result<MaterialId> add_painted_material(pipeline::SceneSink& sink, PaintGroup group, FaceTextureId paint,
                                        const std::string& name) {
  pipeline::TextureNode node;
  node.kind = pipeline::TextureKind::face, node.image = paint.value;
  for (float& v : node.value) v = 1;
  SPILLWAY_ASSIGN(const TextureId texture, sink.add_texture(node));
  pipeline::Material material = material_of(representative(group));
  material.reflectance.texture = texture.value;
  return sink.add_material(material, name);
}

Status add_painted_mesh(pipeline::SceneSink& sink, const PaintedMesh& mesh, MaterialId material,
                        const std::string& name, uint32_t object) {
  std::vector<uint32_t> indices;
  std::vector<pipeline::TriangleFace> faces;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& c = mesh.faces[f].corners;
    indices.insert(indices.end(), {c[0], c[1], c[2]});
    faces.push_back({f, {0, 1, 2}, false, c[3]});
    if (mesh.faces[f].is_triangle()) continue;
    indices.insert(indices.end(), {c[0], c[2], c[3]});
    faces.push_back({f, {0, 2, 3}, false, c[1]});
  }
  pipeline::MeshInput input;
  input.name = name, input.material = material, input.object = object;
  input.positions = mesh.positions, input.indices = indices, input.faces = faces;
  return sink.add_mesh(input);
}

Status add_painted(pipeline::SceneSink& sink, const Geometry& g, PaintGroup group, const Place& place) {
  const PaintedMesh& mesh = g.painted(group);
  if (mesh.faces.empty()) return {};
  cache::FaceTexFormat format;
  format.encoding = cache::FaceTexEncoding::srgb;
  cache::FaceTextureShape shape;
  shape.name = fmt::format("{}_{}", place.name, city::name(group));
  shape.faces = face_infos(mesh);
  const std::string name = shape.name;
  SPILLWAY_ASSIGN(const FaceTextureId paint, sink.begin_face_texture(format, std::move(shape)));
  SPILLWAY_TRY(add_texels(sink, g, mesh));
  SPILLWAY_ASSIGN(const MaterialId material, add_painted_material(sink, group, paint, name));
  return add_painted_mesh(sink, mesh, material, name, place.object);
}

// The meshes of a geometry, one a surface and one for each group of what is painted, and its cages. Material ids are
// surface numbers.
Status add_geometry(pipeline::SceneSink& sink, const Geometry& g, const Place& place) {
  for (size_t s = 0; s < kSurfaceCount; ++s) {
    const auto surface = static_cast<Surface>(s);
    const SurfaceMesh& mesh = g.mesh(surface);
    if (mesh.indices.empty()) continue;
    SPILLWAY_TRY(add_mesh(sink, input_of(place, surface), mesh));
  }
  for (size_t group = 0; group < kPaintGroups; ++group)
    SPILLWAY_TRY(add_painted(sink, g, static_cast<PaintGroup>(group), place));
  return add_cages(sink, g, place);
}

}  // namespace

struct City::Made {
  Geometry geometry;
  std::vector<Standing> standing;
};

std::vector<Standing> City::at_sea() const {
  std::vector<Standing> standing;
  for (const Vec2 at : sea_places(terrain_)) standing.push_back({{{at.x, at.y, 0}}, 1, kSeaPrototype});
  if (building_count() == 0) return standing;
  for (const Frame& place : boat_places(terrain_, options_.seed)) {
    const double drawn = Random(key_of(options_.seed, standing.size())).unit();
    const BoatKind kind = drawn < 0.6 ? BoatKind::sailboat : drawn < 0.85 ? BoatKind::trawler : BoatKind::ferry;
    standing.push_back({place, 1, kFirstBoat + static_cast<uint32_t>(kind)});
  }
  return standing;
}

Status City::emit_prototypes(pipeline::SceneSink& sink, Objects& objects) const {
  const std::vector<Prototype> all = catalogue(plan_options_.designs, build_options_);
  objects.assign(all.size(), 0);
  for (size_t i = 0; i < all.size(); ++i) {
    if (used_[i] == 0) continue;
    objects[i] = sink.begin_object(all[i].name);
    Geometry g = geometry(Geometry::Mode::keep);
    all[i].make(g);
    if (i != kSeaPrototype) g.weld();  // the sea has normals
    SPILLWAY_TRY(add_geometry(sink, g, {all[i].name, objects[i], options_.time}));
  }
  return {};
}

void City::count_prototypes() {
  for (const Standing& s : at_sea()) {
    ++used_[s.prototype];
    ++(s.prototype == kSeaPrototype ? counts_.sea_tiles : counts_.boats);
  }
  const std::vector<Prototype> all = catalogue(plan_options_.designs, build_options_);
  for (size_t i = 0; i < all.size(); ++i) {
    if (used_[i] == 0) continue;
    Geometry g = counting();
    all[i].make(g);
    if (g.face_sizes()) sizes_->add(*g.face_sizes());
    counts_.prototype_triangles += g.triangle_count();
    counts_.instances += used_[i], counts_.instanced_triangles += used_[i] * g.triangle_count();
    count_surfaces(counts_, g);
  }
}

void City::make_land(Geometry& g, int part) const {
  land(g, terrain_, options_.seed, part, kLandParts);
  if (building_count() > 0) waterfront(g, terrain_, options_.seed, options_.time, part, kLandParts);
}

void City::count_land() {
  for (int part = 0; part < kLandParts; ++part) {
    Geometry g = counting();
    make_land(g, part);
    if (g.face_sizes()) sizes_->add(*g.face_sizes());
    counts_.ground_triangles += g.triangle_count();
    count_surfaces(counts_, g);
  }
}

City::Made City::make_tile(size_t tile) const {
  Made made{geometry(Geometry::Mode::keep), {}};
  for (size_t i = tiles_[tile].first_block; i < tiles_[tile].last_block; ++i) {
    const Contents c = contents(i);
    make_buildings(made.geometry, c);
    make_ground(made.geometry, i, c);
    for (const auto* standing : {&c.lamps, &c.trees, &c.cars, &c.lanterns, &c.instanced_buildings})
      made.standing.insert(made.standing.end(), standing->begin(), standing->end());
  }
  made.geometry.weld();
  return made;
}

Status City::emit_tiles(pipeline::SceneSink& sink, const Objects& objects) const {
  size_t next = 0, said = 0;
  Status status;
  const auto say = [&](const Made& tile) -> Status {
    SPILLWAY_TRY(add_geometry(sink, tile.geometry, {fmt::format("tile{:05}", said), 0, options_.time}));
    for (const Standing& s : tile.standing)
      SPILLWAY_TRY(sink.add_instance(objects[s.prototype], affine(s.frame, s.scale)));
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
  for (const Standing& s : at_sea()) SPILLWAY_TRY(sink.add_instance(objects[s.prototype], affine(s.frame, s.scale)));
  return {};
}

View City::view(uint32_t frame) const {
  return view_of(options_.camera, static_cast<double>(frame - 1) / (kFlightFrames - 1), blocks_, terrain_);
}

// What scatters in gas goes on: with the five bounces of streets alone clouds are grey.
constexpr uint32_t kAiryDepth = 16;

void City::emit_cameras(pipeline::SceneSink& sink, uint32_t medium) const {
  pipeline::SceneSettings settings = settings_of(view(options_.first_frame));
  settings.render.camera_medium = medium;
  if (has_air()) settings.render.max_depth = kAiryDepth;
  sink.set_settings(settings);
  if (options_.last_frame == options_.first_frame) return;
  std::vector<shading::Camera> cameras;
  for (uint32_t frame = options_.first_frame; frame <= options_.last_frame; ++frame)
    cameras.push_back(settings_of(view(frame)).camera);
  sink.set_camera_path(options_.first_frame, cameras);
}

Status City::emit(pipeline::SceneSink& sink, const std::filesystem::path& sky,
                  const std::filesystem::path& air) const {
  for (size_t s = 0; s < kSurfaceCount; ++s) {
    const auto surface = static_cast<Surface>(s);
    SPILLWAY_ASSIGN(const MaterialId id, sink.add_material(material_of(surface), std::string(name(surface))));
    if (id.value != s) return error("material {} was given number {}", name(surface), id.value);
  }
  uint32_t medium = pipeline::kNoMedium;
  if (has_air()) {
    SPILLWAY_ASSIGN(medium, emit_air(sink, air));
  }
  emit_cameras(sink, medium);
  SPILLWAY_TRY(add_light(sink, options_.time, sky));
  Objects objects;
  SPILLWAY_TRY(emit_prototypes(sink, objects));
  SPILLWAY_TRY(emit_land(sink, objects));
  return emit_tiles(sink, objects);
}

}  // namespace spillway::tools::city
