#include <tbb/task_arena.h>

#include <charconv>
#include <map>
#include <memory>

#include "cache/base/parallel.h"
#include "pipeline/pack/scene_packer.h"
#include "tools/city/city.h"
#include "tools/city/manifest.h"
#include "tools/city/pbrt_sink.h"
#include "tools/commands.h"
#include "tools/open_scene.h"
#include "tools/sizes.h"
#include "tools/write_text.h"

namespace spillway::tools {
namespace {

namespace fs = std::filesystem;
using city::City;
using city::CityOptions;

constexpr double kUsualTexels = 4;  // a metre

struct CityArguments {
  CityOptions city;
  fs::path output;
  std::string format = "pbrt", terrain = "full", frames, fog;
  uint64_t memory_bytes = 0;
  uint64_t street_lights = 0, trees = 0, cars = 0;
  float edge_length_px = pipeline::DiceOptions{}.edge_length_px;
  uint32_t threads = 0;
  bool dry_run = false, quiet = false;
};

Result<std::unique_ptr<pipeline::SceneSink>> make_sink(const CityArguments& a) {
  if (a.format == "pbrt") {
    SPILLWAY_ASSIGN(auto sink, city::PbrtSink::create(a.output, "city"));
    return std::unique_ptr<pipeline::SceneSink>(std::move(sink));
  }
  pipeline::PackOptions pack;
  pack.dice.edge_length_px = a.edge_length_px;
  if (a.memory_bytes != 0) {
    SPILLWAY_ASSIGN(pack.memory_limit_bytes, pack_limit_bytes(a.memory_bytes));
  }
  SPILLWAY_ASSIGN(auto packer, pipeline::ScenePacker::create(a.output / "city.store", pack));
  return std::unique_ptr<pipeline::SceneSink>(std::move(packer));
}

// Refuses what cannot fit before anything is written.
Status check_space(const City& plan, const fs::path& folder) {
  std::error_code code;
  const fs::space_info space = fs::space(folder, code);
  const uint64_t needed = plan.predicted_store_bytes() + plan.predicted_texture_bytes();
  if (code || space.available >= needed) return {};
  return error("{}: the disk has {:.2f} GiB left, the city takes about {:.2f}", folder.string(),
               static_cast<double>(space.available) / 0x1p30, static_cast<double>(needed) / 0x1p30);
}

Status write_city(const CityArguments& a, const City& plan) {
  std::error_code code;
  fs::create_directories(a.output, code);
  if (!fs::is_directory(a.output, code))
    return error("{}: cannot be made a directory; name another folder", a.output.string());
  if (a.format == "store") SPILLWAY_TRY(check_space(plan, a.output));  // of text nobody knows the size before
  fs::remove(a.output / "manifest.json", code);
  SPILLWAY_TRY(city::write_sky(a.output / "sky.exr", a.city.time));
  SPILLWAY_ASSIGN(const auto sink, make_sink(a));
  const fs::path air = a.output / "air.vdb";
  if (plan.has_air()) SPILLWAY_TRY(plan.write_air(air));
  SPILLWAY_TRY(plan.emit(*sink, a.output / "sky.exr", air));
  SPILLWAY_TRY(sink->finish());
  if (const auto* packer = dynamic_cast<const pipeline::ScenePacker*>(sink.get()); packer && !a.quiet)
    fmt::print(stderr, "{}", report_table(packer->report()));
  return write_text(a.output / "manifest.json", city::manifest_json(plan, a.city));
}

// "5" or "5-20".
Status read_frames(CityArguments& a) {
  if (a.frames.empty()) return {};
  if (a.city.camera != city::CameraKind::flight) return error("--frames {}: only --camera flight moves", a.frames);
  uint32_t& first = a.city.first_frame;
  uint32_t& last = a.city.last_frame;
  const char* const end = a.frames.data() + a.frames.size();
  std::from_chars_result read = std::from_chars(a.frames.data(), end, first);
  last = first;
  if (read.ec == std::errc() && read.ptr != end && *read.ptr == '-') read = std::from_chars(read.ptr + 1, end, last);
  if (read.ec != std::errc() || read.ptr != end || first < 1 || last < first || last > city::kFlightFrames)
    return error("--frames {}: write FIRST-LAST, from 1 to {}", a.frames, city::kFlightFrames);
  return {};
}

// "all", or some of fog, cloud and smoke.
Status read_fog(CityArguments& a) {
  city::AirKinds& air = a.city.air;
  std::string_view rest = a.fog;
  while (!rest.empty()) {
    const std::string_view kind = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), kind.size() + 1));
    if (kind == "all") air = {true, true, true};
    else if (kind == "fog") air.fog = true;
    else if (kind == "cloud") air.cloud = true;
    else if (kind == "smoke") air.smoke = true;
    else return error("--fog={}: write some of fog, cloud and smoke, separated by commas, or all", a.fog);
  }
  if (air.any() && a.city.tessellate)
    return error("--fog: a tessellated city is for renderers that read no .vdb files; leave out one of both");
  return {};
}

// What the command line alone tells.
Status check_usage(CityArguments& a, const CLI::App& command) {
  SPILLWAY_TRY(read_frames(a));
  SPILLWAY_TRY(read_fog(a));
  for (const char* option : {"--memory", "--edge-length-px"})
    if (a.format != "store" && command.count(option) > 0)
      return error("{}: is of --format store: text is written as it is made, and diced when it is packed", option);
  if (a.city.tessellate && a.city.texture_bytes > 0)
    return error("--textures: a tessellated city has none; leave out one of both");
  if (a.output.empty() && !a.dry_run) return error("-o is missing: name the folder for the city");
  return {};
}

