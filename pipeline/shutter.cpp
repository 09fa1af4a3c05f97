#include "pipeline/shutter.h"

namespace spillway::pipeline {

Shutter shutter_of(const SceneSettings& settings) {
  const double start = settings.motion.start_time, length = settings.motion.end_time - start;
  return {static_cast<float>((settings.camera.shutter_open - start) / length),
          static_cast<float>((settings.camera.shutter_close - start) / length)};
}

}  // namespace spillway::pipeline
