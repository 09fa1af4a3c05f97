#pragma once

namespace spillway::shading {

// 0 up to `low`, 1 from `high` on, a cubic that is level at both between them.
[[nodiscard]] inline float smoothstep(float low, float high, float x) {
  const float share = (x - low) / (high - low);
  const float t = share < 0 ? 0.0f : share > 1 ? 1.0f : share;
  return t * t * (3 - 2 * t);
}

}  // namespace spillway::shading
