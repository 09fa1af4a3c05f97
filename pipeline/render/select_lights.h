#pragma once

// The light table of a store for one way of choosing lights and points on them (RenderSettings::light_selection,
// estimator).

#include "cache/base/memory.h"
#include "pipeline/store.h"

namespace spillway::pipeline {

// Whether a mesh emits what must be looked up: by a texture of its emission, or where it is not opaque.
[[nodiscard]] bool looks_up_emission(const Store& store, const Mesh& mesh);

// Owns what the store's table does not have: nothing, unless lights are chosen uniformly or emission is looked up.
// Memory: tag lights.
class SelectedLights {
 public:
  SelectedLights() = default;
  SelectedLights(const Store& store, const RenderSettings& settings);

  // Views into this and the store, which must outlive them.
  [[nodiscard]] const shading::LightTable& table() const { return table_; }

 private:
  void select_uniformly();
  void count_in_nodes();

  shading::LightTable table_;
  Buffer<shading::EmissionPlace> places_;
  Buffer<float> cdf_;
  Buffer<shading::LightNode> nodes_;
};

}  // namespace spillway::pipeline
