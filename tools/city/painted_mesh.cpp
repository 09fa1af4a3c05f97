#include "tools/city/painted_mesh.h"

#include <algorithm>
#include <cmath>

#include "cache/base/check.h"

namespace spillway::tools::city {
namespace {

int quarter_of(float length_m) {
  if (!(length_m > 0)) return FaceSizes::kFirst;
  const auto quarter = static_cast<int>(std::floor(4 * std::log2(static_cast<double>(length_m))));
  return std::clamp(quarter, FaceSizes::kFirst, FaceSizes::kFirst + FaceSizes::kCount - 1);
}

uint8_t log2_of(int quarter, double texels_per_metre) {
  const double texels_log2 = (quarter + 0.5) / 4 + std::log2(texels_per_metre);
  return static_cast<uint8_t>(std::clamp(std::floor(texels_log2 + 0.5), 0.0, double{kMostFaceLog2}));
}

// An edge of a face, by its two points.
struct FaceEdge {
  uint32_t low, high;  // points
  uint32_t face, edge;
  bool runs_up;  // from low to high
  auto operator<=>(const FaceEdge&) const = default;
};

std::vector<FaceEdge> sorted_edges(const PaintedMesh& mesh) {
  std::vector<FaceEdge> edges;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f)
    for (uint32_t e = 0; e < 4; ++e) {
      const uint32_t a = mesh.faces[f].corners[e], b = mesh.faces[f].corners[(e + 1) % 4];
      if (a != b) edges.push_back({std::min(a, b), std::max(a, b), f, e, a < b});
    }
  std::ranges::sort(edges);
  return edges;
}

Float3 normal_of(const PaintedMesh& mesh, const PaintedFace& face) {
  const auto at = [&](int corner) { return mesh.positions[face.corners[static_cast<size_t>(corner)]]; };
  const Float3 n = cross(at(2) - at(0), at(3) - at(1));  // of a triangle, too
  const float squared = length_squared(n);
  return squared > 0 ? n * (1 / std::sqrt(squared)) : n;
}

bool continue_each_other(const PaintedMesh& mesh, const PaintedFace& a, const PaintedFace& b) {
  constexpr float kInOnePlane = 0.999f;  // the cosine of 2.6 degrees
  const PaintGroup group = paint_group(a.surface);
  return a.wall == b.wall && a.surface == b.surface && (group == PaintGroup::matte || group == PaintGroup::panel) &&
         dot(normal_of(mesh, a), normal_of(mesh, b)) > kInOnePlane;
}

void name_neighbour(cache::FaceInfo& face, uint32_t edge, const FaceEdge& other) {
  face.adjacent_faces[edge] = other.face;
  face.adjacent_edges = static_cast<uint8_t>(face.adjacent_edges | other.edge << (2 * edge));
}

}  // namespace

std::vector<cache::FaceInfo> face_infos(const PaintedMesh& mesh) {
  std::vector<cache::FaceInfo> infos;
  infos.reserve(mesh.faces.size());
  for (const PaintedFace& face : mesh.faces) infos.push_back({.ulog2 = face.size.ulog2, .vlog2 = face.size.vlog2});
  const std::vector<FaceEdge> edges = sorted_edges(mesh);
  for (size_t first = 0; first < edges.size();) {
    size_t last = first + 1;
    while (last < edges.size() && edges[last].low == edges[first].low && edges[last].high == edges[first].high) ++last;
    const FaceEdge &a = edges[first], &b = edges[last - 1];
    if (last - first == 2 && a.face != b.face && a.runs_up != b.runs_up &&
        continue_each_other(mesh, mesh.faces[a.face], mesh.faces[b.face])) {
      name_neighbour(infos[a.face], a.edge, b);
      name_neighbour(infos[b.face], b.edge, a);
    }
    first = last;
  }
  return infos;
}

PaintGroup paint_group(Surface surface) {
  using enum Surface;
  if (surface == glass_dark) return PaintGroup::window;
  if (surface >= glass_blue && surface <= glass_silver) return PaintGroup::mirror;
  if (surface >= panel_silver && surface <= panel_blue) return PaintGroup::panel;
  const bool is_wall = surface <= wood_red, is_trim = surface >= trim_white && surface <= trim_dark;
  const bool is_roof = surface >= roof_tar && surface <= copper;
  const bool is_awning = surface >= awning_red && surface <= awning_navy;
  const bool is_street = surface == asphalt || surface == pavement || surface == plaza;
  return is_wall || is_trim || is_roof || is_awning || is_street ? PaintGroup::matte : PaintGroup::count;
}

Surface representative(PaintGroup group) {
  switch (group) {
    case PaintGroup::window:
      return Surface::glass_dark;
    case PaintGroup::panel:
      return Surface::panel_silver;
    case PaintGroup::mirror:
      return Surface::glass_silver;
    default:
      return Surface::concrete;
  }
}

const char* name(PaintGroup group) {
  static constexpr const char* kNames[] = {"matte", "window", "panel", "mirror"};
  return kNames[static_cast<size_t>(group)];
}

FaceQuarters quarters_of(Float3 a, Float3 b, Float3 c, Float3 d) {
  return {quarter_of(std::max(length(b - a), length(c - d))), quarter_of(std::max(length(d - a), length(c - b)))};
}

FaceSize size_of(FaceQuarters quarters, double texels_per_metre) {
  if (texels_per_metre <= 0) return {};
  return {log2_of(quarters.u, texels_per_metre), log2_of(quarters.v, texels_per_metre)};
}

void FaceSizes::add(const FaceSizes& other, uint64_t times) {
  for (size_t u = 0; u < kCount; ++u)
    for (size_t v = 0; v < kCount; ++v) counts_[u][v] += times * other.counts_[u][v];
}

FaceSizes::Texels FaceSizes::at(double texels_per_metre) const {
  Texels sum;
  if (texels_per_metre <= 0) return sum;
  for (int u = 0; u < kCount; ++u)
    for (int v = 0; v < kCount; ++v) {
      const uint64_t count = counts_[static_cast<size_t>(u)][static_cast<size_t>(v)];
      const FaceSize size = size_of({u + kFirst, v + kFirst}, texels_per_metre);
      if (count == 0 || !is_worth_painting(size)) continue;
      sum.faces += count, sum.texels += count << (size.ulog2 + size.vlog2);
    }
  return sum;
}

}  // namespace spillway::tools::city
