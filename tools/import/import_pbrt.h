#pragma once

// Reads pbrt-v4 text scenes with PLY meshes, and says them to a scene sink.
//
// In: a .pbrt file and what it includes. Out: calls of the sink, children before what uses them: settings (at
// WorldBegin), images, textures and materials (when the first shape uses them), lights, objects, meshes, instances.
// finish() is left to the caller.
// Memory: one mesh (those that a few numbers describe have a limit in the options), and what has a name.
// Fails: `file:line:column: what, and what to do`; the sink has then heard a part of the scene and must be dropped.
// The text of a scene is a stranger's: no input may crash the importer or make it use memory out of proportion.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "cache/base/result.h"
#include "pipeline/pack/scene_sink.h"

namespace spillway::tools {

struct ImportOptions {
  bool lenient = false;  // unknown and unsupported things that can be left out become warnings
  // What one shape may take that a few numbers describe: a bilinearmesh, a loopsubdiv. Of memory.
  uint64_t most_diced_bytes = 1 << 30;
  // Instances of parts of objects that move by themselves: N parts and M instances are N x M of them in N + M lines.
  uint64_t most_moving_instances = 1 << 22;
};

inline constexpr size_t kMaxWarnings = 1000;  // kept; all are counted

struct ImportReport {
  std::vector<std::string> warnings;
  uint64_t warning_count = 0;
  uint64_t mesh_count = 0;
  uint64_t cage_count = 0;  // of subdivision surfaces
  uint64_t triangle_count = 0;  // as read, degenerate ones included
  uint64_t instance_count = 0;
  uint64_t light_count = 0;  // lights without a shape
  uint64_t image_count = 0;
};

Status import_pbrt(const std::filesystem::path& scene, pipeline::SceneSink& sink, const ImportOptions& options,
                   ImportReport& report);

}  // namespace spillway::tools
