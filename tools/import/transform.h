#pragma once

// Affine transforms in double precision, as the directives build them: column vectors, a = b * c applies c first.

#include <array>
#include <optional>
#include <span>

#include "cache/base/vec.h"

namespace spillway::tools {

struct Vec3 {
  double x, y, z;
};

struct Transform {
  double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};

  [[nodiscard]] Vec3 point(Vec3 p) const;
  [[nodiscard]] Vec3 vector(Vec3 v) const;
  // A normal, when *this is the inverse of the transform of points. Not normalised.
  [[nodiscard]] Vec3 transposed_vector(Vec3 n) const;
  [[nodiscard]] double determinant() const;
  // Finite, and not so flat that its inverse is rounding noise.
  [[nodiscard]] bool is_invertible() const;
  [[nodiscard]] Transform inverse() const;  // of an invertible one
  [[nodiscard]] Affine3 affine() const;
  // Angles survive: a rotation or mirroring times one scale, within one part in 1e5 (scenes print six digits).
  [[nodiscard]] bool keeps_angles() const;
};
[[nodiscard]] Transform operator*(const Transform& a, const Transform& b);
[[nodiscard]] bool operator==(const Transform& a, const Transform& b);

[[nodiscard]] Transform translation(Vec3 offset);
[[nodiscard]] Transform scaling(Vec3 factors);
// By the right-hand rule about the axis; none when the axis is zero.
[[nodiscard]] std::optional<Transform> rotation(double angle_deg, Vec3 axis);
// pbrt's LookAt: camera from world, where the camera looks along +z with y up and x to the right (left-handed).
// None when eye and target coincide, or up is parallel to the view.
[[nodiscard]] std::optional<Transform> look_at(Vec3 eye, Vec3 target, Vec3 up);
// Sixteen numbers, column by column as pbrt writes them. None when the last row is not (0, 0, 0, w != 0).
[[nodiscard]] std::optional<Transform> from_columns(std::span<const double> numbers);

}  // namespace spillway::tools
