#pragma once

// Takes two transforms apart into what may be interpolated: translation, rotation, stretch.
//
// Based on: polar decomposition by Newton's iteration with scaling (Higham 1986, Computing the Polar Decomposition), as
// Shoemake and Duff 1992 animate matrices; a mirroring counts as a negative stretch, so that the rotation is proper.

#include "cache/base/motion.h"
#include "cache/base/result.h"

namespace spillway::pipeline {

// Fails when there is a time between the keys at which the transform has no usable inverse. The message is a predicate.
[[nodiscard]] Result<Motion> make_motion(const Affine3& start, const Affine3& end);

}  // namespace spillway::pipeline
