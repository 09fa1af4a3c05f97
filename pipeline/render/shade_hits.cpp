#include "pipeline/render/shade_hits.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <mutex>
#include <numeric>
#include <utility>
#include <vector>

#include "cache/base/check.h"
#include "cache/base/parallel.h"
#include "pipeline/render/hit_runs.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBatchHits = ShadeHitsScratch::kBatchHits;
constexpr size_t kBlockHits = ShadeHitsScratch::kBlockHits;

constexpr size_t kPrefetch = 8;  // hits ahead, of vertices that lie apart

// What one thread needs to shade a block.
struct BlockScratch {
  std::array<HitRecord, kBlockHits> hits;
  std::array<cache::TrianglePlace, kBlockHits> places;
  std::array<ShadingPoint, kBlockHits> points;
  std::array<FacePoint, kBlockHits> face_points;
  std::array<SurfaceQuery, kBlockHits> queries;
  static constexpr size_t kVertices = 64;
  std::array<VertexStart, kVertices> starts;
  std::array<shading::LightQuery, kVertices> light_queries;
  std::array<shading::LightSample, kVertices> lights;
  std::vector<SplatRecord> splats;
  std::vector<AovRecord> aovs;
  std::array<uint32_t, kBlockHits> lookups;  // by hit, when costs are counted
  std::array<uint64_t, kBlockHits> users;    // of tiles, likewise
  MaterialResolver::Scratch resolver;
};

// A hit whose attributes have left memory before it is shaded.
struct GatheredHit {
  ShadingPoint point;
  FacePoint face;
  uint32_t mesh;
};

// What one block of hits turned into, in the batch scratch from `first` on.
struct ShadedBlock {
  size_t first = 0;
  uint32_t path_count = 0, shadow_count = 0, let_through_count = 0, other_medium_count = 0;
  uint32_t rays_of_half[2] = {0, 0};

  // The place of one more ray of the kind, counted for its epoch.
  size_t next_path(uint32_t sample) {
    ++rays_of_half[sample & 1];
    return first + path_count++;
  }
  size_t next_shadow(uint32_t sample) {
    ++rays_of_half[sample & 1];
    return first + shadow_count++;
  }
};

class Shader {
 public:
  Shader(const ShadeInputs& inputs, AttributeStore& attributes, Film& film, ShadeHitsScratch& out)
      : inputs_(inputs), attributes_(attributes), film_(film), out_(out) {
    if (looks_up_emission()) out.shadow_ends.grow(MemoryTag::paths, kBatchHits);
  }

  // bytes: the attribute block that holds all of these hits; empty: each hit's block is resident.
  Status shade_batch(const SortedHits& hits, std::span<const std::byte> bytes, RayColumns<PathRecord>& paths,
                     ShadowColumns& shadows, ShadeHitsReport& report) {
    if (inputs_.stages_face_textures) SPILLWAY_TRY(stage_face_textures(hits, bytes));
    std::array<ShadedBlock, kBatchHits / kBlockHits> blocks;
    parallel_blocks(hits.size(), kBlockHits, [&](size_t b, size_t first, size_t last) {
      blocks[b] = ShadedBlock{first};
      shade_block(hits.subspan(first, last - first), bytes, blocks[b]);
    });
    hits_before_ += hits.size();
    if (!failure_) return failure_.error();
    const std::span<const ShadedBlock> done = std::span(blocks).first(block_count(hits.size(), kBlockHits));
    SPILLWAY_TRY(append(out_.path_rays, out_.paths, done, &ShadedBlock::path_count, paths));
    SPILLWAY_TRY(append(out_.shadow_rays, out_.shadows, done, &ShadedBlock::shadow_count, shadows));
    if (shadows.ends) SPILLWAY_TRY(append(out_.shadow_ends, done, &ShadedBlock::shadow_count, *shadows.ends));
    for (const ShadedBlock& block : done) {
      report.path_count += block.path_count, report.shadow_count += block.shadow_count;
      report.let_through_count += block.let_through_count, report.other_medium_count += block.other_medium_count;
      report.rays_of_half[0] += block.rays_of_half[0], report.rays_of_half[1] += block.rays_of_half[1];
    }
    report.shaded_count += hits.size();
    return {};
  }

