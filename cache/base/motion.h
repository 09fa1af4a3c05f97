#pragma once

// A transform that moves between two keys, as pbrt's do: translation along a straight line, rotation at a constant rate
// about one axis (slerp, Shoemake 1985), stretch entry by entry. Keys are taken apart at pack time (pipeline/pack/
// make_motion.h) by polar decomposition (Shoemake and Duff 1992, Matrix Animation and Polar Decomposition).

#include <type_traits>

#include "cache/base/vec.h"

namespace spillway {

struct Motion {
  Affine3 key[2];        // the transform at 0 and at 1
  float rotation[3][3];  // of key 0: proper
  float axis[3];         // unit; about it, by `turns`, the rotation of key 0 becomes that of key 1
  float turns;           // 0 to 1/2
  float stretch[2][6];   // xx, yy, zz, yz, xz, xy: symmetric, definite, of one sign in both keys (negative: mirrored)
};
static_assert(sizeof(Motion) == 196 && std::is_trivially_copyable_v<Motion>);

// The transform at `time`, 0 to 1; outside of that, of the nearer key. Keys are met exactly.
[[nodiscard]] Affine3 transform_at(const Motion& motion, float time);

// A transform and its inverse at one time.
struct Pose {
  Affine3 transform, inverse;
};
[[nodiscard]] Pose pose_at(const Motion& motion, float time);

// The inverse, computed in double; false when it is singular or not finite in 32 bits.
[[nodiscard]] bool invert(const Affine3& transform, Affine3& inverse);

}  // namespace spillway
