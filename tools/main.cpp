#include <csignal>

#include "tools/commands.h"

int main(int argc, char** argv) {
  using namespace spillway::tools;
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond the limit is then an error like a full disk
  CLI::App app("Spillway renders frames whose geometry, textures, volumes and rays do not fit in memory.");
  app.require_subcommand(1);
  app.set_version_flag("--version", SPILLWAY_VERSION);
  int exit_code = kExitOk;
  add_render_command(app, exit_code);
  add_plan_command(app, exit_code);
  add_whatif_command(app, exit_code);
  add_pack_command(app, exit_code);
  add_city_command(app, exit_code);
  add_info_command(app, exit_code);
  add_compare_command(app, exit_code);
  add_convert_command(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? kExitOk : kExitUsage;
  }
  return exit_code;
}
