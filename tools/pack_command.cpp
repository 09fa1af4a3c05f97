#include <memory>

#include "tools/commands.h"
#include "tools/open_scene.h"
#include "tools/sizes.h"
#include "tools/write_text.h"

namespace spillway::tools {
namespace {

struct PackArguments {
  OpenSceneOptions scene;
  std::string report;
};

Status pack(const PackArguments& arguments) {
  SPILLWAY_ASSIGN(const pipeline::PackReport report, pack_scene(arguments.scene));
  if (!arguments.scene.quiet) fmt::print(stderr, "{}", report_table(report));
  return arguments.report.empty() ? Status{} : write_text(arguments.report, report_json(report));
}

}  // namespace

void add_pack_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("pack", "pack a .pbrt scene into a store");
  auto arguments = std::make_shared<PackArguments>();
  command->add_option("scene", arguments->scene.scene, "a .pbrt scene")->required();
  command->add_option("-o,--output", arguments->scene.store_directory, "the store's directory [beside the scene]");
  add_parsed(*command, "--memory", arguments->scene.memory_bytes, parse_bytes,
             "limit for packing, such as 1GiB [2GiB beside what is loaded]");
  command->add_option("--report", arguments->report, "write what each step cost as JSON");
  command->add_option("--edge-length-px", arguments->scene.edge_length_px, "longest edge of diced surfaces on the picture [4]")
      ->check(positive());
  command->add_option("--dice-cache", arguments->scene.dice_cache, "directory that keeps diced surfaces for the next packing [none]");
  command->add_flag("--lenient", arguments->scene.lenient, "warn about what can be ignored instead of refusing");
  command->add_flag("-q,--quiet", arguments->scene.quiet, "errors only");
  command->callback([arguments, &exit_code] {
    const Status status = pack(*arguments);
    exit_code = status ? kExitOk : fail(status.error().message);
  });
}

}  // namespace spillway::tools
