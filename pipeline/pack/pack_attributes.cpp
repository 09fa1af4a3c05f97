#include "pipeline/pack/pack_attributes.h"

#include "cache/base/hash.h"

namespace spillway::pipeline {
namespace {

// Chunks [first, last) that make the next block: as many whole ones as fit.
size_t block_end(const std::vector<PlacedChunk>& chunks, size_t first, uint32_t max_faces) {
  uint32_t faces = 0;
  size_t last = first;
  while (last < chunks.size() && faces + chunks[last].chunk.face_count <= max_faces)
    faces += chunks[last++].chunk.face_count;
  return last;
}

Result<AttributeLocation> write_block(const SpooledScene& scene, SpoolReader& reader, size_t first, size_t last,
                                      cache::WriteFile& file, uint64_t& content) {
  std::vector<cache::AttributeSegmentData> segments;
  uint32_t prims = 0;
  for (size_t c = first; c < last; ++c) {
    SPILLWAY_ASSIGN(segments.emplace_back(), reader.read(scene.chunks[c].chunk, true));
    segments.back().mesh = scene.chunks[c].mesh;
    segments.back().first_prim = scene.chunks[c].first_prim;
    prims += scene.chunks[c].chunk.face_count;
  }
  const Buffer<std::byte> block = cache::build_attribute_block(segments);
  AttributeLocation location{};
  location.offset_bytes = file.size_bytes();
  location.size_bytes = static_cast<uint32_t>(block.size());
  content = hash_combine(content, reinterpret_cast<const cache::AttributeBlockHeader*>(block.data())->checksum);
  location.first_prim = segments.front().first_prim;
  location.prim_count = prims;
  SPILLWAY_TRY(file.append(block));
  return location;
}

}  // namespace

Result<std::vector<AttributeLocation>> pack_attributes(const SpooledScene& scene, uint32_t max_faces_per_block,
                                                       cache::WriteFile& file, uint64_t& content) {
  std::vector<AttributeLocation> locations;
  SpoolReader reader(*scene.spool);
  for (size_t first = 0; first < scene.chunks.size();) {
    const size_t last = block_end(scene.chunks, first, max_faces_per_block);
    SPILLWAY_ASSIGN(locations.emplace_back(), write_block(scene, reader, first, last, file, content));
    first = last;
  }
  return locations;
}

}  // namespace spillway::pipeline
