#include "cache/trace_kernel.h"

#include <immintrin.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cfloat>
#include <cstddef>
#include <cstring>

namespace spillway::cache {
namespace {

// One function a ray: a call a page and its walk costs more than the root of the page's tree.
#define SPILLWAY_INLINE [[gnu::always_inline]] inline

// Margins in roundings (2^-24) of the largest coordinate in play, M = max(|origin|, extent of the scene or object).
// A triangle's own box, from which its hits cannot stray: the shear moves a vertex by three roundings of |v - o| <= 2 M.
constexpr float kTrianglePadding = 8 * 0x1p-24f;
// The boxes above it enclose that one as computed: o / d and the padding (2), the node's corner (2), its quantum (2) and
// the sum of both (2) on the box's side, difference and product (4) on the triangle's.
constexpr float kBoxPadding = kTrianglePadding + 16 * 0x1p-24f;
// A direction component below this is treated as this: 1/d stays finite, 0 * 1/d stays 0.
constexpr float kSmallestDirection = 1e-18f;

constexpr int kUpperPlanes = offsetof(TraceNode, upper) - offsetof(TraceNode, lower);

// A ray in the space of one object: slabs for boxes, shear for triangles.
struct KernelRay {
  // A plane at p along axis a is met at p * slope[a] + near_end[a], or far_end[a]: the padding of boxes included.
  __m256 slope[3], near_end[3], far_end[3];
  ptrdiff_t near_plane[3];  // where a node's planes that face the ray's origin begin, in bytes from `lower`
  ptrdiff_t far_plane[3];
  alignas(16) float inverse[4];  // 1 / direction
  float triangle_pad[4];
  Float3 origin, direction;
  int kx, ky, kz;     // axes of the shear: kz is the largest of |direction|
  float ox, oy, oz;   // the origin's coordinates along them
  float sx, sy;       // Woop et al. 2013, section 3.1

  // Three axes side by side: a ray is made for every instance that it meets.
  KernelRay(Float3 o, Float3 d, float extent) : origin(o), direction(d) {
    const float largest = std::max(max_abs(o), extent);
    const __m128 sign = _mm_set1_ps(-0.0f), smallest = _mm_set1_ps(kSmallestDirection);
    const __m128 along = _mm_set_ps(1, d.z, d.y, d.x), from = _mm_set_ps(0, o.z, o.y, o.x);
    const __m128 is_small = _mm_cmplt_ps(_mm_andnot_ps(sign, along), smallest);
    const __m128 component = _mm_blendv_ps(along, _mm_or_ps(_mm_and_ps(along, sign), smallest), is_small);
    const __m128 inverted = _mm_div_ps(_mm_set1_ps(1), component), size = _mm_andnot_ps(sign, inverted);
    const __m128 at_zero = _mm_xor_ps(_mm_mul_ps(from, inverted), sign);
    const __m128 pad = _mm_mul_ps(_mm_set1_ps(kBoxPadding * largest), size);
    const __m128 near = _mm_sub_ps(at_zero, pad), far = _mm_add_ps(at_zero, pad);
    _mm_store_ps(inverse, inverted);
    _mm_store_ps(triangle_pad, _mm_mul_ps(_mm_set1_ps(kTrianglePadding * largest), size));
    spread(inverted, slope), spread(near, near_end), spread(far, far_end);
    const int backwards = _mm_movemask_ps(component);
    for (int a = 0; a < 3; ++a) {
      near_plane[a] = (backwards >> a & 1) * kUpperPlanes + 8 * a;
      far_plane[a] = kUpperPlanes - near_plane[a] + 16 * a;
    }
    choose_axes();
  }

