#pragma once

// What each pixel cost, as counts: layers of the picture, and the meshes that cost most.
//
// Owns: its counters. Made only when they are asked for. Memory: tag film, exactly bytes().
// Threads: add...() from any number of threads at once; everything else while nobody adds.
// Order: sums of integers. Lookups, scatterings and rays are the paths' own: the same for any memory, threads, waves,
//        layout. Steps and waits are what tracing did: the same for any number of threads, but more or less of them
//        with other waves, budgets or pages, for a ray shortened early looks at less.
//        A tile is missed by the first hit of a wave, in the order in which hits are shaded, that looks into it: what
//        a cache reads that every wave finds empty. Which of them memory holds, and for which pixel one of two threads
//        reads it, would be chance. The same for any memory of textures and attributes, threads and pages, with the
//        same waves.

#include <cstdint>
#include <span>

#include "cache/base/memory.h"
#include "pipeline/render/film.h"

namespace spillway::pipeline {

enum class Cost : uint32_t {
  tree_steps,       // nodes and leaves that its rays looked at
  pages_waited,     // visits to pages that were not in memory when the wave began
  texture_lookups,  // of images and face textures
  scatterings,      // places on surfaces and in media that were shaded
  rays,             // of both kinds
  tiles_missed,     // of images and face textures: those that it was the first to look into in a wave
  count
};
inline constexpr uint32_t kCostCount = static_cast<uint32_t>(Cost::count);
[[nodiscard]] const char* name(Cost cost);

// What tracing one ray of a wave took.
struct RayCost {
  uint32_t tree_steps = 0, pages_waited = 0;
};

class PixelCosts {
 public:
  PixelCosts(const FilmShape& shape, size_t mesh_count, size_t tile_count);
  [[nodiscard]] static uint64_t bytes(const FilmShape& shape, size_t mesh_count, size_t tile_count);

  void add(uint32_t sink, Cost cost, uint64_t count);
  void add_ray(uint32_t sink, const RayCost& ray);
  void add_mesh(uint32_t mesh, uint64_t scatterings);

  // For TextureCache::note_first_users(), by tile: the number of the hit in its wave, then the pixel that it is of.
  [[nodiscard]] static uint64_t tile_user(uint64_t hit, uint32_t sink) { return hit << 32 | sink; }
  [[nodiscard]] std::span<uint64_t> first_users() { return first_users_; }
  // The wave is shaded: its tiles go to the pixels of their first users, and all begin anew.
  void add_tiles_missed(std::span<const uint64_t> touched_bits);

  // Of pixel (x, y) of the full image, inside the window.
  [[nodiscard]] uint64_t at(uint32_t x, uint32_t y, Cost cost) const;
  [[nodiscard]] uint64_t total(Cost cost) const;
  // Scatterings by mesh.
  [[nodiscard]] std::span<const uint64_t> by_mesh() const { return by_mesh_; }

 private:
  static constexpr uint64_t kNobody = UINT64_MAX;
  [[nodiscard]] size_t index(uint32_t x, uint32_t y) const;

  FilmShape shape_;
  Buffer<uint64_t> counts_;  // kCostCount a pixel
  Buffer<uint64_t> by_mesh_;
  Buffer<uint64_t> first_users_;  // a tile; kNobody: none in this wave
};

}  // namespace spillway::pipeline
