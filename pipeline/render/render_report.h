#pragma once

// What a render did, from counters: for the closing table, report.json and the tests.

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cache/base/memory.h"
#include "cache/file.h"
#include "cache/part_store.h"
#include "cache/texture_cache.h"
#include "pipeline/render/estimate_error.h"
#include "pipeline/render/film.h"
#include "pipeline/render/plan.h"
#include "pipeline/render/route_hits.h"
#include "pipeline/render/shade_hits.h"
#include "pipeline/render/trace_rays.h"
#include "pipeline/render/track_media.h"

namespace spillway::pipeline {

enum class RenderEnd : uint32_t { samples, error, time, stop };  // what ended it: all samples were made, or this
[[nodiscard]] const char* name(RenderEnd end);

struct WaveReport {
  uint64_t path_count = 0, shadow_count = 0, generated_count = 0;
  double sort_seconds = 0, trace_seconds = 0, track_seconds = 0, route_seconds = 0, shade_seconds = 0;
  cache::TextureCounters textures;
  uint64_t pages_touched = 0, pair_count = 0, window_count = 0, partition_count = 0, spilled_bytes = 0;
};

struct TextureReport {
  std::string name;
  bool is_face_texture = false;
  cache::TextureCounters counters;
};

// A part of the renderer: how much of its kind's unit (items, visits, rows, bytes) a run used. 0: it was left out.
struct UsedPart {
  const char* kind;  // stages, caches, columns, tables
  const char* name;
  uint64_t count;
};

struct NamedCost {
  std::string name;
  uint64_t count;
};

struct RenderReport {
  Plan plan;
  std::array<uint32_t, 2> half_samples = {0, 0};
  uint32_t samples_per_pixel = 0;
  uint32_t epoch_count = 0;
  RenderEnd ended_by = RenderEnd::samples;
  [[nodiscard]] bool stopped_early() const { return ended_by == RenderEnd::time || ended_by == RenderEnd::stop; }
  double error_asked = 0;              // 0: none
  std::optional<ErrorEstimate> error;  // of the picture; none when a half has no samples
  double seconds = 0, generate_seconds = 0;
  double log_seconds = 0;  // of these, what an access log took
  std::vector<WaveReport> waves;
  uint64_t sorted_count = 0;  // rays that sort_rays ordered
  TraceRaysReport trace;
  bool has_media = false;            // without, track_media did not run
  uint32_t camera_medium = kNoMedium;  // where camera rays began
  TrackMediaReport track;
  RouteHitsReport route;
  ShadeHitsReport shade;
  cache::PartStoreCounters pages, attributes, volumes;
  cache::TextureCounters textures;
  std::vector<TextureReport> by_texture;  // images, then face textures
  std::string texture_advice;  // the option that would keep tiles from being read again in a wave; empty: few are
  bool has_textures = false;
  std::vector<NamedCost> costs;           // totals of the cost layers, when they were asked for;
  std::vector<NamedCost> dearest_meshes;  // number and name, scatterings: ten at most
  std::vector<NamedCost> dearest_textures;  // by lookups: ten at most
  std::vector<UsedPart> parts;            // all there are: see used_parts.h
  uint64_t spilled_bytes = 0, scratch_peak_bytes = 0;
  bool direct_io = false;
  std::array<cache::IoUse, cache::kIoPurposeCount> io{};
  cache::ProcessIo process_io;       // during the render
  std::array<MemoryUse, kMemoryTagCount> memory{};
  MemoryUse memory_total;
  ResidentMemory resident;
  uint64_t floor_bytes = 0;          // resident when the program started
  uint64_t untagged_bytes = 0;       // peak resident - peak of the tags - floor; 0 when negative
  FilmFaults faults;                 // contributions that were not finite or out of range
  std::string image_hash;
};

// Resident memory when the program began, before any table: measured once, at static initialisation.
[[nodiscard]] uint64_t memory_floor_bytes();

[[nodiscard]] std::string report_json(const RenderReport& report, const std::string& scene);
// The closing table.
[[nodiscard]] std::string report_table(const RenderReport& report);

}  // namespace spillway::pipeline
