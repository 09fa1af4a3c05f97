#pragma once

// Builds the light trees of a scene, one object after the other.
//
// In:     the lights of an object, in any number; for the world, instances of objects that are done.
// Out:    nodes, the root of each object, and where each emitter and instance is.
// Memory: tag pack: the sort of one object's lights (memory_limit_bytes, then scratch) and one chunk of them (52 bytes
// a
//         light). What is built stays: about 30 bytes a light.
// Order:  depends on the lights alone: sorted along a curve and cut into chunks of a fixed size, each a tree, whose
// roots
//         are the leaves of another one. Sums in fixed order; serial.
// Based on: Conty Estevez and Kulla 2018, section 4 (cuts by energy, size and spread of normals); here the size is the
//         squared diagonal, since streets are flat, and the spread is that of the mean normal. Cuts are at multiples of
//         eight lights, which fills the nodes at the bottom.

#include <cstdint>
#include <memory>
#include <vector>

#include "cache/external_sort.h"
#include "pipeline/pack/light_bounds.h"

namespace spillway::pipeline {

struct LightTrees {
  std::vector<shading::LightNode> nodes;
  std::vector<uint32_t> roots;            // by object; kNoLightNode where nothing emits
  std::vector<uint32_t> emitter_leaves;   // by emitter
  std::vector<uint32_t> instance_leaves;  // by instance, as many as emit; [0] is kNoLightNode
};

struct BuildLightTreeOptions {
  cache::Scratch* scratch = nullptr;
  uint64_t memory_limit_bytes = 64 << 20;
  uint32_t chunk_lights = 1 << 17;  // larger: better trees of more lights than this, and more memory
};

class LightTreeBuilder {
 public:
  // What emits: emitters 0 .. emitter_count, instances 1 .. instance_count.
  LightTreeBuilder(uint32_t object_count, size_t emitter_count, size_t instance_count, BuildLightTreeOptions options);

  // The next lights are of this object, and lie in the box.
  void begin(uint32_t object, const Bounds3& box);
  Status add(const LightItem& item);
  // Builds. The bounds of all of them, energy 0 when there were none; the moments of their normals.
  struct Object {
    LightItem bounds;
    NormalMoments moments;
  };
  Result<Object> end();

  LightTrees take() { return std::move(trees_); }

 private:
  LightItem build(std::vector<LightItem>& items);

  BuildLightTreeOptions options_;
  LightTrees trees_;
  cache::ExternalSort<LightItem> sort_;
  uint32_t object_ = 0;
  uint32_t added_ = 0;
  double energy_ = 0;
  Bounds3 box_;
  NormalMoments moments_;
};

}  // namespace spillway::pipeline
