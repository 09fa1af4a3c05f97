#pragma once

// When rays are shot. Time runs from 0 to 1 between the two keys of everything that moves.

#include <algorithm>

#include "pipeline/scene.h"
#include "shading/sampler.h"

namespace spillway::pipeline {

// In parts of the way between the keys, which may end before or begin after: what moves stands still outside of them.
struct Shutter {
  float open = 0, close = 0;  // both 0 where nothing moves
  [[nodiscard]] float earliest() const { return std::clamp(open, 0.0f, 1.0f); }
  [[nodiscard]] float latest() const { return std::clamp(close, 0.0f, 1.0f); }
};

// Of a scene in which something moves.
[[nodiscard]] Shutter shutter_of(const shading::Camera& camera, const MotionSettings& motion);
[[nodiscard]] inline Shutter shutter_of(const SceneSettings& settings) {
  return shutter_of(settings.camera, settings.motion);
}

// The time of a path and of all its shadow rays: a function of its key, so that no record holds it.
[[nodiscard]] inline float ray_time(const Shutter& shutter, const shading::SampleKey& key) {
  if (shutter.open == shutter.close) return shutter.earliest();
  const float u = shading::sample_2d(key, shading::kSlotTime).x;
  return std::clamp(shutter.open + u * (shutter.close - shutter.open), shutter.earliest(), shutter.latest());
}

}  // namespace spillway::pipeline
