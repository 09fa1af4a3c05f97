#include "pipeline/render/route_hits.h"

#include <algorithm>
#include <array>

#include "cache/base/parallel.h"

namespace spillway::pipeline {
namespace {

constexpr size_t kBatchRecords = RouteHitsScratch::kBatchRecords;
constexpr size_t kBlockRecords = 1024;

// What one block of rays turned into, written to the scratch from `first` on.
struct RoutedBlock {
  size_t first = 0;
  uint32_t hit_count = 0, splat_count = 0, occluded_count = 0, alpha_shadow_count = 0;
  uint32_t medium_count = 0, absorbed_count = 0, parked_count = 0;

  void emit(const HitRecord& record, const cache::SortKey& key, RouteHitsScratch& scratch) {
    scratch.hits[first + hit_count] = record;
    scratch.keys[first + hit_count++] = key;
  }
  void emit(const SplatRecord& splat, RouteHitsScratch& scratch) { scratch.splats[first + splat_count++] = splat; }
};

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

// Reads the cold records batch by batch, routes the blocks of a batch in parallel, appends their hits in block order.
// read_more: what else a batch needs, from a first record on.
template <class Record, class ReadMore, class RouteOne>
Status route_all(const cache::RecordStream<Record>& records, Buffer<Record>& cold, size_t count,
                 cache::ExternalSort<HitRecord>& sort, Film& film, RouteHitsScratch& scratch, RouteHitsReport& report,
                 const ReadMore& read_more, const RouteOne& route_one) {
  std::array<RoutedBlock, kBatchRecords / kBlockRecords> blocks;
  // Whole blocks of the stream where they fit a batch: each is then read once.
  const size_t per_block = records.records_per_block();
  const size_t step = per_block <= kBatchRecords ? kBatchRecords / per_block * per_block : kBatchRecords;
  for (size_t start = 0; start < count; start += step) {
    const size_t in_batch = std::min(step, count - start);
    SPILLWAY_TRY(records.read(start, {cold.data(), in_batch}));
    SPILLWAY_TRY(read_more(start, in_batch));
    parallel_blocks(in_batch, kBlockRecords, [&](size_t b, size_t first, size_t last) {
      RoutedBlock out{first};
      for (size_t i = first; i < last; ++i) route_one(start + i, cold[i], out);
      film.add({scratch.splats.data() + first, out.splat_count});
      blocks[b] = out;
    });
    std::array<cache::SortSpan, kBatchRecords / kBlockRecords> pieces;
    const size_t block_total = block_count(in_batch, kBlockRecords);
    for (size_t b = 0; b < block_total; ++b) {
      const RoutedBlock& out = blocks[b];
      pieces[b] = {scratch.keys.data() + out.first, scratch.hits.data() + out.first, out.hit_count};
      report.hit_count += out.hit_count, report.occluded_count += out.occluded_count;
      report.alpha_shadow_count += out.alpha_shadow_count, report.medium_count += out.medium_count;
      report.absorbed_count += out.absorbed_count, report.parked_count += out.parked_count;
    }
    SPILLWAY_TRY(sort.append(std::span(pieces).first(block_total)));
  }
  return {};
}

}  // namespace

cache::SortKey hit_key(const HitRecord& hit) {
  const uint32_t place = morton16(unit_to_byte(hit.hit.u), unit_to_byte(hit.hit.v));
  const uint32_t event = hit.is_shadow ? shadow_event(hit.path.bounce) : emission_event(hit.path.bounce);
  return {uint64_t{hit.hit.prim} << 32 | place << 16 | (event & 0xffff),
          uint64_t{hit.path.sink} << 32 | hit.path.sample};
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

Status route_hits(const PathSettings& settings, const TracedPaths& paths, const TracedShadows& shadows,
                  cache::ExternalSort<HitRecord>& hits, Film& film, RouteHitsScratch& scratch, RouteHitsReport& report,
                  const HitOrder& order, PixelCosts* pixel_costs) {
  const bool has_outside_light = shading::has_infinite_light(settings.lights);
  const auto route_path = [&](size_t i, PathRecord path, RoutedBlock& out) {
    const cache::TraceRay& ray = paths.rays[i];
    const cache::TraceHit& hit = paths.hits[i];
    if (hit.flags & cache::kHitWaits) {
      ++out.parked_count;
      return;
    }
    if (pixel_costs != nullptr) pixel_costs->add_ray(path.sink, paths.costs[i]);
    if (!paths.media.empty()) {
      const SegmentResult& medium = paths.media[i];
      if (!is_black(medium.emitted))
        out.emit(SplatRecord{path.sink, path.sample, emission_event(path.bounce), path.throughput * medium.emitted}, scratch);
      path.throughput *= medium.weight;
      if (is_black(path.throughput)) {
        ++out.absorbed_count;
        return;
      }
      if (medium.distance < INFINITY) {
        ++out.medium_count;
        const HitRecord record = medium_hit(ray, path, medium.distance);
        return out.emit(record, key_in(order, record, i), scratch);
      }
    }
    if (hit.prim != PrimId::kNone) {
      const HitRecord record{hit, ray.direction_world, ray.t_max, path, 0};
      out.emit(record, key_in(order, record, i), scratch);
    } else if (has_outside_light) {
      out.emit(escaped_splat(settings, path, ray.direction_world), scratch);
    }
  };
  size_t first_end = 0;  // of the batch
  const auto read_nothing = [](size_t, size_t) -> Status { return {}; };
  const auto read_ends = [&](size_t start, size_t in_batch) -> Status {
    if (shadows.ends == nullptr) return {};
    scratch.ends.grow(MemoryTag::paths, kBatchRecords);
    first_end = start;
    return shadows.ends->read(start, {scratch.ends.data(), in_batch});
  };
  const auto route_shadow = [&](size_t i, ShadowRecord shadow, RoutedBlock& out) {
    const cache::TraceHit& hit = shadows.hits[i];
    if (hit.flags & cache::kHitWaits) {
      ++out.parked_count;
      return;
    }
    if (pixel_costs != nullptr) pixel_costs->add_ray(shadow.sink, shadows.costs[i]);
    if (!shadows.media.empty()) shadow.contribution *= shadows.media[i].weight;
    const shading::LightPlace end = shadows.ends == nullptr ? shading::LightPlace{} : scratch.ends[i - first_end];
    if (hit.flags & cache::kHitOccluded) {
      ++out.occluded_count;
    } else if (hit.prim != PrimId::kNone) {
      ++out.alpha_shadow_count;
      const HitRecord record = shadow_hit(shadows.rays[i], hit, shadow, end);
      out.emit(record, key_in(order, record, paths.rays.size() + i), scratch);
    } else if (end.prim != PrimId::kNone) {
      const HitRecord record = arrived_hit(shadows.rays[i], shadow, end);
      out.emit(record, key_in(order, record, paths.rays.size() + i), scratch);
    } else {
      out.emit(SplatRecord{shadow.sink, shadow.sample, shadow_event(shadow.bounce), shadow.contribution}, scratch);
    }
  };
  const auto elsewhere = [&report] { return report.hit_count + report.absorbed_count + report.parked_count; };
  const uint64_t elsewhere_before = elsewhere();
  SPILLWAY_TRY(route_all(*paths.records, scratch.paths, paths.rays.size(), hits, film, scratch, report, read_nothing,
                         route_path));
  report.escaped_count += paths.rays.size() - (elsewhere() - elsewhere_before);
  const auto stopped = [&report] { return report.occluded_count + report.alpha_shadow_count + report.parked_count; };
  const uint64_t stopped_before = stopped();
  SPILLWAY_TRY(route_all(*shadows.records, scratch.shadows, shadows.rays.size(), hits, film, scratch, report, read_ends,
                         route_shadow));
  report.arrived_count += shadows.rays.size() - (stopped() - stopped_before);
  return {};
}

}  // namespace spillway::pipeline
