#pragma once

// Tables of the store with what RenderSettings change of them, to measure the store's own by: how images are filtered,
// and how tight the bounds of media are. Own nothing where the settings leave the store's; views last as long as this
// and the store.

#include "cache/base/memory.h"
#include "pipeline/store.h"

namespace spillway::pipeline {

// Whether textures are looked up in images: those of lights without a surface are in memory, and need no cache.
[[nodiscard]] bool looks_up_images(const Store& store);

// Memory: tag scene.
class SelectedTextures {
 public:
  SelectedTextures() = default;
  SelectedTextures(const Store& store, TextureFilter filter);
  [[nodiscard]] std::span<const TextureNode> nodes() const { return nodes_; }

 private:
  Buffer<TextureNode> changed_;
  std::span<const TextureNode> nodes_;
};

// Memory: tag volumes.
class SelectedMedia {
 public:
  SelectedMedia() = default;
  SelectedMedia(const Store& store, MajorantExtent extent);
  [[nodiscard]] const MediumTables& tables() const { return tables_; }

 private:
  void loosen(const cache::VolumeGrid& grid, MajorantExtent extent);

  Buffer<float> changed_;
  MediumTables tables_;
};

}  // namespace spillway::pipeline
