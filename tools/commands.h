#pragma once

// The sub-commands of the program. Each declares its options on `app`; what it returns is the exit code.

#include <CLI/CLI.hpp>
#include <string>

namespace spillway::tools {

// Exit codes that scripts can use.
enum ExitCode {
  kExitOk = 0,
  kExitDifferent = 1,     // compare: the images differ
  kExitUsage = 2,         // the command line makes no sense
  kExitFailed = 3,        // bad input, disk full, budget too small: nothing was written
  kExitBadValues = 4,     // a picture was written, but contributions were not finite or out of range
  kExitInterrupted = 130  // Ctrl-C: the picture of the last whole epoch was written
};

void add_render_command(CLI::App& app, int& exit_code);
void add_plan_command(CLI::App& app, int& exit_code);
void add_whatif_command(CLI::App& app, int& exit_code);
void add_pack_command(CLI::App& app, int& exit_code);
void add_city_command(CLI::App& app, int& exit_code);
void add_info_command(CLI::App& app, int& exit_code);
void add_compare_command(CLI::App& app, int& exit_code);
void add_convert_command(CLI::App& app, int& exit_code);

// A finite number above 0: CLI::PositiveNumber takes nan.
[[nodiscard]] CLI::Validator positive();

// `spillway: message` on stderr; returns the code.
int fail(const std::string& message, int code = kExitFailed);

}  // namespace spillway::tools
