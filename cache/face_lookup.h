#pragma once

// One lookup in a face texture: which level, and which texels of the face and of its neighbours.
//
// Inside a level texels are blended bilinearly, of triangles by their distance in the lattice. Beyond an edge lies what
// the neighbour has in an area as large as one of our texels; where its own are larger, the texel that holds the place.
// What lies beyond a corner where not four quads meet has no part; nor has what lies beyond a triangle's border.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "cache/facetex_texel.h"
#include "cache/tile_cache.h"

namespace spillway::cache {

struct Texel;

enum class FaceLevelChoice : uint32_t {
  stochastic,  // of the two levels one, by the request's random number
  trilinear    // both
};

struct FaceTextureRequest {
  uint32_t texture;  // of the cache
  uint32_t face;
  float u, v;              // on the face
  float width_u, width_v;  // footprint in u and v; 0 asks for the finest level
  float random;            // in [0, 1)
  FaceLevelChoice choice;
};

// A texture, with what a lookup needs of its file.
struct FaceTexture {
  const FaceTexFile* file = nullptr;
  const FaceTexTexture* texture = nullptr;
  std::span<const FaceInfo> faces;
  std::span<const uint32_t> numbers;
  const FaceTexDecoder* decoder = nullptr;
  const TileFile* tiles = nullptr;
  uint32_t owner = 0;  // of the counters
  // Of quads of eight bits, for the path that most lookups take: what each number of a channel is.
  bool is_bytes = false;
  uint32_t channels = 0, tile_log2 = 0;
  std::array<const float*, 4> byte_tables = {};
  void choose_tables();
};

// values[i] answers requests[i]. Returns how many were answered before a face that is not there, or a tile that cannot
// be read. Fastest when neighbours share faces: what a lookup reads is asked of the memory some lookups ahead.
// users[i]: who asks, where first users are noted.
size_t look_up_faces(TileThread& thread, std::span<const FaceTexture> textures,
                     std::span<const FaceTextureRequest> requests, std::span<Texel> values,
                     std::span<const uint64_t> users = {});

// Adds the linear value to sum[0 .. channels); false when a tile cannot be read.
bool look_up_face(TileThread& thread, const FaceTexture& texture, const FaceTextureRequest& request, float* sum);

// Appends the numbers, in the file, of the tiles that the request needs, of its face and of neighbours; some more than once.
void append_face_tiles(const FaceTexture& texture, const FaceTextureRequest& request, std::vector<uint64_t>& tiles);

}  // namespace spillway::cache
