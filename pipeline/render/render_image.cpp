#include "pipeline/render/render_image.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "cache/base/check.h"
#include "cache/trace_log.h"
#include "pipeline/render/estimate_error.h"
#include "pipeline/render/render_state.h"
#include "pipeline/render/route_hits.h"
#include "pipeline/render/shade_hits.h"
#include "pipeline/render/stage_timer.h"
#include "pipeline/render/trace_wave.h"

namespace spillway::pipeline {
namespace {

cache::StreamOptions stream_options(RenderState& state, const char* what, MemoryTag tag, cache::IoPurpose purpose,
                                    uint64_t limit) {
  return {.what = what, .tag = tag, .purpose = purpose, .memory_limit_bytes = limit,
          .block_bytes = state.options.spill_block_bytes, .scratch = state.scratch.get()};
}

Wave make_wave(RenderState& state) {
  const auto options = [&](const char* what) {
    return stream_options(state, what, MemoryTag::paths, cache::IoPurpose::paths, state.plan.cold_bytes);
  };
  Wave wave{{{}, cache::RecordStream<PathRecord>(options("paths"))},
            {{{}, cache::RecordStream<ShadowRecord>(options("shadow rays"))}, {}}};
  if (!state.inputs.settings.lights.places.empty()) wave.shadows.ends.emplace(options("ends of shadow rays"));
  return wave;
}

// Empty columns with room for so many rays.
template <class Record>
void empty(RayColumns<Record>& columns, size_t capacity) {
  columns.hot.grow(MemoryTag::rays, capacity);
  columns.hot.set_size(0);
  columns.cold.clear();
}

void empty_shadows(ShadowColumns& shadows, size_t capacity) {
  empty(shadows, capacity);
  if (shadows.ends) shadows.ends->clear();
}

class RenderLoop {
 public:
  RenderLoop(RenderState& state, RenderReport& report)
      : state_(state),
        report_(report),
        settings_(state.options.settings),
        camera_rays_(settings_.camera, settings_.filter, pixel_window(settings_), settings_.render.seed,
                     settings_.render.sampler, ray_times(state.store, settings_), settings_.film.exposure_scale,
                     settings_.render.camera_medium),
        schedule_({settings_.render.samples_per_pixel, state.plan.epoch_samples, state.plan.first_epoch_samples,
                   state.options.error > 0}),
        tracer_(state, report),
        hits_(stream_options(state, "hits", MemoryTag::hits, cache::IoPurpose::hits, state.plan.hit_bytes)) {}

  Status run() {
    start_ = Clock::now();
    Wave wave = make_wave(state_);
    empty(wave.paths, state_.plan.wave_paths);
    empty_shadows(wave.shadows, 0);
    report_.has_media = !state_.media.tables.media.empty();
    report_.camera_medium = settings_.render.camera_medium;
    while (true) {
      const cache::TraceSpan span("wave", "wave");
      WaveReport wave_report;
      const double generated_before = report_.generate_seconds;
      if (tracer_.lot_is_full()) SPILLWAY_TRY(sweep_lot(wave_report));
      SPILLWAY_TRY(top_up(wave, wave_report));
      if (wave.empty() && !tracer_.parked().empty()) {
        SPILLWAY_TRY(sweep_lot(wave_report));
        SPILLWAY_TRY(top_up(wave, wave_report));
      }
      if (wave.empty()) break;
      begin_log();
      SPILLWAY_TRY(advance(wave, wave_report));
      end_log(wave_report, report_.generate_seconds - generated_before);
      report_.waves.push_back(wave_report);
      close_epochs();
      stop_at_error();
      stop_when_asked();
      tell_progress();
      log_counters();
    }
    SPILLWAY_CHECK(schedule_.finished(), ==, true);
    report_.half_samples = schedule_.closed_samples();
    report_.samples_per_pixel = report_.half_samples[0] + report_.half_samples[1];
    report_.epoch_count = schedule_.closed_epoch_count();
    report_.error_asked = state_.options.error;
    report_.error = estimate_error(*state_.film);
    report_.seconds = seconds_since(start_);
    return {};
  }

 private:
  // An entry of its own in a log.
  Status sweep_lot(WaveReport& report) {
    begin_log();
    SPILLWAY_TRY(tracer_.sweep_lot(report));
    AccessLog* const log = state_.options.access_log;
    if (log != nullptr && log->tiles.is_open()) SPILLWAY_TRY(log->tiles.append({}));
    end_log({}, 0);
    return {};
  }

