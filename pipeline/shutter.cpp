#include "pipeline/shutter.h"

namespace spillway::pipeline {

Shutter shutter_of(const shading::Camera& camera, const MotionSettings& motion) {
  const double start = motion.start_time, length = motion.end_time - start;
  return {static_cast<float>((camera.shutter_open - start) / length),
          static_cast<float>((camera.shutter_close - start) / length)};
}

}  // namespace spillway::pipeline