  // A batch in the order in which its hits arrived: the blocks that hold it are swept to gather it, unless all are in
  // memory.
  Status shade_arrived(const SortedHits& hits, RayColumns<PathRecord>& paths, ShadowColumns& shadows,
                       ShadeHitsReport& report) {
    const bool resident = attributes_.parts().all_resident();
    if (resident && out_.touched_blocks == nullptr) return shade_batch(hits, {}, paths, shadows, report);
    std::vector<uint32_t> by_prim(hits.size());
    std::iota(by_prim.begin(), by_prim.end(), 0u);
    const auto prim = [&](uint32_t hit) { return hits[hit].hit.prim; };
    std::ranges::sort(by_prim, {}, prim);
    std::vector<uint32_t> blocks;
    for (const uint32_t hit : by_prim)
      if (blocks.empty() || prim(hit) >= attributes_.end_prim(blocks.back()))
        blocks.push_back(attributes_.block_of(prim(hit)));
    if (out_.touched_blocks) out_.touched_blocks->insert(out_.touched_blocks->end(), blocks.begin(), blocks.end());
    if (resident) return shade_batch(hits, {}, paths, shadows, report);
    report.attribute_blocks_touched += blocks.size();
    gathered_.grow(MemoryTag::paths, kBatchHits);
    size_t first = 0;
    SPILLWAY_TRY(attributes_.parts().sweep(blocks, [&](uint32_t block, std::span<const std::byte> bytes) -> Status {
      const auto from = by_prim.begin() + static_cast<ptrdiff_t>(first);
      const uint64_t end_prim = attributes_.end_prim(block);
      const auto end = std::partition_point(from, by_prim.end(), [&](uint32_t hit) { return prim(hit) < end_prim; });
      first = static_cast<size_t>(end - by_prim.begin());
      gather_apart(hits, std::span(from, end), bytes);
      return {};
    }));
    is_gathered_ = true;
    const Status shaded = shade_batch(hits, {}, paths, shadows, report);
    is_gathered_ = false;
    return shaded;
  }

 private:
  [[nodiscard]] bool looks_up_emission() const { return !inputs_.settings.lights.places.empty(); }

  template <class Record>
  static Status append(const Buffer<Record>& records, std::span<const ShadedBlock> blocks, uint32_t ShadedBlock::*count,
                       cache::RecordStream<Record>& to) {
    std::array<cache::RecordSpan, kBatchHits / kBlockHits> pieces;
    for (size_t b = 0; b < blocks.size(); ++b) pieces[b] = {records.data() + blocks[b].first, blocks[b].*count};
    return to.append(std::span<const cache::RecordSpan>(pieces).first(blocks.size()));
  }

  // Blocks in order, each copied by whichever thread is free.
  template <class Record>
  static Status append(const Buffer<cache::TraceRay>& rays, const Buffer<Record>& records,
                       std::span<const ShadedBlock> blocks, uint32_t ShadedBlock::*count, RayColumns<Record>& to) {
    std::array<size_t, kBatchHits / kBlockHits> places;
    size_t end = to.hot.size();
    for (size_t b = 0; b < blocks.size(); ++b) places[b] = std::exchange(end, end + blocks[b].*count);
    SPILLWAY_CHECK(end, <=, to.hot.capacity());
    to.hot.set_size(end);
    parallel_blocks(blocks.size(), 8, [&](size_t, size_t first, size_t last) {
      for (size_t b = first; b < last; ++b)
        std::copy_n(rays.data() + blocks[b].first, blocks[b].*count, to.hot.data() + places[b]);
    });
    return append(records, blocks, count, to.cold);
  }