 private:
  static void spread(__m128 of_axes, __m256 (&to)[3]) {
    to[0] = _mm256_broadcastss_ps(of_axes);
    to[1] = _mm256_broadcastss_ps(_mm_movehdup_ps(of_axes));
    to[2] = _mm256_broadcastss_ps(_mm_movehl_ps(of_axes, of_axes));
  }
  // By tables and numbers: the axes of a ray cannot be foretold, so that branches cost more than the rest.
  void choose_axes() {
    const float d[3] = {direction.x, direction.y, direction.z}, o[3] = {origin.x, origin.y, origin.z};
    const float x = std::fabs(d[0]), y = std::fabs(d[1]), z = std::fabs(d[2]);
    const int not_x = static_cast<int>(y >= x);
    kz = static_cast<int>(z >= std::max(x, y)) ? 2 : not_x;
    static constexpr int kOthers[3][2][2] = {{{1, 2}, {2, 1}}, {{2, 0}, {0, 2}}, {{0, 1}, {1, 0}}};  // [kz][d < 0]
    const int (&others)[2] = kOthers[kz][static_cast<int>(d[kz] < 0)];
    kx = others[0], ky = others[1];
    ox = o[kx], oy = o[ky], oz = o[kz];
    sx = d[kx] / d[kz], sy = d[ky] / d[kz];
  }
};

// A child and where the ray enters it. Both in one number that orders as entries do, which are not negative: where the
// nearer of two children is chosen there is then no branch to be foretold.
using StackEntry = uint64_t;
inline StackEntry stack_entry(uint32_t reference, float entry) {
  return uint64_t{std::bit_cast<uint32_t>(entry)} << 32 | reference;
}
inline uint32_t reference_of(StackEntry entry) { return static_cast<uint32_t>(entry); }
inline bool is_beyond(StackEntry entry, float t) { return std::bit_cast<float>(static_cast<uint32_t>(entry >> 32)) > t; }

// A node pushes at most seven more than it pops.
constexpr int kStackSize = kMaxTreeDepth * 7 + 8;

inline __m256 load_quantised(const uint8_t* q) {
  return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(q))));
}

// Which children the ray enters at t <= t_far, and where.
struct NodeHits {
  uint32_t mask;
  alignas(32) float entry[8];
};

inline void enter_node(const TraceNode& node, const KernelRay& ray, float t_far, NodeHits& hits) {
  const uint8_t* const planes = &node.lower[0][0];
  __m256 near = _mm256_setzero_ps();
  __m256 far = _mm256_set1_ps(t_far);
  for (int a = 0; a < 3; ++a) {
    const __m256 origin = _mm256_broadcast_ss(&node.origin[a]), scale = _mm256_broadcast_ss(&node.scale[a]);
    const __m256 step = _mm256_mul_ps(scale, ray.slope[a]);
    const __m256 base_near = _mm256_fmadd_ps(origin, ray.slope[a], ray.near_end[a]);
    const __m256 base_far = _mm256_fmadd_ps(origin, ray.slope[a], ray.far_end[a]);
    near = _mm256_max_ps(_mm256_fmadd_ps(load_quantised(planes + ray.near_plane[a]), step, base_near), near);
    far = _mm256_min_ps(_mm256_fmadd_ps(load_quantised(planes + ray.far_plane[a]), step, base_far), far);
  }
  const auto inside = static_cast<uint32_t>(_mm256_movemask_ps(_mm256_cmp_ps(near, far, _CMP_LE_OQ)));
  hits.mask = inside & ((1u << node.child_count) - 1);
  _mm256_store_ps(hits.entry, near);
}

// A tree as the walk sees it. Leaves are what on_leaf takes the index of; the walk only asks the memory for them.
template <class Leaf>
struct TreeView {
  const TraceNode* nodes;
  const Leaf* leaves;

  // What is entered soon is asked for now: most of a walk through a tree that outgrows the caches is waiting.
  void prefetch(uint32_t reference) const {
    const bool is_leaf = (reference & kLeafBit) != 0;
    const auto* const at = is_leaf ? reinterpret_cast<const char*>(leaves + (reference & ~kLeafBit))
                                   : reinterpret_cast<const char*>(nodes + reference);
    const size_t size = sizeof(Leaf) > sizeof(TraceNode) ? sizeof(Leaf) : sizeof(TraceNode);
    for (size_t line = 0; line < size; line += 64) _mm_prefetch(at + line, _MM_HINT_T0);
  }
};

