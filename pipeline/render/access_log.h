#pragma once

// Which pages, attribute blocks and texture tiles each wave of a render needed, read and swept: what `whatif` replays,
// and bench/access_log.py recounts.
//
// Owns: the waves' lists. Threads: one at a time.
// Memory: tag trace_log: four bytes an item of a list (in the file about one); some bytes a sampled ray, of which
//         there are about log_needs.h's kMostSamples at most; of tiles see tile_log.h.
// Fails: write() as files do; read() refuses a file that is damaged or of another version, with its name.
// Format: a section file of kind SPWACCES: facts (AccessFacts), page_bytes and attribute_bytes (uint64 a part), waves
//         (WaveFacts) and sets (bytes): for each wave its lists in the order of WaveAccess, each as its length and the
//         differences of its ascending items, in LEB128 (ascending_list.h). Of textures: tile_bytes (uint32 a tile,
//         what it takes in its file) and chunks of sets, see tile_log.h. Of single rays: samples, see ray_samples.h.
//
// A run that parks rays says what it swept and read: an entry without rays is a sweep of the lot. It cannot be replayed,
// for what its waves need is not what others' waves do.
//
// What rays need (`*_pages`, `*_boxes`, attribute_blocks, samples, the tiles touched) depends on the rays alone: the same
// for any budget and the same waves. What was swept and read is this run's.

#include <cstdint>
#include <filesystem>
#include <vector>

#include "cache/base/memory.h"
#include "cache/base/result.h"
#include "pipeline/render/plan.h"
#include "pipeline/render/ray_samples.h"
#include "pipeline/render/tile_log.h"

namespace spillway::pipeline {

struct WaveFacts {
  uint64_t path_count = 0, shadow_count = 0, generated_count = 0, spilled_bytes = 0;
  double generate_seconds = 0, sort_seconds = 0, trace_seconds = 0, route_seconds = 0, shade_seconds = 0;
  double page_wait_seconds = 0, attribute_wait_seconds = 0;  // for reads, inside trace and shade
};

struct WaveAccess {
  WaveFacts facts;
  // Needed: pages by rays from the camera, by paths that go on, by shadow rays that arrived. What occluded ones need
  // depends on what is in memory: see samples.
  std::vector<uint32_t> camera_pages, continued_pages, shadow_pages;
  // Whose box, if not their top, sampled rays met: needed too as long as the top is not known.
  std::vector<uint32_t> camera_boxes, later_boxes;
  std::vector<uint32_t> attribute_blocks;
  // Visited by the sweep, resident or not, and read.
  std::vector<uint32_t> swept_pages, read_pages, read_attribute_blocks;
};

struct AccessFacts {
  SceneFacts scene;
  uint64_t wave_paths = 0;
  uint64_t memory_bytes = 0;  // the budget of the run; 0: none
  uint64_t page_bytes_read = 0, attribute_bytes_read = 0;
  double seconds = 0;
  double log_seconds = 0;          // of these, what logging took
  double page_wait_seconds = 0, attribute_wait_seconds = 0;
  uint64_t sampled_of = 1;         // the rays of one path in so many are samples,
  uint64_t boxed_of = 1;           // and those of one in so many tell of boxes
  uint64_t probe_bytes = 0;        // of pages, read again before the first wave for nothing but
  double probe_seconds = 0;        // the time that takes,
  double probe_cpu_seconds = 0;    // and the processors' time
  uint64_t threads = 1;
  uint64_t rays_are_parked = 0;    // 1: waves without rays are sweeps of the lot, and nothing is said of needs
};

class AccessLog {
 public:
  static constexpr uint32_t kVersion = 6;  // of the file

  AccessFacts facts;
  std::vector<uint64_t> page_bytes, attribute_bytes;
  std::vector<WaveAccess> waves;
  std::vector<std::byte> sample_bytes;
  bool is_over = false;  // visits of pages are no longer the render's
  TileLog tiles;  // open where the scene has textures

  // What single rays need; fails when they are damaged.
  [[nodiscard]] Result<RaySamples> samples() const;
  // The wave that is under way: the last one.
  WaveAccess& wave() { return waves.back(); }
  void begin_wave() { waves.emplace_back(); }
  // Lists become ascending and without duplicates; their memory is claimed.
  void end_wave(const WaveFacts& wave_facts);

  Status write(const std::filesystem::path& path);
  // Checks the tiles, tells `visit` of them, and does not keep them.
  static Result<AccessLog> read(const std::filesystem::path& path, const TileLog::Visit& visit = {});

 private:
  std::vector<MemoryClaim> claims_;
};

}  // namespace spillway::pipeline
