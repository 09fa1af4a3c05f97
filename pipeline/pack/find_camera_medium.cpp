#include "pipeline/pack/find_camera_medium.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>

namespace spillway::pipeline {
namespace {

// Nowhere near the axes or the diagonals, which walls and their edges follow.
constexpr std::array<Float3, 9> kDirections = {{{0.83f, 0.39f, 0.41f},
                                                {-0.77f, 0.53f, 0.36f},
                                                {0.31f, -0.88f, 0.37f},
                                                {-0.43f, -0.71f, 0.56f},
                                                {0.17f, 0.26f, 0.95f},
                                                {0.71f, -0.37f, -0.59f},
                                                {-0.66f, -0.29f, -0.69f},
                                                {0.27f, 0.74f, -0.61f},
                                                {-0.23f, 0.41f, -0.88f}}};

struct Vec {
  double x, y, z;
};
Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec vec(Float3 p) { return {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)}; }

struct Ray {
  Vec origin, direction;
  double distance = INFINITY;  // to what was met first
  uint32_t medium = kNoMedium;
};

// Moeller and Trumbore 1997. Distances are the same in world and object.
void meet(Ray& ray, const Ray& in_object, Vec a, Vec b, Vec c, const Mesh& mesh) {
  const Vec e1 = b - a, e2 = c - a, p = cross(in_object.direction, e2);
  const double determinant = dot(e1, p);
  if (determinant == 0) return;
  const Vec from = in_object.origin - a, q = cross(from, e1);
  const double u = dot(from, p) / determinant, v = dot(in_object.direction, q) / determinant;
  const double t = dot(e2, q) / determinant;
  if (u < 0 || v < 0 || u + v > 1 || !(t > 0) || t >= ray.distance) return;
  // A mirroring instance turns the normal, which is turned back where the mesh is one that is flipped.
  const bool leaves = (dot(in_object.direction, cross(e1, e2)) > 0) != ((mesh.flags & kMeshFlipNormals) != 0);
  ray.distance = t, ray.medium = leaves ? mesh.medium_inside : mesh.medium_outside;
}

// Whether a ray meets the box before what it met already.
bool meets(const Bounds3& box, const Ray& in_object, double distance) {
  double near = 0, far = distance;
  const double origin[] = {in_object.origin.x, in_object.origin.y, in_object.origin.z};
  const double direction[] = {in_object.direction.x, in_object.direction.y, in_object.direction.z};
  for (int a = 0; a < 3; ++a) {
    const auto lower = static_cast<double>(box.lower[a]), upper = static_cast<double>(box.upper[a]);
    if (direction[a] == 0) {
      if (origin[a] < lower || origin[a] > upper) return false;
      continue;
    }
    const double t0 = (lower - origin[a]) / direction[a], t1 = (upper - origin[a]) / direction[a];
    near = std::max(near, std::min(t0, t1) * (1 - 1e-12)), far = std::min(far, std::max(t0, t1) * (1 + 1e-12));
  }
  return near <= far;
}

struct Chunk {
  SpoolReader::View view;
  Bounds3 bounds;
  const Mesh& mesh;
};

void meet_chunk(const Chunk& chunk, const cache::Instance& instance, std::span<Ray> rays) {
  for (Ray& ray : rays) {
    const auto& m = instance.object_from_world.m;
    const auto row = [&](int i, Vec v) {
      return static_cast<double>(m[i][0]) * v.x + static_cast<double>(m[i][1]) * v.y + static_cast<double>(m[i][2]) * v.z;
    };
    const auto moved = [&](int i) { return row(i, ray.origin) + static_cast<double>(m[i][3]); };
    Ray in_object = ray;
    if (instance.object != 0) {
      in_object.origin = {moved(0), moved(1), moved(2)};
      in_object.direction = {row(0, ray.direction), row(1, ray.direction), row(2, ray.direction)};
    }
    if (!meets(chunk.bounds, in_object, ray.distance)) continue;
    const auto corner = [&](size_t i) { return vec(chunk.view.positions[chunk.view.indices[i]]); };
    for (size_t i = 0; i < chunk.view.indices.size(); i += 3)
      meet(ray, in_object, corner(i), corner(i + 1), corner(i + 2), chunk.mesh);
  }
}

uint32_t winner(std::span<const Ray> rays) {
  std::map<uint32_t, int> votes;
  for (const Ray& ray : rays)
    if (ray.distance < INFINITY) ++votes[ray.medium];
  if (votes.empty()) return kNoMedium;
  return std::max_element(votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

// The middle of the first triangle that divides media and stands somewhere. Something is then met from everywhere.
Result<std::optional<Float3>> first_divider(const SpooledScene& scene, std::span<const cache::Instance> instances,
                                            SpoolReader& reader) {
  for (const PlacedChunk& placed : scene.chunks) {
    const Mesh& mesh = scene.meshes[placed.mesh].row;
    if ((mesh.flags & kMeshDividesMedia) == 0) continue;
    for (const cache::Instance& instance : instances) {
      if (instance.object != mesh.object) continue;
      SPILLWAY_ASSIGN(const SpoolReader::View view, reader.view(placed.chunk));
      const auto corner = [&](size_t i) { return view.positions[view.indices[i]]; };
      const Float3 middle = (corner(0) + corner(1) + corner(2)) * (1.0f / 3);
      return std::optional(instance.object == 0 ? middle : instance.world_from_object.point(middle));
    }
  }
  return std::optional<Float3>();
}

}  // namespace

Result<std::vector<uint32_t>> find_camera_media(const SpooledScene& scene, std::span<const cache::Instance> instances,
                                                std::span<const Float3> eyes_world) {
  SpoolReader reader(*scene.spool);
  SPILLWAY_ASSIGN(const std::optional<Float3> divider, first_divider(scene, instances, reader));
  std::vector<Ray> rays;
  for (const Float3 eye : eyes_world) {
    for (const Float3 direction : kDirections) rays.push_back({vec(eye), vec(direction)});
    rays.push_back({vec(eye), vec(divider.value_or(eye)) - vec(eye)});
  }
  for (const PlacedChunk& placed : scene.chunks) {
    const Mesh& mesh = scene.meshes[placed.mesh].row;
    if ((mesh.flags & kMeshDividesMedia) == 0) continue;
    SPILLWAY_ASSIGN(const SpoolReader::View view, reader.view(placed.chunk));
    Chunk chunk{view, {}, mesh};
    for (const Float3 p : view.positions) chunk.bounds.grow(p);
    for (const cache::Instance& instance : instances)
      if (instance.object == mesh.object) meet_chunk(chunk, instance, rays);
  }
  std::vector<uint32_t> media;
  for (size_t eye = 0; eye < eyes_world.size(); ++eye)
    media.push_back(winner(std::span(rays).subspan(eye * (kDirections.size() + 1), kDirections.size() + 1)));
  return media;
}

}  // namespace spillway::pipeline
