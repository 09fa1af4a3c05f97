#include "pipeline/render/hit_runs.h"

#include <algorithm>
#include <ranges>

namespace spillway::pipeline {
namespace {

// How many hits, from the first on, pass a test that the others fail.
template <class Test>
size_t leading(const SortedHits& hits, const Test& test) {
  const auto places = std::views::iota(size_t{0}, hits.size());
  const auto end = std::ranges::partition_point(places, [&](size_t i) { return test(hits[i].hit.prim); });
  return static_cast<size_t>(end - places.begin());
}

}  // namespace

SurfacesAndMedia surfaces_and_media(const SortedHits& hits, bool descends) {
  const size_t count = leading(hits, [descends](uint32_t prim) { return (prim == kMediumPrim) == descends; });
  if (descends) return {hits.subspan(count), hits.first(count)};
  return {hits.first(count), hits.subspan(count)};
}

size_t run_length(const SortedHits& hits, bool descends) {
  size_t length = std::min<size_t>(hits.size(), 1);
  for (; length < hits.size(); ++length) {
    const uint32_t before = hits[length - 1].hit.prim, prim = hits[length].hit.prim;
    if (descends ? prim > before : prim < before) break;
  }
  return length;
}

size_t hits_in_block(const SortedHits& run, const AttributeStore& attributes, uint32_t block, bool descends) {
  const uint64_t first = attributes.first_prim(block), end = attributes.end_prim(block);
  return leading(run, [=](uint32_t prim) { return descends ? prim >= first : prim < end; });
}

std::vector<uint32_t> blocks_touched(SortedHits run, const AttributeStore& attributes, bool descends) {
  std::vector<uint32_t> blocks;
  while (!run.empty()) {
    blocks.push_back(attributes.block_of(run.front().hit.prim));
    run = run.subspan(hits_in_block(run, attributes, blocks.back(), descends));
  }
  return blocks;
}

}  // namespace spillway::pipeline
