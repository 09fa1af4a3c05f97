#include "pipeline/render/tile_log.h"

#include <bit>

#include "pipeline/render/ascending_list.h"

namespace spillway::pipeline {
namespace {

constexpr uint64_t kStreamBlockBytes = 1 << 18;

// Calls f(number) for each bit that is set.
template <class F>
void for_each_bit(std::span<const uint64_t> bits, const F& f) {
  for (size_t word = 0; word < bits.size(); ++word)
    for (uint64_t rest = bits[word]; rest != 0; rest &= rest - 1)
      f(word * 64 + static_cast<size_t>(std::countr_zero(rest)));
}

std::vector<std::byte> encoded(const cache::TextureCache::WaveTileUse& use) {
  std::vector<std::byte> bytes;
  uint64_t count = 0, before = 0;
  for (const uint64_t word : use.touched_bits) count += static_cast<uint64_t>(std::popcount(word));
  put_number(bytes, count);
  for_each_bit(use.touched_bits, [&](uint64_t tile) {
    put_number(bytes, tile - before);
    before = tile;
  });
  count = before = 0;
  for (const uint32_t times : use.read_counts) count += times > 0 ? 1 : 0;
  put_number(bytes, count);
  for (uint64_t tile = 0; tile < use.read_counts.size(); ++tile) {
    if (use.read_counts[tile] == 0) continue;
    put_number(bytes, tile - before);
    put_number(bytes, use.read_counts[tile]);
    before = tile;
  }
  return bytes;
}

void decode(NumberReader& reader, uint64_t tile_count, WaveTiles& tiles) {
  tiles.touched.clear(), tiles.read.clear();
  uint64_t tile = 0, count = reader.count(tile_count);
  for (uint64_t i = 0; i < count && reader.ok; ++i)
    tiles.touched.push_back(tile = reader.next(tile, i == 0, tile_count));
  tile = 0, count = reader.count(tile_count);
  for (uint64_t i = 0; i < count && reader.ok; ++i) {
    tile = reader.next(tile, i == 0, tile_count);
    const uint64_t times = reader.number();
    if (times == 0) reader.ok = false;
    tiles.read.emplace_back(tile, times);
  }
}

std::string chunk_name(size_t chunk) { return fmt::format("tiles{}", chunk); }

}  // namespace

Status TileLog::open(const std::filesystem::path& scratch_directory, std::vector<uint32_t> tile_bytes) {
  stream_.reset();  // before its scratch
  SPILLWAY_ASSIGN(scratch_, cache::Scratch::create(scratch_directory));
  stream_.emplace(cache::StreamOptions{.what = "tiles of the access log",
                                       .tag = MemoryTag::trace_log,
                                       .purpose = cache::IoPurpose::scene,
                                       .memory_limit_bytes = kMemoryBytes,
                                       .block_bytes = kStreamBlockBytes,
                                       .scratch = scratch_.get()});
  tile_bytes_ = std::move(tile_bytes);
  chunk_ends_.clear();
  return {};
}

Status TileLog::append(const cache::TextureCache::WaveTileUse& use) {
  SPILLWAY_TRY(stream_->append(std::span<const std::byte>(encoded(use))));
  if (stream_->size() - (chunk_ends_.empty() ? 0 : chunk_ends_.back()) >= kChunkBytes)
    chunk_ends_.push_back(stream_->size());
  return {};
}

Status TileLog::finish() {
  if (!is_open()) return {};
  if (chunk_ends_.empty() || chunk_ends_.back() != stream_->size()) chunk_ends_.push_back(stream_->size());
  return stream_->finish();
}

void TileLog::add_to(cache::SectionWriter& writer) const {
  writer.add_view("tile_bytes", std::as_bytes(std::span(tile_bytes_)));
  for (size_t chunk = 0; chunk < chunk_ends_.size(); ++chunk) {
    const uint64_t begin = chunk == 0 ? 0 : chunk_ends_[chunk - 1];
    writer.add_made(chunk_name(chunk), chunk_ends_[chunk] - begin,
                    [this, begin](std::span<std::byte> bytes) { return stream_->read(begin, bytes); });
  }
}

Status TileLog::visit(const cache::SectionReader& file, size_t wave_count, const Visit& visit) {
  SPILLWAY_ASSIGN(const Buffer<uint32_t> tile_bytes, file.load<uint32_t>("tile_bytes", MemoryTag::trace_log));
  size_t wave = 0;
  WaveTiles tiles;
  for (size_t chunk = 0; file.has(chunk_name(chunk)); ++chunk) {
    SPILLWAY_ASSIGN(const Buffer<std::byte> bytes, file.load<std::byte>(chunk_name(chunk), MemoryTag::trace_log));
    NumberReader reader{bytes.begin(), bytes.end()};
    while (reader.at != reader.end) {
      decode(reader, tile_bytes.size(), tiles);
      if (!reader.ok || wave == wave_count)
        return error("{}: the tiles of wave {} are damaged; make the log anew with --access-log", file.path().string(),
                     wave);
      if (visit) visit(wave, tiles);
      ++wave;
    }
  }
  if (wave != wave_count && wave != 0)
    return error("{}: has tiles of {} waves out of {}; make the log anew with --access-log", file.path().string(), wave,
                 wave_count);
  return {};
}

}  // namespace spillway::pipeline
