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
#include "pipeline/render/gather_hits.h"
#include "pipeline/render/hit_runs.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBatchHits = ShadeHitsScratch::kBatchHits;
constexpr size_t kBlockHits = ShadeHitsScratch::kBlockHits;
// Of hits whose tiles are read while the batch before is shaded: two of them are held.
constexpr size_t kStagedHits = kBatchHits / 2;

// What one thread needs to shade a block.
struct BlockScratch {
  std::array<HitRecord, kBlockHits> hits;
  std::array<ShadingPoint, kBlockHits> points;
  std::array<FacePoint, kBlockHits> face_points;
  std::array<uint32_t, kBlockHits> meshes;
  std::array<SurfaceQuery, kBlockHits> queries;
  HitGatherer::Scratch gatherer;
  static constexpr size_t kVertices = 64;
  std::array<VertexStart, kVertices> starts;
  std::array<shading::LightQuery, kVertices> light_queries;
  std::array<shading::LightSample, kVertices> lights;
  std::vector<SplatRecord> splats;
  std::vector<AovRecord> aovs;
  std::array<uint32_t, kBlockHits> lookups;  // by hit, when costs are counted
  std::array<uint64_t, kBlockHits> users;    // of tiles, likewise
  MaterialResolver::Scratch resolver;
  std::vector<cache::FaceTextureRequest> face_requests;   // of hits being gathered
  std::vector<cache::TextureCache::WantedTile> wanted;  // of the batch being gathered
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
  Shader(const ShadeInputs& inputs, AttributeStore& attributes, Film& film, RayColumns<PathRecord>& paths,
         ShadowColumns& shadows, ShadeHitsScratch& out, ShadeHitsReport& report)
      : inputs_(inputs), attributes_(attributes), film_(film), paths_(paths), shadows_(shadows), out_(out),
        report_(report), gatherer_(inputs, attributes) {
    if (looks_up_emission()) out.shadow_ends.grow(MemoryTag::paths, kBatchHits);
  }

  // bytes: the attribute block that holds all of these hits; empty: each hit's block is resident.
  Status shade(const SortedHits& hits, std::span<const std::byte> bytes) {
    const bool is_staged = inputs_.stages_face_textures && !hits.empty() && hits.front().hit.prim != kMediumPrim;
    const size_t most = is_staged ? kStagedHits : kBatchHits;
    for (size_t first = 0; first < hits.size();) {
      const size_t count = std::min(most - (is_staged ? filling().count : 0), hits.size() - first);
      const SortedHits some = hits.subspan(first, count);
      if (is_staged)
        SPILLWAY_TRY(gather_ahead(some, bytes));
      else
        SPILLWAY_TRY(shade_batch(some, bytes, nullptr));
      first += count;
    }
    return {};
  }

  // Surfaces in the order in which they arrived: the blocks that hold a batch are swept to gather it, unless all are in
  // memory.
  Status shade_arrived(const SortedHits& surfaces) {
    if (attributes_.parts().all_resident() && out_.touched_blocks == nullptr) return shade(surfaces, {});
    for (size_t first = 0; first < surfaces.size(); first += kBatchHits)
      SPILLWAY_TRY(shade_arrived_batch(surfaces.subspan(first, std::min(kBatchHits, surfaces.size() - first))));
    return {};
  }

