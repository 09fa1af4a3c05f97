#pragma once

// What shading needs to know of hits, from their attribute blocks: as they are shaded, or a batch of them before, for
// attributes that leave memory in between, or while what the batch before asked for is read.
//
// Threads: const; one thread for each of the places it writes to.

#include <array>
#include <cstdint>
#include <span>

#include "cache/attribute_block.h"
#include "pipeline/render/hit_runs.h"
#include "pipeline/render/shade_hits.h"

namespace spillway::pipeline {

// Where gathered hits go, one after the other. faces[i] belongs to points[i].
struct GatheredHits {
  HitRecord* hits;
  ShadingPoint* points;
  FacePoint* faces;
  uint32_t* meshes;
  [[nodiscard]] GatheredHits from(size_t i) const { return {hits + i, points + i, faces + i, meshes + i}; }
};

// Memory: tag paths, 240 bytes a hit.
struct GatheredBatch {
  SortedHits sorted;  // where they came from
  size_t count = 0;
  Buffer<HitRecord> hits;
  Buffer<ShadingPoint> points;
  Buffer<FacePoint> faces;
  Buffer<uint32_t> meshes;

  void make_room(size_t capacity);
  [[nodiscard]] GatheredHits all() { return {hits.data(), points.data(), faces.data(), meshes.data()}; }
};

class HitGatherer {
 public:
  static constexpr size_t kBlockHits = ShadeHitsScratch::kBlockHits;  // at most, in one call of gather()
  struct Scratch {
    std::array<cache::TrianglePlace, kBlockHits> places;
  };

  HitGatherer(const ShadeInputs& inputs, const AttributeStore& attributes) : inputs_(inputs), attributes_(attributes) {}

  // bytes: the attribute block that holds all of these hits; empty: each hit's block is resident.
  void gather(const SortedHits& sorted, std::span<const std::byte> bytes, Scratch& scratch,
              const GatheredHits& to) const;
  // Some hits of a batch, ascending by triangle, that lie in one block: each to its place in the batch.
  void gather_apart(const SortedHits& sorted, std::span<const uint32_t> which, std::span<const std::byte> bytes,
                    const GatheredHits& to) const;

 private:
  void find_triangles(std::span<const HitRecord> hits, std::span<const std::byte> bytes, Scratch& scratch) const;
  void gather_one(const cache::TrianglePlace& place, const GatheredHits& to) const;

  const ShadeInputs& inputs_;
  const AttributeStore& attributes_;
};

}  // namespace spillway::pipeline
