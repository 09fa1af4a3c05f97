#include <tbb/task_arena.h>
#include <unistd.h>

#include <csignal>
#include <map>
#include <optional>

#include "cache/base/parallel.h"
#include "cache/trace_log.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/write_image.h"
#include "tools/commands.h"
#include "tools/method_names.h"
#include "tools/open_scene.h"
#include "tools/render_frames.h"
#include "tools/set_resolution.h"
#include "tools/sizes.h"
#include "tools/write_text.h"

namespace spillway::tools {
namespace {

using namespace pipeline;

std::atomic<bool> stop_requested{false};
extern "C" void request_stop(int) { stop_requested = true; }

// A pixel, under --error where --spp says no other.
constexpr uint32_t kMostSamplesToAnError = 1 << 16;

// What the command line said.
struct RenderArguments {
  OpenSceneOptions scene;
  std::string output, report, trace, scratch, spill = "auto";
  uint32_t spp = 0, seed = 0, threads = 0;
  int max_depth = -1, light_selection = -1, estimator = -1, texture_filter = -1, majorants = -1;
  uint64_t wave_paths = 0, parked_rays = 0;
  double time_limit = 0, error = 0;
  bool has_seed = false, independent = false, aovs = false, halves = false, costs = false, direct = false,
       no_sort_rays = false, no_sort_hits = false, no_turn_hits = false, no_roulette = false, json = false;
  bool no_read_ahead = false, no_resident_first = false, no_park = false, no_tops = false, no_top_up = false;
  uint32_t hit_batch = 0;
  std::string access_log;
  bool log_parked = false;
  RenderOptions options;  // the sizes
  std::optional<Resolution> resolution;
  std::optional<Crop> crop;
  std::vector<uint32_t> frames;  // none: the scene's own camera
};

// Options that do not go together, before anything is packed or opened.
Status check_usage(const RenderArguments& a) {
  if (a.frames.size() > 1) SPILLWAY_TRY(frame_path(a.output, 0));
  if (!a.frames.empty() && !a.access_log.empty()) return error("--access-log is of one frame; leave --frames out");
  return {};
}

Status override_settings(const RenderArguments& arguments, SceneSettings& settings) {
  // The scene's number is of pictures without a limit of their error: it would cut those with one short.
  if (arguments.error > 0) settings.render.samples_per_pixel = kMostSamplesToAnError;
  if (arguments.spp != 0) settings.render.samples_per_pixel = arguments.spp;
  if (arguments.max_depth >= 0) settings.render.max_depth = static_cast<uint32_t>(arguments.max_depth);
  if (arguments.has_seed) settings.render.seed = arguments.seed;
  if (arguments.independent) settings.render.sampler = shading::SamplerKind::independent;
  if (arguments.light_selection >= 0) settings.render.light_selection = static_cast<LightSelection>(arguments.light_selection);
  if (arguments.estimator >= 0) settings.render.estimator = static_cast<Estimator>(arguments.estimator);
  if (arguments.texture_filter >= 0)
    settings.render.texture_filter = static_cast<TextureFilter>(arguments.texture_filter);
  if (arguments.majorants >= 0) settings.render.majorants = static_cast<MajorantExtent>(arguments.majorants);
  if (arguments.no_roulette) settings.render.roulette = 0;
  if (arguments.resolution) set_resolution(settings, *arguments.resolution);
  if (arguments.crop) {
    const Crop& c = *arguments.crop;
    if (c.x1 > settings.camera.resolution_x_px || c.y1 > settings.camera.resolution_y_px)
      return error("--crop {},{},{},{}: the frame has {} x {} pixels", c.x0, c.y0, c.x1, c.y1,
                   settings.camera.resolution_x_px, settings.camera.resolution_y_px);
    settings.film.crop_x0 = c.x0, settings.film.crop_y0 = c.y0, settings.film.crop_x1 = c.x1, settings.film.crop_y1 = c.y1;
  }
  return {};
}

// The budget of the render binds packing too.
Result<Store> open_within(const RenderArguments& arguments) {
  OpenSceneOptions scene = arguments.scene;
  scene.memory_bytes = arguments.options.plan.memory_bytes;
  return open_scene(scene);
}

Result<RenderOptions> render_options(const RenderArguments& arguments, const Store& store) {
  RenderOptions options = arguments.options;
  options.settings = store.settings();
  SPILLWAY_TRY(override_settings(arguments, options.settings));
  options.aov_layers = arguments.aovs;
  options.cost_layers = arguments.costs;
  options.plan.wave_paths = arguments.wave_paths;
  options.plan.parked_rays = arguments.parked_rays;
  options.plan.spill = arguments.spill == "always" ? 1 : arguments.spill == "never" ? 0 : -1;
  options.sort_rays = !arguments.no_sort_rays;
  options.sort_hits = !arguments.no_sort_hits;
  options.hit_batch_rays = arguments.hit_batch;
  options.turn_hits = !arguments.no_turn_hits;
  options.read_ahead = !arguments.no_read_ahead;
  options.resident_first = !arguments.no_resident_first;
  options.park_rays = !arguments.no_park;
  options.page_tops = !arguments.no_tops;
  options.top_up_waves = !arguments.no_top_up;
  options.direct_io = arguments.direct;
  options.scratch_directory = arguments.scratch;
  options.time_limit_seconds = arguments.time_limit;
  options.error = arguments.error;
  options.stop = &stop_requested;
  return options;
}

// One line that is written over on a terminal; elsewhere a line every tenth of the way.
class Progress {
 public:
  explicit Progress(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO)) {}
  void show(const RenderProgress& p) {
    if (quiet_) return;
    const double left = p.fraction > 0 ? p.elapsed_seconds * (1 - p.fraction) / p.fraction : 0;
    const auto tenth = static_cast<int>(p.fraction * 10);
    if (terminal_ && p.elapsed_seconds - shown_at_ > 0.2) {
      fmt::print(stderr, "\r{:5.1f} %  {} done, {} left   ", 100 * p.fraction, duration_text(p.elapsed_seconds),
                 duration_text(left));
      shown_at_ = p.elapsed_seconds;
    } else if (!terminal_ && tenth > tenth_) {
      fmt::print(stderr, "{:3.0f} %, {} done, {} left\n", 100 * p.fraction, duration_text(p.elapsed_seconds),
                 duration_text(left));
    }
    tenth_ = tenth;
  }
  void end() const {
    if (!quiet_ && terminal_) fmt::print(stderr, "\r{:60}\r", "");
  }

