#pragma once

// Triangles by surface: what a tile, or a prototype, is made of.
//
// Local coordinates are metres in double precision (x along a front, y to its left, z up); they become 32-bit floats
// once, when a triangle is added. A Geometry that only counts goes the same ways and keeps nothing.

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "cache/base/vec.h"
#include "pipeline/pack/scene_sink.h"
#include "tools/city/frame.h"
#include "tools/city/painted_mesh.h"
#include "tools/city/palette.h"

namespace spillway::tools::city {

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

// The mouth of a chimney that smokes.
struct Chimney {
  Vec3 mouth;
  double radius_m;
};

class Geometry {
 public:
  enum class Mode { keep, count };
  struct Options {
    uint32_t tessellation = 0;    // 0 when cages stay cages; else they count as the triangles of so many pieces an edge
    double texels_per_metre = 0;  // 0: nothing is painted
  };
  explicit Geometry(Mode mode = Mode::keep) : Geometry(mode, Options()) {}
  Geometry(Mode mode, const Options& options) : keeps_(mode == Mode::keep), options_(options) {}

  // Counter-clockwise seen from outside.
  void triangle(Surface surface, Float3 a, Float3 b, Float3 c);
  void quad(Surface surface, Float3 a, Float3 b, Float3 c, Float3 d);
  void quad(Surface surface, const Frame& frame, Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
    quad(surface, frame.point(a), frame.point(b), frame.point(c), frame.point(d));
  }
  void add_cage(Cage cage);
  void add_chimney(const Chimney& chimney) { chimneys_.push_back(chimney); }
  // What is added until the next call is part of this wall. Returns the wall before, for back_to_wall.
  uint32_t begin_wall(const WallGrid& wall);
  void back_to_wall(uint32_t wall) { wall_ = wall; }
  [[nodiscard]] WallGrid wall() const { return wall_ < walls_.size() ? walls_[wall_] : WallGrid(); }
  // Equal positions become one vertex. Of meshes without normals.
  void weld();
  // Normals: the mean of the faces at a vertex, by area. After weld().
  void smooth(Surface surface);

  [[nodiscard]] uint64_t triangle_count(Surface surface) const { return counts_[static_cast<size_t>(surface)]; }
  [[nodiscard]] uint64_t triangle_count() const;
  [[nodiscard]] const std::vector<Cage>& cages() const { return cages_; }
  [[nodiscard]] const std::vector<Chimney>& chimneys() const { return chimneys_; }
  [[nodiscard]] uint64_t cage_count() const { return cage_count_; }
  [[nodiscard]] uint64_t cage_face_count() const { return cage_face_count_; }
  [[nodiscard]] uint32_t tessellation() const { return options_.tessellation; }
  // Without what is painted.
  [[nodiscard]] const SurfaceMesh& mesh(Surface surface) const { return meshes_[static_cast<size_t>(surface)]; }
  [[nodiscard]] const PaintedMesh& painted(PaintGroup group) const { return painted_[static_cast<size_t>(group)]; }
  [[nodiscard]] const std::vector<WallGrid>& walls() const { return walls_; }
  // Of faces that can be painted, whether or not they are.
  [[nodiscard]] const FaceSizes* face_sizes() const { return sizes_.get(); }
  void count_faces() { sizes_ = std::make_unique<FaceSizes>(); }

 private:
  bool paint(Surface surface, Float3 a, Float3 b, Float3 c, Float3 d);

  bool keeps_;
  Options options_;
  uint32_t wall_ = 0;
  std::vector<WallGrid> walls_;
  std::unique_ptr<FaceSizes> sizes_;
  uint64_t cage_count_ = 0, cage_face_count_ = 0;
  std::vector<Cage> cages_;
  std::vector<Chimney> chimneys_;
  std::array<uint64_t, kSurfaceCount> counts_{};
  std::array<SurfaceMesh, kSurfaceCount> meshes_;
  std::array<PaintedMesh, kPaintGroups> painted_;
};

}  // namespace spillway::tools::city
