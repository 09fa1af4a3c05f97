#include "pipeline/pack/light_bounds.h"

#include <algorithm>
#include <cmath>

#include "pipeline/pack/pack_page_tree.h"
#include "shading/trigonometry.h"

namespace spillway::pipeline {
namespace {

struct Double3 {
  double x = 0, y = 0, z = 0;
};
Double3 wide(Float3 v) { return {v.x, v.y, v.z}; }
double dot(Double3 a, Double3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

Float3 unit_or(Double3 v, Float3 otherwise) {
  const double size = std::sqrt(dot(v, v));
  if (!(size > 0) || !std::isfinite(size)) return otherwise;
  return {static_cast<float>(v.x / size), static_cast<float>(v.y / size), static_cast<float>(v.z / size)};
}

// Of a symmetric matrix, by Jacobi's rotations: the largest and the smallest eigenvalue.
struct Eigenvalues {
  double largest, smallest;
};
Eigenvalues eigenvalues(double (&a)[3][3]) {
  for (int sweep = 0; sweep < 16; ++sweep)
    for (int p = 0; p < 2; ++p)
      for (int q = p + 1; q < 3; ++q) {
        if (a[p][q] == 0) continue;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double t = std::copysign(1 / (std::fabs(theta) + std::sqrt(theta * theta + 1)), theta);
        const double c = 1 / std::sqrt(t * t + 1), s = t * c;
        for (int k = 0; k < 3; ++k) {
          const double kp = a[k][p], kq = a[k][q];
          a[k][p] = c * kp - s * kq, a[k][q] = s * kp + c * kq;
        }
        for (int k = 0; k < 3; ++k) {
          const double pk = a[p][k], qk = a[q][k];
          a[p][k] = c * pk - s * qk, a[q][k] = s * pk + c * qk;
        }
      }
  const auto [least, most] = std::minmax({a[0][0], a[1][1], a[2][2]});
  return {most, least};
}

// How much longer the transform makes one direction than another, at most.
double stretch_ratio(const Affine3& t) {
  double square[3][3] = {};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) square[i][j] += static_cast<double>(t.m[k][i]) * t.m[k][j];
  const Eigenvalues of = eigenvalues(square);
  return of.smallest > 0 ? std::sqrt(of.largest / of.smallest) : INFINITY;
}

// Cofactors: what areas, as vectors along their normals, are multiplied by; turned back where the transform mirrors, so
// that they point to the side that emits.
struct AreaTransform {
  Double3 row[3];
  explicit AreaTransform(const Affine3& t) {
    const auto m = [&](int i, int j) { return static_cast<double>(t.m[i][j]); };
    double c[3][3];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        c[i][j] = m(i1, j1) * m(i2, j2) - m(i1, j2) * m(i2, j1);
      }
    const double sign = m(0, 0) * c[0][0] + m(0, 1) * c[0][1] + m(0, 2) * c[0][2] < 0 ? -1 : 1;
    for (int i = 0; i < 3; ++i) row[i] = {sign * c[i][0], sign * c[i][1], sign * c[i][2]};
  }
  [[nodiscard]] Double3 operator()(Double3 n) const { return {dot(row[0], n), dot(row[1], n), dot(row[2], n)}; }
};

// The mean of the squared lengths that unit normals take on.
double mean_squared_stretch(const AreaTransform& area, const NormalMoments& m) {
  double sum = 0;
  for (const Double3& r : area.row)
    sum += r.x * r.x * m.xx + r.y * r.y * m.yy + r.z * r.z * m.zz +
           2 * (r.x * r.y * m.xy + r.x * r.z * m.xz + r.y * r.z * m.yz);
  return m.energy > 0 ? sum / m.energy : 0;
}

}  // namespace

double cosine_of_sum(double cos_a, double cos_b) {
  // The sum reaches a half turn where the cosines no longer add up to anything positive.
  if (cos_a + cos_b <= 0) return -1;
  const double sine_a = std::sqrt(std::max(0.0, 1 - cos_a * cos_a)),
               sine_b = std::sqrt(std::max(0.0, 1 - cos_b * cos_b));
  return cos_a * cos_b - sine_a * sine_b;
}

