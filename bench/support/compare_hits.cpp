#include "bench/support/compare_hits.h"

#include <bit>
#include <cmath>
#include <map>
#include <vector>

#include "cache/file.h"
#include "cache/trace_page.h"

namespace spillway::bench {
namespace {

using cache::TraceHit;
using cache::TraceRay;

constexpr int kTieUlps = 4;

struct Triangle {
  Float3 vertex[3];
};
using Triangles = std::map<uint32_t, Triangle>;

void collect(const cache::TracePageView& page, Triangles& wanted) {
  for (uint32_t lane = 0; lane < 4 * page.header->leaf_count; ++lane) {
    const cache::TraceLeaf& leaf = page.leaves[lane / 4];
    const auto at = wanted.find(leaf.prim[lane % 4]);
    if (at == wanted.end()) continue;
    for (int v = 0; v < 3; ++v)
      for (int a = 0; a < 3; ++a) at->second.vertex[v][a] = leaf.vertex[v][a][lane % 4];
  }
}

Status read_triangles(const pipeline::Store& store, Triangles& wanted) {
  SPILLWAY_ASSIGN(const cache::ReadFile file, cache::ReadFile::open(store.trace_pages_path(), {}));
  for (const cache::PageLocation& location : store.pages()) {
    std::vector<std::byte> page(location.size_bytes);
    SPILLWAY_TRY(file.read(location.offset_bytes, page));
    SPILLWAY_TRY(cache::validate_trace_page(page, "page"));
    collect(cache::trace_page_view(page), wanted);
  }
  return {};
}

struct Double3 {
  double x, y, z;
};
Double3 to_double(Float3 v) { return {v.x, v.y, v.z}; }
Double3 operator-(Double3 a, Double3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
double dot(Double3 a, Double3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Double3 cross(Double3 a, Double3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

// Moeller and Trumbore 1997; infinity where the ray passes by or t is not positive.
double exact_t(const Triangle& triangle, const TraceRay& ray) {
  const Double3 p0 = to_double(triangle.vertex[0]), d = to_double(ray.direction_world);
  const Double3 e1 = to_double(triangle.vertex[1]) - p0, e2 = to_double(triangle.vertex[2]) - p0;
  const Double3 p = cross(d, e2), s = to_double(ray.origin_world) - p0, q = cross(s, e1);
  const double det = dot(e1, p), u = dot(s, p) / det, v = dot(d, q) / det, t = dot(e2, q) / det;
  return u >= 0 && v >= 0 && u + v <= 1 && t > 0 ? t : INFINITY;
}

struct Difference {
  size_t ray;
  TraceHit ours, embree;
};

const char* verdict(const Difference& difference, const TraceRay& ray, const Triangles& triangles) {
  if (difference.ours.instance != 0 || difference.embree.instance != 0) return "in an instance";
  const auto exact = [&](const TraceHit& hit) {
    return hit.prim == PrimId::kNone ? INFINITY : exact_t(triangles.at(hit.prim), ray);
  };
  const double ours = exact(difference.ours), embree = exact(difference.embree);
  if (ours < embree) return "ours is right";
  if (embree < ours) return "Embree is right";
  return std::isinf(ours) ? "no exact hit of either" : "both at the same t";
}

}  // namespace

Status compare_hits(const pipeline::Store& store, std::span<const TraceRay> rays, std::span<const TraceHit> ours,
                    std::span<const TraceHit> embree) {
  size_t same = 0, ties = 0, alpha = 0;
  std::vector<Difference> differences;
  for (size_t i = 0; i < rays.size(); ++i) {
    const bool both = ours[i].prim != PrimId::kNone && embree[i].prim != PrimId::kNone;
    const int ulps = std::abs(std::bit_cast<int>(ours[i].t) - std::bit_cast<int>(embree[i].t));
    if ((embree[i].flags & cache::kHitAlphaUnknown) != 0)
      ++alpha;
    else if (ours[i].prim == embree[i].prim && (!both || ours[i].instance == embree[i].instance))
      ++same;
    else if (both && ulps <= kTieUlps)
      ++ties;
    else
      differences.push_back({i, ours[i], embree[i]});
  }
  Triangles triangles;
  for (const Difference& d : differences)
    for (const uint32_t prim : {d.ours.prim, d.embree.prim})
      if (prim != PrimId::kNone) triangles[prim];
  SPILLWAY_TRY(read_triangles(store, triangles));
  std::map<std::string, size_t> verdicts;
  for (const Difference& d : differences) {
    const std::string by_double = verdict(d, rays[d.ray], triangles);
    ++verdicts[by_double];
    fmt::print("  ray {}: prim {} at t {:.9g} | Embree prim {} at t {:.9g}: {}\n", d.ray, static_cast<int>(d.ours.prim),
               d.ours.t, static_cast<int>(d.embree.prim), d.embree.t, by_double);
  }
  fmt::print("hits: {} same, {} ties within {} ulp, {} on masks (not compared), {} other", same, ties, kTieUlps, alpha,
             differences.size());
  for (const auto& [by_double, count] : verdicts) fmt::print("; {}: {}", by_double, count);
  fmt::print("\n");
  return {};
}

}  // namespace spillway::bench
