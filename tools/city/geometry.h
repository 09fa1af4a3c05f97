#pragma once

// Triangles by surface: what a tile, or a prototype, is made of.
//
// Local coordinates are metres in double precision (x along a front, y to its left, z up); they become 32-bit floats
// once, when a triangle is added. A Geometry that only counts goes the same ways and keeps nothing.

#include <array>
#include <cstdint>
#include <vector>

#include "cache/base/vec.h"
#include "pipeline/pack/scene_sink.h"
#include "tools/city/palette.h"
#include "tools/city/polygon.h"

namespace spillway::tools::city {

struct Vec3 {
  double x = 0, y = 0, z = 0;
};
inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(Vec3 a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline Vec3 normalize(Vec3 a) { return a * (1 / std::sqrt(dot(a, a))); }

// A place and a heading.
struct Frame {
  Vec3 origin;
  Vec2 x_axis{1, 0};

  [[nodiscard]] Vec3 world(Vec3 local) const {
    const Vec2 flat = x_axis * local.x + left_of(x_axis) * local.y;
    return {origin.x + flat.x, origin.y + flat.y, origin.z + local.z};
  }
  [[nodiscard]] Float3 point(Vec3 local) const {
    const Vec3 p = world(local);
    return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)};
  }
  // The same heading elsewhere.
  [[nodiscard]] Frame at(Vec3 local) const { return {world(local), x_axis}; }
  [[nodiscard]] Frame turned(double angle_rad) const {
    const Vec2 d = direction_of(angle_rad);
    return {origin, x_axis * d.x + left_of(x_axis) * d.y};
  }
};

struct SurfaceMesh {
  std::vector<Float3> positions, normals;  // normals: empty, or one a position
  std::vector<uint32_t> indices;
};

// A Catmull-Clark cage; see cage.h.
struct Cage {
  Surface surface{};
  std::vector<Float3> positions;
  std::vector<uint32_t> indices;  // four a face
  std::vector<pipeline::SharpEdge> sharp_edges;
  std::vector<uint32_t> holes;  // faces without a surface

  [[nodiscard]] uint64_t face_count() const { return indices.size() / 4 - holes.size(); }
};

class Geometry {
 public:
  enum class Mode { keep, count };
  // tessellation: 0 when cages stay cages; else they count as the triangles of so many pieces an edge.
  explicit Geometry(Mode mode = Mode::keep, uint32_t tessellation = 0)
      : keeps_(mode == Mode::keep), tessellation_(tessellation) {}

  // Counter-clockwise seen from outside.
  void triangle(Surface surface, Float3 a, Float3 b, Float3 c);
  void quad(Surface surface, Float3 a, Float3 b, Float3 c, Float3 d);
  void quad(Surface surface, const Frame& frame, Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
    quad(surface, frame.point(a), frame.point(b), frame.point(c), frame.point(d));
  }
  void add_cage(Cage cage);
  // Equal positions become one vertex. Of meshes without normals.
  void weld();
  // Normals: the mean of the faces at a vertex, by area. After weld().
  void smooth(Surface surface);

  [[nodiscard]] uint64_t triangle_count(Surface surface) const { return counts_[static_cast<size_t>(surface)]; }
  [[nodiscard]] uint64_t triangle_count() const;
  [[nodiscard]] const std::vector<Cage>& cages() const { return cages_; }
  [[nodiscard]] uint64_t cage_count() const { return cage_count_; }
  [[nodiscard]] uint64_t cage_face_count() const { return cage_face_count_; }
  [[nodiscard]] uint32_t tessellation() const { return tessellation_; }
  [[nodiscard]] const SurfaceMesh& mesh(Surface surface) const { return meshes_[static_cast<size_t>(surface)]; }

 private:
  bool keeps_;
  uint32_t tessellation_;
  uint64_t cage_count_ = 0, cage_face_count_ = 0;
  std::vector<Cage> cages_;
  std::array<uint64_t, kSurfaceCount> counts_{};
  std::array<SurfaceMesh, kSurfaceCount> meshes_;
};

}  // namespace spillway::tools::city
