#include "tests/support/ptex_filter.h"

#include <immintrin.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace spillway::test {
namespace {

using cache::FaceBorder;
using cache::FaceInfo;
using cache::FacePlace;
using cache::FaceShape;
using cache::FaceTexelType;
using cache::Neighbour;

double number(FaceTexelType type, const std::byte* at) {
  if (type == FaceTexelType::uint8) return static_cast<uint8_t>(*at) / 255.0;
  if (type == FaceTexelType::float32) {
    float value;
    std::memcpy(&value, at, sizeof value);
    return static_cast<double>(value);
  }
  uint16_t bits;
  std::memcpy(&bits, at, sizeof bits);
  return type == FaceTexelType::uint16 ? bits / 65535.0 : static_cast<double>(_cvtsh_ss(bits));
}

// One axis of a separable kernel: texels first, first + 1, ... of a face that has 2^log2.
struct Axis {
  int log2 = 0;
  int first = 0;
  std::vector<double> weights;

  // Beyond the face, where there may be subfaces.
  [[nodiscard]] bool is_larger_than_a_subface() const {
    bool beyond = false;
    for (size_t i = 0; i < weights.size(); ++i)
      beyond = beyond || (weights[i] != 0 && first + static_cast<int>(i) != 0);
    return log2 == 0 && beyond;
  }
  // Each texel as two halves.
  void refine() {
    std::vector<double> halves;
    for (const double weight : weights) halves.insert(halves.end(), {weight / 2, weight / 2});
    weights = halves, first *= 2, ++log2;
  }
};

// The coarsest texels that are not larger than the filter is wide.
int log2_for_width(float width) { return -std::ilogb(width); }

double bspline(double x) {
  x = std::fabs(x);
  if (x < 1) return x * x * x / 2 - x * x + 2.0 / 3;
  return x < 2 ? (2 - x) * (2 - x) * (2 - x) / 6 : 0;
}

double hermite(double x) {
  x = std::fabs(x);
  return x < 1 ? (2 * x - 3) * x * x + 1 : 0;
}

Axis bilinear_axis(float at, int log2) {
  const float texel = std::ldexp(at, log2) - 0.5f, floor = std::floor(texel);
  const double share = static_cast<double>(texel - floor);
  return {log2, static_cast<int>(floor), {1 - share, share}};
}

Axis box_axis(float at, float width, int log2) {
  const float middle = std::ldexp(at, log2), size = std::ldexp(width, log2);
  const float low = middle - 0.5f * size, high = middle + 0.5f * size;
  Axis axis{log2, static_cast<int>(std::floor(low)), {}};
  for (int i = axis.first; i < static_cast<int>(std::ceil(high)); ++i)
    axis.weights.push_back(
        static_cast<double>(std::min(high, static_cast<float>(i) + 1) - std::max(low, static_cast<float>(i))));
  return axis;
}

// A kernel of 4 widths; wider ones than a quarter of the face are broad humps over few texels.
Axis bspline_axis(float at, float width, int log2, bool lerp) {
  const double finest = std::ldexp(1.0, -log2);
  const double share = lerp ? (static_cast<double>(width) - finest) / finest : 0;  // of the next coarser texels
  const auto pairs = [&](Axis axis, int end, const auto& fine, const auto& coarse) {
    axis.first &= ~1, end = (end + 1) & ~1;
    for (int i = axis.first; i < end; i += 2)
      for (const int k : {i, i + 1}) axis.weights.push_back((1 - share) * fine(k) + share * coarse(i + 0.5));
    return axis;
  };
  const double w = static_cast<double>(width);
  if (width >= 1) {
    const float texel = at - 0.5f, floor = std::floor(texel);
    const double first = hermite(static_cast<double>(texel - floor));
    return {0, static_cast<int>(floor), {first, 1 - first}};
  }
  const double middle = static_cast<double>(std::ldexp(at, width >= 0.5f ? 1 : width >= 0.25f ? 2 : log2) - 0.5f);
  if (width >= 0.5f) {
    const int first = static_cast<int>(std::floor(at - 0.5f)) * 2;
    const double s = 1 / (1.5 * w + 0.5);
    return pairs(
        {1, first, {}}, first + 4, [&](double x) { return hermite((x - middle) * s); },
        [&](double x) { return hermite((x - middle) * s); });
  }
  if (width >= 0.25f)
    return pairs(
        {2, static_cast<int>(std::ceil(middle - 2)), {}}, static_cast<int>(std::ceil(middle + 2)),
        [&](double x) { return bspline(x - middle); },
        [&](double x) { return hermite((x - middle) / 2 / (w + 0.75)); });
  const double size = std::ldexp(w, log2);
  Axis axis{log2, static_cast<int>(std::ceil(middle - 2 * size)), {}};
  const int end = static_cast<int>(std::ceil(middle + 2 * size));
  const auto weight = [&](double x) { return bspline((x - middle) / size); };
  if (lerp && share > 0) return pairs(axis, end, weight, weight);
  for (int i = axis.first; i < end; ++i) axis.weights.push_back(weight(i));
  return axis;
}

Axis quad_axis(PtexFilterKind kind, float at, float width, uint32_t face_log2, bool lerp) {
  width = std::max(width, std::ldexp(1.0f, -static_cast<int>(face_log2)));
  if (kind == PtexFilterKind::bspline) return bspline_axis(at, width, log2_for_width(width), lerp);
  width = std::min(width, 1.0f);
  const int log2 = log2_for_width(width);
  return kind == PtexFilterKind::box ? box_axis(at, width, log2) : bilinear_axis(at, log2);
}

float outside(FacePlace p, uint32_t edge) {
  return edge == 0 ? -p.v : edge == 1 ? p.u - 1 : edge == 2 ? p.v - 1 : -p.u;
}

bool has_subfaces(std::span<const FaceInfo> faces) {
  return std::any_of(faces.begin(), faces.end(), [](const FaceInfo& f) { return f.is_subface(); });
}

}  // namespace