  // Fills the wave: parked rays that were traced come back, and camera paths of the open epochs, opening the next one
  // where there is none.
  Status top_up(Wave& wave, WaveReport& report) {
    const StageTimer timer("generate_rays", report_.generate_seconds);
    const bool waits = !state_.options.top_up_waves && !wave.empty();
    const size_t most = state_.plan.wave_paths - tracer_.choose_returning(wave);
    while (!waits && wave.paths.hot.size() < most) {
      if (camera_rays_.exhausted()) {
        const std::optional<Epoch> epoch = schedule_.open_next();
        if (!epoch) break;
        camera_rays_.begin(*epoch);
        generating_half_ = epoch->half;
      }
      SPILLWAY_TRY(generate_batch(wave, most, report));
    }
    return tracer_.begin(wave);
  }

  Status generate_batch(Wave& wave, size_t most, WaveReport& report) {
    const size_t at = wave.paths.hot.size();
    const size_t room = std::min<size_t>(most - at, generated_.size());
    const size_t made = camera_rays_.generate_rays(room, wave.paths.hot.data() + at, generated_.data());
    wave.paths.hot.set_size(at + made);
    report.generated_count += made;
    constexpr size_t kPiece = 1024;  // copied by a thread
    std::vector<cache::RecordSpan> pieces;
    for (size_t first = 0; first < made; first += kPiece)
      pieces.push_back({generated_.data() + first, std::min(kPiece, made - first)});
    return wave.paths.cold.append(pieces);
  }

  // One bounce: sort, trace, route, shade. The rays of the wave become the rays of the next, in the same buffers: once
  // routed, a ray lives on in its hit.
  Status advance(Wave& wave, WaveReport& report) {
    report.path_count = wave.paths.hot.size(), report.shadow_count = wave.shadows.hot.size();
    SPILLWAY_TRY(wave.paths.cold.finish());
    SPILLWAY_TRY(wave.shadows.cold.finish());
    if (wave.shadows.ends) SPILLWAY_TRY(wave.shadows.ends->finish());
    cache::ExternalSort<HitRecord>& hits = hits_;
    hits.clear();
    // While rays are traced nothing is in the sort: what comes back from scratch to be routed waits there. A path takes
    // a hit's room when it was read.
    if (auto& cold = wave.paths.cold; cold.spilled_bytes() > 0)
      cold.read_ahead(hits.lend(report.path_count + 2 * cold.records_per_block()), sizeof(HitRecord));
    state_.inputs.hits_descend = turns_hits() && report_.waves.size() % 2 == 1;
    SPILLWAY_TRY(tracer_.trace(wave, report));
    SPILLWAY_TRY(log_wave(wave, report));
    if (report_.has_media) SPILLWAY_TRY(track_wave(wave, report));
    SPILLWAY_TRY(route_wave(wave, hits, report));
    report.spilled_bytes += wave.paths.cold.spilled_bytes() + wave.shadows.cold.spilled_bytes();
    if (wave.shadows.ends) report.spilled_bytes += wave.shadows.ends->spilled_bytes();
    empty(wave.paths, std::max<size_t>(hits.size(), state_.plan.wave_paths));
    empty_shadows(wave.shadows, std::max<size_t>(hits.size(), tracer_.parked().empty() ? 0 : state_.plan.wave_paths));
    SPILLWAY_TRY(shade_wave(wave, hits, report));
    report.spilled_bytes += hits.spilled_bytes();
    report_.spilled_bytes += report.spilled_bytes;
    state_.attributes->parts().rebalance();
    return {};
  }

  Status shade_wave(Wave& wave, cache::ExternalSort<HitRecord>& hits, WaveReport& report) {
    const StageTimer timer("shade_hits", report.shade_seconds);
    SPILLWAY_TRY(hits.finish());
    const ShadeHitsReport before = report_.shade;
    cache::TextureCounters textures_before;
    if (state_.textures) state_.textures->begin_wave(), textures_before = state_.textures->counters();
    SPILLWAY_TRY(shade_hits(state_.inputs, hits, *state_.attributes, *state_.film, wave.paths, wave.shadows,
                            shade_scratch_, report_.shade));
    if (state_.textures) report.textures = gained(state_.textures->counters(), textures_before);
    if (state_.costs && state_.textures) state_.costs->add_tiles_missed(state_.textures->wave_tiles().touched_bits);
    AccessLog* const log = state_.options.access_log;
    if (log != nullptr && state_.textures) SPILLWAY_TRY(log->tiles.append(state_.textures->wave_tiles()));
    report.partition_count = report_.shade.partition_count - before.partition_count;
    for (const int half : {0, 1}) live_[half] = report_.shade.rays_of_half[half] - before.rays_of_half[half];
    return {};
  }

