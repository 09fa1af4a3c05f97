#include "tools/import/shapes.h"

#include <cmath>

#include "tools/import/bilinear_mesh.h"
#include "tools/import/loop_subdivision.h"
#include "tools/import/quadrics.h"
#include "tools/import/vertex_lists.h"

namespace spillway::tools {
namespace {

using pipeline::MeshInput;

Float3 rounded(Vec3 v) { return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}; }
Vec3 widened(Float3 v) { return {v.x, v.y, v.z}; }

// Twice the triangle's area, along its normal by the right-hand rule.
Float3 area_vector(const PlyMesh& mesh, size_t triangle) {
  const uint32_t* corner = mesh.indices.data() + 3 * triangle;
  const Float3 p0 = mesh.positions[corner[0]];
  return cross(mesh.positions[corner[1]] - p0, mesh.positions[corner[2]] - p0);
}

Float3 unit_or_zero(Vec3 v) {
  const double size = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
  if (!(size > 0) || !std::isfinite(size)) return {0, 0, 0};
  return rounded({v.x / size, v.y / size, v.z / size});
}

// Normals that cannot be normalised become the mean of their triangles' (or z, where there is none).
void repair_normals(PlyMesh& mesh, float side) {
  constexpr Float3 kZero{0, 0, 0};
  std::vector<uint32_t> broken;
  for (uint32_t i = 0; i < mesh.normals.size(); ++i) {
    if (mesh.normals[i] == kZero) broken.push_back(i);
  }
  if (broken.empty()) return;
  std::vector<bool> is_broken(mesh.normals.size());
  for (const uint32_t i : broken) is_broken[i] = true;
  for (size_t i = 0; i < mesh.indices.size(); ++i) {
    if (is_broken[mesh.indices[i]]) mesh.normals[mesh.indices[i]] += area_vector(mesh, i / 3) * side;
  }
  for (const uint32_t i : broken) {
    const Float3 normal = unit_or_zero(widened(mesh.normals[i]));
    mesh.normals[i] = normal == kZero ? Float3{0, 0, 1} : normal;
  }
}

// With vertex normals, pbrt's geometric normal lies on their side, whatever the winding says. A triangle that
// disagrees is wound the other way round, so that one flag for the mesh is true of all of it.
void rewind_against_normals(PlyMesh& mesh, float side) {
  for (size_t t = 0; t < mesh.indices.size() / 3; ++t) {
    uint32_t* corner = mesh.indices.data() + 3 * t;
    const Float3 shading = mesh.normals[corner[0]] + mesh.normals[corner[1]] + mesh.normals[corner[2]];
    if (dot(area_vector(mesh, t), shading) * side >= 0) continue;
    std::swap(corner[1], corner[2]);
    if (!mesh.faces.empty()) std::swap(mesh.faces[t].corner[1], mesh.faces[t].corner[2]);
  }
}

// ---- reading ----

// What a shape is read from, and what it is called in messages: its place, unless a file has a better name.
struct ShapeSource {
  Session& session;
  const ParamList& params;
  Place place;
  const std::string& type;
  std::string& name;
};

Result<PlyMesh> read_trianglemesh(const ShapeSource& source) {
  const auto& [session, params, place, type, name] = source;
  PlyMesh mesh;
  SPILLWAY_TRY(read_vertices(params, "trianglemesh", place, mesh));
  SPILLWAY_TRY(read_corners(params, "trianglemesh", place, 3, mesh));
  if (const Parameter* tangents = params.find(ParamType::vector3, "S")) {
    session.warn(tangents->place, "tangents \"S\" are not used: they follow from uv");
  }
  const Parameter* numbers = params.find(ParamType::integer, "faceIndices");  // of face textures alone
  if (!session.has_face_textures) return mesh;
  const size_t count = mesh.indices.size() / 3;
  if (numbers != nullptr) SPILLWAY_TRY(expect_count(*numbers, numbers->integers.size(), count));
  for (uint32_t t = 0; t < count; ++t) {
    const int32_t number = numbers != nullptr ? numbers->integers[t] : static_cast<int32_t>(t);
    if (number < 0) return error_at(numbers->place, "face index {} is negative", number);
    mesh.faces.push_back({static_cast<uint32_t>(number), {0, 1, 2}, true, 0});
  }
  return mesh;
}

Result<PlyMesh> read_plymesh(const ShapeSource& source) {
  const auto& [session, params, place, type, name] = source;
  const Parameter* file = params.find(ParamType::string, "filename");
  if (file == nullptr) return error_at(place, "plymesh without \"string filename\"");
  SPILLWAY_TRY(expect_count(*file, file->strings.size(), 1));
  if (const Parameter* displacement = params.find(ParamType::texture, "displacement")) {
    (void)params.find(ParamType::real, "edgelength");
    SPILLWAY_TRY(
        session.ignorable(displacement->place, "displaced meshes are not supported yet: remove \"displacement\""));
  }
  name = file->strings[0];
  Result<PlyMesh> mesh =
      read_ply(session.resolved(name), session.has_face_textures ? PlyFaces::numbered_triangles : PlyFaces::triangles);
  if (!mesh) return error_at(file->place, "{}", mesh.error().message);
  return mesh;
}

// The faces that a subdivmesh may name in a file; the rest is read_cage's.
Result<PlyMesh> read_subdivmesh(const ShapeSource& source) {
  const Parameter* file = source.params.find(ParamType::string, "filename");
  if (file == nullptr) return PlyMesh{};
  SPILLWAY_TRY(expect_count(*file, file->strings.size(), 1));
  source.name = file->strings[0];
  Result<PlyMesh> mesh = read_ply(source.session.resolved(source.name), PlyFaces::polygons);
  if (!mesh) return error_at(file->place, "{}", mesh.error().message);
  return mesh;
}

Result<PlyMesh> read_quadric(const ShapeSource& source) { return dice_quadric(source.type, source.params, source.place); }

constexpr std::string_view kSubdivmesh = "subdivmesh";

struct ShapeReader {
  std::string_view type;
  Result<PlyMesh> (*read)(const ShapeSource&);
};
constexpr ShapeReader kShapeReaders[] = {
    {"trianglemesh", read_trianglemesh},
    {"plymesh", read_plymesh},
    {kSubdivmesh, read_subdivmesh},
    {"bilinearmesh", [](const ShapeSource& s) { return dice_bilinear_mesh(s.params, s.place, s.session.options.most_diced_bytes); }},
    {"loopsubdiv", [](const ShapeSource& s) { return subdivide_loop(s.params, s.place, s.session.options.most_diced_bytes); }},
    {"sphere", read_quadric},
    {"disk", read_quadric},
    {"cylinder", read_quadric},
};

const ShapeReader* find_reader(const std::string& type) {
  for (const ShapeReader& reader : kShapeReaders)
    if (reader.type == type) return &reader;
  return nullptr;
}

Result<TextureId> read_alpha(TextureTable& textures, const ParamList& params, Place place) {
  SPILLWAY_ASSIGN(const std::optional<pipeline::Param> alpha, textures.real_param(params, "alpha"));
  if (!alpha) return TextureId{};
  if (alpha->texture != TextureId::kNone) return TextureId{alpha->texture};
  if (alpha->constant.r >= 1) return TextureId{};
  return textures.add_constant(alpha->constant, place);
}

Status read_displacement(TextureTable& textures, const ParamList& params, Place place, ReadCage& cage) {
  SPILLWAY_ASSIGN(cage.displacement_scale, params.real("displacementscale", 1));
  SPILLWAY_ASSIGN(const std::optional<pipeline::Param> height, textures.real_param(params, "displacement"));
  if (!height) return {};
  if (height->texture != TextureId::kNone) {
    cage.displacement = TextureId{height->texture};
    return {};
  }
  SPILLWAY_ASSIGN(cage.displacement, textures.add_constant(height->constant, place));
  return {};
}

// ---- sending ----

Status send(Session& session, const MeshInput& input, Place place) {
  if (const Status added = session.sink.add_mesh(input); !added) return error_at(place, "{}", added.error().message);
  ++session.report.mesh_count;
  session.report.triangle_count += input.indices.size() / 3;
  return {};
}

// One radiance for a shape that is one light of pbrt's.
float radiance_factor(const PlyMesh& mesh, const AreaEmission& emission) {
  double area = 0;
  for (size_t t = 0; t < mesh.indices.size() / 3; ++t) area += length(area_vector(mesh, t)) / 2;
  return static_cast<float>(emission.power / (M_PI * area * (emission.two_sided ? 2 : 1)));
}

// pbrt makes a light of each triangle and gives each the whole power, so that radiance differs between them: one mesh
// a triangle says the same.
Status send_by_power(Session& session, const PlyMesh& mesh, MeshInput input, const AreaEmission& emission,
                     Place place) {
  const float sides = emission.two_sided ? 2 : 1;
  for (size_t t = 0; t < mesh.indices.size() / 3; ++t) {
    const float area = length(area_vector(mesh, t)) / 2;
    if (!(area > 0)) continue;
    input.faces = {};  // each of these is a mesh of its own
    input.indices = std::span(mesh.indices).subspan(3 * t, 3);
    PlyMesh one;
    for (const uint32_t corner : input.indices) {
      one.positions.push_back(mesh.positions[corner]);
      if (!mesh.normals.empty()) one.normals.push_back(mesh.normals[corner]);
      if (!mesh.uvs.empty()) one.uvs.push_back(mesh.uvs[corner]);
    }
    one.indices = {0, 1, 2};
    input.positions = one.positions, input.normals = one.normals, input.uvs = one.uvs, input.indices = one.indices;
    input.emission = emission.radiance * (emission.power / (static_cast<float>(M_PI) * area * sides));
    SPILLWAY_TRY(send(session, input, place));
  }
  return {};
}

// Its normals are the limit surface's, outside by the winding; ReverseOrientation turns them, and the side that emits.
Status send_cage(Session& session, ReadShape& shape, MeshInput input) {
  ReadCage& cage = *shape.cage;
  place_cage(shape.mesh, cage, shape.state.object_from_shape);
  input.flip_normals = shape.state.reverse_orientation;
  if (shape.emits()) {
    if (shape.state.emission->power > 0)
      return error_at(shape.place, "a subdivmesh with \"power\" is not supported: give its \"L\"");
    input.emits = true;
    input.emission = shape.state.emission->radiance;
    input.emits_two_sided = shape.state.emission->two_sided;
    input.emission_texture = shape.state.emission->image;
  }
  input.positions = shape.mesh.positions, input.uvs = shape.mesh.uvs, input.indices = shape.mesh.indices;
  const pipeline::SubdivisionInput subdivision{input,      cage.corner_counts, cage.uv_indices, cage.sharp_edges, cage.sharp_vertices,
                                               cage.holes, cage.boundary,      cage.uv_rule,    cage.displacement,
                                               cage.displacement_scale};
  const Status added = session.sink.add_subdivision(subdivision);
  if (!added) return error_at(shape.place, "{}", added.error().message);
  ++session.report.cage_count;
  return {};
}

}  // namespace