  // Before hits that do not follow those given so far: shades what was gathered of them.
  Status shade_rest() {
    if (filling().count > 0) SPILLWAY_TRY(turn());
    return shade_gathered(gathered_[1 - filling_]);
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

  // ---- gathered before they are shaded ----

  GatheredBatch& filling() { return gathered_[filling_]; }

  // Hits that follow those gathered so far, as many as there is room for.
  Status gather_ahead(const SortedHits& hits, std::span<const std::byte> bytes) {
    GatheredBatch& batch = filling();
    batch.make_room(kStagedHits);
    batch.sorted = batch.count == 0 ? hits : batch.sorted.joined(hits);
    parallel_blocks(hits.size(), kBlockHits, [&](size_t, size_t first, size_t last) {
      BlockScratch& scratch = scratches_.local();
      gatherer_.gather(hits.subspan(first, last - first), bytes, scratch.gatherer, batch.all().from(batch.count + first));
      append_wanted(batch, batch.count + first, batch.count + last, scratch);
    });
    batch.count += hits.size();
    return batch.count == kStagedHits ? turn() : Status{};
  }

  Status shade_arrived_batch(const SortedHits& hits) {
    std::vector<uint32_t> by_prim(hits.size());
    std::iota(by_prim.begin(), by_prim.end(), 0u);
    const auto prim = [&](uint32_t hit) { return hits[hit].hit.prim; };
    std::ranges::sort(by_prim, {}, prim);
    std::vector<uint32_t> blocks;
    for (const uint32_t hit : by_prim)
      if (blocks.empty() || prim(hit) >= attributes_.end_prim(blocks.back()))
        blocks.push_back(attributes_.block_of(prim(hit)));
    if (out_.touched_blocks) out_.touched_blocks->insert(out_.touched_blocks->end(), blocks.begin(), blocks.end());
    if (attributes_.parts().all_resident()) return shade(hits, {});
    report_.attribute_blocks_touched += blocks.size();
    GatheredBatch& batch = filling();
    batch.make_room(kBatchHits);
    batch.sorted = hits, batch.count = hits.size();
    size_t first = 0;
    SPILLWAY_TRY(attributes_.parts().sweep(blocks, [&](uint32_t block, std::span<const std::byte> bytes) -> Status {
      const auto from = by_prim.begin() + static_cast<ptrdiff_t>(first);
      const uint64_t end_prim = attributes_.end_prim(block);
      const auto end = std::partition_point(from, by_prim.end(), [&](uint32_t hit) { return prim(hit) < end_prim; });
      first = static_cast<size_t>(end - by_prim.begin());
      const std::span<const uint32_t> which(from, end);
      parallel_blocks(which.size(), kBlockHits, [&](size_t, size_t begin, size_t last) {
        gatherer_.gather_apart(hits, which.subspan(begin, last - begin), bytes, batch.all());
      });
      return {};
    }));
    if (!inputs_.stages_face_textures) return shade_gathered(batch);
    parallel_blocks(hits.size(), kBlockHits, [&](size_t, size_t begin, size_t last) {
      append_wanted(batch, begin, last, scratches_.local());
    });
    return turn();
  }

  // The batch is gathered: the one before it is shaded while this one's tiles are read, in the order of the file.
  Status turn() {
    std::vector<cache::TextureCache::WantedTile> wanted;
    for (BlockScratch& scratch : scratches_) {
      wanted.insert(wanted.end(), scratch.wanted.begin(), scratch.wanted.end());
      scratch.wanted.clear();
    }
    cache::TextureCache& textures = *inputs_.tables.textures->images();
    SPILLWAY_TRY(textures.begin_staging(std::move(wanted)));
    filling_ = 1 - filling_;
    SPILLWAY_TRY(shade_gathered(filling()));
    return textures.finish_staging();
  }

  // What hits of the batch will ask of face textures.
  void append_wanted(GatheredBatch& batch, size_t first, size_t last, BlockScratch& scratch) {
    scratch.face_requests.clear();
    for (size_t i = first; i < last; ++i)
      inputs_.resolver->append_face_requests({&batch.hits[i], &batch.points[i], batch.meshes[i], true, 0, {}},
                                             scratch.face_requests);
    if (!scratch.face_requests.empty())
      inputs_.tables.textures->images()->append_wanted(scratch.face_requests, scratch.wanted);
  }

  Status shade_gathered(GatheredBatch& batch) {
    if (batch.count == 0) return {};
    const Status shaded = shade_batch(batch.sorted, {}, &batch);
    batch.count = 0;
    return shaded;
  }

  // ---- a batch ----

  // gathered: where its hits have been gathered; null: they are, from `bytes`, as they are shaded.
  Status shade_batch(const SortedHits& hits, std::span<const std::byte> bytes, GatheredBatch* gathered) {
    std::array<ShadedBlock, kBatchHits / kBlockHits> blocks;
    parallel_blocks(hits.size(), kBlockHits, [&](size_t b, size_t first, size_t last) {
      blocks[b] = ShadedBlock{first};
      shade_block(hits.subspan(first, last - first), bytes, gathered, blocks[b]);
    });
    hits_before_ += hits.size();
    if (!failure_) return failure_.error();
    const std::span<const ShadedBlock> done = std::span(blocks).first(block_count(hits.size(), kBlockHits));
    SPILLWAY_TRY(append(out_.path_rays, out_.paths, done, &ShadedBlock::path_count, paths_));
    SPILLWAY_TRY(append(out_.shadow_rays, out_.shadows, done, &ShadedBlock::shadow_count, shadows_));
    if (shadows_.ends) SPILLWAY_TRY(append(out_.shadow_ends, done, &ShadedBlock::shadow_count, *shadows_.ends));
    for (const ShadedBlock& block : done) {
      report_.path_count += block.path_count, report_.shadow_count += block.shadow_count;
      report_.let_through_count += block.let_through_count, report_.other_medium_count += block.other_medium_count;
      report_.rays_of_half[0] += block.rays_of_half[0], report_.rays_of_half[1] += block.rays_of_half[1];
    }
    report_.shaded_count += hits.size();
    return {};
  }

  // The hits of a block, the first of them number `first` of the batch.
  std::span<SurfaceQuery> queries_of(const SortedHits& sorted, size_t first, std::span<const std::byte> bytes,
                                     GatheredBatch* gathered, BlockScratch& scratch) {
    GatheredHits at{scratch.hits.data(), scratch.points.data(), scratch.face_points.data(), scratch.meshes.data()};
    if (gathered != nullptr)
      at = gathered->all().from(first);
    else
      gatherer_.gather(sorted, bytes, scratch.gatherer, at);
    for (size_t i = 0; i < sorted.size(); ++i)
      scratch.queries[i] = SurfaceQuery{at.hits + i, at.points + i, at.meshes[i], true, 0, {}};
    return {scratch.queries.data(), sorted.size()};
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

  void shade_block(const SortedHits& hits, std::span<const std::byte> bytes, GatheredBatch* gathered,
                   ShadedBlock& out) {
    if (hits.front().hit.prim == kMediumPrim) return shade_media(hits, out);
    BlockScratch& scratch = scratches_.local();
    scratch.splats.clear(), scratch.aovs.clear();
    const std::span queries = queries_of(hits, out.first, bytes, gathered, scratch);
    scratch.resolver.evaluator.tally = {};
    if (inputs_.costs != nullptr) {
      scratch.lookups.fill(0);
      for (size_t i = 0; i < queries.size(); ++i)
        scratch.users[i] = PixelCosts::tile_user(hits_before_ + out.first + i, queries[i].hit->path.sink);
      scratch.resolver.evaluator.tally = {queries.front().point, scratch.lookups, scratch.users};
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
  RayColumns<PathRecord>& paths_;
  ShadowColumns& shadows_;
  ShadeHitsScratch& out_;
  ShadeHitsReport& report_;
  HitGatherer gatherer_;
  tbb::enumerable_thread_specific<BlockScratch> scratches_;
  std::array<GatheredBatch, 2> gathered_;  // one that is being gathered; and, tiles being staged, the one before
  size_t filling_ = 0;
  uint64_t hits_before_ = 0;  // of this wave, in earlier batches
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
  Shader shader(inputs, attributes, film, next_paths, next_shadows, scratch, report);
  // The blocks of sorted hits follow each other in the file, forwards or backwards.
  const bool descends = inputs.hits_descend;
  const auto shade_run = [&](const SortedHits& all) -> Status {
    const auto [on_surfaces, in_media] = surfaces_and_media(all, descends);
    SPILLWAY_TRY(shader.shade(in_media, {}));
    SortedHits run = on_surfaces;
    if (run.empty()) return {};
    const bool resident = attributes.parts().all_resident();
    const std::vector<uint32_t> blocks = resident && scratch.touched_blocks == nullptr
                                             ? std::vector<uint32_t>{}
                                             : blocks_touched(run, attributes, descends);
    if (scratch.touched_blocks)
      scratch.touched_blocks->insert(scratch.touched_blocks->end(), blocks.begin(), blocks.end());
    if (resident) {
      SPILLWAY_TRY(shader.shade(run, {}));
      return shader.shade_rest();
    }
    report.attribute_blocks_touched += blocks.size();
    SPILLWAY_TRY(attributes.parts().sweep(blocks, [&](uint32_t block, std::span<const std::byte> bytes) -> Status {
      const auto in_block = run.first(hits_in_block(run, attributes, block, descends));
      run = run.subspan(in_block.size());
      return shader.shade(in_block, bytes);
    }));
    return shader.shade_rest();
  };
  const auto shade_unsorted = [&](const SortedHits& all) -> Status {
    const auto [surfaces, in_media] = surfaces_and_media(all, false);
    SPILLWAY_TRY(shader.shade_arrived(surfaces));
    SPILLWAY_TRY(shader.shade_rest());
    return shader.shade(in_media, {});
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