// Texels of the size that the kernel has, as the face counts them.
struct PtexFilter::Grid {
  int ulog2, vlog2;
};

std::vector<double> PtexFilter::texel(uint32_t face, uint32_t ulog2, uint32_t vlog2, uint32_t u, uint32_t v) {
  auto& image = images_[{face, ulog2, vlog2}];
  if (image.empty()) {
    auto texels = file_.texels(face, ulog2, vlog2);
    if (!texels) throw std::runtime_error(texels.error().message);
    image = std::move(*texels);
  }
  std::vector<double> values(file_.info().channels);
  const size_t size = texel_type_bytes(file_.info().type);
  const std::byte* at = image.data() + ((size_t{v} << ulog2) + u) * file_.texel_bytes();
  for (size_t c = 0; c < values.size(); ++c) values[c] = number(file_.info().type, at + c * size);
  return values;
}

void PtexFilter::add(uint32_t face, uint32_t ulog2, uint32_t vlog2, uint32_t u, uint32_t v, double weight) {
  const std::vector<double> values = texel(face, ulog2, vlog2, u, v);
  for (size_t c = 0; c < values.size(); ++c) sum_[c] += weight * values[c];
  weight_ += weight;
}

std::vector<double> PtexFilter::value(const PtexLookup& lookup) {
  const FaceInfo& face = file_.faces()[lookup.face];
  met_extraordinary_corner_ = false;
  sum_.assign(file_.info().channels, 0), weight_ = 0;
  const bool is_quad = file_.info().shape == FaceShape::quad;
  if (lookup.kind == PtexFilterKind::point) {
    const int width = 1 << face.ulog2, height = 1 << face.vlog2;
    cache::TexelIndex at{std::clamp(static_cast<int>(lookup.u * static_cast<float>(width)), 0, width - 1),
                         std::clamp(static_cast<int>(lookup.v * static_cast<float>(height)), 0, height - 1)};
    if (!is_quad) at = cache::triangle_texel({lookup.u, lookup.v}, width);
    return texel(lookup.face, face.ulog2, face.vlog2, static_cast<uint32_t>(at.u), static_cast<uint32_t>(at.v));
  }
  if (face.flags & cache::kFaceNeighbourhoodIsConstant) return texel(lookup.face, 0, 0, 0, 0);
  return is_quad ? quad_value(lookup) : triangle_value(lookup);
}

// ---- quads ----

std::vector<double> PtexFilter::quad_value(const PtexLookup& l) {
  const FaceInfo& face = file_.faces()[l.face];
  const bool is_subface = face.is_subface();
  // A subface is filtered as a quarter of a face twice as large.
  const float scale = is_subface ? 0.5f : 1;
  const uint32_t more = is_subface ? 1 : 0;
  const float blur = is_subface ? 2 * l.blur : l.blur;
  const float u_width = (std::fabs(l.u_width1) + std::fabs(l.u_width2)) * l.width + blur;
  const float v_width = (std::fabs(l.v_width1) + std::fabs(l.v_width2)) * l.width + blur;
  Axis u = quad_axis(l.kind, std::clamp(l.u, 0.0f, 1.0f) * scale, u_width * scale, face.ulog2 + more, l.lerp);
  Axis v = quad_axis(l.kind, std::clamp(l.v, 0.0f, 1.0f) * scale, v_width * scale, face.vlog2 + more, l.lerp);
  // A texel as large as a face would lie half on one subface and half on the other.
  const bool subdivided = has_subfaces(file_.faces());
  if (subdivided && u.is_larger_than_a_subface()) u.refine();
  if (subdivided && v.is_larger_than_a_subface()) v.refine();
  const Grid grid{u.log2 - static_cast<int>(more), v.log2 - static_cast<int>(more)};
  for (size_t i = 0; i < u.weights.size(); ++i)
    for (size_t j = 0; j < v.weights.size(); ++j) {
      const FacePlace middle{std::ldexp(static_cast<float>(u.first + static_cast<int>(i)) + 0.5f, -grid.ulog2),
                             std::ldexp(static_cast<float>(v.first + static_cast<int>(j)) + 0.5f, -grid.vlog2)};
      const double weight = u.weights[i] * v.weights[j];
      if (weight != 0) add_quad_texel(l.face, middle, grid, weight, l.no_edge_blend);
    }
  for (double& value : sum_) value /= weight_;
  return sum_;
}

