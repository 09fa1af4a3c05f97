#include "pipeline/check_motion.h"

#include <cfloat>
#include <cmath>

namespace spillway::pipeline {
namespace {

// Parts are rounded to 32 bits, and sines are off by 2e-8; a hundred times that.
constexpr double kTolerance = 1e-5;
// Of the largest to the smallest stretch: beyond it the rounding of the parts is a sixteenth of the smallest.
constexpr double kLargestCondition = 1e6;
constexpr double kLargestNumber = 1e30;  // of a transform or its inverse

bool all_finite(const Motion& motion) {
  const float* const numbers = &motion.key[0].m[0][0];
  for (size_t i = 0; i < sizeof(Motion) / sizeof(float); ++i)
    if (!std::isfinite(numbers[i])) return false;
  return true;
}

bool is_rotation(const float (&r)[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const double sum = static_cast<double>(r[i][0]) * r[j][0] + static_cast<double>(r[i][1]) * r[j][1] +
                         static_cast<double>(r[i][2]) * r[j][2];
      if (std::fabs(sum - (i == j ? 1 : 0)) > kTolerance) return false;
    }
  return dot(cross({r[0][0], r[0][1], r[0][2]}, {r[1][0], r[1][1], r[1][2]}), {r[2][0], r[2][1], r[2][2]}) > 0;
}

// Frobenius norms of a stretch and of its inverse. The smallest eigenvalue is at least 1 / inverse.
struct Norms {
  double itself, inverse;
};

// By Sylvester's criterion; negated first when `sign` is negative. False when it is not definite.
bool definite(const float (&stretch)[6], double sign, Norms& norms) {
  const double xx = sign * stretch[0], yy = sign * stretch[1], zz = sign * stretch[2];
  const double yz = sign * stretch[3], xz = sign * stretch[4], xy = sign * stretch[5];
  const double minor = xx * yy - xy * xy;
  const double c[6] = {yy * zz - yz * yz, xx * zz - xz * xz, minor,
                       xy * xz - xx * yz, xy * yz - yy * xz, xz * yz - zz * xy};
  const double determinant = xx * c[0] + xy * c[5] + xz * c[4];
  if (!(xx > 0 && minor > 0 && determinant > 0)) return false;
  const auto frobenius = [](double a, double b, double d, double e, double f, double g) {
    return std::sqrt(a * a + b * b + d * d + 2 * (e * e + f * f + g * g));
  };
  norms = {frobenius(xx, yy, zz, yz, xz, xy), frobenius(c[0], c[1], c[2], c[3], c[4], c[5]) / determinant};
  return true;
}

// Of the parts, just beside a key, where the key itself is not asked.
bool meets_key(const Motion& motion, int key, double size) {
  const Affine3 beside = transform_at(motion, key == 0 ? FLT_MIN : 1 - FLT_EPSILON / 2);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (!(std::fabs(static_cast<double>(beside.m[i][j]) - motion.key[key].m[i][j]) <= kTolerance * size))
        return false;
  return true;
}

}  // namespace

Status check_motion(const Motion& motion) {
  if (!all_finite(motion)) return error("moves by numbers that are not finite");
  if (!is_rotation(motion.rotation)) return error("moves by what is no rotation");
  const double squared = length_squared({motion.axis[0], motion.axis[1], motion.axis[2]});
  if (!(std::fabs(squared - 1) <= kTolerance) || !(motion.turns >= 0 && motion.turns <= 0.5f))
    return error("turns about no axis, or by {} turns; 0 to 1/2 are possible", motion.turns);
  const double sign = motion.stretch[0][0] < 0 ? -1 : 1;
  for (int key = 0; key < 2; ++key) {
    Norms norms{};
    if (!definite(motion.stretch[key], sign, norms)) return error("is flat or mirrored at some time of its motion");
    if (!(norms.itself * norms.inverse <= kLargestCondition))
      return error("moves and is {} times as thin in one direction as in another; up to {} is possible",
                   norms.itself * norms.inverse, kLargestCondition);
    const Affine3& t = motion.key[key];
    const double far = 1 + max_abs({t.m[0][3], t.m[1][3], t.m[2][3]});
    if (!(norms.itself <= kLargestNumber && norms.inverse * far <= kLargestNumber))
      return error("moves by a transform whose inverse is too large for 32-bit floats");
    if (!meets_key(motion, key, norms.itself)) return error("moves by parts that do not make its keys");
  }
  return {};
}

}  // namespace spillway::pipeline
