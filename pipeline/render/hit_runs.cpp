#include "pipeline/render/hit_runs.h"

#include <algorithm>
#include <functional>

namespace spillway::pipeline {

SurfacesAndMedia surfaces_and_media(std::span<const HitRecord> hits, bool descends) {
  const auto middle = std::ranges::partition_point(
      hits, [descends](const HitRecord& h) { return (h.hit.prim == kMediumPrim) == descends; });
  const auto count = static_cast<size_t>(middle - hits.begin());
  if (descends) return {hits.subspan(count), hits.first(count)};
  return {hits.first(count), hits.subspan(count)};
}

size_t run_length(std::span<const HitRecord> hits, bool descends) {
  const auto prim = [](const HitRecord& h) { return h.hit.prim; };
  const auto end = descends ? std::ranges::is_sorted_until(hits, std::ranges::greater{}, prim)
                            : std::ranges::is_sorted_until(hits, std::ranges::less{}, prim);
  return static_cast<size_t>(end - hits.begin());
}

size_t hits_in_block(std::span<const HitRecord> run, const AttributeStore& attributes, uint32_t block, bool descends) {
  const uint64_t first = attributes.first_prim(block), end = attributes.end_prim(block);
  const auto beyond = std::ranges::partition_point(
      run, [=](const HitRecord& h) { return descends ? h.hit.prim >= first : h.hit.prim < end; });
  return static_cast<size_t>(beyond - run.begin());
}

std::vector<uint32_t> blocks_touched(std::span<const HitRecord> run, const AttributeStore& attributes, bool descends) {
  std::vector<uint32_t> blocks;
  while (!run.empty()) {
    blocks.push_back(attributes.block_of(run.front().hit.prim));
    run = run.subspan(hits_in_block(run, attributes, blocks.back(), descends));
  }
  return blocks;
}

}  // namespace spillway::pipeline
