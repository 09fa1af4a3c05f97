#include "pipeline/render/access_log.h"

#include <algorithm>
#include <array>

#include "cache/section_file.h"
#include "pipeline/render/ascending_list.h"

namespace spillway::pipeline {
namespace {

constexpr const char* kKind = "SPWACCES";
constexpr uint64_t kMostWaves = 1 << 24;

using List = std::vector<uint32_t>;
constexpr std::array<List WaveAccess::*, 9> kLists = {&WaveAccess::camera_pages,         &WaveAccess::continued_pages,
                                                      &WaveAccess::shadow_pages,         &WaveAccess::camera_boxes,
                                                      &WaveAccess::later_boxes,          &WaveAccess::attribute_blocks,
                                                      &WaveAccess::swept_pages,          &WaveAccess::read_pages,
                                                      &WaveAccess::read_attribute_blocks};
constexpr std::array<bool, 9> kOfAttributes = {false, false, false, false, false, true, false, false, true};

void put(std::vector<std::byte>& bytes, const List& list) {
  put_number(bytes, list.size());
  uint32_t before = 0;
  for (const uint32_t item : list) {
    put_number(bytes, item - before);
    before = item;
  }
}

void get(NumberReader& reader, List& items, uint64_t limit) {
  const uint64_t count = reader.count(limit);
  uint64_t item = 0;
  for (uint64_t i = 0; i < count && reader.ok; ++i)
    items.push_back(static_cast<uint32_t>(item = reader.next(item, i == 0, limit)));
}

}  // namespace

void AccessLog::end_wave(const WaveFacts& wave_facts) {
  WaveAccess& w = wave();
  w.facts = wave_facts;
  uint64_t bytes = sizeof w;
  for (const auto list : kLists) {
    List& items = w.*list;
    std::ranges::sort(items);
    items.erase(std::unique(items.begin(), items.end()), items.end());
    items.shrink_to_fit();
    bytes += items.size() * sizeof(uint32_t);
  }
  claims_.emplace_back(MemoryTag::trace_log, bytes);
}

Result<RaySamples> AccessLog::samples() const {
  RaySamples all;
  if (!get_samples(sample_bytes, page_bytes.size(), waves.size(), all))
    return error("what single rays need is damaged; make the log anew with --access-log");
  return all;
}

Status AccessLog::write(const std::filesystem::path& path) {
  SPILLWAY_TRY(tiles.finish());
  std::vector<WaveFacts> rows;
  std::vector<std::byte> sets;
  for (const WaveAccess& w : waves) {
    rows.push_back(w.facts);
    for (const auto list : kLists) put(sets, w.*list);
  }
  cache::SectionWriter writer(kKind, kVersion);
  writer.add_view("facts", std::as_bytes(std::span(&facts, 1)));
  writer.add_view("page_bytes", std::as_bytes(std::span(page_bytes)));
  writer.add_view("attribute_bytes", std::as_bytes(std::span(attribute_bytes)));
  writer.add_view("waves", std::as_bytes(std::span(rows)));
  writer.add_view("sets", sets);
  writer.add_view("samples", sample_bytes);
  tiles.add_to(writer);
  return writer.write(path);
}

Result<AccessLog> AccessLog::read(const std::filesystem::path& path, const TileLog::Visit& visit) {
  SPILLWAY_ASSIGN(const auto file, cache::SectionReader::open(path, kKind, kVersion));
  SPILLWAY_ASSIGN(const Buffer<AccessFacts> log_facts, file.load<AccessFacts>("facts", MemoryTag::trace_log));
  SPILLWAY_ASSIGN(const Buffer<uint64_t> pages, file.load<uint64_t>("page_bytes", MemoryTag::trace_log));
  SPILLWAY_ASSIGN(const Buffer<uint64_t> blocks, file.load<uint64_t>("attribute_bytes", MemoryTag::trace_log));
  SPILLWAY_ASSIGN(const Buffer<WaveFacts> rows, file.load<WaveFacts>("waves", MemoryTag::trace_log));
  SPILLWAY_ASSIGN(const Buffer<std::byte> sets, file.load<std::byte>("sets", MemoryTag::trace_log));
  if (log_facts.size() != 1 || rows.size() > kMostWaves)
    return error("{}: is no log of a render; make it anew with --access-log", path.string());
  AccessLog log;
  log.facts = log_facts[0];
  log.page_bytes.assign(pages.begin(), pages.end());
  log.attribute_bytes.assign(blocks.begin(), blocks.end());
  NumberReader reader{sets.begin(), sets.end()};
  for (const WaveFacts& row : rows) {
    WaveAccess& w = log.waves.emplace_back();
    w.facts = row;
    for (size_t i = 0; i < kLists.size(); ++i)
      get(reader, w.*kLists[i], kOfAttributes[i] ? log.attribute_bytes.size() : log.page_bytes.size());
    if (!reader.ok)
      return error("{}: the lists of wave {} are damaged; make the log anew with --access-log", path.string(),
                   log.waves.size() - 1);
  }
  if (reader.at != reader.end) return error("{}: more follows the last wave; the file is damaged", path.string());
  SPILLWAY_ASSIGN(const Buffer<std::byte> samples, file.load<std::byte>("samples", MemoryTag::trace_log));
  log.sample_bytes.assign(samples.begin(), samples.end());
  if (const auto decoded = log.samples(); !decoded) return error("{}: {}", path.string(), decoded.error().message);
  SPILLWAY_TRY(TileLog::visit(file, log.waves.size(), visit));
  return log;
}

}  // namespace spillway::pipeline