// Walks a tree front to back. on_leaf(leaf index) may shorten t_far; returns true to end the walk.
template <class Leaf, class OnLeaf>
SPILLWAY_INLINE bool walk(const TreeView<Leaf> tree, uint32_t root, const KernelRay& ray, const float& t_far, uint64_t& node_count,
                 const OnLeaf& on_leaf) {
  if (root == kNoChild) return false;
  StackEntry stack[kStackSize];
  int size = 0;
  uint32_t reference = root;
  while (true) {
    if (reference & kLeafBit) {
      if (on_leaf(reference & ~kLeafBit)) return true;
    } else {
      const TraceNode& node = tree.nodes[reference];
      NodeHits hits;
      enter_node(node, ray, t_far, hits);
      ++node_count;
      if (hits.mask != 0) {
        const int first = std::countr_zero(hits.mask);
        reference = node.child[first];
        // One child or two is most often all.
        if ((hits.mask &= hits.mask - 1) == 0) continue;
        tree.prefetch(reference);
        StackEntry nearest = stack_entry(reference, hits.entry[first]);
        const int second = std::countr_zero(hits.mask);
        if ((hits.mask & (hits.mask - 1)) == 0) {
          tree.prefetch(node.child[second]);
          const StackEntry child = stack_entry(node.child[second], hits.entry[second]);
          stack[size++] = std::max(child, nearest);
          reference = reference_of(std::min(child, nearest));
          continue;
        }
        const int bottom = size;
        for (; hits.mask != 0; hits.mask &= hits.mask - 1) {
          const int c = std::countr_zero(hits.mask);
          const StackEntry child = stack_entry(node.child[c], hits.entry[c]);
          tree.prefetch(node.child[c]);
          const StackEntry other = std::max(child, nearest);
          nearest = std::min(child, nearest);
          // The others wait in order, the nearer on top.
          int at = size++;
          for (; at > bottom && stack[at - 1] < other; --at) stack[at] = stack[at - 1];
          stack[at] = other;
        }
        reference = reference_of(nearest);
        continue;
      }
    }
    // Skipped only when its entry is greater: an equal one may hold a tied triangle of a smaller id.
    do {
      if (size == 0) return false;
      --size;
    } while (is_beyond(stack[size], t_far));
    reference = reference_of(stack[size]);
  }
}

// Walks a tree in the order of its children, for rays whose end nothing shortens: pack puts those first that are most
// likely to stop them.
template <class Leaf, class OnLeaf>
SPILLWAY_INLINE bool walk_unordered(const TreeView<Leaf> tree, uint32_t root, const KernelRay& ray, float t_far, uint64_t& node_count,
                           const OnLeaf& on_leaf) {
  if (root == kNoChild) return false;
  uint32_t stack[kStackSize];
  int size = 0;
  uint32_t reference = root;
  while (true) {
    if (reference & kLeafBit) {
      if (on_leaf(reference & ~kLeafBit)) return true;
    } else {
      const TraceNode& node = tree.nodes[reference];
      NodeHits hits;
      enter_node(node, ray, t_far, hits);
      ++node_count;
      if (hits.mask != 0) {
        while ((hits.mask & (hits.mask - 1)) != 0) {
          const int last = std::bit_width(hits.mask) - 1;
          stack[size++] = node.child[last];
          tree.prefetch(node.child[last]);
          hits.mask ^= 1u << last;
        }
        reference = node.child[std::countr_zero(hits.mask)];
        continue;
      }
    }
    if (size == 0) return false;
    reference = stack[--size];
  }
}

// Edge functions of four sheared triangles. Both products are rounded and neither is fused, so that the sign of their
// difference is exact or the difference is zero, and is the opposite seen from the other side. Zero counts as inside: an
// edge then belongs to at least one of its triangles, and the double precision of section 3.2 there is not needed.
struct Edges {
  __m128 u, v, w;
};

struct Vector4 {
  __m128 x, y, z;
};
inline Vector4 minus(const Vector4& a, const Vector4& b) {
  return {_mm_sub_ps(a.x, b.x), _mm_sub_ps(a.y, b.y), _mm_sub_ps(a.z, b.z)};
}
inline __m128 dot(const Vector4& a, const Vector4& b) {
  return _mm_fmadd_ps(a.x, b.x, _mm_fmadd_ps(a.y, b.y, _mm_mul_ps(a.z, b.z)));
}
inline Vector4 select(const Vector4& otherwise, const Vector4& chosen, __m128 mask) {
  return {_mm_blendv_ps(otherwise.x, chosen.x, mask), _mm_blendv_ps(otherwise.y, chosen.y, mask),
          _mm_blendv_ps(otherwise.z, chosen.z, mask)};
}
inline Vector4 load_vertex(const TraceLeaf& leaf, int v) {
  return {_mm_load_ps(leaf.vertex[v][0]), _mm_load_ps(leaf.vertex[v][1]), _mm_load_ps(leaf.vertex[v][2])};
}
inline Vector4 broadcast(Float3 v) { return {_mm_set1_ps(v.x), _mm_set1_ps(v.y), _mm_set1_ps(v.z)}; }