  // Tiles leave memory in about the order in which they were used. A wave that goes through the file as the last one did
  // asks for each of them after it has left; one that turns back begins with those that are there.
  [[nodiscard]] bool turns_hits() const {
    const RenderOptions& o = state_.options;
    return o.turn_hits && o.sort_hits && o.hit_batch_rays == 0 && state_.textures != nullptr;
  }
  [[nodiscard]] HitOrder hit_order() const {
    return {state_.options.sort_hits, state_.options.hit_batch_rays, state_.inputs.hits_descend};
  }

  // Only in scenes that have media: elsewhere there are no results, and nothing looks for them.
  Status track_wave(const Wave& wave, WaveReport& report) {
    const StageTimer timer("track_media", report.track_seconds);
    TrackMediaOptions options;
    options.run_limit_bytes = state_.plan.run_bytes;
    TrackMediaReport tracked;
    const TraceBatch rays = tracer_.batch(wave);
    SPILLWAY_TRY(track_media(state_.media, {rays.path_rays, rays.path_hits, &wave.paths.cold},
                             {rays.shadow_rays, rays.shadow_hits, &wave.shadows.cold}, options, track_scratch_, tracked));
    report_.track += tracked;
    if (state_.volumes) state_.volumes->parts().rebalance();
    return {};
  }

  Status route_wave(Wave& wave, cache::ExternalSort<HitRecord>& hits, WaveReport& report) {
    const StageTimer timer("route_hits", report.route_seconds);
    SPILLWAY_TRY(route_hits(state_.inputs.settings, tracer_.traced_paths(wave, track_scratch_.path_results),
                            tracer_.traced_shadows(wave, track_scratch_.shadow_results), hits, *state_.film, route_scratch_,
                            report_.route, hit_order(), state_.costs.get()));
    if (state_.plan.gives_back) tracer_.give_back();
    return {};
  }

  // Path rays from the camera were added last.
  Status log_wave(const Wave& wave, const WaveReport& report) {
    if (!state_.needs) return {};
    const StageTimer timer("log_needs", report_.log_seconds);
    return state_.needs->log_wave(*state_.pages, tracer_.batch(wave), wave.paths.cold, wave.shadows.cold,
                                  wave.paths.hot.size() - report.generated_count);
  }

  void begin_log() {
    if (AccessLog* log = state_.options.access_log) {
      log->begin_wave();
      shade_scratch_.touched_blocks = &log->wave().attribute_blocks;
      page_wait_ = state_.page_parts->counters().wait_seconds;
      attribute_wait_ = state_.attributes->parts().counters().wait_seconds;
    }
  }

  void end_log(const WaveReport& wave, double generate_seconds) {
    AccessLog* log = state_.options.access_log;
    if (log == nullptr) return;
    log->end_wave({wave.path_count, wave.shadow_count, wave.generated_count, wave.spilled_bytes, generate_seconds,
                   wave.sort_seconds, wave.trace_seconds, wave.route_seconds, wave.shade_seconds,
                   state_.page_parts->counters().wait_seconds - page_wait_,
                   state_.attributes->parts().counters().wait_seconds - attribute_wait_});
  }

  // An epoch is over when all its camera rays were made and none of its rays is on its way.
  void close_epochs() {
    for (const uint32_t half : {0u, 1u}) {
      const bool generated = camera_rays_.exhausted() || generating_half_ != half;
      if (!schedule_.is_open(half) || !generated || live_[half] != 0 || tracer_.parked().any_of_half(half)) continue;
      schedule_.close(half);
      state_.film->set_half_samples(static_cast<int>(half), schedule_.closed_samples()[half]);
    }
  }

  // Looks at the picture whenever its halves are whole and equal.
  void stop_at_error() {
    const double asked = state_.options.error;
    if (asked <= 0 || report_.ended_by != RenderEnd::samples || !schedule_.halves_are_equal()) return;
    const std::optional<ErrorEstimate> estimate = estimate_error(*state_.film);
    const double bound = estimate->relative_error_bound(), samples = schedule_.closed_samples()[0] * 2.0;
    expected_samples_ = samples * std::max(1.0, (bound / asked) * (bound / asked));  // it falls as 1 / sqrt at least
    if (bound > asked) return;
    schedule_.stop_early();
    report_.ended_by = RenderEnd::error;
  }