bool is_supported_shape(const std::string& type) { return find_reader(type) != nullptr; }

// pbrt's sides. Without vertex normals, the geometric normal is that of the winding, turned by ReverseOrientation, and
// turned once more where the transform mirrors (the cross product of mirrored edges points inwards). With vertex
// normals, these are moved by the inverse transpose, which keeps them outside under mirroring, and turned by
// ReverseOrientation alone; the geometric normal then takes their side. Area lights emit to the side of the geometric
// normal. Both rules are met by the flag, with triangles rewound where the two disagree.
bool place_mesh(PlyMesh& mesh, const Transform& object_from_shape, bool reverse_orientation) {
  const bool flip = reverse_orientation != (object_from_shape.determinant() < 0);
  for (Float3& p : mesh.positions) p = rounded(object_from_shape.point(widened(p)));
  if (mesh.normals.empty()) return flip;
  const Transform shape_from_object = object_from_shape.inverse();
  const float normal_side = reverse_orientation ? -1 : 1;
  for (Float3& n : mesh.normals) n = unit_or_zero(shape_from_object.transposed_vector(widened(n))) * normal_side;
  const float side = flip ? -1 : 1;
  repair_normals(mesh, side);
  rewind_against_normals(mesh, side);
  return flip;
}

Result<ReadShape> read_shape(Session& session, TextureTable& textures, const std::string& type, const ParamList& params,
                             Place place, const ShapeState& state) {
  ReadShape shape{type, to_string(place), place, {}, {}, {}, state};
  SPILLWAY_ASSIGN(shape.mesh, find_reader(type)->read({session, params, place, type, shape.name}));
  if (type == kSubdivmesh) {
    SPILLWAY_ASSIGN(shape.cage, read_cage(params, place, shape.mesh));
    SPILLWAY_TRY(read_displacement(textures, params, place, *shape.cage));
  }
  SPILLWAY_ASSIGN(shape.alpha, read_alpha(textures, params, place));
  SPILLWAY_TRY(params.check_all_used(session, fmt::format("Shape \"{}\"", type)));
  return shape;
}

