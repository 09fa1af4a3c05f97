#pragma once

// What single rays need, ray after ray of some paths: of one path in so many, for what unions of pages cannot tell - how
// many rays wait, where the paths that were parked go on, and which shadow rays need nothing more because something that
// is in memory occludes them.
//
// Format: bytes of groups: a wave's number; the different needs of its rays; its rays. Of needs: their number, and of
//         each its RayKind (plus kKnowsBoxes, kIsSingle), pages (an ascending list), stops (their number, and each), and with
//         kKnowsBoxes boxes (an ascending list) and those behind (their number; of each, place and page). Of rays: their
//         number, and of each how far its path's key lies from that of the ray before (zigzag), and which needs are its.
//         Numbers and lists as in ascending_list.h. Camera rays lie in the order in which they begin.

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace spillway::pipeline {

enum class RayKind : uint8_t { camera, continued, shadow };
inline constexpr uint8_t kRayKinds = 3;

// What a ray needs: the pages it meets as far as their tops tell (cache/page_tops.h), before its hit or its light. An
// occluded shadow ray meets all as far as its light, and needs none once a page that occludes it is in memory. A path
// that hits needs pages behind its hit as well while the page of the hit is not in memory: as far as one that is.
// While the top of a page is not known, those that meet its box need it.
struct RayNeeds {
  static constexpr size_t kMostBehind = 8;

  RayKind kind = RayKind::camera;
  std::vector<uint32_t> pages = {};  // ascending
  // Of shadow rays: what occludes them. Of paths: where they hit, and what is behind, front to back.
  std::vector<uint32_t> stops = {};
  // Of some rays: pages that are met by their box alone. Behind the hit: how many stops come before, and the page.
  bool knows_boxes = false;
  // Not a sample, and not for others: logged for a page that no sample of its wave and kind needs.
  bool is_single = false;
  std::vector<uint32_t> boxes = {};  // ascending
  std::vector<std::pair<uint32_t, uint32_t>> boxes_behind = {};
  auto operator<=>(const RayNeeds&) const = default;
};

// Of the path with this key.
struct SampledRay {
  uint64_t path = 0;
  RayNeeds needs;
};

void put_samples(std::vector<std::byte>& bytes, uint32_t wave, std::span<const SampledRay> rays);

// Decoded.
struct NeedsRow {
  RayKind kind = RayKind::camera;
  bool knows_boxes = false, is_single = false;
  // In items, one after the other; of boxes behind the place before the page.
  uint32_t first = 0, page_count = 0, stop_count = 0, box_count = 0, behind_count = 0;
};
struct SampleRow {
  uint64_t path = 0;
  uint32_t wave = 0, needs = 0;
};
struct RaySamples {
  std::vector<NeedsRow> needs;
  std::vector<uint32_t> items;
  std::vector<SampleRow> rays;

  [[nodiscard]] const NeedsRow& needs_of(const SampleRow& ray) const { return needs[ray.needs]; }
  [[nodiscard]] std::span<const uint32_t> pages(const NeedsRow& n) const { return part(n.first, n.page_count); }
  [[nodiscard]] std::span<const uint32_t> stops(const NeedsRow& n) const {
    return part(n.first + n.page_count, n.stop_count);
  }
  [[nodiscard]] std::span<const uint32_t> boxes(const NeedsRow& n) const {
    return part(n.first + n.page_count + n.stop_count, n.box_count);
  }
  [[nodiscard]] std::span<const uint32_t> boxes_behind(const NeedsRow& n) const {
    return part(n.first + n.page_count + n.stop_count + n.box_count, 2 * size_t{n.behind_count});
  }

 private:
  [[nodiscard]] std::span<const uint32_t> part(size_t first, size_t count) const { return {items.data() + first, count}; }
};

// Adds what the bytes hold; false when they are damaged, or name other pages or waves.
bool get_samples(std::span<const std::byte> bytes, uint64_t page_count, uint64_t wave_count, RaySamples& samples);

}  // namespace spillway::pipeline
