#include "cache/base/motion.h"

#include <cmath>

#include "cache/base/trigonometry.h"

namespace spillway {
namespace {

struct Matrix3 {
  double m[3][3];
};

Matrix3 operator*(const Matrix3& a, const Matrix3& b) {
  Matrix3 product;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) product.m[i][j] = a.m[i][0] * b.m[0][j] + a.m[i][1] * b.m[1][j] + a.m[i][2] * b.m[2][j];
  return product;
}

// Rodrigues' formula: c I + s [a]x + (1 - c) a a^T.
Matrix3 turn_about(const float (&axis)[3], SinCos turn) {
  const double x = axis[0], y = axis[1], z = axis[2], s = turn.sin, c = turn.cos, d = 1 - c;
  return {{{c + d * x * x, d * x * y - s * z, d * x * z + s * y},
           {d * y * x + s * z, c + d * y * y, d * y * z - s * x},
           {d * z * x - s * y, d * z * y + s * x, c + d * z * z}}};
}

double between(float a, float b, double time) { return (1 - time) * a + time * b; }

}  // namespace

// In double, rounded once: the transforms of still instances are no better.
Affine3 transform_at(const Motion& motion, float time) {
  if (!(time > 0)) return motion.key[0];
  if (time >= 1) return motion.key[1];
  Matrix3 rotation, stretch;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int entry = i == j ? i : 6 - i - j;
      rotation.m[i][j] = motion.rotation[i][j];
      stretch.m[i][j] = between(motion.stretch[0][entry], motion.stretch[1][entry], time);
    }
  if (motion.turns > 0) rotation = turn_about(motion.axis, sin_cos_turn(time * motion.turns)) * rotation;
  const Matrix3 linear = rotation * stretch;
  Affine3 out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) out.m[i][j] = static_cast<float>(linear.m[i][j]);
    out.m[i][3] = static_cast<float>(between(motion.key[0].m[i][3], motion.key[1].m[i][3], time));
  }
  return out;
}

Pose pose_at(const Motion& motion, float time) {
  Pose pose{transform_at(motion, time), {}};
  (void)invert(pose.transform, pose.inverse);  // pipeline/check_motion.h: there is one at every time
  return pose;
}

bool invert(const Affine3& transform, Affine3& inverse) {
  const auto m = [&](int i, int j) { return static_cast<double>(transform.m[i][j]); };
  double cofactor[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      cofactor[i][j] = m(i1, j1) * m(i2, j2) - m(i1, j2) * m(i2, j1);
    }
  const double determinant = m(0, 0) * cofactor[0][0] + m(0, 1) * cofactor[0][1] + m(0, 2) * cofactor[0][2];
  if (!std::isfinite(determinant) || determinant == 0) return false;
  bool finite = true;
  for (int i = 0; i < 3; ++i) {
    double translation = 0;
    for (int j = 0; j < 3; ++j) {
      const double value = cofactor[j][i] / determinant;
      inverse.m[i][j] = static_cast<float>(value);
      translation -= value * m(j, 3);
      finite = finite && std::isfinite(inverse.m[i][j]);
    }
    inverse.m[i][3] = static_cast<float>(translation);
    finite = finite && std::isfinite(inverse.m[i][3]);
  }
  return finite;
}

}  // namespace spillway
