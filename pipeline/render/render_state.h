#pragma once

// What lives as long as the frames of one session: the plan, the caches it gives their shares, the tables of shading; and
// the film of the frame that is being rendered.
//
// Owns: the open store files, scratch, caches, film. Memory: as planned. Threads: opened and closed by one thread; what
// the stages may do at once with its parts, those say.

#include <array>
#include <memory>

#include "cache/file.h"
#include "cache/part_store.h"
#include "cache/texture_cache.h"
#include "pipeline/evaluate_texture.h"
#include "pipeline/render/attribute_store.h"
#include "pipeline/render/film.h"
#include "pipeline/render/log_needs.h"
#include "pipeline/render/plan.h"
#include "pipeline/render/render_image.h"
#include "pipeline/render/render_report.h"
#include "pipeline/render/resolve_material.h"
#include "pipeline/render/shade_hits.h"
#include "pipeline/render/select_lights.h"
#include "pipeline/render/select_tables.h"
#include "pipeline/render/trace_rays.h"
#include "pipeline/render/track_media.h"

namespace spillway::pipeline {

struct RenderState {
  RenderState(const Store& s, const RenderOptions& o) : store(s), options(o) {}

  const Store& store;
  const RenderOptions& options;
  SceneFacts facts;
  PlanOptions plan_options;
  Plan plan = {};  // of these
  std::unique_ptr<cache::Scratch> scratch;
  std::unique_ptr<cache::PartStore> page_parts;
  std::unique_ptr<PageViews> pages;
  std::unique_ptr<AttributeStore> attributes;
  std::unique_ptr<NeedsLog> needs;  // null: no access log
  std::unique_ptr<cache::TextureCache> textures;
  SelectedTextures texture_nodes;
  std::unique_ptr<TextureEvaluator> evaluator;
  std::unique_ptr<MaterialResolver> resolver;
  std::unique_ptr<VolumeStore> volumes;  // null: no grids
  SelectedMedia medium_tables;
  MediaInputs media;
  SelectedLights lights;
  std::unique_ptr<Film> film;
  std::unique_ptr<PixelCosts> costs;  // null: nobody asks
  ShadeInputs inputs;
};

// Plans, and opens everything but the film that the plan has a share for. Fails as the parts do, and when the budget is
// too small.
Status open_render_state(RenderState& state);
// An empty film for the camera of the options.
Status open_film(RenderState& state);

// The counters when a frame begins: a report is what they gained.
struct CountersBefore {
  explicit CountersBefore(const RenderState& state);
  cache::ProcessIo process = cache::process_io();
  std::array<cache::IoUse, cache::kIoPurposeCount> by_purpose = io();
  cache::PartStoreCounters pages, attributes, volumes;
  std::vector<cache::TextureCounters> textures;

  static std::array<cache::IoUse, cache::kIoPurposeCount> io();
};

// Facts of the run, when its waves are in the log; and what is found out after the last wave. Fails as pages do.
Status fill_log(const RenderState& state, const RenderReport& report);
// The counters at the end of the frame.
void fill_report(const RenderState& state, const CountersBefore& before, RenderReport& report);

}  // namespace spillway::pipeline