  // Where the triangles of sorted hits lie: neighbours share a segment.
  void find_triangles(std::span<const HitRecord> hits, std::span<const std::byte> bytes, BlockScratch& scratch) const {
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

  // Returns the mesh.
  uint32_t gather_one(const HitRecord& hit, const cache::TrianglePlace& place, ShadingPoint& point,
                      FacePoint& face) const {
    const cache::TriangleAttributes triangle = cache::triangle_attributes(place);
    Pose moved;
    const InstanceTransform transform = instance_transform(inputs_, hit, moved);
    const uint32_t mesh = triangle.mesh.value;
    const bool flip = inputs_.tables.meshes[mesh].flags & kMeshFlipNormals;
    point = shading_point(triangle, hit, transform, flip);
    set_media(inputs_.tables.meshes[mesh], hit.path.medium, point);
    if (triangle.has_face) {
      face = face_point(triangle, hit, transform, point.width_world, inputs_.settings.seed);
      point.face = &face;
    }
    return mesh;
  }

  // Some hits of a batch, ascending, that lie in one block.
  void gather_apart(const SortedHits& hits, std::span<const uint32_t> which, std::span<const std::byte> bytes) {
    parallel_blocks(which.size(), kBlockHits, [&](size_t, size_t first, size_t last) {
      cache::TrianglePlace place;
      for (const uint32_t hit : which.subspan(first, last - first)) {
        place = cache::triangle_place(bytes, PrimId{hits[hit].hit.prim}, place);
        GatheredHit& to = gathered_[hit];
        to.mesh = gather_one(hits[hit], place, to.point, to.face);
      }
    });
  }

  // The hits of a block, the first of them number `first` of the batch.
  void gather(const SortedHits& sorted, size_t first, std::span<const std::byte> bytes, BlockScratch& scratch) {
    sorted.copy_to(scratch.hits.data());
    const std::span<const HitRecord> hits(scratch.hits.data(), sorted.size());
    if (!is_gathered_) find_triangles(hits, bytes, scratch);
    for (size_t i = 0; i < hits.size(); ++i) {
      uint32_t mesh = 0;
      if (is_gathered_) {
        const GatheredHit& from = gathered_[first + i];
        scratch.points[i] = from.point, scratch.face_points[i] = from.face, mesh = from.mesh;
        if (from.point.face != nullptr) scratch.points[i].face = &scratch.face_points[i];
      } else {
        if (i + kPrefetch < hits.size()) cache::prefetch_vertices(scratch.places[i + kPrefetch]);
        mesh = gather_one(hits[i], scratch.places[i], scratch.points[i], scratch.face_points[i]);
      }
      scratch.queries[i] = SurfaceQuery{&hits[i], &scratch.points[i], mesh, true, 0, {}};
    }
  }

  // What the batch will ask of face textures, read in the order of the file. Places in media have none, nor attributes.
  Status stage_face_textures(const SortedHits& hits, std::span<const std::byte> bytes) {
    if (hits.front().hit.prim == kMediumPrim) return {};
    std::array<std::vector<cache::FaceTextureRequest>, kBatchHits / kBlockHits> of_block;
    parallel_blocks(hits.size(), kBlockHits, [&](size_t b, size_t first, size_t last) {
      BlockScratch& scratch = scratches_.local();
      gather(hits.subspan(first, last - first), first, bytes, scratch);
      for (size_t i = 0; i < last - first; ++i) inputs_.resolver->append_face_requests(scratch.queries[i], of_block[b]);
    });
    std::vector<cache::FaceTextureRequest> requests;
    for (const auto& some : of_block) requests.insert(requests.end(), some.begin(), some.end());
    return requests.empty() ? Status{} : inputs_.tables.textures->images()->stage_faces(requests);
  }

  void let_through(const SurfaceQuery& q, ShadedBlock& out) {
    ++out.let_through_count;
    const HitRecord& hit = *q.hit;
    if (hit.is_shadow) {
      const size_t at = out.next_shadow(hit.path.sample);
      out_.shadow_rays[at] = ray_beyond(hit, *q.point);
      out_.shadows[at] = {hit.path.sink, hit.path.sample, medium_beyond(*q.point, hit.direction_world), hit.path.bounce,
                          hit.path.throughput};
      if (looks_up_emission()) out_.shadow_ends[at] = shadow_end(hit);
      return;
    }
    const size_t at = out.next_path(hit.path.sample);
    out_.path_rays[at] = ray_beyond(hit, *q.point);
    out_.paths[at] = hit.path;
    out_.paths[at].cone_width = q.point->width_world;
    out_.paths[at].medium = medium_beyond(*q.point, hit.direction_world);
  }

  void send_on(const ShadedVertex& vertex, uint32_t sample, ShadedBlock& out) {
    if (vertex.has_path) {
      const size_t at = out.next_path(sample);
      out_.path_rays[at] = vertex.path_ray, out_.paths[at] = vertex.path;
    }
    if (vertex.has_shadow) {
      const size_t at = out.next_shadow(sample);
      out_.shadow_rays[at] = vertex.shadow_ray, out_.shadows[at] = vertex.shadow;
      if (looks_up_emission()) out_.shadow_ends[at] = vertex.shadow_end;
    }
  }

  // A surface that divides media is met from the side of another one than the ray's: it does not close, or it crosses
  // another one. The ray goes on in what the surface says.
  [[nodiscard]] bool is_in_other_medium(const SurfaceQuery& q) const {
    return q.hit->is_shadow != kShadowArrived &&
           medium_beyond(*q.point, q.hit->direction_world * -1.0f) != q.hit->path.medium;
  }

  // A few at a time, at most BlockScratch::kVertices: their lights are sampled together.
  void shade_some(std::span<const SurfaceQuery> queries, BlockScratch& scratch, ShadedBlock& out) {
    size_t asked = 0;
    for (size_t i = 0; i < queries.size(); ++i) {
      const SurfaceQuery& q = queries[i];
      if (!q.stopped || q.hit->is_shadow) continue;
      VertexStart& start = scratch.starts[i] = begin_vertex(inputs_.settings, *q.hit, *q.point, q.values);
      if (start.asks_lights) scratch.light_queries[asked++] = start.light_query();
    }
    shading::sample_lights(inputs_.settings.lights, std::span(scratch.light_queries).first(asked), scratch.lights);
    asked = 0;
    for (size_t i = 0; i < queries.size(); ++i) {
      const SurfaceQuery& q = queries[i];
      if (!inputs_.settings.media.empty() && is_in_other_medium(q)) ++out.other_medium_count;
      if (!q.stopped)
        let_through(q, out);
      else if (q.hit->is_shadow == kShadowArrived)
        scratch.splats.push_back(arrived_splat(*q.hit, q.values));
      else if (!q.hit->is_shadow)
        end_one(q, scratch.starts[i], scratch.starts[i].asks_lights ? scratch.lights[asked++] : shading::LightSample{},
                scratch, out);
    }
  }

  void end_one(const SurfaceQuery& q, const VertexStart& start, const shading::LightSample& light,
               BlockScratch& scratch, ShadedBlock& out) {
    const ShadedVertex vertex = end_vertex(inputs_.settings, *q.hit, *q.point, q.values, start, light);
    if (vertex.has_splat) scratch.splats.push_back(vertex.splat);
    send_on(vertex, q.hit->path.sample, out);
    if (inputs_.wants_aovs && q.hit->path.bounce == 0) scratch.aovs.push_back(first_hit_aovs(q));
  }

  void shade_media(const SortedHits& hits, ShadedBlock& out) {
    for (size_t i = 0; i < hits.size(); ++i) {
      send_on(shade_medium(inputs_.settings, hits[i]), hits[i].path.sample, out);
      if (inputs_.costs != nullptr) inputs_.costs->add(hits[i].path.sink, Cost::scatterings, 1);
    }
  }

  // After resolve(): what each hit looked up, and the surfaces that were shaded, those of a mesh together.
  void add_costs(std::span<const SurfaceQuery> queries, const BlockScratch& scratch) {
    uint64_t of_mesh = 0;
    for (size_t i = 0; i < queries.size(); ++i) {
      const SurfaceQuery& q = queries[i];
      inputs_.costs->add(q.hit->path.sink, Cost::texture_lookups, scratch.lookups[i]);
      if (q.stopped && !q.hit->is_shadow) inputs_.costs->add(q.hit->path.sink, Cost::scatterings, 1), ++of_mesh;
      if (i + 1 == queries.size() || queries[i + 1].mesh != q.mesh)
        inputs_.costs->add_mesh(q.mesh, std::exchange(of_mesh, 0));
    }
  }

  void shade_block(const SortedHits& hits, std::span<const std::byte> bytes, ShadedBlock& out) {
    if (hits.front().hit.prim == kMediumPrim) return shade_media(hits, out);
    BlockScratch& scratch = scratches_.local();
    scratch.splats.clear(), scratch.aovs.clear();
    gather(hits, out.first, bytes, scratch);
    const std::span queries(scratch.queries.data(), hits.size());
    scratch.resolver.evaluator.tally = {};
    if (inputs_.costs != nullptr) {
      scratch.lookups.fill(0);
      for (size_t i = 0; i < hits.size(); ++i)
        scratch.users[i] = PixelCosts::tile_user(hits_before_ + out.first + i, scratch.hits[i].path.sink);
      scratch.resolver.evaluator.tally = {scratch.points.data(), scratch.lookups, scratch.users};
    }
    if (const Status status = inputs_.resolver->resolve(queries, scratch.resolver); !status) return fail(status);
    if (inputs_.costs != nullptr) add_costs(queries, scratch);
    for (size_t first = 0; first < queries.size(); first += BlockScratch::kVertices)
      shade_some(queries.subspan(first, std::min(BlockScratch::kVertices, queries.size() - first)), scratch, out);
    film_.add(scratch.splats);
    film_.add_aovs(scratch.aovs);
  }

  void fail(const Status& status) {
    const std::lock_guard lock(failure_mutex_);
    if (failure_) failure_ = status;
  }

  const ShadeInputs& inputs_;
  AttributeStore& attributes_;
  Film& film_;
  ShadeHitsScratch& out_;
  tbb::enumerable_thread_specific<BlockScratch> scratches_;
  Buffer<GatheredHit> gathered_;  // by hit of the batch, where
  bool is_gathered_ = false;      // else hits are gathered as they are shaded
  uint64_t hits_before_ = 0;      // of this wave, in earlier batches
  std::mutex failure_mutex_;
  Status failure_;
};

}  // namespace

