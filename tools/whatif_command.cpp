#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/json_text.h"
#include "pipeline/render/render_report.h"
#include "pipeline/render/replay_access.h"
#include "tools/commands.h"
#include "tools/sizes.h"

namespace spillway::tools {
namespace {

using namespace pipeline;

struct WhatifArguments {
  std::filesystem::path log;
  std::vector<uint64_t> budgets;
  uint64_t read_rate_bytes = 0;  // a second
  bool json = false;
};

Result<std::vector<uint64_t>> parse_budgets(const std::string& text) {
  std::vector<uint64_t> budgets;
  for (size_t from = 0; from <= text.size();) {
    const size_t comma = std::min(text.find(',', from), text.size());
    SPILLWAY_ASSIGN(budgets.emplace_back(), parse_bytes(text.substr(from, comma - from)));
    from = comma + 1;
  }
  return budgets;
}

nlohmann::json replay_json(uint64_t budget, const Replay& r) {
  return {{"memory_bytes", budget},
          {"seconds", r.seconds},
          {"compute_seconds", r.compute_seconds},
          {"io_seconds", r.io_seconds},
          {"wave_paths", r.plan.wave_paths},
          {"waves", r.wave_count},
          {"page_sweeps", r.page_sweeps},
          {"parked_rays", r.parked_rays},
          {"waiting_rays", r.waiting_rays},
          {"spills", r.plan.spills},
          {"page_bytes", r.page_bytes},
          {"attribute_bytes", r.attribute_bytes},
          {"spill_bytes", r.spill_bytes},
          {"finer_than_log", r.finer_than_log}};
}

std::string replay_line(uint64_t budget, const Replay& r) {
  return fmt::format("{:>12} {:>10} {:>10} {:>7} {:>12} {:>12} {:>12}{}\n", bytes_text(budget),
                     duration_text(r.seconds), r.plan.wave_paths, r.wave_count, bytes_text(r.page_bytes),
                     bytes_text(r.attribute_bytes), bytes_text(r.spill_bytes),
                     r.finer_than_log ? "  waves smaller than the log's: at most this" : "");
}

// A budget that is too small is a line that says so: the others are worth knowing.
Status whatif(const WhatifArguments& arguments) {
  SPILLWAY_ASSIGN(const AccessLog log, AccessLog::read(arguments.log));
  ReplayRates rates;
  if (arguments.read_rate_bytes != 0) rates.disk_bytes_per_second = static_cast<double>(arguments.read_rate_bytes);
  nlohmann::json all = nlohmann::json::array();
  std::string table = fmt::format("{:>12} {:>10} {:>10} {:>7} {:>12} {:>12} {:>12}\n", "memory", "time", "wave",
                                  "waves", "pages", "attributes", "spilled");
  for (const uint64_t budget : arguments.budgets) {
    PlanOptions options;
    options.memory_bytes = budget, options.floor_bytes = memory_floor_bytes();
    const Result<Replay> replay = replay_access(log, options, rates);
    if (replay) all.push_back(replay_json(budget, *replay));
    if (!replay) all.push_back({{"memory_bytes", budget}, {"error", replay.error().message}});
    table +=
        replay ? replay_line(budget, *replay) : fmt::format("{:>12} {}\n", bytes_text(budget), replay.error().message);
  }
  fmt::print("{}", arguments.json ? json_text(all) + "\n" : table);
  return {};
}

}  // namespace

void add_whatif_command(CLI::App& app, int& exit_code) {
  CLI::App* command =
      app.add_subcommand("whatif", "what other budgets would have made of a render, from its access log");
  auto arguments = std::make_shared<WhatifArguments>();
  command->add_option("log", arguments->log, "written by render --access-log")->required();
  add_parsed(*command, "--memory", arguments->budgets, parse_budgets, "budgets, such as 1GiB,2GiB,8GiB")->required();
  add_parsed(*command, "--read-rate", arguments->read_rate_bytes, parse_bytes,
             "bytes a second that the disk reads, such as 2GiB [as it did for the log]");
  command->add_flag("--json", arguments->json, "for machines");
  command->callback([arguments, &exit_code] {
    const Status status = whatif(*arguments);
    exit_code = status ? kExitOk : fail(status.error().message);
  });
}

}  // namespace spillway::tools
