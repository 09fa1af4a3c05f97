#pragma once

// Which pages single rays of a wave need: of one ray in so many, for what unions of pages cannot tell - how many rays
// wait, and which shadow rays need nothing more because something that is in memory occludes them.
//
// Format: bytes of groups, each a wave's number, how many kinds of rays follow, and of each: its RayKind, how many rays
//         it stands for, the pages (an ascending list) and the stops (their number, and each). Numbers and lists as in
//         ascending_list.h. Rays of a kind that need the same are one row.

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

namespace spillway::pipeline {

enum class RayKind : uint8_t { camera, continued, shadow };
inline constexpr uint8_t kRayKinds = 3;

// What a ray needs: the pages it meets as far as their tops tell (cache/page_tops.h), before its hit or its light. An
// occluded shadow ray meets all as far as its light, and needs none once a page that occludes it is in memory. A path
// that hits needs pages behind its hit as well while the page of the hit is not in memory: as far as one that is.
struct RayNeeds {
  static constexpr size_t kMostBehind = 8;

  RayKind kind = RayKind::camera;
  std::vector<uint32_t> pages;  // ascending
  // Of shadow rays: what occludes them. Of paths: where they hit, and what is behind, front to back.
  std::vector<uint32_t> stops;
  auto operator<=>(const RayNeeds&) const = default;
};
using CountedNeeds = std::map<RayNeeds, uint32_t>;

void put_samples(std::vector<std::byte>& bytes, uint32_t wave, const CountedNeeds& rays);

// Rows of one wave, decoded.
struct SampleRow {
  RayKind kind = RayKind::camera;
  uint32_t count = 0;
  uint32_t first_page = 0, page_count = 0, stop_count = 0;  // in items: pages, then stops
};
struct WaveSamples {
  std::vector<SampleRow> rows;
  std::vector<uint32_t> items;
  [[nodiscard]] std::span<const uint32_t> pages(const SampleRow& row) const {
    return {items.data() + row.first_page, row.page_count};
  }
  [[nodiscard]] std::span<const uint32_t> stops(const SampleRow& row) const {
    return {items.data() + row.first_page + row.page_count, row.stop_count};
  }
};

// Adds what the bytes hold to the waves; false when they are damaged or name other pages.
bool get_samples(std::span<const std::byte> bytes, uint64_t page_count, std::vector<WaveSamples>& waves);

}  // namespace spillway::pipeline
