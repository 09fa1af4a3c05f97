#include "pipeline/render/route_hits.h"

#include <algorithm>
#include <utility>

#include "cache/base/parallel.h"
#include "cache/base/parallel_status.h"

namespace spillway::pipeline {
namespace {

using Block = RouteHitsScratch::Block;
constexpr size_t kBlockRecords = Block::kRecords;
// What a sample's number leaves of 32 bits, in a record to the medium, in a key to the event.
constexpr uint32_t kEventBits = kMediumBits;

void emit(const HitRecord& record, const cache::SortKey& key, Block& out) {
  out.hits[out.hit_count] = record;
  out.keys[out.hit_count++] = key;
  ++out.report.hit_count;
}
void emit(const SplatRecord& splat, Block& out) { out.splats[out.splat_count++] = splat; }

std::span<PathRecord> cold_of(Block& block, const PathRecord*) { return block.paths; }
std::span<ShadowRecord> cold_of(Block& block, const ShadowRecord*) { return block.shadows; }

// Interleaves the bits of two 8-bit numbers.
uint32_t morton16(uint32_t x, uint32_t y) {
  const auto spread = [](uint32_t v) {
    v = (v | (v << 4)) & 0x0f0f;
    v = (v | (v << 2)) & 0x3333;
    return (v | (v << 1)) & 0x5555;
  };
  return spread(x) | (spread(y) << 1);
}

uint32_t unit_to_byte(float x) { return static_cast<uint32_t>(std::clamp(x, 0.0f, 1.0f) * 255.0f); }

// Records of a batch: a few make what fits of the hits, and whole blocks of a spilled stream, of which each is then read
// once.
template <class Record>
size_t batch_records(const cache::RecordStream<Record>& records, const cache::ExternalSort<HitRecord>& sort) {
  const auto most = std::clamp<size_t>(sort.capacity() / 4, 1, RouteHitsScratch::kBatchRecords);
  const size_t per_block = records.records_per_block();
  return per_block <= most ? most / per_block * per_block : most;
}

// Routes the cold records batch by batch, the blocks of a batch in parallel. What is spilled is read by the batch, what
// else a batch needs by read_more, from a first record on. route_one may change the record that it is given, a copy.
template <class Record, class ReadMore, class RouteOne>
Status route_all(const cache::RecordStream<Record>& records, Buffer<Record>& spilled, size_t count,
                 cache::ExternalSort<HitRecord>& sort, Film& film, RouteHitsScratch& scratch, const ReadMore& read_more,
                 const RouteOne& route_one) {
  const bool is_spilled = records.spilled_bytes() > 0;
  const size_t step = batch_records(records, sort);
  if (is_spilled) spilled.grow(MemoryTag::paths, step);
  for (size_t start = 0; start < count; start += step) {
    const size_t in_batch = std::min(step, count - start);
    if (is_spilled) SPILLWAY_TRY(records.read(start, {spilled.data(), in_batch}));
    SPILLWAY_TRY(read_more(start, in_batch));
    SPILLWAY_TRY(sort.make_room(in_batch));
    const auto route_block = [&](size_t first, size_t last) -> Status {
      Block& out = scratch.blocks.local();
      out.hit_count = out.splat_count = 0;
      std::span<Record> cold = cold_of(out, spilled.data()).first(last - first);
      if (is_spilled)
        cold = std::span(spilled.data() + first, last - first);
      else
        SPILLWAY_TRY(records.read(start + first, cold));
      for (size_t i = first; i < last; ++i) route_one(start + i, cold[i - first], out);
      film.add({out.splats.data(), out.splat_count});
      sort.append_apart({out.keys.data(), out.hit_count}, out.hits.data());
      return {};
    };
    SPILLWAY_TRY(parallel_status(block_count(in_batch, kBlockRecords), [&](size_t b) {
      return route_block(b * kBlockRecords, std::min(in_batch, (b + 1) * kBlockRecords));
    }));
  }
  return {};
}

}  // namespace

cache::SortKey hit_key(const HitRecord& hit) {
  const uint32_t place = morton16(unit_to_byte(hit.hit.u), unit_to_byte(hit.hit.v));
  const uint32_t event = hit.is_shadow ? shadow_event(hit.path.bounce) : emission_event(hit.path.bounce);
  return {uint64_t{hit.hit.prim} << 32 | place << 16,
          uint64_t{hit.path.sink} << 32 | uint64_t{hit.path.sample} << kEventBits | (event & ((1u << kEventBits) - 1))};
}

HitRecord medium_hit(const cache::TraceRay& ray, const PathRecord& path, float distance) {
  const Float3 direction = normalize(ray.direction_world);
  HitRecord record{{distance, 0, 0, kMediumPrim, 0, 0}, direction, INFINITY, path, 0};
  record.path.position_previous = ray.origin_world + direction * distance;
  return record;
}

// Batches follow the order of rays; inside, the triangle comes first.
static cache::SortKey key_in(const HitOrder& order, const HitRecord& hit, size_t ray) {
  if (!order.is_sorted) return {uint64_t{hit.hit.prim == kMediumPrim} << 32 | ray, 0};
  if (order.batch_rays == 0) {
    const cache::SortKey key = hit_key(hit);
    return order.descends ? cache::SortKey{~key.high, ~key.low} : key;
  }
  return {uint64_t{ray / order.batch_rays} << 32 | hit.hit.prim, ray};
}

RouteHitsReport& RouteHitsReport::operator+=(const RouteHitsReport& other) {
  hit_count += other.hit_count, escaped_count += other.escaped_count, arrived_count += other.arrived_count;
  occluded_count += other.occluded_count, alpha_shadow_count += other.alpha_shadow_count;
  medium_count += other.medium_count, parked_count += other.parked_count, absorbed_count += other.absorbed_count;
  return *this;
}

Status route_hits(const PathSettings& settings, const TracedPaths& paths, const TracedShadows& shadows,
                  cache::ExternalSort<HitRecord>& hits, Film& film, RouteHitsScratch& scratch, RouteHitsReport& report,
                  const HitOrder& order, PixelCosts* pixel_costs) {
  const bool has_outside_light = shading::has_infinite_light(settings.lights);
  const auto route_path = [&](size_t i, PathRecord& path, Block& out) {
    const cache::TraceRay& ray = paths.rays[i];
    const cache::TraceHit& hit = paths.hits[i];
    if (hit.flags & cache::kHitWaits) {
      ++out.report.parked_count;
      return;
    }
    if (pixel_costs != nullptr) pixel_costs->add_ray(path.sink, paths.costs[i]);
    if (!paths.media.empty()) {
      const SegmentResult& medium = paths.media[i];
      if (!is_black(medium.emitted))
        emit(SplatRecord{path.sink, path.sample, emission_event(path.bounce), path.throughput * medium.emitted}, out);
      path.throughput *= medium.weight;
      if (is_black(path.throughput)) {
        ++out.report.absorbed_count;
        return;
      }
      if (medium.distance < INFINITY) {
        ++out.report.medium_count;
        const HitRecord record = medium_hit(ray, path, medium.distance);
        return emit(record, key_in(order, record, i), out);
      }
    }
    if (hit.prim != PrimId::kNone) {
      const HitRecord record{hit, ray.direction_world, ray.t_max, path, 0};
      emit(record, key_in(order, record, i), out);
    } else {
      ++out.report.escaped_count;
      if (has_outside_light) emit(escaped_splat(settings, path, ray.direction_world), out);
    }
  };
  size_t first_end = 0;  // of the batch
  const auto read_nothing = [](size_t, size_t) -> Status { return {}; };
  const auto read_ends = [&](size_t start, size_t in_batch) -> Status {
    if (shadows.ends == nullptr) return {};
    scratch.ends.grow(MemoryTag::paths, RouteHitsScratch::kBatchRecords);
    first_end = start;
    return shadows.ends->read(start, {scratch.ends.data(), in_batch});
  };
  const auto route_shadow = [&](size_t i, ShadowRecord& shadow, Block& out) {
    const cache::TraceHit& hit = shadows.hits[i];
    if (hit.flags & cache::kHitWaits) {
      ++out.report.parked_count;
      return;
    }
    if (pixel_costs != nullptr) pixel_costs->add_ray(shadow.sink, shadows.costs[i]);
    if (!shadows.media.empty()) shadow.contribution *= shadows.media[i].weight;
    const shading::LightPlace end = shadows.ends == nullptr ? shading::LightPlace{} : scratch.ends[i - first_end];
    if (hit.flags & cache::kHitOccluded) {
      ++out.report.occluded_count;
    } else if (hit.prim != PrimId::kNone) {
      ++out.report.alpha_shadow_count;
      const HitRecord record = shadow_hit(shadows.rays[i], hit, shadow, end);
      emit(record, key_in(order, record, paths.rays.size() + i), out);
    } else if (++out.report.arrived_count; end.prim != PrimId::kNone) {
      const HitRecord record = arrived_hit(shadows.rays[i], shadow, end);
      emit(record, key_in(order, record, paths.rays.size() + i), out);
    } else {
      emit(SplatRecord{shadow.sink, shadow.sample, shadow_event(shadow.bounce), shadow.contribution}, out);
    }
  };
  SPILLWAY_TRY(route_all(*paths.records, scratch.paths, paths.rays.size(), hits, film, scratch, read_nothing, route_path));
  SPILLWAY_TRY(route_all(*shadows.records, scratch.shadows, shadows.rays.size(), hits, film, scratch, read_ends, route_shadow));
  for (Block& block : scratch.blocks) report += std::exchange(block.report, {});
  return {};
}

}  // namespace spillway::pipeline
