#pragma once

// Numbers that are meant to lie in [0, 1].

namespace spillway {

// 0 for what is no number.
[[nodiscard]] inline float clamp_unit(float x) { return x > 0 ? (x < 1 ? x : 1.0f) : 0.0f; }

}  // namespace spillway
