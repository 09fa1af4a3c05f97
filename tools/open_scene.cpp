#include "tools/open_scene.h"

#include "pipeline/pack/scene_packer.h"
#include "tools/import/import_pbrt.h"

namespace spillway::tools {
namespace {

using pipeline::Store;

bool is_scene(const std::filesystem::path& path) { return path.extension() == ".pbrt"; }

std::filesystem::path store_beside(const OpenSceneOptions& options) {
  if (!options.store_directory.empty()) return options.store_directory;
  std::filesystem::path store = options.scene;
  return store.replace_extension(".store");
}

void tell_warnings(const ImportReport& report, bool quiet) {
  if (quiet) return;
  for (const std::string& warning : report.warnings) fmt::print(stderr, "spillway: warning: {}\n", warning);
}

}  // namespace

Status pack_scene(const OpenSceneOptions& options) {
  pipeline::PackOptions pack;
  pack.source_files = {options.scene};
  if (options.memory_bytes != 0) pack.memory_limit_bytes = options.memory_bytes;
  SPILLWAY_ASSIGN(auto packer, pipeline::ScenePacker::create(store_beside(options), pack));
  ImportReport report;
  const Status imported = import_pbrt(options.scene, *packer, {.lenient = options.lenient}, report);
  tell_warnings(report, options.quiet);
  SPILLWAY_TRY(imported);
  return packer->finish();
}

Result<Store> open_scene(const OpenSceneOptions& options) {
  std::error_code code;
  if (!std::filesystem::exists(options.scene, code)) return error("{}: there is no such scene or store", options.scene.string());
  if (!is_scene(options.scene)) return Store::open(options.scene);
  const std::filesystem::path directory = store_beside(options);
  if (!options.repack) {
    auto existing = Store::open(directory);
    if (existing && existing->is_current(std::vector{options.scene})) return existing;
  }
  SPILLWAY_TRY(pack_scene(options));
  return Store::open(directory);
}

}  // namespace spillway::tools
