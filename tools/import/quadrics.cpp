#include "tools/import/quadrics.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace spillway::tools {
namespace {

constexpr double kRadians = M_PI / 180;

// The fewest equal steps over an angle whose chords keep to kChordError.
uint32_t step_count(double angle) {
  const double step = 2 * std::acos(1 - kChordError);
  return std::max(1u, static_cast<uint32_t>(std::ceil(std::fabs(angle) / step)));
}

struct SurfacePoint {
  Float3 position, normal;
};
using Surface = std::function<SurfacePoint(double u, double v)>;

Float3 rounded(double x, double y, double z) {
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)};
}

// A grid over (u, v); triangles that have no area, as at a sphere's poles, are left out.
PlyMesh dice(uint32_t u_count, uint32_t v_count, const Surface& surface) {
  PlyMesh mesh;
  for (uint32_t j = 0; j <= v_count; ++j)
    for (uint32_t i = 0; i <= u_count; ++i) {
      const double u = static_cast<double>(i) / u_count, v = static_cast<double>(j) / v_count;
      const SurfacePoint point = surface(u, v);
      mesh.positions.push_back(point.position);
      mesh.normals.push_back(point.normal);
      mesh.uvs.push_back({static_cast<float>(u), static_cast<float>(v)});
    }
  const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
    const Float3 p = mesh.positions[a], q = mesh.positions[b], r = mesh.positions[c];
    if (p == q || q == r || r == p) return;
    mesh.indices.insert(mesh.indices.end(), {a, b, c});
  };
  const uint32_t row = u_count + 1;
  for (uint32_t j = 0; j < v_count; ++j)
    for (uint32_t i = 0; i < u_count; ++i) {
      const uint32_t corner = j * row + i;
      add(corner, corner + 1, corner + row + 1);
      add(corner, corner + row + 1, corner + row);
    }
  return mesh;
}

// The point of a circle at `angle` of `whole`; a closed circle ends exactly where it began.
struct Circle {
  double cosine, sine;
  Circle(double angle, double whole) {
    const bool closes = whole >= 2 * M_PI && angle >= whole;
    cosine = closes ? 1 : std::cos(angle), sine = closes ? 0 : std::sin(angle);
  }
};

struct Quadric {
  float radius = 1, z_min = -1, z_max = 1, phi_max = 360, height = 0, inner_radius = 0;
};

Result<Quadric> read_common(const ParamList& params, Place place) {
  Quadric q;
  SPILLWAY_ASSIGN(q.radius, params.real("radius", 1));
  SPILLWAY_ASSIGN(q.phi_max, params.real("phimax", 360));
  if (!(q.radius > 0)) return error_at(place, "\"radius\" is {}; it must be above zero", q.radius);
  q.phi_max = std::min(q.phi_max, 360.0f);
  if (!(q.phi_max > 0)) return error_at(place, "\"phimax\" is {}; it must be above zero", q.phi_max);
  return q;
}

Result<PlyMesh> dice_sphere(const ParamList& params, Place place) {
  SPILLWAY_ASSIGN(Quadric q, read_common(params, place));
  SPILLWAY_ASSIGN(q.z_min, params.real("zmin", -q.radius));
  SPILLWAY_ASSIGN(q.z_max, params.real("zmax", q.radius));
  const double r = q.radius, phi_max = q.phi_max * kRadians;
  const double low = std::clamp<double>(std::min(q.z_min, q.z_max), -r, r);
  const double high = std::clamp<double>(std::max(q.z_min, q.z_max), -r, r);
  if (!(low < high))
    return error_at(place, "\"zmin\" {} and \"zmax\" {} leave nothing of the sphere", q.z_min, q.z_max);
  const double theta_low = std::acos(low / r), theta_high = std::acos(high / r);
  return dice(step_count(phi_max), step_count(theta_low - theta_high), [=](double u, double v) {
    const double theta = theta_low + v * (theta_high - theta_low);
    const Circle phi(u * phi_max, phi_max);
    const bool is_pole = (v == 0 && low <= -r) || (v == 1 && high >= r);
    const double sine = is_pole ? 0 : std::sin(theta), cosine = std::cos(theta);
    const double x = sine * phi.cosine, y = sine * phi.sine;
    return SurfacePoint{rounded(r * x, r * y, r * cosine), rounded(x, y, cosine)};
  });
}

Result<PlyMesh> dice_cylinder(const ParamList& params, Place place) {
  SPILLWAY_ASSIGN(Quadric q, read_common(params, place));
  SPILLWAY_ASSIGN(q.z_min, params.real("zmin", -1));
  SPILLWAY_ASSIGN(q.z_max, params.real("zmax", 1));
  const double r = q.radius, phi_max = q.phi_max * kRadians;
  const double low = std::min(q.z_min, q.z_max), high = std::max(q.z_min, q.z_max);
  if (!(low < high)) return error_at(place, "\"zmin\" and \"zmax\" are both {}", q.z_min);
  return dice(step_count(phi_max), 1, [=](double u, double v) {
    const Circle phi(u * phi_max, phi_max);
    return SurfacePoint{rounded(r * phi.cosine, r * phi.sine, low + v * (high - low)),
                        rounded(phi.cosine, phi.sine, 0)};
  });
}

Result<PlyMesh> dice_disk(const ParamList& params, Place place) {
  SPILLWAY_ASSIGN(Quadric q, read_common(params, place));
  SPILLWAY_ASSIGN(q.height, params.real("height", 0));
  SPILLWAY_ASSIGN(q.inner_radius, params.real("innerradius", 0));
  if (!(q.inner_radius >= 0 && q.inner_radius < q.radius))
    return error_at(place, "\"innerradius\" is {}; it must be from 0 to below the radius {}", q.inner_radius, q.radius);
  const double r = q.radius, inner = q.inner_radius, phi_max = q.phi_max * kRadians;
  return dice(step_count(phi_max), 1, [=](double u, double v) {
    const Circle phi(u * phi_max, phi_max);
    const double at = r + v * (inner - r);
    return SurfacePoint{rounded(at * phi.cosine, at * phi.sine, q.height), {0, 0, 1}};
  });
}

}  // namespace

Result<PlyMesh> dice_quadric(const std::string& type, const ParamList& params, Place place) {
  if (type == "sphere") return dice_sphere(params, place);
  if (type == "cylinder") return dice_cylinder(params, place);
  return dice_disk(params, place);
}

}  // namespace spillway::tools
