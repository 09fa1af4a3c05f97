#include "pipeline/pack/pack_attributes.h"

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <memory>

#include "cache/base/hash.h"
#include "cache/compact_segment.h"

namespace spillway::pipeline {
namespace {

// A block under way: its chunks as vectors, their compact columns, and the block; at most 2 MB each, but few scenes
// have more than a fifth.
constexpr uint64_t kBlockBytes = 4 << 20;

// Chunks [first, last) of a block.
struct ChunkRange {
  size_t first, last;
};

// As many whole chunks a block as fit, of a mesh one: pieces of a diced mesh are not full.
std::vector<ChunkRange> cut_blocks(const std::vector<PlacedChunk>& chunks, uint32_t max_faces) {
  std::vector<ChunkRange> blocks;
  uint32_t faces = max_faces + 1;
  for (size_t c = 0; c < chunks.size(); ++c) {
    const uint32_t more = chunks[c].chunk.face_count;
    const bool same_mesh = c > 0 && chunks[c].mesh == chunks[c - 1].mesh;
    if (faces + more > max_faces || same_mesh) blocks.push_back({c, c}), faces = 0;
    faces += more;
    blocks.back().last = c + 1;
  }
  return blocks;
}

Result<Buffer<std::byte>> build_block(const SpooledScene& scene, ChunkRange range, SpoolReader& reader) {
  std::vector<cache::AttributeSegmentData> segments;
  for (size_t c = range.first; c < range.last; ++c) {
    SPILLWAY_ASSIGN(segments.emplace_back(), reader.read(scene.chunks[c].chunk, true));
    segments.back().mesh = scene.chunks[c].mesh;
    segments.back().first_prim = scene.chunks[c].first_prim;
  }
  return cache::build_attribute_block(segments);
}

AttributeLocation location_of(const Buffer<std::byte>& block, uint64_t offset_bytes) {
  const auto& header = *reinterpret_cast<const cache::AttributeBlockHeader*>(block.data());
  AttributeLocation location{};
  location.offset_bytes = offset_bytes;
  location.size_bytes = static_cast<uint32_t>(block.size());
  location.first_prim = header.first_prim;
  location.prim_count = header.prim_count;
  return location;
}

}  // namespace

uint64_t least_attribute_bytes(const std::vector<PlacedChunk>& chunks) {
  constexpr uint64_t kSavedPerFace = 3, kSavedPerVertex = sizeof(Float3) - sizeof(cache::PositionCode);
  uint64_t bytes = 0;
  for (const PlacedChunk& placed : chunks)
    bytes += chunk_bytes(placed.chunk, true) - kSavedPerFace * placed.chunk.face_count -
             kSavedPerVertex * placed.chunk.vertex_count;
  return bytes;
}

Result<std::vector<AttributeLocation>> pack_attributes(const SpooledScene& scene, uint32_t max_faces_per_block,
                                                       uint64_t memory_limit_bytes, cache::WriteFile& file,
                                                       uint64_t& content) {
  using Built = std::shared_ptr<Result<Buffer<std::byte>>>;
  const std::vector<ChunkRange> blocks = cut_blocks(scene.chunks, max_faces_per_block);
  std::vector<AttributeLocation> locations;
  locations.reserve(blocks.size());
  size_t next = 0;
  Status status;
  std::atomic<bool> stopped = false;
  const auto source = [&](tbb::flow_control& control) -> ChunkRange {
    if (next < blocks.size() && !stopped) return blocks[next++];
    control.stop();
    return {0, 0};
  };
  const auto build = [&](ChunkRange range) {
    SpoolReader reader(*scene.spool);
    return std::make_shared<Result<Buffer<std::byte>>>(build_block(scene, range, reader));
  };
  const auto write = [&](const Built& built) {
    if (!status) return;
    status = *built ? Status{} : Status(built->error());
    if (status) {
      const Buffer<std::byte>& block = **built;
      locations.push_back(location_of(block, file.size_bytes()));
      content = hash_combine(content, reinterpret_cast<const cache::AttributeBlockHeader*>(block.data())->checksum);
      status = file.append(block);
    }
    if (!status) stopped = true;
  };
  const auto threads = static_cast<uint64_t>(tbb::this_task_arena::max_concurrency());
  const size_t tokens = std::clamp<uint64_t>(memory_limit_bytes / 2 / kBlockBytes, 1, threads + 2);
  tbb::parallel_pipeline(tokens, tbb::make_filter<void, ChunkRange>(tbb::filter_mode::serial_in_order, source) &
                                     tbb::make_filter<ChunkRange, Built>(tbb::filter_mode::parallel, build) &
                                     tbb::make_filter<Built, void>(tbb::filter_mode::serial_in_order, write));
  SPILLWAY_TRY(status);
  return locations;
}

}  // namespace spillway::pipeline