LightItem emitter_item(const shading::TriangleShape& shape, const shading::Emission& emission, uint32_t index) {
  LightItem item;
  for (const Float3 p : {shape.position, shape.position + shape.edge1, shape.position + shape.edge2}) item.box.grow(p);
  item.axis = unit_or(wide(cross(shape.edge1, shape.edge2)), {0, 0, 1});
  item.energy = shading::emitter_power(shape, emission) / shading::kPi;
  item.two_sided = emission.two_sided;
  item.child = shading::light_child(shading::LightChild::emitter, index);
  return item;
}

// A spot shines within its cone alone, a projection before itself; the half space around each normal of this one holds
// it.
LightItem light_item(const shading::Light& light, uint32_t index, float of_image) {
  LightItem item;
  item.box.grow(light.position);
  item.cos_cone = -1;
  if (light.kind == shading::LightKind::spot) {
    item.axis = light.edge1;
    // The angle of the spot less a quarter turn.
    item.cos_cone = light.cos_total >= 0 ? 1 : std::sqrt(1 - light.cos_total * light.cos_total);
  }
  if (light.kind == shading::LightKind::projection) item.axis = light.edge1, item.cos_cone = 1;
  item.energy = shading::light_power(light, 1, of_image) / shading::kPi;
  item.child = shading::light_child(shading::LightChild::light, index);
  return item;
}

LightItem bounds_of(std::span<const LightItem> items) {
  LightItem all;
  double energy = 0;
  Double3 mean;
  for (const LightItem& item : items) {
    all.box.grow(item.box);
    energy += item.energy;
    all.two_sided |= item.two_sided;
  }
  // To both sides: a normal and its opposite are the same.
  const auto turned = [&](const LightItem& item) {
    const Double3 axis = wide(item.axis);
    const double sign = all.two_sided && dot(axis, wide(items[0].axis)) < 0 ? -1 : 1;
    return Double3{sign * axis.x, sign * axis.y, sign * axis.z};
  };
  for (const LightItem& item : items) {
    const Double3 axis = turned(item);
    const double weight = energy > 0 ? item.energy / energy : 1;
    mean.x += weight * axis.x, mean.y += weight * axis.y, mean.z += weight * axis.z;
  }
  all.axis = unit_or(mean, items[0].axis);
  double least = 1;
  for (const LightItem& item : items)
    least = std::min(least, cosine_of_sum(std::clamp(dot(wide(all.axis), turned(item)), -1.0, 1.0), item.cos_cone));
  all.cos_cone = std::max(-1.0f, std::nextafter(static_cast<float>(least), -2.0f));
  all.energy = static_cast<float>(energy);
  return all;
}

void NormalMoments::add(const LightItem& item) {
  const Double3 n = wide(item.axis);
  const double e = item.energy;
  xx += e * n.x * n.x, xy += e * n.x * n.y, xz += e * n.x * n.z;
  yy += e * n.y * n.y, yz += e * n.y * n.z, zz += e * n.z * n.z;
  energy += e;
}

// A cone of half angle a becomes one within b of its axis' image, tan(b / 2) <= ratio tan(a / 2): Wielandt's inequality
// as generalised by Bauer and Householder 1960, for the angle and for what is left of a half turn.
LightItem instance_item(const LightItem& object, const NormalMoments& moments, const Affine3& world_from_object,
                        uint32_t instance) {
  LightItem item = object;
  item.child = shading::light_child(shading::LightChild::instance, instance);
  item.box = transformed_bounds(world_from_object, object.box);
  const AreaTransform area(world_from_object);
  item.axis = unit_or(area(wide(object.axis)), {0, 0, 1});
  item.energy = static_cast<float>(object.energy * std::sqrt(mean_squared_stretch(area, moments)));
  const double c = object.cos_cone;
  const double tangent_squared = c > -1 ? (1 - c) / (1 + c) : INFINITY;  // of half the angle
  const double ratio = stretch_ratio(world_from_object);
  const double stretched = tangent_squared == 0 ? 0 : tangent_squared * ratio * ratio;
  const double widened = std::isfinite(stretched) ? (1 - stretched) / (1 + stretched) : -1;
  item.cos_cone = static_cast<float>(std::max(-1.0, widened - 1e-6));  // roundings of the ratio
  return item;
}

}  // namespace spillway::pipeline
