#pragma once

// Faces that are painted: a quad each, with its own small image. What they are painted with is paint.h's.
//
// How many texels a face has follows from its edges in quarters of powers of two metres, so that a table of such sizes
// tells exactly how many texels a city has at any resolution. A triangle is a quad whose last two corners are one.

#include <array>
#include <cstdint>
#include <vector>

#include "cache/base/vec.h"
#include "cache/face_layout.h"
#include "tools/city/palette.h"
#include "tools/city/wall_grid.h"

namespace spillway::tools::city {

// Faces of one group share a material: they differ in the colour that is painted on them.
enum class PaintGroup : uint8_t { matte, window, panel, mirror, count };
inline constexpr size_t kPaintGroups = static_cast<size_t>(PaintGroup::count);

// None for what is never painted: what shines, thin metal, leaves, cars.
[[nodiscard]] PaintGroup paint_group(Surface surface);  // PaintGroup::count: none
// One surface of the group, for its material.
[[nodiscard]] Surface representative(PaintGroup group);
[[nodiscard]] const char* name(PaintGroup group);

struct FaceSize {
  uint8_t ulog2 = 0, vlog2 = 0;  // of its texels
};

struct PaintedFace {
  std::array<uint32_t, 4> corners{};  // counter-clockwise from outside; of a triangle the last two are equal
  uint32_t wall = 0;                  // of PaintedMesh::walls' owner, the geometry
  Surface surface{};
  FaceSize size;

  [[nodiscard]] bool is_triangle() const { return corners[2] == corners[3]; }
};

struct PaintedMesh {
  std::vector<Float3> positions;
  std::vector<PaintedFace> faces;
};

// The faces as a file of face textures holds them. Neighbours are faces that share an edge and are painted on across
// it: of one wall and surface, in one plane, no panes (each has curtains of its own). Of a mesh whose points are
// welded.
[[nodiscard]] std::vector<cache::FaceInfo> face_infos(const PaintedMesh& mesh);

// ---- sizes ----

inline constexpr uint32_t kMostFaceLog2 = 11;    // 2048 texels an edge
inline constexpr uint32_t kLeastTexelsLog2 = 4;  // faces of fewer than 16 texels are not worth an image

// How long a face is along u and v, in quarters of powers of two metres.
struct FaceQuarters {
  int u = 0, v = 0;
};
[[nodiscard]] FaceQuarters quarters_of(Float3 a, Float3 b, Float3 c, Float3 d);
[[nodiscard]] FaceSize size_of(FaceQuarters quarters, double texels_per_metre);
[[nodiscard]] constexpr bool is_worth_painting(FaceSize size) {
  return size.ulog2 + size.vlog2 >= int{kLeastTexelsLog2};
}

// How many faces there are of each size.
class FaceSizes {
 public:
  void add(FaceQuarters quarters) { ++counts_[index(quarters.u)][index(quarters.v)]; }
  void add(const FaceSizes& other, uint64_t times = 1);
  struct Texels {
    uint64_t faces = 0, texels = 0;  // of the finest levels
  };
  [[nodiscard]] Texels at(double texels_per_metre) const;

  static constexpr int kFirst = -16, kCount = 64;  // 6 cm to 4 km

 private:
  static size_t index(int quarter) { return static_cast<size_t>(quarter - kFirst); }
  std::array<std::array<uint64_t, kCount>, kCount> counts_{};
};

}  // namespace spillway::tools::city
