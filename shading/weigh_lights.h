#pragma once

// What each child of a node of a light tree may bring to a receiver: eight estimates side by side (AVX2).
//
// A weight is energy x emitted towards the receiver x cosine at the receiver / squared distance, each a mean over where
// in the child's bounds the lights may be. It is zero only where nothing can arrive: behind the receiver, or outside of
// all cones of emission. Sums are in a fixed order, and no instruction is used whose result depends on the processor.

#include "shading/light_tree.h"

namespace spillway::shading {

[[nodiscard]] LocalLightReceiver receiver_in_world(const LightReceiver& receiver);
// Normals are planes: those before and behind them stay so under any transform. The scale stays 1.
[[nodiscard]] LocalLightReceiver receiver_in_object(const LocalLightReceiver& world, const LightInstance& instance);

struct LightWeights {
  alignas(32) float of[kLightNodeWidth];
  float sum;  // may be no number, for receivers at the end of what floats hold
};

void weigh_lights(const LightNode& node, const LocalLightReceiver& receiver, LightWeights& weights);

// The same, and by how much each weight may be wrong: what would arrive without the cosines, times the squared ratio of
// the child's radius to its distance. Zero for triangles and lights, which have nothing below.
void weigh_lights(const LightNode& node, const LocalLightReceiver& receiver, LightWeights& weights,
                  float (&urgency)[kLightNodeWidth]);

void weigh_lights_by_energy(const LightNode& node, LightWeights& weights);

}  // namespace spillway::shading