void PtexFilter::add_quad_texel(uint32_t face, FacePlace place, Grid grid, double weight, bool no_edge_blend) {
  for (int step = 0; step < 8; ++step) {
    const FaceInfo& info = file_.faces()[face];
    uint32_t crossed = 4, crossed_count = 0;
    for (const uint32_t edge : {0u, 2u, 1u, 3u}) {
      if (outside(place, edge) <= 0) continue;
      if (no_edge_blend || info.adjacent_faces[edge] == cache::kNoFace) {
        const float inside = std::ldexp(0.5f, -(edge % 2 == 0 ? grid.vlog2 : grid.ulog2));
        (edge % 2 == 0 ? place.v : place.u) = edge == 0 || edge == 3 ? inside : 1 - inside;
        continue;
      }
      crossed = edge, ++crossed_count;
    }
    if (crossed_count == 0) {
      const int ulog2 = std::clamp(grid.ulog2, 0, int{info.ulog2}), vlog2 = std::clamp(grid.vlog2, 0, int{info.vlog2});
      return add(face, static_cast<uint32_t>(ulog2), static_cast<uint32_t>(vlog2),
                 static_cast<uint32_t>(std::ldexp(place.u, ulog2)), static_cast<uint32_t>(std::ldexp(place.v, vlog2)),
                 weight);
    }
    if (crossed_count == 2 && step == 0) {
      const uint32_t corner = place.u < 0 ? (place.v < 0 ? 0 : 3) : (place.v < 0 ? 1 : 2);
      if (!is_regular_corner(file_.faces(), face, corner)) {
        met_extraordinary_corner_ = true;
        return;
      }
    }
    const bool second_half = cache::along_edge(FaceShape::quad, place, crossed) >= 0.5f;
    const Neighbour to = neighbour_across(file_.faces(), face, crossed, second_half);
    place = place_across(FaceShape::quad, place, crossed, info.is_subface(), to);
    if ((crossed ^ to.edge) & 1) std::swap(grid.ulog2, grid.vlog2);
    if (to.part >= 0) grid.ulog2 += info.is_subface() ? 1 : -1, grid.vlog2 += info.is_subface() ? 1 : -1;
    face = to.face;
  }
}

// ---- triangles: an elliptical Gaussian (Heckbert 1989, section 3.5.8), cut off at 3.5 widths ----

// a (u-u0)^2 + b (u-u0)(v-v0) + c (v-v0)^2 <= ac - b^2/4, within bounds of each barycentric coordinate.
struct PtexFilter::Ellipse {
  int log2;
  double center[3];  // barycentric: w, u, v
  double low[3], high[3];
  double a, b, c;  // in u and v

  // The same seen from the triangle across `edge`.
  [[nodiscard]] Ellipse across(uint32_t edge, uint32_t to_edge) const;
};

PtexFilter::Ellipse PtexFilter::Ellipse::across(uint32_t edge, uint32_t to_edge) const {
  Ellipse there = *this;
  const uint32_t begin = edge, end = (edge + 1) % 3, opposite = (edge + 2) % 3;
  const auto put = [&](uint32_t to, uint32_t from, double one) {
    there.center[to] = one - center[from], there.low[to] = one - high[from], there.high[to] = one - low[from];
  };
  put(to_edge, begin, 1), put((to_edge + 1) % 3, end, 1), put((to_edge + 2) % 3, opposite, 0);
  // The quadratic form over (w, u, v) with w = -u - v for differences: q = p0 dw^2 + p1 du^2 + p2 dv^2.
  const double p[3] = {b / 2, a - b / 2, c - b / 2};
  double q[3];
  q[to_edge] = p[begin], q[(to_edge + 1) % 3] = p[end], q[(to_edge + 2) % 3] = p[opposite];
  there.a = q[1] + q[0], there.b = 2 * q[0], there.c = q[2] + q[0];
  return there;
}

