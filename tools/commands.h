#pragma once

// The sub-commands of the program. Each declares its options on `app`; what it returns is the exit code.

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <utility>

#include "cache/base/result.h"

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

// Thrown to CLI11: the text of an option makes no sense, which ends with kExitUsage.
[[noreturn]] void refuse_option(const std::string& name, const std::string& message);

// An option whose text `parse` (of sizes.h, say) makes `into` of, before anything else is done: a slip of the hand
// costs no packing.
template <class Value, class Into>
CLI::Option* add_parsed(CLI::App& command, const std::string& name, Into& into,
                        Result<Value> (*parse)(const std::string&), const std::string& what) {
  const auto read = [name, &into, parse](const std::string& text) {
    Result<Value> value = parse(text);
    if (!value) refuse_option(name, value.error().message);
    into = std::move(*value);
  };
  return command.add_option_function<std::string>(name, read, what);
}

// An option that takes one of some words. CLI11 itself would print the values behind them, bytes too.
template <class Value>
CLI::Option* add_choice(CLI::App& command, const std::string& name, Value& into,
                        const std::map<std::string, Value>& values, const std::string& what) {
  CLI::CheckedTransformer one_of(values);
  std::string words;
  for (const auto& [word, value] : values) words += (words.empty() ? "{" : ",") + word;
  one_of.description(words + "}");
  return command.add_option(name, into, what)->transform(one_of);
}

// `spillway: message` on stderr; returns the code.
int fail(const std::string& message, int code = kExitFailed);

}  // namespace spillway::tools