  void stop_when_asked() {
    if (report_.ended_by != RenderEnd::samples) return;
    const double limit = state_.options.time_limit_seconds;
    const bool out_of_time = limit > 0 && seconds_since(start_) >= limit;
    const bool is_stopped = state_.options.stop && state_.options.stop->load();
    if (!out_of_time && !is_stopped) return;
    schedule_.stop_early();
    report_.ended_by = is_stopped ? RenderEnd::stop : RenderEnd::time;
  }

  void tell_progress() {
    generated_total_ += report_.waves.back().generated_count;
    if (!state_.options.on_progress) return;
    const auto done = schedule_.closed_samples();
    const auto target = schedule_.target_samples();
    const double samples = std::min<double>(target[0] + target[1], expected_samples_);
    const double wanted = static_cast<double>(pixel_window(settings_).pixel_count()) * samples;
    state_.options.on_progress(
        {std::min(1.0, static_cast<double>(generated_total_) / wanted), seconds_since(start_), done[0] + done[1]});
  }

  void log_counters() const {
    cache::trace_log_counter("path rays", report_.waves.back().path_count);
    cache::trace_log_counter("shadow rays", report_.waves.back().shadow_count);
    for (int i = 0; i < kMemoryTagCount; ++i) {
      const auto tag = static_cast<MemoryTag>(i);
      if (const MemoryUse use = memory_use(tag); use.peak_bytes != 0) cache::trace_log_counter(name(tag), use.current_bytes);
    }
  }

  RenderState& state_;
  RenderReport& report_;
  const SceneSettings& settings_;
  CameraRays camera_rays_;
  EpochSchedule schedule_;
  uint32_t generating_half_ = 0;
  uint64_t generated_total_ = 0;
  double expected_samples_ = INFINITY;  // a pixel, until the error that was asked for is reached
  std::array<uint64_t, 2> live_ = {0, 0};  // rays of each half's epoch on their way to the next wave
  Buffer<PathRecord> generated_{MemoryTag::paths, 1 << 14};
  WaveTracer tracer_;
  cache::ExternalSort<HitRecord> hits_;
  TrackMediaScratch track_scratch_;
  RouteHitsScratch route_scratch_;
  ShadeHitsScratch shade_scratch_;
  double page_wait_ = 0, attribute_wait_ = 0;  // when the wave began, for the log
  Clock::time_point start_;
};

}  // namespace

struct RenderSession::State {
  State(const Store& store, const RenderOptions& o) : options(o), render(store, options) {}
  RenderOptions options;
  RenderState render;
  bool used = false;
};

RenderSession::RenderSession(std::unique_ptr<State> state) : state_(std::move(state)) {}
RenderSession::RenderSession(RenderSession&&) noexcept = default;
RenderSession& RenderSession::operator=(RenderSession&&) noexcept = default;
RenderSession::~RenderSession() = default;

Result<RenderSession> RenderSession::open(const Store& store, const RenderOptions& options) {
  memory_reset_peaks();
  auto state = std::make_unique<State>(store, options);
  SPILLWAY_TRY(open_render_state(state->render));
  return RenderSession(std::move(state));
}

Result<RenderedImage> RenderSession::render(const shading::Camera& camera, uint32_t camera_medium) {
  SPILLWAY_CHECK(camera.resolution_x_px, ==, state_->options.settings.camera.resolution_x_px);
  SPILLWAY_CHECK(camera.resolution_y_px, ==, state_->options.settings.camera.resolution_y_px);
  if (std::exchange(state_->used, true)) memory_reset_peaks();
  state_->options.settings.camera = camera, state_->options.settings.render.camera_medium = camera_medium;
  RenderState& state = state_->render;
  state.inputs.settings.shutter = ray_times(state.store, state.options.settings).shutter;
  const CountersBefore before(state);
  SPILLWAY_TRY(open_film(state));
  RenderedImage image;
  if (state.costs && state.textures) state.textures->note_first_users(state.costs->first_users());
  const Status rendered = RenderLoop(state, image.report).run();
  if (state.textures) state.textures->note_first_users({});
  if (rendered) fill_report(state, before, image.report);
  if (rendered && state.options.access_log) SPILLWAY_TRY(fill_log(state, image.report));
  image.film = std::move(state.film), image.costs = std::move(state.costs);
  SPILLWAY_TRY(rendered);
  return image;
}

Result<RenderedImage> render_image(const Store& store, const RenderOptions& options) {
  SPILLWAY_ASSIGN(RenderSession session, RenderSession::open(store, options));
  return session.render(options.settings.camera, options.settings.render.camera_medium);
}

}  // namespace spillway::pipeline
