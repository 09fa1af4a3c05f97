#pragma once

// The texture graph of a scene (scene.h, TextureNode), evaluated for blocks of places: all image lookups of a block go
// to the cache together, then values are combined. A value depends on its own query alone.

#include <cstdint>
#include <span>
#include <vector>

#include "cache/base/result.h"
#include "cache/texture_cache.h"
#include "pipeline/scene.h"

namespace spillway::pipeline {

struct ShadingPoint;

struct TextureQuery {
  uint32_t texture;  // TextureId
  Float2 uv;         // near the point's own: bump mapping looks a step away
  float width_uv;    // footprint; 0: the finest level, also of what does not depend on uv
  // Of a graph with places (mappings other than uv) or normals: what it looks at. Others do not touch it.
  const ShadingPoint* point = nullptr;
};

// What an image node makes of the texel that was looked up.
[[nodiscard]] cache::Texel image_value(const TextureNode& node, cache::Texel texel);

// The face textures in a graph, as FaceTextureIds.
[[nodiscard]] std::vector<uint32_t> face_textures_in(std::span<const TextureNode> nodes, uint32_t texture);
// The textures of a material's own parameters whose graphs have face textures.
[[nodiscard]] std::vector<uint32_t> face_texture_params(const Material& material, std::span<const TextureNode> nodes);

// Counts lookups by the point they are made for, and says who asks. Empty: nobody wants to know.
struct LookupTally {
  const ShadingPoint* points = nullptr;  // all queries' points are among these
  std::span<uint32_t> counts = {};
  std::span<const uint64_t> users = {};  // by point, for TextureCache::note_first_users(); with counts
};

class TextureEvaluator {
 public:
  // `images` may be null when no node is an image. Nodes have been validated: children before parents.
  TextureEvaluator(std::span<const TextureNode> nodes, cache::TextureCache* images) : nodes_(nodes), images_(images) {}

  // Reused from block to block by one thread.
  struct Scratch {
    std::vector<cache::TextureRequest> requests;
    std::vector<cache::FaceTextureRequest> face_requests;
    std::vector<cache::Texel> texels, face_texels;
    std::vector<uint64_t> users, face_users;  // of the requests, where they are told
    LookupTally tally;
    [[nodiscard]] size_t lookup_count() const { return requests.size() + face_requests.size(); }
  };
  Status evaluate(std::span<const TextureQuery> queries, std::span<cache::Texel> values, Scratch& scratch) const;

  // The face textures that evaluate() would look up.
  void append_face_requests(const TextureQuery& query, std::vector<cache::FaceTextureRequest>& requests) const;
  [[nodiscard]] cache::TextureCache* images() const { return images_; }
  [[nodiscard]] std::span<const TextureNode> nodes() const { return nodes_; }

 private:
  // Texels of a block, taken one after the other.
  struct Texels {
    const cache::Texel *image, *face;
  };
  void collect_and_count(const TextureQuery& query, Scratch& scratch) const;
  void collect(uint32_t node, const TextureQuery& query, Scratch& scratch) const;
  cache::Texel combine(uint32_t node, const TextureQuery& query, Texels& next) const;

  std::span<const TextureNode> nodes_;
  cache::TextureCache* images_;
};

}  // namespace spillway::pipeline
