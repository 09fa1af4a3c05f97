#pragma once

// Bounds of what moves, over a span of time.

#include "cache/base/motion.h"

namespace spillway::pipeline {

// Holds what `motion` makes of everything in `bounds` at every time in [first_time, last_time], as rays that are moved
// into the object see it. Between samples in time a point strays from the line between its places there by at most
// h^2/8 times the largest second derivative of its path (the error of linear interpolation), which is known in closed
// form: theta^2 |S p| + 2 theta |dS/dt p|, for a turn by theta and the stretch S.
[[nodiscard]] Bounds3 swept_bounds(const Motion& motion, float first_time, float last_time, const Bounds3& bounds);

}  // namespace spillway::pipeline