InstanceTransform instance_transform(const ShadeInputs& inputs, const HitRecord& hit, Pose& moved) {
  const float time = ray_time(inputs.settings.shutter, sample_key(hit.path, inputs.settings.seed, inputs.settings.sampler));
  if (hit.hit.instance == 0) return {nullptr, nullptr, time};
  const cache::Instance& instance = inputs.instances[hit.hit.instance];
  if (instance.motion == 0) return {&instance.world_from_object, &instance.object_from_world, time};
  moved = pose_at(inputs.motions[instance.motion - 1], time);
  return {&moved.transform, &moved.inverse, time};
}

AovRecord first_hit_aovs(const SurfaceQuery& q) {
  const Float3 w_prev = q.hit->direction_world * -1.0f;
  const shading::Frame frame = shading::frame_from_z(q.values.normal_shading);
  const Rgb albedo = shading::albedo_estimate(q.values.bsdf, frame.local_from_world(w_prev));
  return {q.hit->path.sink, q.hit->path.sample,           q.hit->hit.t,          q.values.normal_shading,
          albedo,           q.mesh,                       q.material,            q.hit->hit.instance};
}

Status shade_hits(const ShadeInputs& inputs, cache::ExternalSort<HitRecord>& hits, AttributeStore& attributes,
                  Film& film, RayColumns<PathRecord>& next_paths, ShadowColumns& next_shadows,
                  ShadeHitsScratch& scratch, ShadeHitsReport& report) {
  Shader shader(inputs, attributes, film, scratch);
  const auto shade_range = [&](const SortedHits& range, std::span<const std::byte> bytes) -> Status {
    for (size_t first = 0; first < range.size(); first += kBatchHits)
      SPILLWAY_TRY(shader.shade_batch(range.subspan(first, std::min(kBatchHits, range.size() - first)), bytes,
                                      next_paths, next_shadows, report));
    return {};
  };
  // The blocks of sorted hits follow each other in the file, forwards or backwards.
  const bool descends = inputs.hits_descend;
  const auto shade_run = [&](const SortedHits& all) -> Status {
    const auto [on_surfaces, in_media] = surfaces_and_media(all, descends);
    SPILLWAY_TRY(shade_range(in_media, {}));
    SortedHits run = on_surfaces;
    if (run.empty()) return {};
    const bool resident = attributes.parts().all_resident();
    const std::vector<uint32_t> blocks = resident && scratch.touched_blocks == nullptr
                                             ? std::vector<uint32_t>{}
                                             : blocks_touched(run, attributes, descends);
    if (scratch.touched_blocks)
      scratch.touched_blocks->insert(scratch.touched_blocks->end(), blocks.begin(), blocks.end());
    if (resident) return shade_range(run, {});
    report.attribute_blocks_touched += blocks.size();
    return attributes.parts().sweep(blocks, [&](uint32_t block, std::span<const std::byte> bytes) -> Status {
      const auto in_block = run.first(hits_in_block(run, attributes, block, descends));
      run = run.subspan(in_block.size());
      return shade_range(in_block, bytes);
    });
  };
  const auto shade_unsorted = [&](const SortedHits& all) -> Status {
    const auto [surfaces, in_media] = surfaces_and_media(all, false);
    for (size_t first = 0; first < surfaces.size(); first += kBatchHits)
      SPILLWAY_TRY(shader.shade_arrived(surfaces.subspan(first, std::min(kBatchHits, surfaces.size() - first)),
                                        next_paths, next_shadows, report));
    return shade_range(in_media, {});
  };
  for (size_t p = 0; p < hits.partition_count(); ++p) {
    SPILLWAY_ASSIGN(const SortedHits partition, hits.partition(p));
    ++report.partition_count;
    if (!inputs.hits_are_sorted) {
      SPILLWAY_TRY(shade_unsorted(partition));
      continue;
    }
    for (auto rest = partition; !rest.empty();) {
      const auto run = inputs.hits_come_in_runs ? rest.first(run_length(rest, descends)) : rest;
      SPILLWAY_TRY(shade_run(run));
      rest = rest.subspan(run.size());
    }
  }
  return {};
}

}  // namespace spillway::pipeline
