#include "cache/face_lookup.h"

#include <algorithm>
#include <cmath>

#include "cache/base/clamp_unit.h"
#include "cache/texture_cache.h"

namespace spillway::cache {
namespace {

// Levels of a face that a footprint asks for: one, or two of which the coarser weighs `blend`.
struct Levels {
  uint32_t fine = 0;
  float blend = 0;
};

Levels levels_of(const FaceInfo& face, const FaceTextureRequest& request) {
  const float texels = std::max(request.width_u * static_cast<float>(1u << face.ulog2),
                                request.width_v * static_cast<float>(1u << face.vlog2));
  if (!(texels > 1)) return {};
  const float level = std::min(approximate_log2(texels), static_cast<float>(std::max(face.ulog2, face.vlog2)));
  const auto fine = static_cast<uint32_t>(level);
  const float blend = level - static_cast<float>(fine);
  if (request.choice == FaceLevelChoice::stochastic) return {fine + (request.random < blend ? 1u : 0u), 0};
  return {fine, blend};
}

// A face at a level: how many texels it has there, and where they lie.
struct FaceLevel {
  const FaceTexImage* image;
  uint32_t image_index;
  uint32_t x0, y0;
  uint32_t ulog2, vlog2;
  bool is_constant;  // one texel is all of them
};

FaceLevel face_level(const FaceTexture& t, uint32_t face, uint32_t level) {
  const FaceInfo& info = t.faces[face];
  const bool is_constant = (info.flags & kFaceIsConstant) != 0;
  const uint32_t index = t.file->first_image(info) + (is_constant ? 0 : level);
  const FaceTexImage& image = t.file->images()[index];
  const uint32_t number = t.numbers[face];
  return {&image,
          index,
          image.x_of(number),
          image.y_of(number),
          reduced_log2(info.ulog2, level),
          reduced_log2(info.vlog2, level),
          is_constant};
}

// A sum of weighted texels.
struct Gather {
  TileThread& thread;
  const FaceTexture& texture;
  float sum[4] = {0, 0, 0, 0};
  float weight = 0;

