#include "pipeline/render/select_lights.h"

#include <algorithm>
#include <vector>

namespace spillway::pipeline {
namespace {

using shading::LightChild;

// Puts into each node how many lights are below each child, where energies were.
class Counter {
 public:
  Counter(const shading::LightTree& tree, std::span<shading::LightNode> nodes)
      : tree_(tree), nodes_(nodes), counts_(tree.roots.size()) {
    for (uint32_t o = 1; o < counts_.size(); ++o) counts_[o] = count(tree.roots[o]);
    count(tree.roots[0]);
  }

 private:
  float count(uint32_t index) {  // as deep as the tree, which is bounded
    if (index == shading::kNoLightNode) return 0;
    shading::LightNode& node = nodes_[index];
    float sum = 0;
    for (uint32_t slot = 0; slot < node.child_count; ++slot) {
      node.energy[slot] = below(node.child[slot]);
      sum += node.energy[slot];
    }
    return sum;
  }

  float below(uint32_t child) {
    const uint32_t index = shading::light_child_index(child);
    switch (shading::light_child_kind(child)) {
      case LightChild::node:
        return count(index);
      case LightChild::instance:
        return counts_[tree_.instances[index].object];
      default:
        return 1;
    }
  }

  const shading::LightTree& tree_;
  std::span<shading::LightNode> nodes_;
  std::vector<float> counts_;
};

// Of every emission, when one of them is looked up.
Buffer<shading::EmissionPlace> emission_places(const Store& store) {
  const auto is_looked_up = [&](const Mesh& mesh) { return looks_up_emission(store, mesh); };
  if (std::ranges::none_of(store.meshes(), is_looked_up)) return {};
  Buffer<shading::EmissionPlace> places(MemoryTag::lights, store.emissions().size());
  for (const Mesh& mesh : store.meshes())
    if (mesh.light_base != LightId::kNone)
      places[store.emitters()[mesh.light_base].emission] = {
          mesh.prim_base - mesh.light_base, mesh.flags & kMeshFlipNormals, is_looked_up(mesh) ? 1u : 0u};
  return places;
}

}  // namespace

bool looks_up_emission(const Store& store, const Mesh& mesh) {
  if (mesh.light_base == LightId::kNone) return false;
  return mesh.alpha_texture != TextureId::kNone ||
         store.emissions()[store.emitters()[mesh.light_base].emission].texture != shading::kNoEmissionTexture;
}

SelectedLights::SelectedLights(const Store& store, const RenderSettings& settings) : table_(store.light_table()) {
  table_.emitters_by_area = settings.estimator == Estimator::light_by_area;
  places_ = emission_places(store);
  table_.places = places_;
  table_.tree.by_energy = settings.light_selection != LightSelection::tree;
  if (settings.light_selection == LightSelection::uniform) select_uniformly();
}

// Lights without a place keep their chances, so that the ways of choosing differ in one thing.
void SelectedLights::select_uniformly() {
  if (!table_.tree.empty()) return count_in_nodes();
  const size_t emitters = table_.emitters.size();
  const auto is_placed = [&](size_t choice) {
    return choice < emitters || shading::has_place(table_.lights[choice - emitters]);
  };
  const size_t choices = table_.cdf.size() - 1;
  double share = 0, count = 0;
  for (size_t i = 0; i < choices; ++i)
    if (is_placed(i)) share += static_cast<double>(table_.cdf[i + 1]) - table_.cdf[i], count += 1;
  if (count == 0) return;
  cdf_ = Buffer<float>(MemoryTag::lights, choices + 1);
  double sum = 0;
  for (size_t i = 0; i < choices; ++i) {
    sum += is_placed(i) ? share / count : static_cast<double>(table_.cdf[i + 1]) - table_.cdf[i];
    cdf_[i + 1] = static_cast<float>(std::min(sum, 1.0));
  }
  cdf_[choices] = 1;
  table_.cdf = cdf_;
}

void SelectedLights::count_in_nodes() {
  nodes_ = Buffer<shading::LightNode>(MemoryTag::lights, table_.tree.nodes.size());
  std::copy(table_.tree.nodes.begin(), table_.tree.nodes.end(), nodes_.begin());
  Counter(table_.tree, nodes_);
  table_.tree.nodes = nodes_;
}

}  // namespace spillway::pipeline
