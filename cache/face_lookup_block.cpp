// The path that most lookups of a block take: inside a face, with what is known of it kept from lookup to lookup.

#include <algorithm>
#include <cmath>

#include "cache/base/clamp_unit.h"
#include "cache/face_level.h"

namespace spillway::cache {
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
// lookups are found not to be `inside`, and take the general path. The arithmetic is that of Footprint::quad.
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
  const FaceLevels levels = levels_of(*face.info, request);
  if (levels.blend > 0) return;
  if (levels.fine != face.level) face.turn_to(t, levels.fine);
  const float x = clamp_unit(request.u) * face.width - 0.5f, y = clamp_unit(request.v) * face.height - 0.5f;
  const float floor_x = std::floor(x), floor_y = std::floor(y);
  const int i = static_cast<int>(floor_x), j = static_cast<int>(floor_y);
  if (i < 0 || j < 0 || i >= face.last_i || j >= face.last_j) return;
  found.x = face.x0 + static_cast<uint32_t>(i), found.y = face.y0 + static_cast<uint32_t>(j);
  const uint32_t last = (1u << t.tile_log2) - 1, in_x = found.x & last, in_y = found.y & last;
  if (in_x == last || in_y == last) return;
  const float fx = x - floor_x, fy = y - floor_y;
  found.inside = true;
  found.shares[0] = (1 - fx) * (1 - fy), found.shares[1] = fx * (1 - fy);
  found.shares[2] = (1 - fx) * fy, found.shares[3] = fx * fy;
  found.image_index = face.image_index;
  found.tile = face.first_tile + uint64_t{found.y >> t.tile_log2} * face.tiles_across + (found.x >> t.tile_log2);
  found.offset = (in_y << t.tile_log2 | in_x) * t.channels;
}

// Sums as TexelSum::add makes them, channel by channel.
template <uint32_t kChannels>
Texel sum_of_four(const FaceTexture& t, const std::byte* at, const float* shares) {
  const size_t up = size_t{kChannels} << t.tile_log2;
  const std::byte* const texels[4] = {at, at + kChannels, at + up, at + up + kChannels};
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
  __builtin_prefetch(tile + found.offset + (size_t{t.channels} << t.tile_log2));
}

void prefetch_face(const FaceTexture& t, uint32_t face) {
  if (face >= t.faces.size()) return;
  __builtin_prefetch(&t.faces[face]);
  __builtin_prefetch(&t.numbers[face]);
}

}  // namespace

void FaceTexture::choose_tables() {
  channels = file->format().channels, tile_log2 = file->format().tile_log2;
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

}  // namespace spillway::cache