std::vector<double> PtexFilter::triangle_value(const PtexLookup& l) {
  const auto square = [](double x) { return x * x; };
  const double u1 = l.u_width1, v1 = l.v_width1, u2 = l.u_width2, v2 = l.v_width2;
  const double quarter = 0.25 * square(l.width);
  const double a = (v1 * v1 + v2 * v2) * quarter, b = -2 * (u1 * v1 + u2 * v2) * quarter,
               c = (u1 * u1 + u2 * u2) * quarter;
  // In the plane of an equilateral triangle; rounded up to an eccentricity of at most 15, and to a texel.
  double xx = 0.75 * a, xy = std::sqrt(3.0) / 2 * (b - a), yy = 0.25 * a - 0.5 * b + c;
  const double spread = std::sqrt(square(xx - yy) + square(xy));
  const double for_eccentricity = 0.5 * (226.0 / 224.0 * spread - (xx + yy));
  const double for_texel = square(0.5 / (1 << file_.faces()[l.face].ulog2));
  const double more = std::max({0.25 * square(l.blur), for_eccentricity, for_texel});
  xx += more, yy += more;
  const double minor_radius = std::sqrt(2 * (xx * yy - 0.25 * xy * xy) / (xx + yy + spread));
  const double scale = square(3.5);
  Ellipse e{};
  e.log2 = std::max(0, log2_for_width(static_cast<float>(2 * minor_radius)));
  e.a = 4.0 / 3 * xx * scale;
  e.b = (2 / std::sqrt(3.0) * xy + 4.0 / 3 * xx) * scale;
  e.c = (-0.25 * (4.0 / 3 * xx) + 0.5 * (2 / std::sqrt(3.0) * xy + 4.0 / 3 * xx) + yy) * scale;
  e.center[1] = std::clamp(l.u, 0.0f, 1.0f), e.center[2] = std::clamp(l.v, 0.0f, 1.0f);
  e.center[0] = 1 - e.center[1] - e.center[2];
  const double reach[3] = {e.a - e.b + e.c, e.c, e.a};
  for (int k = 0; k < 3; ++k) {
    const double r = std::min(std::sqrt(reach[k]), 1.0);
    e.low[k] = e.center[k] - r, e.high[k] = e.center[k] + r;
  }
  add_triangle(l.face, e, 0);
  for (double& value : sum_) value /= weight_;
  return sum_;
}

// What reaches beyond an edge is given to the neighbour, the rest is summed up here.
void PtexFilter::add_triangle(uint32_t face, const Ellipse& whole, int depth) {
  const FaceInfo& info = file_.faces()[face];
  Ellipse e = whole;
  for (const uint32_t edge : {2u, 0u, 1u}) {
    const uint32_t opposite = (edge + 2) % 3;
    if (e.low[opposite] >= 0 || info.adjacent_faces[edge] == cache::kNoFace || depth == 12) continue;
    Ellipse beyond = e;
    e.low[opposite] = 0, beyond.high[opposite] = 0;
    add_triangle(info.adjacent_faces[edge], beyond.across(edge, info.adjacent_edge(edge)), depth + 1);
  }
  const auto log2 = static_cast<uint32_t>(std::min(e.log2, int{info.ulog2}));
  const int size = 1 << log2;
  const double limit = e.a * e.c - 0.25 * e.b * e.b;
  for (double& low : e.low) low = std::max(low, 0.0);
  const double high[3] = {std::min(e.high[0], 1 - e.low[1] - e.low[2]), std::min(e.high[1], 1 - e.low[2] - e.low[0]),
                          std::min(e.high[2], 1 - e.low[0] - e.low[1])};
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      const bool is_upper = i + j >= size;  // stored as the triangle of the cell (size-1-j, size-1-i)
      const double u = is_upper ? (size - j - 1.0 / 3) / size : (i + 1.0 / 3) / size;
      const double v = is_upper ? (size - i - 1.0 / 3) / size : (j + 1.0 / 3) / size;
      const double place[3] = {1 - u - v, u, v};
      bool inside = true;
      for (int k = 0; k < 3; ++k) inside = inside && place[k] >= e.low[k] && place[k] < high[k];
      if (!inside) continue;
      const double du = u - e.center[1], dv = v - e.center[2];
      const double q = (e.a * du * du + e.b * du * dv + e.c * dv * dv) / limit;
      if (q < 1)
        add(face, log2, log2, static_cast<uint32_t>(i), static_cast<uint32_t>(j),
            std::exp(-0.5 * 12.25 * q) / (size * size));
    }
}

}  // namespace spillway::test