  const std::byte* texel(const FaceLevel& f, uint32_t i, uint32_t j) {
    const uint32_t x = f.x0 + (f.is_constant ? 0 : i), y = f.y0 + (f.is_constant ? 0 : j);
    const std::byte* tile = thread.tile(*texture.tiles, f.image_index, 0, x, y,
                                        texture.tiles->first_tile + f.image->tile_at(x, y), texture.owner);
    if (tile == nullptr) return nullptr;
    return tile + ((y % kFaceTileSize) * kFaceTileSize + x % kFaceTileSize) * texture.file->format().texel_bytes();
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
  bool quad(uint32_t face, uint32_t level, float u, float v);
  bool quad_beyond(uint32_t face, const FaceLevel& f, int i, int j, float share);
  bool triangle(uint32_t face, uint32_t level, float u, float v);
  bool triangle_beyond(uint32_t face, uint32_t log2, FacePlace place, float share);
};

bool Gather::quad(uint32_t face, uint32_t level, float u, float v) {
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
    if (px % kFaceTileSize != kFaceTileSize - 1 && py % kFaceTileSize != kFaceTileSize - 1) {
      const std::byte* at = texel(f, static_cast<uint32_t>(i), static_cast<uint32_t>(j));
      if (at == nullptr) return false;
      const size_t right = texture.file->format().texel_bytes(), up = right * kFaceTileSize;
      add(at, shares[0]), add(at + right, shares[1]), add(at + up, shares[2]), add(at + up + right, shares[3]);
      return true;
    }
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
bool Gather::quad_beyond(uint32_t face, const FaceLevel& f, int i, int j, float share) {
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
    weight += share;
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
  const FaceInfo& there = texture.faces[face];
  const int coarser = std::max({0, there.ulog2 - ulog2, there.vlog2 - vlog2});
  const auto level = static_cast<uint32_t>(std::min<int>(coarser, std::max(there.ulog2, there.vlog2)));
  const FaceLevel g = face_level(texture, face, level);
  const float w = static_cast<float>(1u << g.ulog2), h = static_cast<float>(1u << g.vlog2);
  return add(g, static_cast<uint32_t>(std::clamp(place.u * w, 0.0f, w - 1)),
             static_cast<uint32_t>(std::clamp(place.v * h, 0.0f, h - 1)), share);
}

// Texels weigh by how far their middles are, counted in steps of the lattice along its three directions.
bool Gather::triangle(uint32_t face, uint32_t level, float u, float v) {
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

bool Gather::triangle_beyond(uint32_t face, uint32_t log2, FacePlace place, float share) {
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

}  // namespace

// ---- the path that most lookups take ----

namespace {

constexpr size_t kAhead = 8;        // lookups, of texels: reads from memory under way at a time
constexpr size_t kFacesAhead = 16;  // and of what is known of faces
static_assert((kAhead & (kAhead - 1)) == 0);

// The face of the latest lookup at its level, as long as lookups stay there.
struct FaceInHand {
  static constexpr uint32_t kNoLevel = UINT32_MAX;
  uint32_t texture = UINT32_MAX, face = kNoFace, level = kNoLevel;
  const FaceInfo* info = nullptr;  // null: its lookups take the general path
  uint32_t image_index = 0, x0 = 0, y0 = 0, tiles_across = 0;
  int last_i = 0, last_j = 0;  // texels that have a neighbour to the right, and above, are before these
  float width = 0, height = 0;
  uint64_t first_tile = 0;  // of the image, in the cache's numbering

  void take(const FaceTexture& t, const FaceTextureRequest& request) {
    texture = request.texture, face = request.face, level = kNoLevel, info = nullptr;
    if (!t.is_bytes || face >= t.faces.size()) return;
    const FaceInfo& found = t.faces[face];
    if ((found.flags & (kFaceIsConstant | kFaceNeighbourhoodIsConstant)) == 0) info = &found;
  }
  void turn_to(const FaceTexture& t, uint32_t to) {
    level = to;
    const FaceLevel f = face_level(t, face, level);
    image_index = f.image_index, x0 = f.x0, y0 = f.y0, tiles_across = f.image->tiles_across();
    last_i = (1 << f.ulog2) - 1, last_j = (1 << f.vlog2) - 1;
    width = static_cast<float>(1 << f.ulog2), height = static_cast<float>(1 << f.vlog2);
    first_tile = t.tiles->first_tile + f.image->first_tile;
  }
};

// A lookup in one level of a quad of bytes whose four texels lie in one tile: where they are and what they weigh. Other
// lookups are found not to be `inside`, and take the general path. The arithmetic is that of Gather::quad.
struct Inside {
  bool inside = false;
  uint32_t image_index, x, y;
  uint64_t tile;    // in the cache's numbering
  uint32_t offset;  // bytes in the tile
  float shares[4];
};

void find_inside(const FaceTexture& t, const FaceTextureRequest& request, FaceInHand& face, Inside& found) {
  found.inside = false;
  if (request.face != face.face || request.texture != face.texture) face.take(t, request);
  if (face.info == nullptr) return;
  const Levels levels = levels_of(*face.info, request);
  if (levels.blend > 0) return;
  if (levels.fine != face.level) face.turn_to(t, levels.fine);
  const float x = clamp_unit(request.u) * face.width - 0.5f, y = clamp_unit(request.v) * face.height - 0.5f;
  const float floor_x = std::floor(x), floor_y = std::floor(y);
  const int i = static_cast<int>(floor_x), j = static_cast<int>(floor_y);
  if (i < 0 || j < 0 || i >= face.last_i || j >= face.last_j) return;
  found.x = face.x0 + static_cast<uint32_t>(i), found.y = face.y0 + static_cast<uint32_t>(j);
  const uint32_t in_x = found.x % kFaceTileSize, in_y = found.y % kFaceTileSize;
  if (in_x == kFaceTileSize - 1 || in_y == kFaceTileSize - 1) return;
  const float fx = x - floor_x, fy = y - floor_y;
  found.inside = true;
  found.shares[0] = (1 - fx) * (1 - fy), found.shares[1] = fx * (1 - fy);
  found.shares[2] = (1 - fx) * fy, found.shares[3] = fx * fy;
  found.image_index = face.image_index;
  found.tile =
      face.first_tile + uint64_t{found.y / kFaceTileSize} * face.tiles_across + found.x / kFaceTileSize;
  found.offset = (in_y * kFaceTileSize + in_x) * t.channels;
}

// Sums as Gather::add makes them, channel by channel.
template <uint32_t kChannels>
Texel sum_of_four(const FaceTexture& t, const std::byte* at, const float* shares) {
  constexpr size_t kUp = kFaceTileSize * kChannels;
  const std::byte* const texels[4] = {at, at + kChannels, at + kUp, at + kUp + kChannels};
  const float scale = 1 / (shares[0] + shares[1] + shares[2] + shares[3]);
  float sum[kChannels];
  for (uint32_t c = 0; c < kChannels; ++c) {
    const float* const table = t.byte_tables[c];
    float value = 0;
    for (int k = 0; k < 4; ++k) value += shares[k] * table[static_cast<uint8_t>(texels[k][c])];
    sum[c] = scale * value;
  }
  return spread_channels(sum, kChannels);
}

bool look_up_inside(TileThread& thread, const FaceTexture& t, const Inside& found, Texel& value) {
  const std::byte* const tile = thread.tile(*t.tiles, found.image_index, 0, found.x, found.y, found.tile, t.owner);
  if (tile == nullptr) return false;
  const std::byte* const at = tile + found.offset;
  switch (t.channels) {
    case 1:
      value = sum_of_four<1>(t, at, found.shares);
      break;
    case 2:
      value = sum_of_four<2>(t, at, found.shares);
      break;
    case 3:
      value = sum_of_four<3>(t, at, found.shares);
      break;
    default:
      value = sum_of_four<4>(t, at, found.shares);
  }
  return true;
}

void prefetch(const TileThread& thread, const FaceTexture& t, const Inside& found) {
  const std::byte* const tile = found.inside ? thread.at_hand(found.tile) : nullptr;
  if (tile == nullptr) return;
  __builtin_prefetch(tile + found.offset);
  __builtin_prefetch(tile + found.offset + size_t{kFaceTileSize} * t.channels);
}

void prefetch_face(const FaceTexture& t, uint32_t face) {
  if (face >= t.faces.size()) return;
  __builtin_prefetch(&t.faces[face]);
  __builtin_prefetch(&t.numbers[face]);
}

}  // namespace

void FaceTexture::choose_tables() {
  channels = file->format().channels;
  is_bytes = texture->shape == FaceShape::quad && file->format().type == FaceTexelType::uint8;
  for (uint32_t c = 0; is_bytes && c < channels; ++c) byte_tables[c] = decoder->byte_table(c);
}

size_t look_up_faces(TileThread& thread, std::span<const FaceTexture> textures,
                     std::span<const FaceTextureRequest> requests, std::span<Texel> values,
                     std::span<const uint64_t> users) {
  std::array<Inside, kAhead> ahead;
  FaceInHand face;
  const auto find = [&](size_t i) {
    const FaceTexture& texture = textures[requests[i].texture];
    Inside& found = ahead[i % kAhead];
    find_inside(texture, requests[i], face, found);
    prefetch(thread, texture, found);
  };
  const size_t count = requests.size();
  for (size_t i = 0; i < std::min(kAhead, count); ++i) find(i);
  for (size_t i = 0; i < count; ++i) {
    const FaceTextureRequest& request = requests[i];
    const FaceTexture& texture = textures[request.texture];
    if (request.face >= texture.faces.size()) return i;
    if (i + kFacesAhead < count && requests[i + kFacesAhead].face != requests[i + kFacesAhead - 1].face)
      prefetch_face(textures[requests[i + kFacesAhead].texture], requests[i + kFacesAhead].face);
    if (!users.empty()) thread.set_user(users[i]);
    ++thread.counters[texture.owner].lookups;
    const Inside& found = ahead[i % kAhead];
    if (found.inside) {
      if (!look_up_inside(thread, texture, found, values[i])) return i;
    } else {
      float sum[4] = {0, 0, 0, 0};
      if (!look_up_face(thread, texture, request, sum)) return i;
      values[i] = spread_channels(sum, texture.channels);
    }
    if (i + kAhead < count) find(i + kAhead);
  }
  return count;
}

bool look_up_face(TileThread& thread, const FaceTexture& texture, const FaceTextureRequest& request, float* sum) {
  const FaceInfo& face = texture.faces[request.face];
  float u = clamp_unit(request.u), v = clamp_unit(request.v);
  const bool is_quad = texture.texture->shape == FaceShape::quad;
  if (!is_quad && u + v > 1) u /= u + v, v = 1 - u;  // beyond the diagonal of a triangle there is nothing
  Levels levels = levels_of(face, request);
  if (face.flags & kFaceNeighbourhoodIsConstant) levels.blend = 0;
  for (int k = 0; k < (levels.blend > 0 ? 2 : 1); ++k) {
    Gather gather{thread, texture};
    const uint32_t level = levels.fine + static_cast<uint32_t>(k);
    const bool is_flat = (face.flags & kFaceNeighbourhoodIsConstant) != 0;
    const bool read = is_flat ? gather.add(face_level(texture, request.face, std::max(face.ulog2, face.vlog2)), 0, 0, 1)
                      : is_quad ? gather.quad(request.face, level, u, v)
                                : gather.triangle(request.face, level, u, v);
    if (!read) return false;
    const float scale = (k == 0 ? 1 - levels.blend : levels.blend) / gather.weight;
    for (uint32_t c = 0; c < texture.file->format().channels; ++c) sum[c] += scale * gather.sum[c];
  }
  return true;
}

void append_face_tiles(const FaceTexture& texture, const FaceTextureRequest& request, std::vector<uint64_t>& tiles) {
  const Levels levels = levels_of(texture.faces[request.face], request);
  for (uint32_t k = 0; k < (levels.blend > 0 ? 2u : 1u); ++k) {
    const FaceLevel f = face_level(texture, request.face, levels.fine + k);
    if (f.is_constant) {
      tiles.push_back(f.image->tile_at(f.x0, f.y0));
      continue;
    }
    const float width = static_cast<float>(1u << f.ulog2), height = static_cast<float>(1u << f.vlog2);
    const auto place = [](float at, float size) {
      return static_cast<uint32_t>(std::clamp(clamp_unit(at) * size - 0.5f, 0.0f, size - 1));
    };
    const uint32_t x = f.x0 + place(request.u, width), y = f.y0 + place(request.v, height);
    tiles.push_back(f.image->tile_at(x, y));
    // The blend reaches one texel further.
    const bool more_x = x % kFaceTileSize == kFaceTileSize - 1 && x + 1 < f.x0 + (1u << f.ulog2);
    const bool more_y = y % kFaceTileSize == kFaceTileSize - 1 && y + 1 < f.y0 + (1u << f.vlog2);
    if (more_x) tiles.push_back(f.image->tile_at(x + 1, y));
    if (more_y) tiles.push_back(f.image->tile_at(x, y + 1));
    if (more_x && more_y) tiles.push_back(f.image->tile_at(x + 1, y + 1));
  }
}

}  // namespace spillway::cache
