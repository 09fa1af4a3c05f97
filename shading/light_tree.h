#pragma once

// Which of very many lights: a tree over their bounds, descended with one random number. Two levels: the tree of the
// world holds its triangles, its point and spot lights, and instances; an instance leads to the tree of its object,
// descended in the object's space. The chance of a triangle hit by chance is found from its leaf upwards, and is bit
// for bit the one that sampling had: both multiply the same quotients in the same order, from the root down.
//
// A child's weight estimates the light it brings to the receiver (weigh_lights.h). Estimates of what is near are poor,
// so that a selection begins with a front: the root's children, of which the most doubtful is replaced by its own
// children again and again, through instances too. The front depends on tree and receiver alone. One slot of it is
// chosen in proportion to its weight, and the way down from there goes by weights, node by node. A node all of whose
// children weigh nothing is descended by energy, as is a front without weight, so that the chances of all lights sum to
// one everywhere. Based on: Conty Estevez and Kulla 2018, Importance Sampling of Many Lights with Adaptive Tree
// Splitting (energy, bounds, cones; what is near is split). Different here: nodes of eight children, weighed side by
// side; cosines are means over the bounds instead of upper limits, which makes clusters around the receiver outweigh
// those beside it; one light is chosen from all parts of the split tree, not one from each.

#include <cstddef>
#include <cstdint>
#include <span>

#include "cache/base/vec.h"

namespace spillway::shading {

inline constexpr int kLightNodeWidth = 8;
inline constexpr uint32_t kNoLightNode = 0xffffffffu;
// Nodes on the way from a root to a leaf, of one tree; checked when a store is opened.
inline constexpr uint32_t kMaxLightTreeDepth = 64;

// What a child is: two bits of kind above 30 of index.
enum class LightChild : uint32_t { node = 0, emitter = 1, light = 2, instance = 3 };
[[nodiscard]] constexpr uint32_t light_child(LightChild kind, uint32_t index) {
  return static_cast<uint32_t>(kind) << 30 | index;
}
[[nodiscard]] constexpr LightChild light_child_kind(uint32_t child) { return static_cast<LightChild>(child >> 30); }
[[nodiscard]] constexpr uint32_t light_child_index(uint32_t child) { return child & 0x3fffffffu; }
inline constexpr uint32_t kMaxLightIndex = 0x3fffffffu;

// Eight children, in the space of the tree. Box of child i: origin + scale * (lower, upper)[axis][i]. Its normals lie
// within an angle of the axis whose cosine is cone[i] / 32767 - 1; each emits to the half space around it, and where
// two_sided has bit i, to the other one too. Slots in use come first; the others have no energy.
struct alignas(64) LightNode {
  float origin[3], scale[3];
  uint32_t parent;  // node * 8 + slot; kNoLightNode: a root
  uint8_t child_count;
  uint8_t two_sided;  // a bit a child
  uint16_t reserved;
  float energy[8];    // shares of the tree's
  uint32_t child[8];  // light_child
  uint8_t lower[3][8], upper[3][8];
  int8_t axis[3][8];  // any length but zero
  uint16_t cone[8];
  uint8_t padding[8];
};
static_assert(sizeof(LightNode) == 192);

// A node's slot, as leaves and parents are referred to.
[[nodiscard]] constexpr uint32_t light_place(uint32_t node, uint32_t slot) { return node * kLightNodeWidth + slot; }
inline constexpr uint32_t kMaxLightNodes = 1u << 28;

// What an instance is, wherever the table of instances lies: shading knows numbers only.
struct LightInstance {
  Affine3 world_from_object;
  Affine3 object_from_world;
  uint32_t object;
};
class LightInstances {
 public:
  LightInstances() = default;
  // Items of `stride_bytes` that each begin with a LightInstance.
  LightInstances(const void* first, size_t stride_bytes)
      : first_(static_cast<const std::byte*>(first)), stride_bytes_(stride_bytes) {}
  const LightInstance& operator[](uint32_t i) const {
    return *reinterpret_cast<const LightInstance*>(first_ + i * stride_bytes_);
  }

 private:
  const std::byte* first_ = nullptr;
  size_t stride_bytes_ = 0;
};

// Views of arrays that must outlive it. Instance 0 is the world.
struct LightTree {
  std::span<const LightNode> nodes;
  std::span<const uint32_t> roots;            // of each object's tree; kNoLightNode where nothing emits
  std::span<const uint32_t> emitter_leaves;   // light_place of each emitter
  std::span<const uint32_t> instance_leaves;  // of the first instances, [0] unused; those beyond do not emit
  LightInstances instances;
  bool by_energy = false;  // energies alone: the same chances everywhere
  [[nodiscard]] bool empty() const { return nodes.empty(); }
};

// Where light is gathered. The normal is packed: 16 bits go with each path, and sampling uses what a chance hit will.
struct LightReceiver {
  Float3 position_world;       // not offset
  uint16_t packed_normal = 0;  // 0: gathers from both sides, or has no surface
};
[[nodiscard]] uint16_t pack_receiver_normal(Float3 unit_normal);
[[nodiscard]] Float3 unpack_receiver_normal(uint16_t packed);

struct LightPick {
  LightChild kind = LightChild::node;  // node: nothing
  uint32_t index = 0;                  // of the emitter or the light
  uint32_t instance = 0;               // of the emitter
  float pmf = 0;
};

// The receiver in the space of a tree.
struct LocalLightReceiver {
  Float3 position;
  Float3 normal;    // unit; zero: none
  float scale = 1;  // what its weights are multiplied by, to compare them with the world's
};

// Nodes that are looked into before a choice is made: more make better choices, and cost 20 to 30 ns each (measured in
// bench/RESULTS.md).
inline constexpr uint32_t kLightFrontNodes = 12;

// The chances of all lights at one receiver. Holds views of the tree, which must outlive it.
class LightChances {
 public:
  LightChances(const LightTree& tree, const LightReceiver& receiver);

  // u in [0, 1), with more bits than a float where there are many lights.
  [[nodiscard]] LightPick pick(double u) const;
  // The chance with which pick returns this triangle, bit for bit.
  [[nodiscard]] float of_emitter(uint32_t instance, uint32_t emitter) const;

 private:
  // A node of the front; slots that another node of it has replaced weigh nothing.
  struct Part {
    alignas(32) float weight[kLightNodeWidth];
    alignas(32) float urgency[kLightNodeWidth];
    LocalLightReceiver receiver;
    float sum;
    uint32_t node, instance;
    uint8_t replaced_by[kLightNodeWidth];  // a part; 0: none
  };

  void make_front();
  void add_part(uint32_t node, uint32_t instance, const LocalLightReceiver& receiver);
  bool replace(uint32_t part, uint32_t slot);
  struct Place;
  [[nodiscard]] Place choose_in_front(double& u) const;

  const LightTree& tree_;
  LocalLightReceiver world_;
  Part parts_[kLightFrontNodes];
  float most_urgent_[kLightFrontNodes];
  uint32_t count_ = 0;  // of parts; none: by energy
  float sum_ = 0;
};

[[nodiscard]] inline LightPick pick_light(const LightTree& tree, const LightReceiver& receiver, double u) {
  return LightChances(tree, receiver).pick(u);
}
[[nodiscard]] inline float emitter_pmf(const LightTree& tree, const LightReceiver& receiver, uint32_t instance,
                                       uint32_t emitter) {
  return LightChances(tree, receiver).of_emitter(instance, emitter);
}

}  // namespace spillway::shading
