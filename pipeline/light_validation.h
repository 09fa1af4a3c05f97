#pragma once

// The laws of a store's light tables.

#include <string_view>

#include "cache/base/result.h"
#include "pipeline/store.h"

namespace spillway::pipeline {

// Finite numbers, a unit axis, a spot whose edges are in order. Also used while packing.
Status check_light(const shading::Light& light, std::string_view where);

// Lights, emitters and their distribution. Called on meshes that are valid.
Status validate_lights(const StoreTables& tables, std::string_view where);

// That every light is in one leaf of the tree of its object, that no way down is longer than kMaxLightTreeDepth or
// comes back, and that every leaf is found from its light. Called on tables that are valid otherwise.
Status validate_light_trees(const StoreTables& tables, std::string_view where);

}  // namespace spillway::pipeline
