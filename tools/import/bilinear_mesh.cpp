#include "tools/import/bilinear_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/import/vertex_lists.h"

namespace spillway::tools {
namespace {

constexpr uint32_t kMostSteps = 64;  // at a twist as large as the patch, 32 keep to kPatchError

template <class T>
T bilinear(const std::array<T, 4>& corner, float u, float v) {
  return (corner[0] * (1 - u) + corner[1] * u) * (1 - v) + (corner[2] * (1 - u) + corner[3] * u) * v;
}

float length_of(Float3 v) { return length(v); }
float length_of(Float2 v) { return std::hypot(v.x, v.y); }

// How far the patch is from a parallelogram, in sizes of the patch. Two triangles miss it by a quarter of that.
template <class T>
double twist(const std::array<T, 4>& corner) {
  const double size = std::max(length_of(corner[3] + corner[0] * -1.0f), length_of(corner[2] + corner[1] * -1.0f));
  const double off = length_of(corner[0] + corner[3] + (corner[1] + corner[2]) * -1.0f);
  return size > 0 ? off / size : 0;
}

// The error falls with the square of the steps; what float rounding makes of a parallelogram is none.
uint32_t steps_for(double twist) {
  if (!(twist > 1e-5)) return 1;
  const double steps = std::ceil(std::sqrt(twist / 4 / kPatchError));  // beyond any integer where corners fold together
  return static_cast<uint32_t>(std::clamp<double>(steps, 1, kMostSteps));
}

struct Patch {
  std::array<Float3, 4> position;  // at (u, v): 0 0, 1 0, 0 1, 1 1
  std::array<Float3, 4> normal;
  std::array<Float2, 4> uv;
};

void add_patch(const Patch& patch, bool has_normals, PlyMesh& mesh) {
  const uint32_t steps = std::max(steps_for(twist(patch.position)), steps_for(twist(patch.uv)));
  const auto base = static_cast<uint32_t>(mesh.positions.size());
  for (uint32_t j = 0; j <= steps; ++j)
    for (uint32_t i = 0; i <= steps; ++i) {
      const float u = static_cast<float>(i) / static_cast<float>(steps),
                  v = static_cast<float>(j) / static_cast<float>(steps);
      mesh.positions.push_back(bilinear(patch.position, u, v));
      mesh.uvs.push_back(bilinear(patch.uv, u, v));
      if (has_normals) mesh.normals.push_back(bilinear(patch.normal, u, v));
    }
  const uint32_t row = steps + 1;
  for (uint32_t j = 0; j < steps; ++j)
    for (uint32_t i = 0; i < steps; ++i) {
      const uint32_t corner = base + j * row + i;
      mesh.indices.insert(mesh.indices.end(),
                          {corner, corner + 1, corner + row + 1, corner, corner + row + 1, corner + row});
    }
}

// Room that vectors keep to grow is not counted: at most as much again.
uint64_t bytes_of(const PlyMesh& mesh) {
  return mesh.positions.size() * sizeof(Float3) + mesh.normals.size() * sizeof(Float3) +
         mesh.uvs.size() * sizeof(Float2) + mesh.indices.size() * sizeof(uint32_t);
}

}  // namespace

Result<PlyMesh> dice_bilinear_mesh(const ParamList& params, Place place, uint64_t most_bytes) {
  PlyMesh corners;
  SPILLWAY_TRY(read_vertices(params, "bilinearmesh", place, corners));
  SPILLWAY_TRY(read_corners(params, "bilinearmesh", place, 4, corners));
  (void)params.find(ParamType::integer, "faceIndices");  // of face textures alone
  PlyMesh mesh;
  for (size_t first = 0; first < corners.indices.size(); first += 4) {
    Patch patch{{}, {}, {{{0, 0}, {1, 0}, {0, 1}, {1, 1}}}};
    for (size_t c = 0; c < 4; ++c) {
      const uint32_t vertex = corners.indices[first + c];
      patch.position[c] = corners.positions[vertex];
      if (!corners.normals.empty()) patch.normal[c] = corners.normals[vertex];
      if (!corners.uvs.empty()) patch.uv[c] = corners.uvs[vertex];
    }
    add_patch(patch, !corners.normals.empty(), mesh);
    if (bytes_of(mesh) > most_bytes)
      return error_at(place, "this bilinearmesh takes more than {} bytes as triangles: split it", most_bytes);
  }
  return mesh;
}

}  // namespace spillway::tools