// Where the ray meets the triangles' planes. From the edge functions t would be off by more than the width of a sliver;
// the normal is taken from the shortest edge and another, whose product loses least. Sets `parallel` where there is no
// such place.
inline __m128 plane_distance(const TraceLeaf& leaf, const KernelRay& ray, __m128& parallel) {
  const Vector4 a = load_vertex(leaf, 0), b = load_vertex(leaf, 1), c = load_vertex(leaf, 2);
  const Vector4 ab = minus(b, a), bc = minus(c, b), ca = minus(a, c);
  // The pair that leaves out the longer of ab and ca has the shortest edge of all in it.
  const __m128 without_ab = _mm_cmpge_ps(dot(ab, ab), dot(ca, ca));
  const Vector4 first = select(ab, bc, without_ab), second = select(bc, ca, without_ab);
  const Vector4 normal{_mm_fmsub_ps(first.y, second.z, _mm_mul_ps(first.z, second.y)),
                       _mm_fmsub_ps(first.z, second.x, _mm_mul_ps(first.x, second.z)),
                       _mm_fmsub_ps(first.x, second.y, _mm_mul_ps(first.y, second.x))};
  const __m128 speed = dot(normal, broadcast(ray.direction));
  parallel = _mm_cmpeq_ps(speed, _mm_setzero_ps());
  return _mm_div_ps(dot(normal, minus(a, broadcast(ray.origin))), speed);
}

// Moves t into the triangle's own box as the ray enters and leaves it; lanes that miss that box are not hit. At grazing
// angles the rounding of t knows no bound: without this a tree with tighter boxes would lose hits that another finds.
inline __m128 hold_in_own_box(const TraceLeaf& leaf, const KernelRay& ray, __m128& t) {
  __m128 near = _mm_set1_ps(-FLT_MAX), far = _mm_set1_ps(FLT_MAX);
  for (int a = 0; a < 3; ++a) {
    const __m128 v0 = _mm_load_ps(leaf.vertex[0][a]), v1 = _mm_load_ps(leaf.vertex[1][a]), v2 = _mm_load_ps(leaf.vertex[2][a]);
    const __m128 origin = _mm_set1_ps(ray.origin[a]), inverse = _mm_set1_ps(ray.inverse[a]);
    const __m128 lower = _mm_mul_ps(_mm_sub_ps(_mm_min_ps(_mm_min_ps(v0, v1), v2), origin), inverse);
    const __m128 upper = _mm_mul_ps(_mm_sub_ps(_mm_max_ps(_mm_max_ps(v0, v1), v2), origin), inverse);
    const __m128 pad = _mm_set1_ps(ray.triangle_pad[a]);
    near = _mm_max_ps(near, _mm_sub_ps(_mm_min_ps(lower, upper), pad));
    far = _mm_min_ps(far, _mm_add_ps(_mm_max_ps(lower, upper), pad));
  }
  t = _mm_max_ps(_mm_min_ps(t, far), near);
  return _mm_cmple_ps(near, far);
}

Opacity opacity_at(const TracePageView& page, uint32_t offset, float u, float v) {
  OpacityMicromap map;
  std::memcpy(&map, page.bytes + offset, sizeof map);
  const uint32_t index = micro_triangle_index(u, v, map.level);
  const auto states = static_cast<uint8_t>(page.bytes[offset + sizeof map + index / 4]);
  return static_cast<Opacity>((states >> (2 * (index % 4))) & 3);
}

inline bool comes_first(float t, uint32_t instance, uint32_t prim, const TraceHit& hit) {
  if (t != hit.t) return t < hit.t;
  return instance != hit.instance ? instance < hit.instance || hit.prim == PrimId::kNone : prim < hit.prim;
}

