#pragma once

// From what a user names on the command line to an open store: a store as it is, a .pbrt scene packed when needed.

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/pack/pack_report.h"
#include "pipeline/store.h"

namespace spillway::tools {

struct OpenSceneOptions {
  std::filesystem::path scene;            // a .pbrt file or a store directory
  std::filesystem::path store_directory;  // where to pack; empty: beside the scene, extension .store,
                                          // or in the current directory when its folder takes no files
  uint64_t memory_bytes = 0;              // for packing, of the whole process; 0: two GiB beside what is loaded
  std::filesystem::path dice_cache;       // where diced surfaces are kept between packings; empty: nowhere
  float edge_length_px = 0;               // of diced surfaces, see DiceOptions; 0: the default
  bool lenient = false;                   // what can be ignored of the scene is a warning
  bool repack = false;                    // even when the store is current
  bool quiet = false;
};

// What of a budget for the whole process is left for packing. Fails when nothing is.
Result<uint64_t> pack_limit_bytes(uint64_t process_bytes);

// Imports and packs the .pbrt scene, whatever store is there.
Result<pipeline::PackReport> pack_scene(const OpenSceneOptions& options);

// Packs unless the store is there and newer than every file of the scene.
Result<pipeline::Store> open_scene(const OpenSceneOptions& options);

}  // namespace spillway::tools
