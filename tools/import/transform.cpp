#include "tools/import/transform.h"

#include <algorithm>
#include <cmath>

namespace spillway::tools {
namespace {

// Determinant over the product of the columns' lengths: 1 for any rotation times any scales, and below this the
// inverse has lost all but two of a double's sixteen digits.
constexpr double kSingular = 1e-14;

Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vec3 cross_of(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
double dot_of(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double length_of(Vec3 a) { return std::sqrt(dot_of(a, a)); }
Vec3 unit(Vec3 a) {
  const double length = length_of(a);
  return {a.x / length, a.y / length, a.z / length};
}
Vec3 column(const Transform& t, int c) { return {t.m[0][c], t.m[1][c], t.m[2][c]}; }

}  // namespace

Vec3 Transform::point(Vec3 p) const {
  const Vec3 v = vector(p);
  return {v.x + m[0][3], v.y + m[1][3], v.z + m[2][3]};
}

Vec3 Transform::vector(Vec3 v) const {
  return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
          m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
}

Vec3 Transform::transposed_vector(Vec3 n) const {
  return {m[0][0] * n.x + m[1][0] * n.y + m[2][0] * n.z, m[0][1] * n.x + m[1][1] * n.y + m[2][1] * n.z,
          m[0][2] * n.x + m[1][2] * n.y + m[2][2] * n.z};
}

double Transform::determinant() const {
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

bool Transform::is_invertible() const {
  for (const auto& row : m) {
    if (!std::all_of(std::begin(row), std::end(row), [](double x) { return std::isfinite(x); })) return false;
  }
  double volume = 1;
  for (int c = 0; c < 3; ++c) volume *= length_of(column(*this, c));
  return std::isfinite(volume) && std::fabs(determinant()) > kSingular * volume;
}

Transform Transform::inverse() const {
  const double scale = 1 / determinant();
  Transform inverse;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {  // the cofactor of (c, r)
      const int c1 = (c + 1) % 3, c2 = (c + 2) % 3, r1 = (r + 1) % 3, r2 = (r + 2) % 3;
      inverse.m[r][c] = (m[c1][r1] * m[c2][r2] - m[c1][r2] * m[c2][r1]) * scale;
    }
  }
  const Vec3 moved = inverse.vector(column(*this, 3));
  inverse.m[0][3] = -moved.x, inverse.m[1][3] = -moved.y, inverse.m[2][3] = -moved.z;
  return inverse;
}

Affine3 Transform::affine() const {
  Affine3 rounded;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) rounded.m[r][c] = static_cast<float>(m[r][c]);
  }
  return rounded;
}

bool Transform::keeps_angles() const {
  constexpr double kTolerance = 1e-5;
  const double size = dot_of(column(*this, 0), column(*this, 0));
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b <= a; ++b) {
      const double want = a == b ? size : 0;
      if (std::fabs(dot_of(column(*this, a), column(*this, b)) - want) > kTolerance * size) return false;
    }
  }
  return true;
}

Transform operator*(const Transform& a, const Transform& b) {
  Transform product;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) {
      product.m[r][c] =
          a.m[r][0] * b.m[0][c] + a.m[r][1] * b.m[1][c] + a.m[r][2] * b.m[2][c] + (c == 3 ? a.m[r][3] : 0);
    }
  }
  return product;
}

bool operator==(const Transform& a, const Transform& b) {
  return std::equal(&a.m[0][0], &a.m[0][0] + 12, &b.m[0][0]);
}

Transform translation(Vec3 offset) {
  Transform t;
  t.m[0][3] = offset.x, t.m[1][3] = offset.y, t.m[2][3] = offset.z;
  return t;
}

Transform scaling(Vec3 factors) {
  Transform t;
  t.m[0][0] = factors.x, t.m[1][1] = factors.y, t.m[2][2] = factors.z;
  return t;
}

std::optional<Transform> rotation(double angle_deg, Vec3 axis) {
  if (!(length_of(axis) > 0)) return std::nullopt;
  const Vec3 a = unit(axis);
  const double angle_rad = angle_deg * (M_PI / 180), s = std::sin(angle_rad), c = std::cos(angle_rad), d = 1 - c;
  Transform t;  // Rodrigues: c I + s [a]x + (1 - c) a a^T
  t.m[0][0] = c + d * a.x * a.x, t.m[0][1] = d * a.x * a.y - s * a.z, t.m[0][2] = d * a.x * a.z + s * a.y;
  t.m[1][0] = d * a.y * a.x + s * a.z, t.m[1][1] = c + d * a.y * a.y, t.m[1][2] = d * a.y * a.z - s * a.x;
  t.m[2][0] = d * a.z * a.x - s * a.y, t.m[2][1] = d * a.z * a.y + s * a.x, t.m[2][2] = c + d * a.z * a.z;
  return t;
}

std::optional<Transform> look_at(Vec3 eye, Vec3 target, Vec3 up) {
  const Vec3 view = target - eye;
  if (!(length_of(view) > 0) || !(length_of(up) > 0)) return std::nullopt;
  const Vec3 z = unit(view), side = cross_of(unit(up), z);
  if (!(length_of(side) > 0)) return std::nullopt;
  const Vec3 x = unit(side), y = cross_of(z, x);
  const Vec3 rows[3] = {x, y, z};
  Transform t;
  for (int r = 0; r < 3; ++r) {
    t.m[r][0] = rows[r].x, t.m[r][1] = rows[r].y, t.m[r][2] = rows[r].z;
    t.m[r][3] = -dot_of(rows[r], eye);
  }
  return t;
}

std::optional<Transform> from_columns(std::span<const double> numbers) {
  const double w = numbers[15];
  if (numbers[3] != 0 || numbers[7] != 0 || numbers[11] != 0 || w == 0) return std::nullopt;
  Transform t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) t.m[r][c] = numbers[static_cast<size_t>(4 * c + r)] / w;
  }
  return t;
}

}  // namespace spillway::tools
