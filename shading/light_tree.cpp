#include "shading/light_tree.h"

#include <algorithm>
#include <cmath>

namespace spillway::shading {
namespace {

// Packed normals are off by at most 0.0164 rad; a test looks for worse.
constexpr float kNormalError = 0.0175f;
// Mean of 1 / d^2 over a box, against the squared distance of its centre: 1 / (d^2 + this * half diagonal^2).
constexpr float kSpreadOfDistance = 0.4f;
// A cluster around the receiver, or with normals to all sides, always has a part that may shine here.
constexpr float kLeastOfWide = 1.0f / 64;
constexpr float kLargestWeight = 1e30f;
constexpr float kSmallestSquare = 1e-30f;

// The receiver in the space of a tree.
struct LocalReceiver {
  Float3 position;
  Float3 normal;  // zero: none
};

LocalReceiver in_world(const LightReceiver& receiver) {
  return {receiver.position_world,
          receiver.packed_normal == 0 ? Float3{0, 0, 0} : unpack_receiver_normal(receiver.packed_normal)};
}

// Normals are planes: those before and behind them stay so under any transform.
LocalReceiver in_object(const LocalReceiver& world, const LightInstance& instance) {
  LocalReceiver local{instance.object_from_world.point(world.position), {0, 0, 0}};
  const Float3 n = instance.world_from_object.transposed_vector(world.normal);
  const float squared = length_squared(n);
  if (squared > 0 && std::isfinite(squared)) local.normal = n * (1 / std::sqrt(squared));
  return local;
}

// The mean of max(0, c + s x) over x in [-1, 1].
inline float mean_positive(float c, float s) {
  const float t = std::max(0.0f, c + s);
  return c >= s ? c : t * t / (4 * s);
}

struct Weights {
  alignas(32) float of[kLightNodeWidth];
  float sum;
};

// How each child lies to the receiver; arrays of eight for the compiler to work on side by side.
struct Relations {
  alignas(32) float squared[8], spread_squared[8];  // distance of the centre, half diagonal
  alignas(32) float nearness[8];                    // 1 outside of the bounding sphere, less towards its centre
  alignas(32) float sine[8], cosine[8];             // of half the angle that the bounding sphere fills
  alignas(32) float emitted[8], received[8];        // cosines of the centre's direction, times nearness
};

void relate(const LightNode& node, const LocalReceiver& receiver, Relations& r) {
  const Float3 base{node.origin[0] - receiver.position.x, node.origin[1] - receiver.position.y,
                    node.origin[2] - receiver.position.z};
  const Float3 half_scale{0.5f * node.scale[0], 0.5f * node.scale[1], 0.5f * node.scale[2]};
  for (int i = 0; i < 8; ++i) {
    const float lx = node.lower[0][i], ly = node.lower[1][i], lz = node.lower[2][i];
    const float ux = node.upper[0][i], uy = node.upper[1][i], uz = node.upper[2][i];
    const float cx = base.x + half_scale.x * (lx + ux), cy = base.y + half_scale.y * (ly + uy),
                cz = base.z + half_scale.z * (lz + uz);
    const float hx = half_scale.x * (ux - lx), hy = half_scale.y * (uy - ly), hz = half_scale.z * (uz - lz);
    const float squared = std::max(cx * cx + cy * cy + cz * cz, kSmallestSquare);
    const float spread = hx * hx + hy * hy + hz * hz;
    const float ratio = spread / squared;  // of the sphere's radius to the distance, squared
    const float inverse = 1 / std::sqrt(squared);
    const float nearness = ratio > 1 ? 1 / std::sqrt(ratio) : 1.0f;
    const float ax = node.axis[0][i], ay = node.axis[1][i], az = node.axis[2][i];
    const float axis_squared = std::max(ax * ax + ay * ay + az * az, 1.0f);
    r.squared[i] = squared, r.spread_squared[i] = spread, r.nearness[i] = nearness;
    r.sine[i] = std::sqrt(std::min(ratio, 1.0f));
    r.cosine[i] = std::sqrt(std::max(0.0f, 1 - ratio));
    r.emitted[i] = -(ax * cx + ay * cy + az * cz) * inverse / std::sqrt(axis_squared) * nearness;
    r.received[i] = (receiver.normal.x * cx + receiver.normal.y * cy + receiver.normal.z * cz) * inverse * nearness;
  }
}

// The mean of the cosine at the emitters, for each child.
void emission(const LightNode& node, const Relations& r, float (&out)[8]) {
  for (int i = 0; i < 8; ++i) {
    const float cos_cone = static_cast<float>(node.cone[i]) * (1.0f / 32767) - 1;
    const float sin_cone = std::sqrt(std::max(0.0f, 1 - cos_cone * cos_cone));
    // The angle by which directions and normals may be off, together.
    const float cos_off = cos_cone * r.cosine[i] - sin_cone * r.sine[i];
    const float sin_off = sin_cone * r.cosine[i] + cos_cone * r.sine[i];
    const bool wide = cos_off <= 0;
    const float spread = wide ? 1.0f : std::max(sin_off, 1e-4f);
    const float c = wide ? r.emitted[i] * std::max(0.0f, sin_off) : r.emitted[i];
    const float one = mean_positive(c, spread), other = mean_positive(-c, spread);
    const float both = 0.5f * (one + other);
    const float mean = (node.two_sided >> i & 1) != 0 ? both : one;
    out[i] = wide ? std::max(mean, kLeastOfWide) : mean;
  }
}

float sum_of(const float (&w)[8]) {
  float sum = 0;
  for (int i = 0; i < 8; ++i) sum += w[i];
  return sum;
}

void weigh(const LightTree& tree, uint32_t index, const LocalReceiver& receiver, Weights& w) {
  const LightNode& node = tree.nodes[index];
  w.sum = 0;
  if (!tree.by_energy) {
    Relations r;
    relate(node, receiver, r);
    alignas(32) float emitted[8];
    emission(node, r, emitted);
    const bool has_normal = !(receiver.normal == Float3{0, 0, 0});
    for (int i = 0; i < 8; ++i) {
      const float received = mean_positive(r.received[i], std::min(1.0f, r.sine[i] + kNormalError));
      const float cosines = emitted[i] * (has_normal ? received : 1.0f);
      w.of[i] =
          std::min(node.energy[i] * cosines / (r.squared[i] + kSpreadOfDistance * r.spread_squared[i]), kLargestWeight);
    }
    w.sum = sum_of(w.of);
  }
  if (w.sum > 0) return;
  std::copy(node.energy, node.energy + 8, w.of);
  w.sum = sum_of(w.of);
}

// The slot whose part of the sum holds u, which becomes the place inside of that part.
uint32_t choose(const Weights& w, double& u) {
  const double target = u * static_cast<double>(w.sum);
  double before = 0;
  uint32_t slot = 0;
  for (uint32_t i = 0; i < kLightNodeWidth; ++i) {
    if (!(w.of[i] > 0)) continue;
    slot = i;
    if (target < before + static_cast<double>(w.of[i])) break;
    before += static_cast<double>(w.of[i]);
  }
  const double inside = (target - before) / static_cast<double>(w.of[slot]);
  u = std::min(std::max(inside, 0.0), 0x1.fffffffffffffp-1);
  return slot;
}

// The places from a leaf up to its root, appended.
struct Trail {
  uint32_t places[2 * kMaxLightTreeDepth];
  uint32_t count = 0;
  void climb(const LightTree& tree, uint32_t leaf) {
    for (uint32_t place = leaf; place != kNoLightNode && count < 2 * kMaxLightTreeDepth;
         place = tree.nodes[place / kLightNodeWidth].parent)
      places[count++] = place;
  }
};

}  // namespace

// Octahedral, 1 to 255 along each side: zero stays free for "none".
uint16_t pack_receiver_normal(Float3 n) {
  const float size = std::fabs(n.x) + std::fabs(n.y) + std::fabs(n.z);
  if (!(size > 0)) return 0;
  float x = n.x / size, y = n.y / size;
  if (n.z < 0) {
    const float folded_x = std::copysign(1 - std::fabs(y), x), folded_y = std::copysign(1 - std::fabs(x), y);
    x = folded_x, y = folded_y;
  }
  const auto byte = [](float v) { return static_cast<uint16_t>(std::clamp(128 + 127 * v + 0.5f, 1.0f, 255.0f)); };
  return static_cast<uint16_t>(byte(x) << 8 | byte(y));
}

Float3 unpack_receiver_normal(uint16_t packed) {
  const float x = (static_cast<float>(packed >> 8) - 128) * (1.0f / 127);
  const float y = (static_cast<float>(packed & 0xff) - 128) * (1.0f / 127);
  Float3 n{x, y, 1 - std::fabs(x) - std::fabs(y)};
  if (n.z < 0) {
    n.x = std::copysign(1 - std::fabs(y), x);
    n.y = std::copysign(1 - std::fabs(x), y);
  }
  return normalize(n);
}

LightPick pick_light(const LightTree& tree, const LightReceiver& receiver, double u) {
  const LocalReceiver world = in_world(receiver);
  LocalReceiver local = world;
  LightPick pick;
  uint32_t node = tree.roots[0];
  float pmf = 1;
  while (node != kNoLightNode) {
    Weights w;
    weigh(tree, node, local, w);
    if (!(w.sum > 0)) return {};
    const uint32_t slot = choose(w, u);
    pmf *= w.of[slot] / w.sum;
    const uint32_t child = tree.nodes[node].child[slot];
    pick.index = light_child_index(child), pick.kind = light_child_kind(child);
    if (pick.kind == LightChild::node) {
      node = pick.index;
    } else if (pick.kind == LightChild::instance) {
      pick.instance = pick.index;
      const LightInstance& instance = tree.instances[pick.instance];
      local = in_object(world, instance);
      node = tree.roots[instance.object];
    } else {
      pick.pmf = pmf;
      return pick;
    }
  }
  return {};
}

float emitter_pmf(const LightTree& tree, const LightReceiver& receiver, uint32_t instance, uint32_t emitter) {
  if (tree.emitter_leaves[emitter] == kNoLightNode) return 0;
  Trail trail;
  trail.climb(tree, tree.emitter_leaves[emitter]);
  const uint32_t in_object_count = trail.count;
  if (instance != 0) {
    if (instance >= tree.instance_leaves.size() || tree.instance_leaves[instance] == kNoLightNode) return 0;
    trail.climb(tree, tree.instance_leaves[instance]);
  }
  const LocalReceiver world = in_world(receiver);
  LocalReceiver local = world;
  float pmf = 1;
  for (uint32_t i = trail.count; i-- > 0;) {
    if (instance != 0 && i + 1 == in_object_count) local = in_object(world, tree.instances[instance]);
    Weights w;
    weigh(tree, trail.places[i] / kLightNodeWidth, local, w);
    if (!(w.sum > 0)) return 0;
    pmf *= w.of[trail.places[i] % kLightNodeWidth] / w.sum;
  }
  return pmf;
}

}  // namespace spillway::shading