// Four triangles. Returns true when an occlusion ray is stopped for good.
template <TraceMode mode>
inline bool intersect_leaf(const TracePageView& page, uint32_t leaf_index, uint32_t instance, const KernelRay& ray,
                           float t_far, TraceHit& hit) {
  const TraceLeaf& leaf = page.leaves[leaf_index];
  const __m128 ox = _mm_set1_ps(ray.ox), oy = _mm_set1_ps(ray.oy), oz = _mm_set1_ps(ray.oz);
  const __m128 sx = _mm_set1_ps(ray.sx), sy = _mm_set1_ps(ray.sy);
  const __m128 az = _mm_sub_ps(_mm_load_ps(leaf.vertex[0][ray.kz]), oz);
  const __m128 bz = _mm_sub_ps(_mm_load_ps(leaf.vertex[1][ray.kz]), oz);
  const __m128 cz = _mm_sub_ps(_mm_load_ps(leaf.vertex[2][ray.kz]), oz);
  const __m128 ax = _mm_fnmadd_ps(sx, az, _mm_sub_ps(_mm_load_ps(leaf.vertex[0][ray.kx]), ox));
  const __m128 ay = _mm_fnmadd_ps(sy, az, _mm_sub_ps(_mm_load_ps(leaf.vertex[0][ray.ky]), oy));
  const __m128 bx = _mm_fnmadd_ps(sx, bz, _mm_sub_ps(_mm_load_ps(leaf.vertex[1][ray.kx]), ox));
  const __m128 by = _mm_fnmadd_ps(sy, bz, _mm_sub_ps(_mm_load_ps(leaf.vertex[1][ray.ky]), oy));
  const __m128 cx = _mm_fnmadd_ps(sx, cz, _mm_sub_ps(_mm_load_ps(leaf.vertex[2][ray.kx]), ox));
  const __m128 cy = _mm_fnmadd_ps(sy, cz, _mm_sub_ps(_mm_load_ps(leaf.vertex[2][ray.ky]), oy));
  const Edges e{_mm_sub_ps(_mm_mul_ps(cx, by), _mm_mul_ps(cy, bx)), _mm_sub_ps(_mm_mul_ps(ax, cy), _mm_mul_ps(ay, cx)),
          _mm_sub_ps(_mm_mul_ps(bx, ay), _mm_mul_ps(by, ax))};
  const __m128 zero = _mm_setzero_ps();
  const __m128 lowest = _mm_min_ps(_mm_min_ps(e.u, e.v), e.w), highest = _mm_max_ps(_mm_max_ps(e.u, e.v), e.w);
  const __m128 mixed = _mm_and_ps(_mm_cmplt_ps(lowest, zero), _mm_cmpgt_ps(highest, zero));
  const __m128 det = _mm_add_ps(_mm_add_ps(e.u, e.v), e.w);
  __m128 accept = _mm_andnot_ps(mixed, _mm_cmpneq_ps(det, zero));
  if (_mm_movemask_ps(accept) == 0) return false;
  __m128 parallel;
  __m128 t4 = plane_distance(leaf, ray, parallel);
  accept = _mm_andnot_ps(parallel, _mm_and_ps(accept, hold_in_own_box(leaf, ray, t4)));
  accept = _mm_and_ps(accept, _mm_and_ps(_mm_cmpgt_ps(t4, zero), _mm_cmple_ps(t4, _mm_set1_ps(std::min(t_far, FLT_MAX)))));
  auto lanes = static_cast<uint32_t>(_mm_movemask_ps(accept));
  if (lanes == 0) return false;
  alignas(16) float t[4], u[4], v[4];
  _mm_store_ps(t, t4);
  _mm_store_ps(u, _mm_div_ps(e.v, det));
  _mm_store_ps(v, _mm_div_ps(e.w, det));
  for (; lanes != 0; lanes &= lanes - 1) {
    const int i = std::countr_zero(lanes);
    uint32_t flags = 0;
    if (page.micromap_offsets != nullptr && page.micromap_offsets[4 * leaf_index + i] != 0) {
      const Opacity opacity = opacity_at(page, page.micromap_offsets[4 * leaf_index + i], u[i], v[i]);
      if (opacity == Opacity::clear) continue;
      if (opacity == Opacity::unknown) flags = kHitAlphaUnknown;
    }
    if (mode == TraceMode::occlusion && flags == 0) {
      hit.flags |= kHitOccluded;
      return true;
    }
    if (comes_first(t[i], instance, leaf.prim[i], hit)) hit = {t[i], u[i], v[i], leaf.prim[i], instance, flags};
  }
  return false;
}

