#pragma once

// What a motion must keep, so that the transform has an inverse at every time and nobody needs to look again.

#include "cache/base/motion.h"
#include "cache/base/result.h"

namespace spillway::pipeline {

// Finite numbers; a rotation, an axis, and stretches that are definite with one sign, of which every mixture is too;
// parts that make the keys. The message is a predicate of what moves.
[[nodiscard]] Status check_motion(const Motion& motion);

}  // namespace spillway::pipeline
