#include "pipeline/pack/surface_sample.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace spillway::pipeline {
namespace {

constexpr Float3 kZero{0, 0, 0};

Float3 rounded(const Double3& v) { return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}; }

// Zero where the surface has no tangent plane.
Float3 unit_normal(const Double3& a, const Double3& b) {
  const Double3 n{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  const double size = std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
  const double tangents = std::sqrt((a.x * a.x + a.y * a.y + a.z * a.z) * (b.x * b.x + b.y * b.y + b.z * b.z));
  // Below this a direction is made of roundings.
  if (!(size > 1e-10 * tangents) || !std::isfinite(size)) return kZero;
  return rounded({n.x / size, n.y / size, n.z / size});
}

// The normal there; as a little further inside where there is none; upwards where all is one point.
Float3 normal_at(const LimitFace& face, QuadPlace place, const LimitPoint& point) {
  Float3 normal = unit_normal(point.du, point.dv);
  if (normal == kZero) {
    const LimitPoint inside = face.at({place.quad, place.u + (0.5 - place.u) / 64, place.v + (0.5 - place.v) / 64});
    normal = unit_normal(inside.du, inside.dv);
  }
  return normal == kZero ? Float3{0, 0, 1} : normal;
}

struct BasePoint {
  LimitPoint limit;
  Float3 normal;
};

BasePoint base_point(const LimitFace& face, QuadPlace place) {
  const LimitPoint limit = face.at(place);
  return {limit, normal_at(face, place, limit)};
}

// Before and after a place along one parameter, `span` apart.
struct Neighbours {
  BasePoint before, after;
  double span;

  [[nodiscard]] float width() const {
    const Double3 &a = before.limit.p, &b = after.limit.p;
    return static_cast<float>(std::hypot(b.x - a.x, b.y - a.y, b.z - a.z) / span);
  }
  [[nodiscard]] float width_uv() const {
    const double *a = before.limit.uv, *b = after.limit.uv;
    return static_cast<float>(std::hypot(b[0] - a[0], b[1] - a[1]) / span);
  }
  // d/dt (p + h n): n' is at right angles to n, whatever differences say.
  [[nodiscard]] Double3 tangent(const Double3& dp, Float3 n, float height, float height_before, float height_after) const {
    Float3 dn = (after.normal - before.normal) * static_cast<float>(1 / span);
    dn = dn - n * dot(n, dn);
    const Float3 moved = dn * height + n * static_cast<float>((height_after - height_before) / span);
    return {dp.x + moved.x, dp.y + moved.y, dp.z + moved.z};
  }
};

Neighbours neighbours(const LimitFace& face, QuadPlace place, double step, double QuadPlace::* axis) {
  QuadPlace before = place, after = place;
  before.*axis = std::max(0.0, place.*axis - step), after.*axis = std::min(1.0, place.*axis + step);
  return {base_point(face, before), base_point(face, after), after.*axis - before.*axis};
}

HeightPlace height_place(const BasePoint& base, float width_uv, float width) {
  return {rounded(base.limit.p), base.normal,
          {static_cast<float>(base.limit.uv[0]), static_cast<float>(base.limit.uv[1])}, width_uv, width};
}

SurfaceSample undisplaced(const BasePoint& base) {
  return {rounded(base.limit.p), base.normal,
          {static_cast<float>(base.limit.uv[0]), static_cast<float>(base.limit.uv[1])}, 0, base.normal};
}

}  // namespace

SurfaceSample surface_sample(const LimitFace& face, QuadPlace place) { return undisplaced(base_point(face, place)); }

SurfaceSample displaced_sample(const LimitFace& face, QuadPlace place, double step, const HeightsAt& heights) {
  const BasePoint base = base_point(face, place);
  const Neighbours u = neighbours(face, place, step, &QuadPlace::u), v = neighbours(face, place, step, &QuadPlace::v);
  const auto piece = static_cast<float>(2 * step);
  const float width_uv = piece * std::max(u.width_uv(), v.width_uv()), width = piece * std::max(u.width(), v.width());
  std::array<HeightPlace, 5> places;
  const std::array points{&base, &u.before, &u.after, &v.before, &v.after};
  for (size_t i = 0; i < places.size(); ++i) places[i] = height_place(*points[i], width_uv, width);
  std::array<float, 5> h;
  heights(places, h);
  SurfaceSample sample = undisplaced(base);
  sample.height = h[0];
  const Float3 normal = unit_normal(u.tangent(base.limit.du, base.normal, h[0], h[1], h[2]),
                                    v.tangent(base.limit.dv, base.normal, h[0], h[3], h[4]));
  // Where the displaced surface folds over, the light still comes from outside.
  if (dot(normal, base.normal) > 0) sample.normal = normal;
  return sample;
}

}  // namespace spillway::pipeline
