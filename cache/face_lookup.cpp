#include "cache/face_lookup.h"

#include <algorithm>
#include <cmath>

#include "cache/base/clamp_unit.h"
#include "cache/face_level.h"

namespace spillway::cache {
namespace {

uint64_t tile_of(const FaceLevel& f, uint32_t i, uint32_t j) {
  return f.image->tile_at(f.x0 + (f.is_constant ? 0 : i), f.y0 + (f.is_constant ? 0 : j));
}

// A sum of weighted texels.
struct TexelSum {
  TileThread& thread;
  const FaceTexture& texture;
  float sum[4] = {0, 0, 0, 0};
  float weight = 0;

  const std::byte* texel(const FaceLevel& f, uint32_t i, uint32_t j) {
    const uint32_t x = f.x0 + (f.is_constant ? 0 : i), y = f.y0 + (f.is_constant ? 0 : j);
    const std::byte* tile = thread.tile(*texture.tiles, f.image_index, 0, x, y,
                                        texture.tiles->first_tile + tile_of(f, i, j), texture.owner);
    if (tile == nullptr) return nullptr;
    const uint32_t log2 = f.image->tile_log2, in_tile = (1u << log2) - 1;
    return tile + ((y & in_tile) << log2 | (x & in_tile)) * texture.file->format().texel_bytes();
  }
  void add(const std::byte* at, float share) {
    for (uint32_t c = 0; c < texture.file->format().channels; ++c) sum[c] += share * texture.decoder->value(at, c);
    weight += share;
  }
  bool add(const FaceLevel& f, uint32_t i, uint32_t j, float share) {
    const std::byte* at = texel(f, i, j);
    if (at == nullptr) return false;
    add(at, share);
    return true;
  }
  // Four of one tile: (i, j) is the least of them.
  bool add_four(const FaceLevel& f, uint32_t i, uint32_t j, const float* shares) {
    const std::byte* at = texel(f, i, j);
    if (at == nullptr) return false;
    const size_t right = texture.file->format().texel_bytes(), up = right << f.image->tile_log2;
    add(at, shares[0]), add(at + right, shares[1]), add(at + up, shares[2]), add(at + up + right, shares[3]);
    return true;
  }
  void add_black(float share) { weight += share; }
};

// The tiles that such a sum would need.
struct TileList {
  std::vector<uint64_t>& tiles;

  bool add(const FaceLevel& f, uint32_t i, uint32_t j, float) {
    const uint64_t tile = tile_of(f, i, j);
    if (tiles.empty() || tiles.back() != tile) tiles.push_back(tile);
    return true;
  }
  bool add_four(const FaceLevel& f, uint32_t i, uint32_t j, const float*) { return add(f, i, j, 0); }
  void add_black(float) {}
};

// Which texels a lookup adds up: those of the face and of its neighbours.
template <class Texels>
struct Footprint {
  const FaceTexture& texture;
  Texels& texels;