Status make_city(CityArguments& a) {
  if (a.city.tessellate && !a.quiet && a.city.texels_per_metre > 0)
    fmt::print(stderr, "face textures are left out: other renderers have none of this kind\n");
  a.city.hills = a.terrain == "full" || a.terrain == "hills";
  a.city.bay = a.terrain == "full" || a.terrain == "bay";
  SPILLWAY_ASSIGN(const City plan, City::plan(a.city));
  if (!a.quiet) fmt::print(stderr, "{}", city::describe(plan));
  if (a.dry_run) {
    fmt::print("{}", city::manifest_json(plan, a.city));
    return {};
  }
  return write_city(a, plan);
}

int run(CityArguments& a, const CLI::App& command) {
  if (const Status usage = check_usage(a, command); !usage) return fail(usage.error().message, kExitUsage);
  const int threads = a.threads ? static_cast<int>(a.threads) : tbb::this_task_arena::max_concurrency();
  const Status status = on_threads(threads, [&] { return make_city(a); });
  return status ? kExitOk : fail(status.error().message);
}

void add_counts(CLI::App& command, CityArguments& a) {
  const auto count = [&](const char* name, std::optional<uint64_t>& into, const char* what) {
    command.add_option_function<uint64_t>(
        name, [&into](uint64_t given) { into = given; }, what);
  };
  count("--buildings", a.city.buildings, "[1000, or what --geometry takes]");
  count("--street-lights", a.city.street_lights, "lamps on kerbs [216 for 83 buildings, if there is room]");
  count("--trees", a.city.trees, "[on four fifths of the places]");
  count("--cars", a.city.cars, "parked [on 11 of 20 places]");
  command
      .add_option_function<double>(
          "--detail", [&a](double given) { a.city.detail_triangles = given; }, "mean triangles of a building [1900, or what --geometry takes]")
      ->check(CLI::Range(1.0, 1e6));
  command
      .add_option("--unique", a.city.unique, "share of buildings with geometry of their own; others are instances [1]")
      ->check(CLI::Range(0.0, 1.0));
  add_parsed(command, "--geometry", a.city.geometry_bytes, parse_bytes,
             "bytes of geometry in the store, such as 40GiB; the buildings, or their detail, follow");
  a.city.texels_per_metre = kUsualTexels;
  command
      .add_option("--texels-per-metre", a.city.texels_per_metre,
                  "of the face textures on buildings and streets; 0 leaves them out [4]")
      ->check(CLI::Range(0.0, 1024.0));
  add_parsed(command, "--textures", a.city.texture_bytes, parse_bytes,
             "bytes of face textures, such as 20GiB; texels-per-metre follows");
  command.add_option("--seed", a.city.seed, "another city [1]");
}

}  // namespace

void add_city_command(CLI::App& app, int& exit_code) {
  using city::CameraKind;
  using city::TimeOfDay;
  CLI::App* command = app.add_subcommand("city", "generate a city as a scene or a store");
  auto arguments = std::make_shared<CityArguments>();
  CityArguments& a = *arguments;
  command->add_option("-o,--output", a.output, "folder for the city");
  add_counts(*command, a);
  command->add_option("--terrain", a.terrain, "full, hills, bay or flat [full]")
      ->check(CLI::IsMember({"full", "hills", "bay", "flat"}));
  const std::map<std::string, TimeOfDay> times = {
      {"day", TimeOfDay::day}, {"dusk", TimeOfDay::dusk}, {"night", TimeOfDay::night}};
  add_choice(*command, "--time", a.city.time, times, "[day]");
  const std::map<std::string, CameraKind> cameras = {
      {"aerial", CameraKind::aerial}, {"street", CameraKind::street}, {"flight", CameraKind::flight}};
  add_choice(*command, "--camera", a.city.camera, cameras, "[aerial]");
  command->add_flag("--fog{all}", a.fog,
                    "fog, low cloud and smoke of chimneys, as air.vdb; --fog=fog,cloud,smoke: some of them");
  command->add_option("--fog-cells", a.city.air_cells, "samples of it along the city's radius; more: a larger file [160]")
      ->check(CLI::Range(8u, 320u));
  command->add_option("--frames", a.frames, "FIRST-LAST of the flight's 240 [1]");
  command->add_option("--format", a.format, "pbrt: text and PLY; store: packed [pbrt]")
      ->check(CLI::IsMember({"pbrt", "store"}));
  command->add_flag("--tessellate", a.city.tessellate, "domes, cars and trees as triangles: text that pbrt-v4 reads");
  command->add_option("--edge-length-px", a.edge_length_px, "of a store: longest edge of what is round, on the picture [4]")
      ->check(positive());
  add_parsed(*command, "--memory", a.memory_bytes, parse_bytes,
             "of a store: limit for packing, such as 1GiB [2GiB beside what is loaded]");
  command->add_option("--threads", a.threads, "[all cores]")->check(CLI::Range(1u, 1024u));
  command->add_flag("--dry-run", a.dry_run, "plan and count only; print the manifest");
  command->add_flag("-q,--quiet", a.quiet, "errors only");
  command->callback([arguments, command, &exit_code] { exit_code = run(*arguments, *command); });
}

}  // namespace spillway::tools
