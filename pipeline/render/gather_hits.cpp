#include "pipeline/render/gather_hits.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kPrefetch = 8;  // hits ahead, of vertices that lie apart

}  // namespace

void GatheredBatch::make_room(size_t capacity) {
  hits.grow(MemoryTag::paths, capacity), points.grow(MemoryTag::paths, capacity);
  faces.grow(MemoryTag::paths, capacity), meshes.grow(MemoryTag::paths, capacity);
}

// Where the triangles of sorted hits lie: neighbours share a segment.
void HitGatherer::find_triangles(std::span<const HitRecord> hits, std::span<const std::byte> bytes,
                                 Scratch& scratch) const {
  uint64_t first_prim = 0, end_prim = 0;  // of the resident block in `bytes`, when there is none given
  cache::TrianglePlace place;
  for (size_t i = 0; i < hits.size(); ++i) {
    const uint32_t prim = hits[i].hit.prim;
    if (prim >= end_prim || prim < first_prim) {
      const uint32_t block = attributes_.block_of(prim);
      first_prim = attributes_.first_prim(block), end_prim = attributes_.end_prim(block);
      if (const auto resident = attributes_.resident(block); !resident.empty()) bytes = resident;
    }
    scratch.places[i] = place = cache::triangle_place(bytes, PrimId{prim}, place);
    cache::prefetch_indices(place);
  }
}

void HitGatherer::gather_one(const cache::TrianglePlace& place, const GatheredHits& to) const {
  const HitRecord& hit = *to.hits;
  ShadingPoint& point = *to.points;
  const cache::TriangleAttributes triangle = cache::triangle_attributes(place);
  Pose moved;
  const InstanceTransform transform = instance_transform(inputs_, hit, moved);
  const uint32_t mesh = *to.meshes = triangle.mesh.value;
  const bool flip = inputs_.tables.meshes[mesh].flags & kMeshFlipNormals;
  point = shading_point(triangle, hit, transform, flip);
  set_media(inputs_.tables.meshes[mesh], hit.path.medium, point);
  if (triangle.has_face) {
    *to.faces = face_point(triangle, hit, transform, point.width_world, inputs_.settings.seed);
    point.face = to.faces;
  }
}

void HitGatherer::gather(const SortedHits& sorted, std::span<const std::byte> bytes, Scratch& scratch,
                         const GatheredHits& to) const {
  sorted.copy_to(to.hits);
  find_triangles({to.hits, sorted.size()}, bytes, scratch);
  for (size_t i = 0; i < sorted.size(); ++i) {
    if (i + kPrefetch < sorted.size()) cache::prefetch_vertices(scratch.places[i + kPrefetch]);
    gather_one(scratch.places[i], to.from(i));
  }
}

void HitGatherer::gather_apart(const SortedHits& sorted, std::span<const uint32_t> which,
                               std::span<const std::byte> bytes, const GatheredHits& to) const {
  cache::TrianglePlace place;
  for (const uint32_t hit : which) {
    to.hits[hit] = sorted[hit];
    place = cache::triangle_place(bytes, PrimId{sorted[hit].hit.prim}, place);
    gather_one(place, to.from(hit));
  }
}

}  // namespace spillway::pipeline