 private:
  bool quiet_, terminal_;
  double shown_at_ = -1;
  int tenth_ = 0;
};

// The program's version and the channels that it adds are part of what a finished picture is.
std::string frame_key(const RenderArguments& arguments, const Store& store, const RenderOptions& options) {
  return fmt::format("{} {}{}{}", pipeline::frame_key(store, options), SPILLWAY_VERSION,
                     fmt::format("{}{}", arguments.halves ? " halves" : "", arguments.costs ? " costs" : ""),
                     arguments.error > 0 ? fmt::format(" error {:a}", arguments.error) : "");
}

Status write_picture(const RenderArguments& arguments, const Store& store, const RenderOptions& options,
                     const RenderedImage& image, const std::filesystem::path& output) {
  if (output.extension() == ".png") return write_png(*image.film, output);
  const ImageMetadata metadata{arguments.scene.scene.filename().string(), SPILLWAY_VERSION,
                               options.settings.render.max_depth, options.settings.render.seed,
                               image.report.epoch_count, frame_key(arguments, store, options),
                               name(image.report.ended_by)};
  return write_exr(*image.film, output, metadata, {.costs = image.costs.get(), .half_buffers = arguments.halves});
}

// Bad endings are known before the hours of rendering, not after.
Status check_output(const std::filesystem::path& output) {
  if (output.extension() != ".exr" && output.extension() != ".png")
    return error("-o {}: pictures are written as .exr or .png", output.string());
  const auto parent = output.parent_path();
  if (!parent.empty() && !std::filesystem::is_directory(parent))
    return error("-o {}: the folder {} does not exist", output.string(), parent.string());
  return {};
}

// The frames of --frames, one after the other.
Result<int> render_all_frames(const RenderArguments& arguments, const Store& store, RenderOptions options) {
  FrameBatch batch;
  batch.frames = arguments.frames;
  batch.output = arguments.output, batch.report = arguments.report;
  batch.json = arguments.json, batch.quiet = arguments.scene.quiet;
  batch.settings_of = [&](const FrameCamera& frame) -> Result<SceneSettings> {
    SceneSettings settings = store.settings();
    settings.camera = frame.camera, settings.render.camera_medium = frame.medium;
    SPILLWAY_TRY(override_settings(arguments, settings));
    return settings;
  };
  batch.key_of = [&](const RenderOptions& frame) { return frame_key(arguments, store, frame); };
  batch.write = [&](const RenderedImage& image, const RenderOptions& frame, const std::filesystem::path& output) {
    return write_picture(arguments, store, frame, image, output);
  };
  return render_frames(store, std::move(options), batch);
}

Status write_trace(const RenderArguments& arguments) {
  return arguments.trace.empty() ? Status{} : cache::trace_log_write(arguments.trace);
}

Result<int> render(const RenderArguments& arguments) {
  SPILLWAY_TRY(check_output(arguments.output));
  SPILLWAY_ASSIGN(const Store store, open_within(arguments));
  if (!arguments.trace.empty()) cache::trace_log_start();
  SPILLWAY_ASSIGN(RenderOptions options, render_options(arguments, store));
  std::signal(SIGINT, request_stop);
  std::signal(SIGTERM, request_stop);
  Progress progress(arguments.scene.quiet);
  options.on_progress = [&](const RenderProgress& p) { progress.show(p); };
  AccessLog access_log;
  if (!arguments.access_log.empty()) options.access_log = &access_log, options.log_parked = arguments.log_parked;
  if (!arguments.frames.empty()) {
    SPILLWAY_ASSIGN(const int code, render_all_frames(arguments, store, std::move(options)));
    SPILLWAY_TRY(write_trace(arguments));
    return code;
  }
  SPILLWAY_ASSIGN(const RenderedImage image, render_image(store, options));
  progress.end();
  SPILLWAY_TRY(write_picture(arguments, store, options, image, arguments.output));
  SPILLWAY_TRY(write_trace(arguments));
  if (options.access_log) SPILLWAY_TRY(access_log.write(arguments.access_log));
  const std::string json = report_json(image.report, store.directory().string());
  if (!arguments.report.empty()) SPILLWAY_TRY(write_text(arguments.report, json));
  if (arguments.json) fmt::print("{}\n", json);
  if (!arguments.json && !arguments.scene.quiet) fmt::print(stderr, "{}", report_table(image.report));
  if (const FilmFaults& faults = image.report.faults; faults.any()) {
    const uint32_t width = options.settings.camera.resolution_x_px;
    return fail(fmt::format("{}: {} contributions were not finite and {} out of range; they are missing from the picture; "
                            "the first at pixel ({}, {})",
                            arguments.output, faults.not_finite_count, faults.out_of_range_count, faults.sink % width,
                            faults.sink / width),
                kExitBadValues);
  }
  if (image.report.stopped_early() && stop_requested) {
    fail(fmt::format("interrupted: {} is whole with {} samples a pixel, the bits of --spp {}; another render begins anew",
                     arguments.output, image.report.samples_per_pixel, image.report.samples_per_pixel));
    return kExitInterrupted;
  }
  return kExitOk;
}

int run(const RenderArguments& arguments) {
  if (const Status usage = check_usage(arguments); !usage) return fail(usage.error().message, kExitUsage);
  const int threads = arguments.threads ? static_cast<int>(arguments.threads) : tbb::this_task_arena::max_concurrency();
  const Result<int> code = on_threads(threads, [&] { return render(arguments); });
  return code ? *code : fail(code.error().message);
}

void add_scene_options(CLI::App& command, RenderArguments& a) {
  OpenSceneOptions& scene = a.scene;
  command.add_option("scene", scene.scene, "a .pbrt scene (packed when needed) or a .store")->required();
  command.add_option("--store", scene.store_directory, "where to pack a .pbrt scene [beside it, or here]");
  add_parsed(command, "--memory", a.options.plan.memory_bytes, parse_bytes, "limit of the whole process, such as 2GiB [none]");
  command.add_option("--edge-length-px", scene.edge_length_px, "longest edge of diced surfaces on the picture, when packing [4]")
      ->check(positive());
  command.add_option("--dice-cache", scene.dice_cache, "directory that keeps diced surfaces for the next packing [none]");
  command.add_flag("--lenient", scene.lenient, "warn about what can be ignored instead of refusing");
  command.add_flag("--repack", scene.repack, "pack even when the store is current");
  command.add_flag("-q,--quiet", scene.quiet, "errors only");
}

template <class Method>
void add_method(CLI::App& command, const char* name, int& value, const std::map<std::string, Method>& names,
                const char* about) {
  std::map<std::string, int> numbers;
  for (const auto& [text, method] : names) numbers[text] = static_cast<int>(method);
  add_choice(command, name, value, numbers, about);
}

void add_meaning(CLI::App& command, RenderArguments& a) {
  command.add_option("--spp", a.spp, "samples a pixel [the scene's]")->check(CLI::Range(1u, 2 * kMaxHalfSamples));
  command.add_option("--max-depth", a.max_depth, "bounces [the scene's]")->check(CLI::Range(0, 10000));
  add_parsed(command, "--resolution", a.resolution, parse_resolution, "WIDTHxHEIGHT [the scene's]");
  add_parsed(command, "--crop", a.crop, parse_crop, "x0,y0,x1,y1 in pixels; the same bits as in the full frame");
  command.add_flag("--independent", a.independent, "independent samples, to measure the usual ones by: noisier");
  command.add_option_function<uint32_t>("--seed", [&a](uint32_t seed) { a.seed = seed, a.has_seed = true; },
                                        "another set of random numbers [the scene's]");
  add_method(command, "--light-selection", a.light_selection, kLightSelections,
             "how lights are chosen: noise differs [the scene's, or tree]");
  add_method(command, "--estimator", a.estimator, kEstimators,
             "what is sampled at a vertex: noise differs [mis-power]");
  add_method(command, "--texture-filter", a.texture_filter, kTextureFilters, "of all images alike [of-texture]");
  add_method(command, "--majorants", a.majorants, kMajorants,
             "what a bound of a medium's density is taken over [cell]");
  command.add_flag("--no-roulette", a.no_roulette, "follow dim paths to the last bounce");
  command.add_flag("--aov", a.aovs, "depth, normal, albedo and id layers");
  command.add_flag("--cost-layers", a.costs,
                   "layers of what each pixel cost: tree steps, pages waited for, lookups, tiles missed, scatterings, "
                   "rays; and the dearest meshes and textures in the report");
}

void add_performance(CLI::App& command, RenderArguments& a) {
  command.add_option("--threads", a.threads, "[all cores]")->check(CLI::Range(1u, 1024u));
  command.add_option("--scratch", a.scratch, "directory for spilled rays [the system's temporary directory]");
  add_parsed(command, "--scratch-limit", a.options.scratch_limit_bytes, parse_bytes,
             "most bytes to spill at a time [what the disk has]");
  command.add_option("--wave-paths", a.wave_paths, "paths a wave [planned]")->check(CLI::Range(1u, 1u << 28));
  command.add_option("--parked-rays", a.parked_rays, "rays of each kind that may wait for a sweep of pages [planned]")
      ->check(CLI::Range(1u, 1u << 28));
  const auto share = [&](const char* name, uint64_t& into, const char* what) {
    add_parsed(command, name, into, parse_bytes, std::string("memory for ") + what + " [planned]");
  };
  share("--page-share", a.options.plan.page_bytes, "geometry pages");
  share("--attribute-share", a.options.plan.attribute_bytes, "attribute blocks");
  share("--texture-share", a.options.plan.texture_bytes, "texture tiles");
  share("--volume-share", a.options.plan.volume_bytes, "bricks of volumes");
  share("--hit-sort-share", a.options.hit_sort_bytes, "sorting hits");
  command.add_option("--spill", a.spill, "auto, always or never [auto]")->check(CLI::IsMember({"auto", "always", "never"}));
  command.add_flag("--direct-io", a.direct, "read pages and attributes past the page cache");
  command.add_flag("--no-sort-rays", a.no_sort_rays, "trace rays in the order they were made");
  command.add_flag("--no-sort-hits", a.no_sort_hits, "shade hits in the order in which they arrive");
  command.add_option("--hit-batch", a.hit_batch, "sort the hits of so many rays together [of the wave]");
  command.add_flag("--no-turn-hits", a.no_turn_hits, "never shade sorted hits from the last to the first");
  command.add_flag("--no-read-ahead", a.no_read_ahead, "read a page when the sweep comes to it");
  command.add_flag("--no-resident-first", a.no_resident_first, "sweep resident pages with the others");
  command.add_flag("--no-page-tops", a.no_tops, "know the boxes alone of pages that are not in memory");
  command.add_flag("--no-park-rays", a.no_park, "sweep in every wave, however few of its rays wait for pages");
  command.add_flag("--no-top-up", a.no_top_up, "begin new paths when the last ones have ended");
}

}  // namespace

