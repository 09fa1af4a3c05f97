#pragma once

// The loop: one wave after the other, each a pass over the stages.

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/render/access_log.h"
#include "pipeline/render/film.h"
#include "pipeline/render/generate_rays.h"
#include "pipeline/render/pixel_costs.h"
#include "pipeline/render/plan.h"
#include "pipeline/render/render_report.h"
#include "pipeline/render/sort_rays.h"
#include "pipeline/render/trace_rays.h"
#include "pipeline/store.h"

namespace spillway::pipeline {

struct RenderProgress {
  double fraction = 0;         // of the samples asked for
  double elapsed_seconds = 0;
  uint32_t samples_per_pixel_done = 0;
};

struct RenderOptions {
  // Meaning: these change the image. Camera, filter, resolution, spp, depth and seed are the settings'.
  SceneSettings settings;
  bool aov_layers = false;           // depth, normal, albedo, ids

  // Performance: these must not.
  PlanOptions plan;                  // budget and shares
  bool sort_rays = true;             // off: rays are traced in the order they were made (ablation)
  bool sort_hits = true;             // off: hits are shaded in the order in which they arrive (ablation)
  uint32_t hit_batch_rays = 0;       // hits of so many rays are sorted together; 0: of the wave (ablation)
  bool turn_hits = true;             // off: where there are textures, every wave shades its hits in the order of the
                                     // file, not every other one against it (ablation)
  bool cost_layers = false;          // counts what each pixel costs, see pixel_costs.h
  bool read_ahead = true;            // off: a page is read when the sweep comes to it (ablation)
  bool resident_first = true;        // off: resident pages are swept in file order with the others (ablation)
  bool park_rays = true;             // off: every wave sweeps, however few of its rays wait for pages (ablation)
  bool page_tops = true;             // off: of a page that is not in memory only its box is known (ablation)
  bool top_up_waves = true;          // off: new paths begin when the last ones have ended (ablation)
  AccessLog* access_log = nullptr;   // what each wave needs and reads is added here; costs a walk a ray
  bool log_parked = false;           // rays are parked all the same: sweeps and reads are logged, needs are not
  uint64_t spill_block_bytes = 1 << 19;   // larger: longer requests, more buffer memory
  uint64_t hit_sort_bytes = 0;       // limit of the hit sort; 0: planned
  bool read_ahead_textures = true;   // of face textures: a batch's tiles, while the batch before is shaded
  bool direct_io = false;            // bypass the page cache for pages, attributes and face textures
  std::filesystem::path scratch_directory;  // empty: the system's temporary directory
  uint64_t scratch_limit_bytes = 0;  // 0: what the disk has

  double time_limit_seconds = 0;     // stops at the next epoch that leaves both halves whole; 0: none
  double error = 0;                  // stops at the epoch whose ErrorEstimate's bound is no more; 0: none. The samples
                                     // a pixel of the settings are then the most
  const std::atomic<bool>* stop = nullptr;  // the same, asked for from outside (Ctrl-C)
  std::function<void(const RenderProgress&)> on_progress;  // once a wave, on the calling thread
};

struct RenderedImage {
  std::unique_ptr<Film> film;
  std::unique_ptr<PixelCosts> costs;  // when they were asked for
  RenderReport report;
};

// What the plan needs to know of a store and a frame.
[[nodiscard]] SceneFacts scene_facts(const Store& store, const RenderOptions& options);
[[nodiscard]] FilmShape film_shape(const SceneSettings& settings, bool aov_layers);
[[nodiscard]] PixelWindow pixel_window(const SceneSettings& settings);
// What must agree for two films to be parts of one image: the store's contents and the settings that change pixels.
[[nodiscard]] FilmIdentity film_identity(const Store& store, const SceneSettings& settings);

// What makes a picture the one that was asked for, in the metadata of finished ones: the store's contents, all settings
// with the samples a pixel, layers, and what computed it. 16 digits.
[[nodiscard]] std::string frame_key(const Store& store, const RenderOptions& options);

// Renders one frame after the other. Owns what they share: open files, resident pages, attributes and textures.
// Threads: one caller; a frame takes the threads of the calling arena. Memory: as planned for the options' camera.
// Fails: open() as the plan and the files; a frame that fails leaves the next ones possible.
class RenderSession {
 public:
  static Result<RenderSession> open(const Store& store, const RenderOptions& options);
  RenderSession(RenderSession&&) noexcept;
  RenderSession& operator=(RenderSession&&) noexcept;
  ~RenderSession();

  // Of the options' resolution. The report counts from the frame's start; first reads are first in the session.
  Result<RenderedImage> render(const shading::Camera& camera, uint32_t camera_medium);

 private:
  struct State;
  explicit RenderSession(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// A session of one frame.
Result<RenderedImage> render_image(const Store& store, const RenderOptions& options);

}  // namespace spillway::pipeline
