#pragma once

// The filters of the reference library for .ptx files, worked out texel by texel: each texel of the kernel is looked
// for on the face where its middle lies. The renderer filters otherwise (cache/face_filter.h); these say whether
// texels, their reductions and their neighbours have been understood.
//
// They differ from the reference at extraordinary corners alone: what lies beyond a corner where not four quads meet is
// left out here; the reference gives it to several faces where there are five or more.

#include <array>
#include <map>
#include <tuple>
#include <vector>

#include "pipeline/pack/ptx_file.h"

namespace spillway::test {

enum class PtexFilterKind { point, bilinear, box, bspline };

struct PtexLookup {
  uint32_t face = 0;
  float u = 0, v = 0;
  float u_width1 = 0, v_width1 = 0, u_width2 = 0, v_width2 = 0;  // the footprint's two axes
  PtexFilterKind kind = PtexFilterKind::point;
  bool lerp = false, no_edge_blend = false;
  float width = 1, blur = 0;
};

class PtexFilter {
 public:
  explicit PtexFilter(const pipeline::PtxFile& file) : file_(file) {}

  // Of each channel; integers over the largest.
  std::vector<double> value(const PtexLookup& lookup);
  // Whether the last lookup left out anything beyond an extraordinary corner.
  [[nodiscard]] bool met_extraordinary_corner() const { return met_extraordinary_corner_; }
  // The texel as numbers.
  std::vector<double> texel(uint32_t face, uint32_t ulog2, uint32_t vlog2, uint32_t u, uint32_t v);

 private:
  struct Grid;
  struct Ellipse;
  std::vector<double> quad_value(const PtexLookup& lookup);
  std::vector<double> triangle_value(const PtexLookup& lookup);
  void add_quad_texel(uint32_t face, cache::FacePlace place, Grid grid, double weight, bool no_edge_blend);
  void add_triangle(uint32_t face, const Ellipse& ellipse, int depth);
  void add(uint32_t face, uint32_t ulog2, uint32_t vlog2, uint32_t u, uint32_t v, double weight);

  const pipeline::PtxFile& file_;
  std::map<std::tuple<uint32_t, uint32_t, uint32_t>, std::vector<std::byte>> images_;
  std::vector<double> sum_;
  double weight_ = 0;
  bool met_extraordinary_corner_ = false;
};

}  // namespace spillway::test