void add_render_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("render", "render a frame into an EXR");
  auto arguments = std::make_shared<RenderArguments>();
  RenderArguments& a = *arguments;
  add_scene_options(*command, a);
  command->add_option("-o,--output", a.output, "the EXR (or PNG, for a look); #### stands for the frame")->required();
  add_meaning(*command, a);
  add_parsed(*command, "--frames", a.frames, parse_frames,
             "frames of the scene's camera path, such as 1-48, 1-48x2 or 3,7; finished ones are skipped");
  command->add_flag("--half-buffers", a.halves, "write the two independent halves of the samples too");
  add_performance(*command, a);
  command->add_option("--time-limit", a.time_limit, "seconds; stops at the next whole epoch, equal to --spp k")
      ->check(positive());
  command->add_option("--error", a.error,
                      "stops at the first whole epoch whose relative error, the root of what compare calls relMSE, is "
                      "estimated to be below this with 95 %, equal to --spp k; --spp is then the most [65536]")
      ->check(fraction());
  command->add_option("--report", a.report, "write what the render did as JSON");
  command->add_option("--access-log", a.access_log,
                      "write which pages and tiles each wave needed and read, for `whatif`");
  command->add_flag("--log-parked", a.log_parked,
                    "park rays while the access log is written: it says what was read, and is not for `whatif`");
  command->add_option("--trace", a.trace, "write stages, waves and reads in Chrome's trace format");
  command->add_flag("--json", a.json, "print the report as JSON");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

namespace {

Status print_plan(const RenderArguments& arguments) {
  SPILLWAY_ASSIGN(const Store store, open_within(arguments));
  SPILLWAY_ASSIGN(const RenderOptions options, render_options(arguments, store));
  PlanOptions plan_options = options.plan;
  plan_options.floor_bytes = memory_floor_bytes();
  SPILLWAY_ASSIGN(const Plan plan, plan_render(scene_facts(store, options), plan_options));
  fmt::print("{}", describe(plan));
  return {};
}

}  // namespace

void add_plan_command(CLI::App& app, int& exit_code) {
  CLI::App* command = app.add_subcommand("plan", "show how a render would use its memory, without rendering");
  auto arguments = std::make_shared<RenderArguments>();
  add_scene_options(*command, *arguments);
  add_meaning(*command, *arguments);
  add_performance(*command, *arguments);
  command->callback([arguments, &exit_code] {
    const Status status = print_plan(*arguments);
    exit_code = status ? kExitOk : fail(status.error().message);
  });
}

}  // namespace spillway::tools
