#include "tools/city/geometry.h"

#include <bit>
#include <cstring>
#include <numeric>

#include "cache/base/hash.h"

namespace spillway::tools::city {
namespace {

// An open-addressed table of vertices by their bits.
class VertexTable {
 public:
  explicit VertexTable(size_t most) : slots_(std::bit_ceil(2 * most + 1), kEmpty) {}

  uint32_t number(Float3 p, std::vector<Float3>& kept) {
    const size_t mask = slots_.size() - 1;
    for (size_t at = hash(p) & mask;; at = (at + 1) & mask) {
      if (slots_[at] == kEmpty) {
        slots_[at] = static_cast<uint32_t>(kept.size());
        kept.push_back(p);
      }
      if (std::memcmp(&kept[slots_[at]], &p, sizeof p) == 0) return slots_[at];
    }
  }

 private:
  static constexpr uint32_t kEmpty = 0xffffffffu;
  static uint64_t hash(Float3 p) {
    const uint64_t xy = uint64_t{std::bit_cast<uint32_t>(p.x)} << 32 | std::bit_cast<uint32_t>(p.y);
    return hash_combine(xy, std::bit_cast<uint32_t>(p.z));
  }
  std::vector<uint32_t> slots_;
};

void weld_mesh(SurfaceMesh& mesh) {
  std::vector<Float3> kept;
  VertexTable table(mesh.positions.size());
  for (uint32_t& index : mesh.indices) index = table.number(mesh.positions[index], kept);
  mesh.positions = std::move(kept);
}

void weld_painted(PaintedMesh& mesh) {
  std::vector<Float3> kept;
  VertexTable table(mesh.positions.size());
  for (PaintedFace& face : mesh.faces)
    for (uint32_t& corner : face.corners) corner = table.number(mesh.positions[corner], kept);
  mesh.positions = std::move(kept);
}

// What has none is not worth a triangle: packing drops it, and counts would differ.
bool has_area(Float3 a, Float3 b, Float3 c) { return length_squared(spillway::cross(b - a, c - a)) > 0; }

}  // namespace

void Geometry::triangle(Surface surface, Float3 a, Float3 b, Float3 c) {
  if (!has_area(a, b, c)) return;
  ++counts_[static_cast<size_t>(surface)];
  if (paint(surface, a, b, c, c) || !keeps_) return;
  SurfaceMesh& mesh = meshes_[static_cast<size_t>(surface)];
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.indices.insert(mesh.indices.end(), {first, first + 1, first + 2});
}

void Geometry::quad(Surface surface, Float3 a, Float3 b, Float3 c, Float3 d) {
  if (!has_area(a, b, c)) return triangle(surface, a, c, d);
  if (!has_area(a, c, d)) return triangle(surface, a, b, c);
  counts_[static_cast<size_t>(surface)] += 2;
  if (paint(surface, a, b, c, d) || !keeps_) return;
  SurfaceMesh& mesh = meshes_[static_cast<size_t>(surface)];
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c, d});
  mesh.indices.insert(mesh.indices.end(), {first, first + 1, first + 2, first, first + 2, first + 3});
}

// Whether the face is painted, and so belongs to no surface's mesh.
bool Geometry::paint(Surface surface, Float3 a, Float3 b, Float3 c, Float3 d) {
  if (options_.texels_per_metre <= 0 && !sizes_) return false;
  const PaintGroup group = paint_group(surface);
  if (group == PaintGroup::count) return false;
  const FaceQuarters quarters = quarters_of(a, b, c, d);
  if (sizes_) sizes_->add(quarters);
  const FaceSize size = size_of(quarters, options_.texels_per_metre);
  if (options_.texels_per_metre <= 0 || !keeps_ || !is_worth_painting(size)) return false;
  if (walls_.empty()) walls_.emplace_back();
  PaintedMesh& mesh = painted_[static_cast<size_t>(group)];
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c, d});
  mesh.faces.push_back({{first, first + 1, first + 2, first + 3}, wall_, surface, size});
  return true;
}

uint32_t Geometry::begin_wall(const WallGrid& wall) {
  if (!keeps_ || options_.texels_per_metre <= 0) return 0;
  if (walls_.empty()) walls_.emplace_back();  // wall 0: of what is no building
  const uint32_t before = wall_;
  wall_ = static_cast<uint32_t>(walls_.size());
  walls_.push_back(wall);
  return before;
}

void Geometry::weld() {
  for (SurfaceMesh& mesh : meshes_)
    if (!mesh.indices.empty()) weld_mesh(mesh);
  for (PaintedMesh& mesh : painted_) weld_painted(mesh);
}

void Geometry::smooth(Surface surface) {
  SurfaceMesh& mesh = meshes_[static_cast<size_t>(surface)];
  mesh.normals.assign(mesh.positions.size(), {0, 0, 0});
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const Float3 a = mesh.positions[mesh.indices[i]];
    const Float3 n = spillway::cross(mesh.positions[mesh.indices[i + 1]] - a, mesh.positions[mesh.indices[i + 2]] - a);
    for (size_t k = 0; k < 3; ++k) mesh.normals[mesh.indices[i + k]] += n;
  }
  for (Float3& n : mesh.normals) n = length_squared(n) > 0 ? spillway::normalize(n) : Float3{0, 0, 1};
}

void Geometry::add_cage(Cage cage) {
  ++cage_count_, cage_face_count_ += cage.face_count();
  counts_[static_cast<size_t>(cage.surface)] += 2 * cage.face_count() * options_.tessellation * options_.tessellation;
  if (keeps_) cages_.push_back(std::move(cage));
}

uint64_t Geometry::triangle_count() const { return std::accumulate(counts_.begin(), counts_.end(), uint64_t{0}); }

}  // namespace spillway::tools::city
