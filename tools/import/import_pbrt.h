#pragma once

// Reads pbrt-v4 text scenes with PLY meshes, and says them to a scene sink.
//
// In: a .pbrt file and what it includes. Out: calls of the sink, children before what uses them: settings (at
// WorldBegin), images, textures and materials (when the first shape uses them), lights, objects, meshes, instances.
// finish() is left to the caller.
// Memory: one mesh, the emitting meshes of objects (both have limits in the options), and the named materials and textures.
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
};

inline constexpr size_t kMaxWarnings = 1000;  // kept; all are counted

struct ImportReport {
  std::vector<std::string> warnings;
  uint64_t warning_count = 0;
  uint64_t mesh_count = 0;
  uint64_t cage_count = 0;  // of subdivision surfaces
  uint64_t triangle_count = 0;  // as read, degenerate ones included
  uint64_t object_count = 0;
  uint64_t instance_count = 0;
  uint64_t light_count = 0;  // lights without a shape
  uint64_t image_count = 0;
  std::string film_file_name;  // what the scene would call its picture; may be empty
};

Status import_pbrt(const std::filesystem::path& scene, pipeline::SceneSink& sink, const ImportOptions& options,
                   ImportReport& report);

}  // namespace spillway::tools
