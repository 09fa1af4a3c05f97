#pragma once

// The triangles of a scene in sets that memory can hold, for pack_pages.
//
// In:     the spooled scene; how many triangles may be held.
// Out:    sets in the order of objects: several small objects whole, or a part of one that is too large alone.
// Memory: four bytes a chunk, eight where an object is cut; load() fills memory of the caller.
// Order:  which triangles are a set depends on the limit, the pages made of all sets do not: see cluster_pages.h.

#include <memory>
#include <span>
#include <vector>

#include "pipeline/pack/cluster_pages.h"
#include "pipeline/pack/mesh_spool.h"

namespace spillway::pipeline {

struct TriangleSet {
  uint32_t first_object = 0, last_object = 0;  // half open
  uint64_t count = 0;
  int depth = 0;  // cuts that led here: of a part of one object
  uint32_t part = 0;
  std::shared_ptr<const StreamedCuts> cuts{};                                       // null: objects are whole
  std::shared_ptr<const std::vector<std::pair<uint32_t, uint32_t>>> chunk_parts{};  // first and last of each chunk
};

class TriangleSets {
 public:
  explicit TriangleSets(const SpooledScene& scene);

  [[nodiscard]] uint64_t largest_object() const;
  // Fails as StreamedCuts::make. pass_count is raised by the passes it took.
  Result<std::vector<TriangleSet>> cut(uint64_t max_set, const ClusterPagesOptions& options,
                                       uint64_t& pass_count) const;
  // The triangles of a set: of whole objects one object after the other, else in any order.
  Status load(const TriangleSet& set, std::span<PackTriangle> triangles) const;
  [[nodiscard]] uint64_t object_count(uint32_t object) const { return counts_[object]; }

 private:
  // Chunk numbers of an object, ascending.
  [[nodiscard]] std::span<const uint32_t> chunks_of(uint32_t object) const;
  Status for_each_chunk(std::span<const uint32_t> chunks,
                        const std::function<Status(size_t index, std::span<const PackTriangle>)>& body) const;
  Status cut_object(uint32_t object, uint64_t max_set, const ClusterPagesOptions& options, uint64_t& pass_count,
                    std::vector<TriangleSet>& sets) const;
  Status load_whole(const TriangleSet& set, std::span<PackTriangle> triangles) const;
  Status load_part(const TriangleSet& set, std::span<PackTriangle> triangles) const;

  const SpooledScene& scene_;
  std::vector<uint32_t> chunks_;       // by object, then ascending
  std::vector<uint64_t> first_chunk_;  // of each object in chunks_, and the end
  std::vector<uint64_t> counts_;       // triangles of each object
};

}  // namespace spillway::pipeline
