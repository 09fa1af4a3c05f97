#include "pipeline/pack/make_motion.h"

#include <cmath>
#include <cstring>

#include "pipeline/check_motion.h"
#include "shading/trigonometry.h"

namespace spillway::pipeline {
namespace {

struct Matrix3 {
  double m[3][3];
};

Matrix3 product_with_transpose(const Matrix3& a, const Matrix3& b) {  // a b^T
  Matrix3 out{};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) out.m[i][j] += a.m[i][k] * b.m[j][k];
  return out;
}

Matrix3 transposed(const Matrix3& a) {
  Matrix3 out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.m[i][j] = a.m[j][i];
  return out;
}

Matrix3 cofactors(const Matrix3& a) {
  Matrix3 out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      out.m[i][j] = a.m[i1][j1] * a.m[i2][j2] - a.m[i1][j2] * a.m[i2][j1];
    }
  return out;
}

double determinant(const Matrix3& a) {
  const Matrix3 c = cofactors(a);
  return a.m[0][0] * c.m[0][0] + a.m[0][1] * c.m[0][1] + a.m[0][2] * c.m[0][2];
}

double norm(const Matrix3& a) {
  double sum = 0;
  for (const auto& row : a.m)
    for (const double x : row) sum += x * x;
  return std::sqrt(sum);
}

Matrix3 linear_part(const Affine3& a) {
  Matrix3 out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.m[i][j] = a.m[i][j];
  return out;
}

// The orthogonal matrix nearest to `a`, which is invertible: half the sum of it and its inverse transpose, again and
// again; quadratic once it is near, and the scale brings it there in a few steps however flat `a` is.
Matrix3 nearest_orthogonal(Matrix3 a) {
  constexpr int kMostSteps = 100;
  const double size = norm(a);
  for (auto& row : a.m)
    for (double& x : row) x /= size;
  for (int step = 0; step < kMostSteps; ++step) {
    Matrix3 inverse_transpose = cofactors(a);
    const double d = determinant(a);
    for (auto& row : inverse_transpose.m)
      for (double& x : row) x /= d;
    const double scale = std::sqrt(norm(inverse_transpose) / norm(a));
    double change = 0;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const double next = (a.m[i][j] * scale + inverse_transpose.m[i][j] / scale) / 2;
        change = std::max(change, std::fabs(next - a.m[i][j]));
        a.m[i][j] = next;
      }
    if (change < 1e-15) break;  // a few roundings
  }
  return a;
}

struct Parts {
  Matrix3 rotation, stretch;
};

Parts taken_apart(const Affine3& transform) {
  const Matrix3 linear = linear_part(transform);
  Parts parts{nearest_orthogonal(linear), {}};
  if (determinant(parts.rotation) < 0)
    for (auto& row : parts.rotation.m)
      for (double& x : row) x = -x;
  const Matrix3 stretch = product_with_transpose(transposed(parts.rotation), transposed(linear));
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) parts.stretch.m[i][j] = (stretch.m[i][j] + stretch.m[j][i]) / 2;
  return parts;
}

struct Quaternion {
  double v[3], w;
};

// Shepperd 1978: by the largest of the four, which no cancellation can touch.
Quaternion quaternion_of(const Matrix3& r) {
  const double trace = r.m[0][0] + r.m[1][1] + r.m[2][2];
  int largest = 0;
  for (int i = 1; i < 3; ++i)
    if (r.m[i][i] > r.m[largest][largest]) largest = i;
  Quaternion q{};
  if (trace > r.m[largest][largest]) {
    const double four_w = 2 * std::sqrt(1 + trace);
    q.w = four_w / 4;
    for (int i = 0; i < 3; ++i) q.v[i] = (r.m[(i + 2) % 3][(i + 1) % 3] - r.m[(i + 1) % 3][(i + 2) % 3]) / four_w;
    return q;
  }
  const int i = largest, j = (i + 1) % 3, k = (i + 2) % 3;
  const double four_v = 2 * std::sqrt(1 + r.m[i][i] - r.m[j][j] - r.m[k][k]);
  q.v[i] = four_v / 4;
  q.v[j] = (r.m[i][j] + r.m[j][i]) / four_v;
  q.v[k] = (r.m[i][k] + r.m[k][i]) / four_v;
  q.w = (r.m[k][j] - r.m[j][k]) / four_v;
  return q;
}

// By the shorter way round.
void set_turn(Motion& motion, Quaternion q) {
  if (q.w < 0) q = {{-q.v[0], -q.v[1], -q.v[2]}, -q.w};
  const double sine = std::sqrt(q.v[0] * q.v[0] + q.v[1] * q.v[1] + q.v[2] * q.v[2]);
  if (!(sine > 0)) return;
  const auto s = static_cast<float>(sine), c = static_cast<float>(q.w);
  const float half_angle_rad = s <= c ? shading::atan_of_ratio(s, c) : kPi / 2 - shading::atan_of_ratio(c, s);
  motion.turns = std::min(half_angle_rad / kPi, 0.5f);
  for (int i = 0; i < 3; ++i) motion.axis[i] = static_cast<float>(q.v[i] / sine);
}

void set_stretch(float (&out)[6], const Matrix3& s) {
  const double entries[6] = {s.m[0][0], s.m[1][1], s.m[2][2], s.m[1][2], s.m[0][2], s.m[0][1]};
  for (int i = 0; i < 6; ++i) out[i] = static_cast<float>(entries[i]);
}

bool same_linear_part(const Affine3& a, const Affine3& b) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (a.m[i][j] != b.m[i][j]) return false;
  return true;
}

}  // namespace

Result<Motion> make_motion(const Affine3& start, const Affine3& end) {
  Motion motion{};
  motion.key[0] = start, motion.key[1] = end;
  const double sides[2] = {determinant(linear_part(start)), determinant(linear_part(end))};
  for (const double side : sides)
    if (!std::isfinite(side) || side == 0) return error("its transform has no finite inverse");
  if ((sides[0] < 0) != (sides[1] < 0))
    return error("its transform mirrors at one end of its motion and not at the other: in between it would be flat");
  const Parts first = taken_apart(start), last = taken_apart(end);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) motion.rotation[i][j] = static_cast<float>(first.rotation.m[i][j]);
  set_stretch(motion.stretch[0], first.stretch), set_stretch(motion.stretch[1], last.stretch);
  motion.axis[0] = 1;
  if (!same_linear_part(start, end))
    set_turn(motion, quaternion_of(product_with_transpose(last.rotation, first.rotation)));
  SPILLWAY_TRY(check_motion(motion));
  return motion;
}

}  // namespace spillway::pipeline
