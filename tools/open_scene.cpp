#include "tools/open_scene.h"

#include <unistd.h>

#include "pipeline/pack/scene_packer.h"
#include "pipeline/render/plan.h"
#include "pipeline/render/render_report.h"
#include "tools/import/import_pbrt.h"

namespace spillway::tools {
namespace {

using pipeline::Store;

// What the allocator, the task scheduler and the spool's lanes hold beside what packing plans with.
constexpr uint64_t kSlackBytes = 96 << 20;

// access() grants root everything, but a folder without any write bit was meant to stay as it is.
bool has_write_bit(const std::filesystem::path& folder) {
  using std::filesystem::perms;
  std::error_code code;
  const perms bits = std::filesystem::status(folder, code).permissions();
  return (bits & (perms::owner_write | perms::group_write | perms::others_write)) != perms::none;
}

bool is_scene(const std::filesystem::path& path) { return path.extension() == ".pbrt"; }

// Beside the scene; in the current directory when the scene's folder takes no files.
std::filesystem::path store_directory(const OpenSceneOptions& options) {
  if (!options.store_directory.empty()) return options.store_directory;
  std::filesystem::path store = options.scene;
  store.replace_extension(".store");
  const std::filesystem::path folder = store.has_parent_path() ? store.parent_path() : ".";
  return access(folder.c_str(), W_OK) == 0 && has_write_bit(folder) ? store : store.filename();
}

// A store without diced surfaces is as good for any length; without a wish, any length is.
bool is_diced_so(const Store& store, const OpenSceneOptions& options) {
  return options.edge_length_px == 0 || store.dicing() == nullptr || store.dicing()->edge_length_px == options.edge_length_px;
}

void tell_warnings(const ImportReport& report, bool quiet) {
  if (quiet) return;
  for (const std::string& warning : report.warnings) fmt::print(stderr, "spillway: warning: {}\n", warning);
  if (const uint64_t more = report.warning_count - report.warnings.size(); more > 0)
    fmt::print(stderr, "spillway: warning: {} more are not shown\n", more);
}

}  // namespace

Result<uint64_t> pack_limit_bytes(uint64_t process_bytes) {
  const uint64_t floor = pipeline::memory_floor_bytes() + kSlackBytes;
  if (process_bytes <= floor)
    return error("--memory {}: packing needs {} before anything is loaded; raise it", pipeline::bytes_text(process_bytes),
                 pipeline::bytes_text(floor));
  return process_bytes - floor;
}

Result<pipeline::PackReport> pack_scene(const OpenSceneOptions& options) {
  pipeline::PackOptions pack;
  pack.source_files = {options.scene};
  if (options.memory_bytes != 0) {
    SPILLWAY_ASSIGN(pack.memory_limit_bytes, pack_limit_bytes(options.memory_bytes));
  }
  if (options.edge_length_px > 0) pack.dice.edge_length_px = options.edge_length_px;
  pack.dice.cache_directory = options.dice_cache;
  SPILLWAY_ASSIGN(auto packer, pipeline::ScenePacker::create(store_directory(options), pack));
  ImportReport report;
  const Status imported = import_pbrt(options.scene, *packer, {.lenient = options.lenient}, report);
  tell_warnings(report, options.quiet);
  SPILLWAY_TRY(imported);
  SPILLWAY_TRY(packer->finish());
  if (!options.quiet)
    for (const std::string& note : packer->report().notes) fmt::print(stderr, "spillway: note: {}\n", note);
  return packer->report();
}

Result<Store> open_scene(const OpenSceneOptions& options) {
  std::error_code code;
  if (!std::filesystem::exists(options.scene, code)) return error("{}: there is no such scene or store", options.scene.string());
  if (!is_scene(options.scene)) return Store::open(options.scene);
  const std::filesystem::path directory = store_directory(options);
  if (!options.repack) {
    auto existing = Store::open(directory);
    if (existing && existing->is_current(std::vector{options.scene}) && is_diced_so(*existing, options)) return existing;
  }
  SPILLWAY_ASSIGN([[maybe_unused]] const pipeline::PackReport report, pack_scene(options));
  return Store::open(directory);
}

}  // namespace spillway::tools