// An occlusion ray looks as far as the light whatever alpha it meets: what stops it for good does not depend on order.
template <TraceMode mode>
SPILLWAY_INLINE bool walk_page(const TracePageView& page, uint32_t instance, const KernelRay& ray, const float& t_far, TraceHit& hit,
               TraceCounters& work) {
  const TreeView<TraceLeaf> tree{page.nodes, page.leaves};
  uint64_t nodes = 0, leaves = 0;
  const auto on_leaf = [&](uint32_t leaf) {
    ++leaves;
    return intersect_leaf<mode>(page, leaf, instance, ray, t_far, hit);
  };
  bool ended;
  if constexpr (mode == TraceMode::occlusion)
    ended = walk_unordered(tree, page.header->root, ray, t_far, nodes, on_leaf);
  else
    ended = walk(tree, page.header->root, ray, t_far, nodes, on_leaf);
  work.nodes += nodes, work.leaves += leaves, ++work.pages;
  return ended;
}

// By any thread; most often it is set already.
void note_used(uint8_t& used) {
  const std::atomic_ref<uint8_t> shared(used);
  if (shared.load(std::memory_order_relaxed) == 0) shared.store(1, std::memory_order_relaxed);
}

// Whether the ray enters a page that is not in memory as far as is known of its tree; where nothing is, it may.
// Out of line, as what renders that fit do not need.
[[gnu::noinline]] bool may_meet(const TracePageView& page, const KernelRay& ray, float t_far, uint64_t& nodes) {
  if (page.nodes == nullptr) return true;
  return walk(TreeView<TraceLeaf>{page.nodes, page.leaves}, 0, ray, t_far, nodes, [](uint32_t) { return true; });
}

float extent_of(const Bounds3& b) { return std::max(max_abs(b.lower), max_abs(b.upper)); }

// Out of line, so that what stands still does not pay for it.
[[gnu::noinline]] KernelRay moving_object_ray(const PageTree& tree, const Instance& instance, const TraceRay& ray) {
  const Affine3 object_from_world = pose_at(tree.motions[instance.motion - 1], ray.time).inverse;
  return {object_from_world.point(ray.origin_world), object_from_world.vector(ray.direction_world),
          extent_of(tree.objects[instance.object].bounds_object)};
}

KernelRay object_ray(const PageTree& tree, const Instance& instance, const TraceRay& ray) {
  if (instance.motion != 0) [[unlikely]] return moving_object_ray(tree, instance, ray);
  return {instance.object_from_world.point(ray.origin_world), instance.object_from_world.vector(ray.direction_world),
          extent_of(tree.objects[instance.object].bounds_object)};
}

KernelRay world_ray(const PageTree& tree, const TraceRay& ray) {
  return {ray.origin_world, ray.direction_world, tree.scene_extent_world};
}

// Calls on_page(page, instance, ray in the page's space) for every page the ray enters at t <= t_far, front to back
// inside each tree; true ends it.
template <class OnPage>
bool walk_pages(const PageTree& tree, const TraceRay& ray, const float& t_far, uint64_t& node_count, const OnPage& on_page) {
  const KernelRay world = world_ray(tree, ray);
  const TreeView<PageTreeEntry> view{tree.nodes.data(), tree.entries.data()};
  return walk(view, tree.objects[0].root, world, t_far, node_count, [&](uint32_t leaf) {
    const PageTreeEntry& entry = tree.entries[leaf];
    if (entry.kind == 0) return on_page(entry.index, 0u, world);
    const Instance& instance = tree.instances[entry.index];
    const KernelRay local = object_ray(tree, instance, ray);
    return walk(view, tree.objects[instance.object].root, local, t_far, node_count,
                [&](uint32_t inner) { return on_page(tree.entries[inner].index, entry.index, local); });
  });
}

}  // namespace