Status send_shape(Session& session, ReadShape shape) {
  const ShapeState& state = shape.state;
  PlyMesh& mesh = shape.mesh;
  MeshInput input;
  input.name = shape.name;
  input.material = state.material;
  input.object = state.object;
  input.alpha = shape.alpha;
  input.divides_media = state.divides_media;
  input.medium_inside = state.medium_inside, input.medium_outside = state.medium_outside;
  if (shape.cage) return send_cage(session, shape, input);
  input.flip_normals = place_mesh(mesh, state.object_from_shape, state.reverse_orientation);
  input.positions = mesh.positions, input.normals = mesh.normals, input.uvs = mesh.uvs, input.indices = mesh.indices;
  input.faces = mesh.faces;
  if (!shape.emits()) return send(session, input, shape.place);
  input.emits = true;
  input.emission = state.emission->radiance;
  input.emits_two_sided = state.emission->two_sided;
  input.emission_texture = state.emission->image;
  input.emission_is_mean = state.emission->image.valid() && state.emission->power > 0;
  if (state.emission->power > 0) {
    const std::string& type = shape.type;
    if (type == "trianglemesh" || type == "plymesh" || type == "loopsubdiv")
      return send_by_power(session, mesh, input, *state.emission, shape.place);
    if (type == "bilinearmesh")
      return error_at(shape.place, "a bilinearmesh with \"power\" is not supported: give its \"L\"");
    input.emission = input.emission * radiance_factor(mesh, *state.emission);
  }
  return send(session, input, shape.place);
}

}  // namespace spillway::tools
