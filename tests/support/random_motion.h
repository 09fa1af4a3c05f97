#pragma once

// Transforms for the tests of motion.

#include <cmath>

#include "cache/base/motion.h"
#include "tests/support/random.h"

namespace spillway::test {

// By the C library's sines: an independent answer.
inline Affine3 rotation_about(Float3 axis, double angle_rad) {
  const double s = std::sin(angle_rad), c = std::cos(angle_rad), d = 1 - c, x = axis.x, y = axis.y, z = axis.z;
  const double rows[3][3] = {{c + d * x * x, d * x * y - s * z, d * x * z + s * y},
                             {d * y * x + s * z, c + d * y * y, d * y * z - s * x},
                             {d * z * x - s * y, d * z * y + s * x, c + d * z * z}};
  Affine3 out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) out.m[i][j] = static_cast<float>(rows[i][j]);
  return out;
}

// Turned, stretched by 0.2 to 2 along three slanted axes, moved by up to 4; mirrored or not.
inline Affine3 random_affine(Random& random, bool mirrored) {
  const Affine3 first = rotation_about(normalize(random.point(1)), random.in(-3, 3));
  const Affine3 second = rotation_about(normalize(random.point(1)), random.in(-3, 3));
  const float stretch[3] = {random.in(0.2f, 2), random.in(0.2f, 2), random.in(0.2f, 2) * (mirrored ? -1.0f : 1.0f)};
  Affine3 out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out.m[i][j] = 0;
      for (int k = 0; k < 3; ++k) out.m[i][j] += first.m[i][k] * stretch[k] * second.m[k][j];
    }
    out.m[i][3] = random.in(-4, 4);
  }
  return out;
}

}  // namespace spillway::test