template <TraceMode mode>
void trace_page(const TracePageView& page, uint32_t instance, const PageTree& tree, const TraceRay& ray, TraceHit& hit,
                TraceCounters& work) {
  const KernelRay local = instance == 0 ? world_ray(tree, ray) : object_ray(tree, tree.instances[instance], ray);
  const float& t_far = mode == TraceMode::nearest ? hit.t : ray.t_max;
  walk_page<mode>(page, instance, local, t_far, hit, work);
}

template <TraceMode mode>
void trace_resident(const PageTree& tree, const ResidentPages& pages, const TraceRay& ray, TraceHit& hit,
                    TraceCounters& work, DueVisits& due) {
  const float& t_far = mode == TraceMode::nearest ? hit.t : ray.t_max;
  walk_pages(tree, ray, t_far, work.nodes, [&](uint32_t index, uint32_t instance, const KernelRay& local) {
    const TracePageView& page = pages.view(index);
    if (page.header == nullptr) {
      if (!may_meet(page, local, t_far, work.nodes)) return false;
      if (due.count < due.capacity) due.visits[due.count] = {index, instance};
      ++due.count;
      return false;
    }
    const uint64_t leaves_before = work.leaves;
    const bool ended = walk_page<mode>(page, instance, local, t_far, hit, work);
    if (due.used != nullptr && work.leaves != leaves_before) note_used(due.used[index]);
    return ended;
  });
}

size_t pages_met(const PageTree& tree, const ResidentPages& pages, uint32_t first_page, uint32_t last_page,
                 TraceMode mode, const TraceRay& ray, const TraceHit& hit, PageVisit* visits, size_t capacity) {
  size_t count = 0;
  uint64_t nodes = 0;
  const float t_far = mode == TraceMode::nearest ? hit.t : ray.t_max;
  walk_pages(tree, ray, t_far, nodes, [&](uint32_t index, uint32_t instance, const KernelRay& local) {
    const TracePageView& page = pages.view(index);
    if (index >= first_page && index < last_page && page.header == nullptr && may_meet(page, local, t_far, nodes)) {
      if (count < capacity) visits[count] = {index, instance};
      ++count;
    }
    return false;
  });
  return count;
}

size_t keep_visits_ahead(const PageTree& tree, const ResidentPages& pages, TraceMode mode, const TraceRay& ray,
                         const TraceHit& hit, std::span<PageVisit> visits) {
  const float t_far = mode == TraceMode::nearest ? hit.t : ray.t_max;
  KernelRay local = world_ray(tree, ray);
  uint32_t space = 0;
  size_t kept = 0;
  uint64_t nodes = 0;
  for (const PageVisit visit : visits) {
    const TracePageView& page = pages.view(visit.page);
    // Where nothing is known of a page's own tree, those above it have to be asked, of no pages but these.
    if (page.nodes == nullptr) {
      const auto [first, last] = std::ranges::minmax(visits, {}, &PageVisit::page);
      return pages_met(tree, pages, first.page, last.page + 1, mode, ray, hit, visits.data(), visits.size());
    }
    if (visit.instance != space) {
      space = visit.instance;
      local = space == 0 ? world_ray(tree, ray) : object_ray(tree, tree.instances[space], ray);
    }
    if (may_meet(page, local, t_far, nodes)) visits[kept++] = visit;
  }
  return kept;
}

template void trace_page<TraceMode::nearest>(const TracePageView&, uint32_t, const PageTree&, const TraceRay&, TraceHit&,
                                             TraceCounters&);
template void trace_page<TraceMode::occlusion>(const TracePageView&, uint32_t, const PageTree&, const TraceRay&,
                                               TraceHit&, TraceCounters&);
template void trace_resident<TraceMode::nearest>(const PageTree&, const ResidentPages&, const TraceRay&, TraceHit&,
                                                 TraceCounters&, DueVisits&);
template void trace_resident<TraceMode::occlusion>(const PageTree&, const ResidentPages&, const TraceRay&, TraceHit&,
                                                   TraceCounters&, DueVisits&);

}  // namespace spillway::cache