  bool add(const FaceLevel& f, uint32_t i, uint32_t j, float share) { return texels.add(f, i, j, share); }
  bool level(const FaceInfo& info, uint32_t face, uint32_t level, float u, float v) {
    if ((info.flags & kFaceNeighbourhoodIsConstant) != 0)
      return add(face_level(texture, face, std::max(info.ulog2, info.vlog2)), 0, 0, 1);
    return texture.texture->shape == FaceShape::quad ? quad(face, level, u, v) : triangle(face, level, u, v);
  }
  bool quad(uint32_t face, uint32_t level, float u, float v);
  bool quad_beyond(uint32_t face, const FaceLevel& f, int i, int j, float share);
  bool seen_from(uint32_t face, FacePlace place, int ulog2, int vlog2, float share);
  bool triangle(uint32_t face, uint32_t level, float u, float v);
  bool triangle_beyond(uint32_t face, uint32_t log2, FacePlace place, float share);
};

template <class Texels>
bool Footprint<Texels>::quad(uint32_t face, uint32_t level, float u, float v) {
  const FaceLevel f = face_level(texture, face, level);
  const int width = 1 << f.ulog2, height = 1 << f.vlog2;
  const float x = u * static_cast<float>(width) - 0.5f, y = v * static_cast<float>(height) - 0.5f;
  const float floor_x = std::floor(x), floor_y = std::floor(y);
  const int i = static_cast<int>(floor_x), j = static_cast<int>(floor_y);
  const float fx = x - floor_x, fy = y - floor_y;
  const float shares[4] = {(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
  const bool inside = i >= 0 && j >= 0 && i + 1 < width && j + 1 < height;
  if (inside && !f.is_constant) {
    const uint32_t px = f.x0 + static_cast<uint32_t>(i), py = f.y0 + static_cast<uint32_t>(j);
    const uint32_t last = (1u << f.image->tile_log2) - 1;
    if ((px & last) != last && (py & last) != last)
      return texels.add_four(f, static_cast<uint32_t>(i), static_cast<uint32_t>(j), shares);
  }
  for (int k = 0; k < 4; ++k) {
    const int ki = i + (k & 1), kj = j + (k >> 1);
    if (shares[k] == 0) continue;
    const bool here = ki >= 0 && kj >= 0 && ki < width && kj < height;
    if (!(here ? add(f, static_cast<uint32_t>(ki), static_cast<uint32_t>(kj), shares[k])
               : quad_beyond(face, f, ki, kj, shares[k])))
      return false;
  }
  return true;
}

// What a texel beyond the border of the mesh is: another one of the face, or black.
bool inside_border(FaceBorder border, int size, int& index) {
  if (border == FaceBorder::black) return false;
  index = border == FaceBorder::periodic ? (index + size) % size : std::clamp(index, 0, size - 1);
  return true;
}

// At most one texel beyond an edge, or beyond two.
template <class Texels>
bool Footprint<Texels>::quad_beyond(uint32_t face, const FaceLevel& f, int i, int j, float share) {
  const int width = 1 << f.ulog2, height = 1 << f.vlog2;
  const FaceInfo& info = texture.faces[face];
  const auto edge_of = [](int k, int size, uint32_t below, uint32_t above) {
    return k < 0 ? below : k >= size ? above : 4u;
  };
  uint32_t edge_u = edge_of(i, width, 3, 1), edge_v = edge_of(j, height, 0, 2);
  bool is_black = false;
  if (edge_u < 4 && info.adjacent_faces[edge_u] == kNoFace)
    is_black = !inside_border(texture.texture->u_border, width, i), edge_u = 4;
  if (edge_v < 4 && info.adjacent_faces[edge_v] == kNoFace)
    is_black = !inside_border(texture.texture->v_border, height, j) || is_black, edge_v = 4;
  if (is_black) {
    texels.add_black(share);
    return true;
  }
  if (edge_u == 4 && edge_v == 4) return add(f, static_cast<uint32_t>(i), static_cast<uint32_t>(j), share);
  if (edge_u < 4 && edge_v < 4) {
    const uint32_t corner = edge_u == 3 ? (edge_v == 0 ? 0 : 3) : (edge_v == 0 ? 1 : 2);
    if (!is_regular_corner(texture.faces, face, corner)) return true;
  }
  FacePlace place{(static_cast<float>(i) + 0.5f) / static_cast<float>(width),
                  (static_cast<float>(j) + 0.5f) / static_cast<float>(height)};
  int ulog2 = static_cast<int>(f.ulog2), vlog2 = static_cast<int>(f.vlog2);  // of our texels, as the face counts them
  for (int step = 0; step < 3; ++step) {
    const uint32_t edge = place.u < 0 ? 3 : place.u > 1 ? 1 : place.v < 0 ? 0 : place.v > 1 ? 2 : 4;
    if (edge == 4) break;
    const bool from_subface = texture.faces[face].is_subface();
    const Neighbour to = neighbour_across(texture.faces, face, edge, along_edge(FaceShape::quad, place, edge) >= 0.5f);
    if (!to.exists()) return true;
    place = place_across(FaceShape::quad, place, edge, from_subface, to);
    if ((edge ^ to.edge) & 1) std::swap(ulog2, vlog2);
    if (to.part >= 0) ulog2 += from_subface ? 1 : -1, vlog2 += from_subface ? 1 : -1;
    face = to.face;
  }
  return seen_from(face, place, ulog2, vlog2, share);
}

// The texel of a face at a place, as large as one of a face with 2^ulog2 x 2^vlog2 texels or, where there are only such,
// larger. A level is coarser along both sides: where the face is finer along one more than along the other, texels are
// added up along that one.
template <class Texels>
bool Footprint<Texels>::seen_from(uint32_t face, FacePlace place, int ulog2, int vlog2, float share) {
  constexpr int kMostLog2 = 4;  // 16 texels; beyond that a coarser level does
  const FaceInfo& there = texture.faces[face];
  const int finer_u = std::clamp<int>(there.ulog2 - ulog2, 0, there.ulog2);
  const int finer_v = std::clamp<int>(there.vlog2 - vlog2, 0, there.vlog2);
  const int level = std::max(std::min(finer_u, finer_v), std::max(finer_u, finer_v) - kMostLog2);
  const FaceLevel f = face_level(texture, face, static_cast<uint32_t>(level));
  const uint32_t along_u = f.is_constant ? 0 : static_cast<uint32_t>(std::max(0, finer_u - level));
  const uint32_t along_v = f.is_constant ? 0 : static_cast<uint32_t>(std::max(0, finer_v - level));
  const auto first = [](float at, uint32_t log2, uint32_t along) {
    const float size = static_cast<float>(1u << (log2 - along));
    return static_cast<uint32_t>(std::clamp(at * size, 0.0f, size - 1)) << along;
  };
  const uint32_t i0 = first(place.u, f.ulog2, along_u), j0 = first(place.v, f.vlog2, along_v);
  share = std::ldexp(share, -static_cast<int>(along_u + along_v));
  for (uint32_t j = j0; j < j0 + (1u << along_v); ++j)
    for (uint32_t i = i0; i < i0 + (1u << along_u); ++i)
      if (!add(f, i, j, share)) return false;
  return true;
}

// Texels weigh by how far their middles are, counted in steps of the lattice along its three directions.
template <class Texels>
bool Footprint<Texels>::triangle(uint32_t face, uint32_t level, float u, float v) {
  const FaceLevel f = face_level(texture, face, level);
  const int size = 1 << f.ulog2;
  const float x = u * static_cast<float>(size), y = v * static_cast<float>(size);
  const int first_i = static_cast<int>(x) - 1, first_j = static_cast<int>(y) - 1;
  for (int j = first_j; j < first_j + 3; ++j)
    for (int i = first_i; i < first_i + 3; ++i)
      for (int upper = 0; upper < 2; ++upper) {
        const float middle = static_cast<float>(1 + upper) / 3;
        const float du = static_cast<float>(i) + middle - x, dv = static_cast<float>(j) + middle - y;
        const float share = 1 - std::max({std::fabs(du), std::fabs(dv), std::fabs(du + dv)});
        if (share <= 0) continue;
        const bool here = i >= 0 && j >= 0 && i + j + upper < size;
        const int ti = upper ? size - 1 - j : i, tj = upper ? size - 1 - i : j;
        const FacePlace place{(static_cast<float>(i) + middle) / static_cast<float>(size),
                              (static_cast<float>(j) + middle) / static_cast<float>(size)};
        if (!(here ? add(f, static_cast<uint32_t>(ti), static_cast<uint32_t>(tj), share)
                   : triangle_beyond(face, f.ulog2, place, share)))
          return false;
      }
  return true;
}

template <class Texels>
bool Footprint<Texels>::triangle_beyond(uint32_t face, uint32_t log2, FacePlace place, float share) {
  for (int step = 0; step < 4; ++step) {
    const float w = 1 - place.u - place.v;
    const float lowest = std::min({w, place.u, place.v});
    if (lowest >= 0) break;
    const uint32_t edge = lowest == place.v ? 0 : lowest == w ? 1 : 2;
    const Neighbour to = neighbour_across(texture.faces, face, edge, false);
    if (!to.exists()) return true;
    place = place_across(FaceShape::triangle, place, edge, false, to);
    face = to.face;
  }
  const uint32_t there = texture.faces[face].ulog2;
  const FaceLevel g = face_level(texture, face, there > log2 ? there - log2 : 0);
  const TexelIndex at = triangle_texel({clamp_unit(place.u), clamp_unit(place.v)}, 1 << g.ulog2);
  return add(g, static_cast<uint32_t>(at.u), static_cast<uint32_t>(at.v), share);
}

// Where a request looks, on the face.
FacePlace place_of(const FaceTexture& texture, const FaceTextureRequest& request) {
  const float u = clamp_unit(request.u), v = clamp_unit(request.v);
  if (texture.texture->shape == FaceShape::quad || u + v <= 1) return {u, v};
  return {u / (u + v), 1 - u / (u + v)};  // beyond the diagonal of a triangle there is nothing
}

FaceLevels levels_looked_up(const FaceInfo& face, const FaceTextureRequest& request) {
  FaceLevels levels = levels_of(face, request);
  if (face.flags & kFaceNeighbourhoodIsConstant) levels.blend = 0;
  return levels;
}

}  // namespace

bool look_up_face(TileThread& thread, const FaceTexture& texture, const FaceTextureRequest& request, float* sum) {
  const FaceInfo& face = texture.faces[request.face];
  const FacePlace at = place_of(texture, request);
  const FaceLevels levels = levels_looked_up(face, request);
  for (uint32_t k = 0; k < (levels.blend > 0 ? 2u : 1u); ++k) {
    TexelSum texels{thread, texture};
    if (!Footprint<TexelSum>{texture, texels}.level(face, request.face, levels.fine + k, at.u, at.v)) return false;
    const float scale = (k == 0 ? 1 - levels.blend : levels.blend) / texels.weight;
    for (uint32_t c = 0; c < texture.file->format().channels; ++c) sum[c] += scale * texels.sum[c];
  }
  return true;
}

void append_face_tiles(const FaceTexture& texture, const FaceTextureRequest& request, std::vector<uint64_t>& tiles) {
  const FaceInfo& face = texture.faces[request.face];
  const FacePlace at = place_of(texture, request);
  const FaceLevels levels = levels_looked_up(face, request);
  TileList list{tiles};
  for (uint32_t k = 0; k < (levels.blend > 0 ? 2u : 1u); ++k)
    Footprint<TileList>{texture, list}.level(face, request.face, levels.fine + k, at.u, at.v);
}

}  // namespace spillway::cache
