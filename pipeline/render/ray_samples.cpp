#include "pipeline/render/ray_samples.h"

#include "pipeline/render/ascending_list.h"

namespace spillway::pipeline {
namespace {

void put_list(std::vector<std::byte>& bytes, const std::vector<uint32_t>& list) {
  put_number(bytes, list.size());
  uint32_t before = 0;
  for (const uint32_t item : list) {
    put_number(bytes, item - before);
    before = item;
  }
}

uint32_t get_list(NumberReader& reader, std::vector<uint32_t>& items, uint64_t limit) {
  const uint64_t count = reader.count(limit);
  uint64_t item = 0;
  for (uint64_t i = 0; i < count && reader.ok; ++i)
    items.push_back(static_cast<uint32_t>(item = reader.next(item, i == 0, limit)));
  return static_cast<uint32_t>(count);
}

uint32_t get_stops(NumberReader& reader, std::vector<uint32_t>& items, uint64_t limit) {
  const uint64_t count = reader.count(limit);
  for (uint64_t i = 0; i < count && reader.ok; ++i) {
    const uint64_t page = reader.number();
    if (page >= limit) reader.ok = false;
    items.push_back(static_cast<uint32_t>(page));
  }
  return static_cast<uint32_t>(count);
}

void get_row(NumberReader& reader, uint64_t page_count, WaveSamples& wave) {
  const uint64_t kind = reader.number(), count = reader.number();
  if (kind >= kRayKinds || count == 0 || count > UINT32_MAX) reader.ok = false;
  if (!reader.ok) return;
  SampleRow row{static_cast<RayKind>(kind), static_cast<uint32_t>(count), static_cast<uint32_t>(wave.items.size()), 0,
                0};
  row.page_count = get_list(reader, wave.items, page_count);
  row.stop_count = get_stops(reader, wave.items, page_count);
  wave.rows.push_back(row);
}

}  // namespace

void put_samples(std::vector<std::byte>& bytes, uint32_t wave, const CountedNeeds& rays) {
  if (rays.empty()) return;
  put_number(bytes, wave);
  put_number(bytes, rays.size());
  for (const auto& [needs, count] : rays) {
    put_number(bytes, static_cast<uint64_t>(needs.kind));
    put_number(bytes, count);
    put_list(bytes, needs.pages);
    put_number(bytes, needs.stops.size());
    for (const uint32_t page : needs.stops) put_number(bytes, page);
  }
}

bool get_samples(std::span<const std::byte> bytes, uint64_t page_count, std::vector<WaveSamples>& waves) {
  NumberReader reader{bytes.data(), bytes.data() + bytes.size()};
  while (reader.ok && reader.at != reader.end) {
    const uint64_t wave = reader.number();
    const uint64_t rows = reader.count(UINT32_MAX);
    if (wave >= waves.size()) reader.ok = false;
    for (uint64_t row = 0; row < rows && reader.ok; ++row) get_row(reader, page_count, waves[wave]);
  }
  return reader.ok;
}

}  // namespace spillway::pipeline
