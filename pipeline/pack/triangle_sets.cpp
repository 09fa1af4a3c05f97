#include "pipeline/pack/triangle_sets.h"

#include <algorithm>
#include <atomic>

#include "cache/base/check.h"
#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kChunksPerTask = 16;  // 16 large chunks are 5 MB, small ones share a read

void make_triangles(const SpoolReader::View& view, uint32_t first_prim, std::span<PackTriangle> triangles) {
  for (size_t face = 0; face < triangles.size(); ++face) {
    PackTriangle& triangle = triangles[face];
    triangle.prim = first_prim + static_cast<uint32_t>(face);
    for (int k = 0; k < 3; ++k) triangle.vertex[k] = view.positions[view.indices[3 * face + k]];
  }
}

}  // namespace

TriangleSets::TriangleSets(const SpooledScene& scene)
    : scene_(scene),
      chunks_(scene.chunks.size()),
      first_chunk_(scene.object_count + 1, 0),
      counts_(scene.object_count, 0) {
  const auto object_of = [&](const PlacedChunk& placed) { return scene.meshes[placed.mesh].row.object; };
  for (const PlacedChunk& placed : scene.chunks) {
    ++first_chunk_[object_of(placed) + 1];
    counts_[object_of(placed)] += placed.chunk.face_count;
  }
  for (size_t o = 1; o < first_chunk_.size(); ++o) first_chunk_[o] += first_chunk_[o - 1];
  std::vector<uint64_t> next(first_chunk_.begin(), first_chunk_.end() - 1);
  for (uint32_t c = 0; c < scene.chunks.size(); ++c) chunks_[next[object_of(scene.chunks[c])]++] = c;
}

uint64_t TriangleSets::largest_object() const {
  return counts_.empty() ? 0 : *std::max_element(counts_.begin(), counts_.end());
}

std::span<const uint32_t> TriangleSets::chunks_of(uint32_t object) const {
  return std::span(chunks_).subspan(first_chunk_[object], first_chunk_[object + 1] - first_chunk_[object]);
}

// body(index into chunks, its triangles), several at once.
Status TriangleSets::for_each_chunk(std::span<const uint32_t> chunks,
                                    const std::function<Status(size_t, std::span<const PackTriangle>)>& body) const {
  return parallel_status(block_count(chunks.size(), kChunksPerTask), [&](size_t block) -> Status {
    SpoolReader reader(*scene_.spool);
    std::vector<PackTriangle> triangles;
    const size_t end = std::min(chunks.size(), (block + 1) * kChunksPerTask);
    for (size_t i = block * kChunksPerTask; i < end; ++i) {
      const PlacedChunk& placed = scene_.chunks[chunks[i]];
      SPILLWAY_ASSIGN(const SpoolReader::View view, reader.view(placed.chunk));
      triangles.resize(placed.chunk.face_count);
      make_triangles(view, placed.first_prim, triangles);
      SPILLWAY_TRY(body(i, triangles));
    }
    return {};
  });
}

Result<std::vector<TriangleSet>> TriangleSets::cut(uint64_t max_set, const ClusterPagesOptions& options,
                                                   uint64_t& pass_count) const {
  std::vector<TriangleSet> sets;
  for (uint32_t object = 0; object < counts_.size(); ++object) {
    if (counts_[object] > max_set) {
      SPILLWAY_TRY(cut_object(object, max_set, options, pass_count, sets));
      continue;
    }
    const bool joins = !sets.empty() && !sets.back().cuts && sets.back().count + counts_[object] <= max_set;
    if (!joins) sets.push_back({.first_object = object});
    sets.back().last_object = object + 1;
    sets.back().count += counts_[object];
  }
  return sets;
}

Status TriangleSets::cut_object(uint32_t object, uint64_t max_set, const ClusterPagesOptions& options,
                                uint64_t& pass_count, std::vector<TriangleSet>& sets) const {
  const std::span<const uint32_t> chunks = chunks_of(object);
  const auto pass = [&](const StreamedCuts::Visit& visit) {
    ++pass_count;
    return for_each_chunk(chunks, [&](size_t, std::span<const PackTriangle> triangles) -> Status {
      visit(triangles);
      return {};
    });
  };
  SPILLWAY_ASSIGN(StreamedCuts made, StreamedCuts::make(pass, counts_[object], max_set, options));
  const auto cuts = std::make_shared<const StreamedCuts>(std::move(made));
  // One pass more tells which chunks each part must read.
  auto parts = std::make_shared<std::vector<std::pair<uint32_t, uint32_t>>>(chunks.size());
  ++pass_count;
  SPILLWAY_TRY(for_each_chunk(chunks, [&](size_t chunk, std::span<const PackTriangle> triangles) -> Status {
    uint32_t first = UINT32_MAX, last = 0;
    for (const PackTriangle& t : triangles) {
      const uint32_t part = cuts->set_of(t);
      first = std::min(first, part), last = std::max(last, part);
    }
    (*parts)[chunk] = {first, last};
    return {};
  }));
  for (uint32_t part = 0; part < cuts->size(); ++part)
    sets.push_back({object, object + 1, cuts->count(part), cuts->depth(part), part, cuts, parts});
  return {};
}

Status TriangleSets::load(const TriangleSet& set, std::span<PackTriangle> triangles) const {
  SPILLWAY_CHECK(triangles.size(), ==, set.count);
  return set.cuts ? load_part(set, triangles) : load_whole(set, triangles);
}

Status TriangleSets::load_whole(const TriangleSet& set, std::span<PackTriangle> triangles) const {
  const uint64_t begin = first_chunk_[set.first_object], end = first_chunk_[set.last_object];
  const std::span chunks = std::span(chunks_).subspan(begin, end - begin);
  std::vector<uint64_t> place(chunks.size());
  uint64_t at = 0;
  for (size_t i = 0; i < chunks.size(); ++i) place[i] = at, at += scene_.chunks[chunks[i]].chunk.face_count;
  return for_each_chunk(chunks, [&](size_t i, std::span<const PackTriangle> loaded) -> Status {
    std::copy(loaded.begin(), loaded.end(), triangles.begin() + static_cast<ptrdiff_t>(place[i]));
    return {};
  });
}

Status TriangleSets::load_part(const TriangleSet& set, std::span<PackTriangle> triangles) const {
  const std::span<const uint32_t> all = chunks_of(set.first_object);
  std::vector<uint32_t> chunks;
  for (size_t i = 0; i < all.size(); ++i) {
    const auto [first, last] = (*set.chunk_parts)[i];
    if (first <= set.part && set.part <= last) chunks.push_back(all[i]);
  }
  std::atomic<uint64_t> placed = 0;
  SPILLWAY_TRY(for_each_chunk(chunks, [&](size_t, std::span<const PackTriangle> loaded) -> Status {
    std::vector<PackTriangle> mine;
    for (const PackTriangle& t : loaded)
      if (set.cuts->set_of(t) == set.part) mine.push_back(t);
    const uint64_t at = placed.fetch_add(mine.size());
    SPILLWAY_CHECK(at + mine.size(), <=, triangles.size());
    std::copy(mine.begin(), mine.end(), triangles.begin() + static_cast<ptrdiff_t>(at));
    return {};
  }));
  SPILLWAY_CHECK(placed.load(), ==, triangles.size());
  return {};
}

}  // namespace spillway::pipeline
