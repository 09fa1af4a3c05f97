#pragma once

// Heights for displaced cages, from the scene's textures.
//
// Threads: heights may be asked for by any number of threads. Fails: heights after an error (an image that cannot be read)
// are zero, and status() is the first that was kept.

#include <tbb/enumerable_thread_specific.h>

#include <mutex>
#include <span>

#include "pipeline/evaluate_texture.h"
#include "pipeline/pack/subdivision_cage.h"
#include "pipeline/pack/surface_sample.h"

namespace spillway::pipeline {

class Displacement {
 public:
  // `images` may be null when no node is an image; infos are theirs.
  Displacement(std::span<const TextureNode> textures, std::span<const cache::ImageInfo> infos, cache::TextureCache* images)
      : textures_(textures), infos_(infos), evaluator_(textures, images) {}

  // Empty when the cage is not displaced. Textures of places look at the undisplaced surface, in the space of its object.
  [[nodiscard]] HeightsAt heights(const SubdivisionCage& cage) const;
  // Of everything that heights depend on.
  [[nodiscard]] uint64_t key(const SubdivisionCage& cage) const;
  [[nodiscard]] Status status() const;

 private:
  void evaluate(uint32_t texture, float scale, std::span<const HeightPlace> places, std::span<float> heights) const;
  [[nodiscard]] uint64_t node_key(uint32_t node) const;

  std::span<const TextureNode> textures_;
  std::span<const cache::ImageInfo> infos_;
  TextureEvaluator evaluator_;
  mutable tbb::enumerable_thread_specific<TextureEvaluator::Scratch> scratch_;
  mutable std::mutex mutex_;
  mutable Status status_;
};

// Whether the texture depends on uvs.
[[nodiscard]] bool reads_uvs(std::span<const TextureNode> textures, uint32_t texture);

}  // namespace spillway::pipeline
