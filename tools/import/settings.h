#pragma once

// What stands before WorldBegin: camera, film, filter, sampler, integrator, options, as the scene's settings.

#include <optional>
#include <string>

#include "tools/import/params.h"
#include "tools/import/session.h"
#include "tools/import/tokens.h"
#include "tools/import/transform.h"

namespace spillway::tools {

// A directive that waits for WorldBegin: the camera needs the film's resolution, the film the camera's shutter.
struct Waiting {
  std::string type;
  ParamList params;
  Place place;
};

struct SceneOptions {
  std::optional<Waiting> camera, film, filter, sampler, integrator;
  Transform camera_from_world, camera_from_world_end;  // at the two times of `motion`
  pipeline::MotionSettings motion;
  uint32_t camera_medium = pipeline::kMediumUnsaid;  // that the camera stands in
  int32_t seed = 0;
  ColorSpace color_space = ColorSpace::srgb;  // at WorldBegin
};

// Option "name" value (options.cpp): mapped, or without meaning here, or a warning that says what is done.
Status read_option(Session& session, Tokenizer& tokens, const Token& directive, SceneOptions& options);

// pbrt's defaults for what is missing, which has its place at WorldBegin. The film's file name goes into the report.
Result<pipeline::SceneSettings> build_settings(Session& session, const SceneOptions& options, Place world_begin);

}  // namespace spillway::tools
