#include "pipeline/render/ray_samples.h"

#include <algorithm>
#include <map>

#include "pipeline/render/ascending_list.h"

namespace spillway::pipeline {
namespace {

constexpr uint64_t kKnowsBoxes = 4, kIsSingle = 8;  // added to a kind

void put_list(std::vector<std::byte>& bytes, const std::vector<uint32_t>& list) {
  put_number(bytes, list.size());
  uint32_t before = 0;
  for (const uint32_t item : list) {
    put_number(bytes, item - before);
    before = item;
  }
}

void put_needs(std::vector<std::byte>& bytes, const RayNeeds& needs) {
  put_number(bytes, static_cast<uint64_t>(needs.kind) + (needs.knows_boxes ? kKnowsBoxes : 0) +
                        (needs.is_single ? kIsSingle : 0));
  put_list(bytes, needs.pages);
  put_number(bytes, needs.stops.size());
  for (const uint32_t page : needs.stops) put_number(bytes, page);
  if (!needs.knows_boxes) return;
  put_list(bytes, needs.boxes);
  put_number(bytes, needs.boxes_behind.size());
  for (const auto& [place, page] : needs.boxes_behind) put_number(bytes, place), put_number(bytes, page);
}

uint32_t get_list(NumberReader& reader, std::vector<uint32_t>& items, uint64_t limit) {
  const uint64_t count = reader.count(limit);
  uint64_t item = 0;
  for (uint64_t i = 0; i < count && reader.ok; ++i)
    items.push_back(static_cast<uint32_t>(item = reader.next(item, i == 0, limit)));
  return static_cast<uint32_t>(count);
}

uint32_t get_below(NumberReader& reader, uint64_t limit) {
  const uint64_t number = reader.number();
  if (number >= limit) reader.ok = false;
  return static_cast<uint32_t>(number);
}

void get_needs(NumberReader& reader, uint64_t page_count, RaySamples& samples) {
  const uint64_t kind = reader.number();
  if (kind % kKnowsBoxes >= kRayKinds || kind >= 2 * kIsSingle) reader.ok = false;
  if (!reader.ok) return;
  NeedsRow row{static_cast<RayKind>(kind % kKnowsBoxes), (kind & kKnowsBoxes) != 0, (kind & kIsSingle) != 0,
               static_cast<uint32_t>(samples.items.size())};
  row.page_count = get_list(reader, samples.items, page_count);
  row.stop_count = static_cast<uint32_t>(reader.count(page_count));
  for (uint32_t i = 0; i < row.stop_count && reader.ok; ++i) samples.items.push_back(get_below(reader, page_count));
  if (row.knows_boxes) {
    row.box_count = get_list(reader, samples.items, page_count);
    row.behind_count = static_cast<uint32_t>(reader.count(page_count));
    for (uint32_t i = 0; i < row.behind_count && reader.ok; ++i) {
      samples.items.push_back(get_below(reader, uint64_t{row.stop_count} + 1));
      samples.items.push_back(get_below(reader, page_count));
    }
  }
  if (samples.items.size() > UINT32_MAX) reader.ok = false;
  samples.needs.push_back(row);
}

void get_group(NumberReader& reader, uint64_t page_count, uint64_t wave_count, RaySamples& samples) {
  const uint32_t wave = get_below(reader, wave_count);
  const size_t first = samples.needs.size();
  const uint64_t needs_count = reader.count(UINT32_MAX);
  for (uint64_t i = 0; i < needs_count && reader.ok; ++i) get_needs(reader, page_count, samples);
  const uint64_t ray_count = reader.count(UINT32_MAX);
  uint64_t path = 0;
  for (uint64_t i = 0; i < ray_count && reader.ok; ++i) {
    const uint64_t step = reader.number();
    path += (step >> 1) ^ (0 - (step & 1));
    const uint32_t needs = get_below(reader, needs_count);
    samples.rays.push_back({path, wave, static_cast<uint32_t>(first + needs)});
  }
}

}  // namespace

void put_samples(std::vector<std::byte>& bytes, uint32_t wave, std::span<const SampledRay> rays) {
  if (rays.empty()) return;
  struct Place {
    uint32_t count = 0, index = 0;
  };
  struct IsLess {
    bool operator()(const RayNeeds* a, const RayNeeds* b) const { return *a < *b; }
  };
  std::map<const RayNeeds*, Place, IsLess> places;
  for (const SampledRay& ray : rays) ++places[&ray.needs].count;
  // The most frequent ones first: their numbers are short.
  std::vector<std::pair<const RayNeeds*, Place*>> by_count;
  for (auto& [needs, place] : places) by_count.emplace_back(needs, &place);
  std::ranges::stable_sort(by_count, std::ranges::greater{}, [](const auto& p) { return p.second->count; });
  put_number(bytes, wave);
  put_number(bytes, by_count.size());
  for (uint32_t i = 0; i < by_count.size(); ++i) {
    by_count[i].second->index = i;
    put_needs(bytes, *by_count[i].first);
  }
  put_number(bytes, rays.size());
  uint64_t before = 0;
  for (const SampledRay& ray : rays) {
    const auto step = static_cast<int64_t>(ray.path - before);
    put_number(bytes, (static_cast<uint64_t>(step) << 1) ^ static_cast<uint64_t>(step >> 63));
    put_number(bytes, places.find(&ray.needs)->second.index);
    before = ray.path;
  }
}

bool get_samples(std::span<const std::byte> bytes, uint64_t page_count, uint64_t wave_count, RaySamples& samples) {
  NumberReader reader{bytes.data(), bytes.data() + bytes.size()};
  while (reader.ok && reader.at != reader.end) get_group(reader, page_count, wave_count, samples);
  return reader.ok;
}

}  // namespace spillway::pipeline
