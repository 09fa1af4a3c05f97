#include <fmt/ranges.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <memory>

#include "cache/base/parallel.h"
#include "tools/commands.h"
#include "tools/lab/write_lab.h"
#include "tools/open_scene.h"
#include "tools/set_resolution.h"
#include "tools/sizes.h"

namespace spillway::tools {
namespace {

std::atomic<bool> lab_stop_requested{false};
extern "C" void request_lab_stop(int) { lab_stop_requested = true; }

struct LabArguments {
  std::vector<std::filesystem::path> scenes;
  std::filesystem::path output, peers;
  lab::ExperimentOptions experiment;
  std::vector<std::string> axes = {"all"}, memory_limits;
  std::optional<Resolution> resolution;
  int max_depth = -1;
  uint32_t threads = 0;
  bool lenient = false, quiet = false;
  std::string command;
};

// What is wrong with the command line, before anything is packed or rendered.
Status check(LabArguments& a) {
  SPILLWAY_ASSIGN(a.experiment.axes, lab::chosen_axes(a.axes));
  for (const std::string& text : a.memory_limits) {
    SPILLWAY_ASSIGN(const uint64_t bytes, parse_bytes(text));
    a.experiment.memory_limits.push_back(bytes);
  }
  std::vector<uint32_t>& spps = a.experiment.spps;
  std::sort(spps.begin(), spps.end());
  spps.erase(std::unique(spps.begin(), spps.end()), spps.end());
  if (!a.experiment.reference_file.empty() && a.scenes.size() != 1)
    return error("--reference is of one scene; {} are named", a.scenes.size());
  return {};
}

// Stores of .pbrt scenes lie below the output, one for each edge length that is asked for.
lab::OpenStore opener(const LabArguments& a, size_t index) {
  return [&a, index](float edge_length_px) {
    OpenSceneOptions scene;
    scene.scene = a.scenes[index], scene.lenient = a.lenient, scene.quiet = true, scene.edge_length_px = edge_length_px;
    const std::string name = fmt::format("{}_{}", index, a.scenes[index].stem().string());
    scene.store_directory =
        a.output / "stores" / (edge_length_px > 0 ? fmt::format("{}_{}.store", name, edge_length_px) : name + ".store");
    return open_scene(scene);
  };
}

// Of all scenes, or of those that there was time for.
Result<std::vector<lab::SceneResult>> run_scenes(const LabArguments& a) {
  std::vector<lab::SceneResult> results;
  for (size_t i = 0; i < a.scenes.size() && !lab_stop_requested; ++i) {
    const bool can_pack = a.scenes[i].extension() == ".pbrt";
    SPILLWAY_ASSIGN(auto result,
                    lab::run_experiment(a.scenes[i].stem().string(), opener(a, i), can_pack, a.experiment));
    results.push_back(std::move(result));
  }
  return results;
}

std::string scene_list(std::span<const std::filesystem::path> scenes) {
  std::string list;
  for (const auto& scene : scenes) list += " " + scene.string();
  return list;
}

// Of a run that was stopped: its numbers, and the commands that measure the rest.
Result<int> end_unfinished(const LabArguments& a, std::span<const lab::SceneResult> results) {
  size_t renders = 0;
  for (const lab::SceneResult& scene : results) renders += scene.rows.size();
  if (renders > 0) SPILLWAY_TRY(lab::write_unfinished(a.output, results));
  std::string said = fmt::format("interrupted after {} renders: no page was written", renders);
  if (renders > 0) said += fmt::format("; {} and unfinished_summary.csv hold them",
                                       (a.output / "unfinished_results.csv").string());
  said += ". The rest, with the other options as they were:";
  const std::span<const std::filesystem::path> scenes = a.scenes;
  const std::string output = " -o " + a.output.string();
  const size_t done = results.size();
  if (done > 0 && !results.back().missing_axes.empty())
    said += fmt::format("\n  spillway lab{} --axis {}{}", scene_list(scenes.subspan(done - 1, 1)),
                        fmt::join(results.back().missing_axes, ","), output);
  if (done < scenes.size())
    said += fmt::format("\n  spillway lab{} --axis {}{}", scene_list(scenes.subspan(done)),
                        fmt::join(a.experiment.axes, ","), output);
  return fail(said, kExitInterrupted);
}

Result<int> run_lab(LabArguments& a) {
  SPILLWAY_ASSIGN(const lab::Peers peers, lab::load_peers(a.peers));
  std::error_code code;
  std::filesystem::create_directories(a.output / "stores", code);
  if (code) return error("-o {}: cannot be made: {}", a.output.string(), code.message());
  std::signal(SIGINT, request_lab_stop);
  std::signal(SIGTERM, request_lab_stop);
  a.experiment.stop = &lab_stop_requested;
  a.experiment.override_settings = [&a](pipeline::SceneSettings& settings) -> Status {
    if (a.resolution) set_resolution(settings, *a.resolution);
    if (a.max_depth >= 0) settings.render.max_depth = static_cast<uint32_t>(a.max_depth);
    return {};
  };
  if (!a.quiet) a.experiment.tell = [](const std::string& line) { fmt::print(stderr, "{}\n", line); };
  SPILLWAY_ASSIGN(const auto results, run_scenes(a));
  const auto is_whole = [](const lab::SceneResult& scene) { return scene.missing_axes.empty(); };
  if (results.size() < a.scenes.size() || !std::ranges::all_of(results, is_whole)) return end_unfinished(a, results);
  const int threads = a.threads ? static_cast<int>(a.threads) : tbb::this_task_arena::max_concurrency();
  SPILLWAY_TRY(
      lab::write_lab(a.output, {results, peers.rows, a.command, peers.remark, threads, a.experiment.seed_count}));
  if (!a.quiet) fmt::print(stderr, "{}\n", (a.output / "index.html").string());
  return lab::has_defect(results) ? kExitDifferent : kExitOk;
}

int run(LabArguments& arguments) {
  if (const Status usage = check(arguments); !usage) return fail(usage.error().message, kExitUsage);
  const int threads = arguments.threads ? static_cast<int>(arguments.threads) : tbb::this_task_arena::max_concurrency();
  const Result<int> code = on_threads(threads, [&] { return run_lab(arguments); });
  if (code) return *code;
  return fail(code.error().message, lab_stop_requested ? kExitInterrupted : kExitFailed);
}

}  // namespace

void add_lab_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("lab", "chart error against time, samples and bytes; one page of HTML");
  auto arguments = std::make_shared<LabArguments>();
  LabArguments& a = *arguments;
  command->add_option("scenes", a.scenes, "scenes or stores; none: the first section of the page alone");
  command->add_option("-o,--output", a.output, "a folder for index.html, the charts and the numbers")->required();
  command
      ->add_option("--axis", a.axes, fmt::format("what is compared, of {} [all]", fmt::join(lab::axis_names(), ", ")))
      ->delimiter(',');
  command->add_option("--spp", a.experiment.spps, "sample counts [1,4,16,64]")
      ->delimiter(',')
      ->check(CLI::Range(1u, 65536u));
  command->add_option("--seeds", a.experiment.seed_count, "independent pictures of each; bands want three or more [4]")
      ->check(CLI::Range(1u, 1000u));
  command->add_option("--reference-spp", a.experiment.reference_spp, "of our own references [1024]")
      ->check(CLI::Range(2u, 131072u));
  command->add_option("--reference", a.experiment.reference_file,
                      "a picture of another renderer instead, linear, of the same size");
  add_parsed(*command, "--resolution", a.resolution, parse_resolution, "WIDTHxHEIGHT [the scene's]");
  command->add_option("--max-depth", a.max_depth, "bounces [the scene's]")->check(CLI::Range(0, 10000));
  command->add_option("--memory-limits", a.memory_limits, "budgets of the axis memory, such as 256MiB,1GiB [planned]")
      ->delimiter(',');
  command->add_option("--peers", a.peers, "what bench/peers.py measured of other renderers");
  command->add_option("--threads", a.threads, "[all cores]")->check(CLI::Range(1u, 1024u));
  command->add_flag("--lenient", a.lenient, "warn about what can be ignored of a scene instead of refusing");
  command->add_flag("-q,--quiet", a.quiet, "errors only");
  command->callback([arguments, &app, &exit_code] {
    arguments->command = "spillway lab" + scene_list(arguments->scenes);
    exit_code = run(*arguments);
  });
}

}  // namespace spillway::tools
