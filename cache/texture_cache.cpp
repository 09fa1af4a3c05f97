#include "cache/texture_cache.h"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <tuple>
#include <utility>

#include "cache/base/check.h"
#include "cache/base/memory.h"
#include "cache/base/parallel.h"
#include "cache/reads_ahead.h"

namespace spillway::cache {
namespace {

// Measured beside OpenImageIO's own limit: what it keeps of a file for ever, of an open handle, and of a subimage.
constexpr uint64_t kBytesPerFile = 20 << 10, kBytesPerHandle = 1 << 20, kBytesPerSubimage = 4 << 10;
constexpr uint64_t kMostStagedBytes = 16 << 20;

uint64_t tile_bytes(const ImageInfo& image) {
  return uint64_t{kTileSize} * kTileSize * image.channels * image.texel_bytes;
}
uint32_t tiles_across(uint32_t size) { return (size + kTileSize - 1) / kTileSize; }
uint64_t tiles_of_level(const ImageInfo& image, uint32_t level) {
  return uint64_t{tiles_across(level_size(image.width, level))} * tiles_across(level_size(image.height, level));
}

// Where a texel index lands; -1: outside, black.
int wrapped(int i, int size, WrapMode wrap) {
  if (static_cast<uint32_t>(i) < static_cast<uint32_t>(size)) return i;
  switch (wrap) {
    case WrapMode::repeat:
      return ((i % size) + size) % size;
    case WrapMode::clamp:
      return std::clamp(i, 0, size - 1);
    case WrapMode::black:
      return -1;
  }
  return -1;
}

struct Tables {
  std::array<float, 256> srgb, linear;
  Tables() {
    for (int i = 0; i < 256; ++i) {
      linear[i] = static_cast<float>(i) / 255.0f;
      srgb[i] = linear_from_srgb(linear[i]);
    }
  }
};
const Tables& tables() {
  static const Tables t;
  return t;
}

// The limit that leaves so many bytes to tiles: an eighth of it is for what is read ahead.
uint64_t limit_for(uint64_t tile_bytes, bool has_containers) {
  return tile_bytes + (has_containers ? std::min(kMostStagedBytes, tile_bytes / 7) : 0);
}

struct Image {
  ImageInfo info;
  TileFile tiles;
  std::vector<uint64_t> level_first_tile;  // in the cache's numbering
  const float* decode[4] = {};             // of each channel of eight bits
};

// Alpha is never encoded.
void choose_decoding(Image& image) {
  const ImageInfo& info = image.info;
  for (uint32_t c = 0; c < 4; ++c) {
    const bool encoded = info.encoding == TexelEncoding::srgb && c < 3 && !(info.channels == 2 && c == 1);
    image.decode[c] = encoded ? tables().srgb.data() : tables().linear.data();
  }
}

// A file of face textures, open.
struct Container {
  std::shared_ptr<FaceTexSource> source;
  std::unique_ptr<FaceTexDecoder> decoder;
  TileFile tiles;
};

}  // namespace

float approximate_log2(float x) {
  const auto bits = std::bit_cast<uint32_t>(x);
  const auto exponent = static_cast<float>(static_cast<int>(bits >> 23) - 127);
  return exponent + (std::bit_cast<float>((bits & 0x7fffff) | 0x3f800000) - 1);
}

float linear_from_srgb(float e) {
  return e <= 0.04045f ? e / 12.92f : static_cast<float>(std::pow((static_cast<double>(e) + 0.055) / 1.055, 2.4));
}
float srgb_from_linear(float l) {
  return l <= 0.0031308f ? l * 12.92f : static_cast<float>(1.055 * std::pow(static_cast<double>(l), 1 / 2.4) - 0.055);
}

struct TextureCache::State {
  explicit State(uint64_t tile_limit_bytes) : cache(tile_limit_bytes) {}

  std::vector<Container> containers;  // before the cache, which reads through them
  TileCache cache;
  std::vector<Image> images;
  std::vector<FaceTexture> faces;
  std::vector<uint32_t> container_of;  // of each of them
  tbb::enumerable_thread_specific<std::unique_ptr<TileThread>> threads;
  std::vector<TextureCounters> staged;  // bytes read ahead, by owner
  uint64_t stage_limit_bytes = 0;
  std::vector<std::vector<uint64_t>> coming;  // by container, ascending: what lookups under way will have read
  bool is_staging = false;  // `reads` are under way, or done and not turned to
  mutable uint64_t most_wave_bytes = 0;
  MemoryClaim claim;
  ReadsAhead reads;  // after what they read into

  ~State() { threads.clear(); }

  TileThread& thread() {
    auto& own = threads.local();
    if (!own) own = cache.make_thread();
    own->begin_block();
    return *own;
  }

  // The tile that holds texel (x, y) of a level; null when it cannot be read.
  const std::byte* tile(TileThread& thread, uint32_t index, uint32_t level, int x, int y) {
    const Image& image = images[index];
    const uint32_t across = tiles_across(level_size(image.info.width, level));
    const uint64_t number = image.level_first_tile[level] + uint64_t{static_cast<uint32_t>(y) / kTileSize} * across +
                            static_cast<uint32_t>(x) / kTileSize;
    return thread.tile(image.tiles, 0, level, static_cast<uint32_t>(x), static_cast<uint32_t>(y), number, index);
  }

  // Adds weight * texel to sum.
  static void add_texel(const Image& image, const std::byte* pixels, uint32_t at, float weight, float* sum) {
    const uint32_t channels = image.info.channels;
    if (image.info.texel_bytes == 1) {
      for (uint32_t c = 0; c < channels; ++c) sum[c] += weight * image.decode[c][static_cast<uint8_t>(pixels[at + c])];
      return;
    }
    for (uint32_t c = 0; c < channels; ++c) {
      float value;
      std::memcpy(&value, pixels + (at + c) * sizeof(float), sizeof value);
      sum[c] += weight * value;
    }
  }

  // Where in its tile a texel begins, in channels.
  static uint32_t place_in_tile(const Image& image, int x, int y) {
    return ((static_cast<uint32_t>(y) % kTileSize) * kTileSize + static_cast<uint32_t>(x) % kTileSize) * image.info.channels;
  }

  // The same wherever the image goes on; false when the tile cannot be read.
  bool add_wrapped(TileThread& thread, uint32_t index, uint32_t level, int x, int y, WrapMode wrap, float weight,
                   float* sum) {
    const Image& image = images[index];
    x = wrapped(x, static_cast<int>(level_size(image.info.width, level)), wrap);
    y = wrapped(y, static_cast<int>(level_size(image.info.height, level)), wrap);
    if (x < 0 || y < 0) return true;
    const std::byte* pixels = tile(thread, index, level, x, y);
    if (pixels == nullptr) return false;
    add_texel(image, pixels, place_in_tile(image, x, y), weight, sum);
    return true;
  }

  // Whether (x, y) and its neighbours to the right and below lie in the image, and in one tile: nearly always.
  static bool is_in_one_tile(const Image& image, uint32_t level, int x, int y) {
    return x >= 0 && y >= 0 && x + 1 < static_cast<int>(level_size(image.info.width, level)) &&
           y + 1 < static_cast<int>(level_size(image.info.height, level)) &&
           static_cast<uint32_t>(x) % kTileSize != kTileSize - 1 && static_cast<uint32_t>(y) % kTileSize != kTileSize - 1;
  }

  bool bilinear(TileThread& thread, uint32_t index, uint32_t level, const TextureRequest& r, float weight, float* sum) {
    const float u = r.wrap == WrapMode::repeat ? r.u - std::floor(r.u) : r.u;
    const float v = r.wrap == WrapMode::repeat ? r.v - std::floor(r.v) : r.v;
    const Image& image = images[index];
    // Far outside, clamped and black images repeat their border: keep the conversion to int in range.
    const float x = std::clamp(u, -4.0f, 5.0f) * static_cast<float>(level_size(image.info.width, level)) - 0.5f;
    const float y = std::clamp(1 - v, -4.0f, 5.0f) * static_cast<float>(level_size(image.info.height, level)) - 0.5f;
    if (r.filter == TexelFilter::point)
      return add_wrapped(thread, index, level, static_cast<int>(std::floor(x + 0.5f)),
                         static_cast<int>(std::floor(y + 0.5f)), r.wrap, weight, sum);
    const float floor_x = std::floor(x), floor_y = std::floor(y);
    const float fx = x - floor_x, fy = y - floor_y;
    const int ix = static_cast<int>(floor_x), iy = static_cast<int>(floor_y);
    const float w[4] = {weight * (1 - fx) * (1 - fy), weight * fx * (1 - fy), weight * (1 - fx) * fy, weight * fx * fy};
    if (!is_in_one_tile(image, level, ix, iy)) {
      for (int i = 0; i < 4; ++i)
        if (!add_wrapped(thread, index, level, ix + (i & 1), iy + (i >> 1), r.wrap, w[i], sum)) return false;
      return true;
    }
    const std::byte* pixels = tile(thread, index, level, ix, iy);
    if (pixels == nullptr) return false;
    const uint32_t at = place_in_tile(image, ix, iy), right = image.info.channels, below = kTileSize * right;
    for (uint32_t i = 0; i < 4; ++i) add_texel(image, pixels, at + (i & 1) * right + (i >> 1) * below, w[i], sum);
    return true;
  }

  // Levels as pbrt-v4 section 10.4.3 chooses them, the footprint measured along the longer axis.
  bool look_up(TileThread& thread, const TextureRequest& r, float* sum) {
    const Image& image = images[r.image];
    const float texels = r.width_uv * static_cast<float>(std::max(image.info.width, image.info.height));
    const float coarsest = static_cast<float>(image.info.levels - 1);
    const float level = texels > 1 ? std::min(approximate_log2(texels), coarsest) : 0;
    const auto fine = static_cast<uint32_t>(level);
    const float blend = level - static_cast<float>(fine);
    if (r.filter != TexelFilter::trilinear || blend == 0) return bilinear(thread, r.image, fine, r, 1, sum);
    return bilinear(thread, r.image, fine, r, 1 - blend, sum) && bilinear(thread, r.image, fine + 1, r, blend, sum);
  }
};

TextureCache::TextureCache(std::unique_ptr<State> state) : state_(std::move(state)) {}
TextureCache::~TextureCache() = default;

uint64_t TextureCache::bytes_for_all(std::span<const ImageInfo> images, std::span<const FaceContainerInfo> containers) {
  uint64_t bytes = 0;
  for (const ImageInfo& image : images)
    for (uint32_t level = 0; level < image.levels; ++level) bytes += tiles_of_level(image, level) * tile_bytes(image);
  for (const FaceContainerInfo& c : containers) bytes += c.tile_count * c.tile_bytes;
  return limit_for(bytes, !containers.empty());
}

// What the library holds, and tables of ours (24 bytes a face, 21 a tile with what it counts).
uint64_t TextureCache::bytes_beside_tiles(std::span<const ImageInfo> images,
                                          std::span<const FaceContainerInfo> containers) {
  uint64_t bytes =
      images.size() * kBytesPerFile + std::min<size_t>(images.size(), TileCache::kOpenHandles) * kBytesPerHandle;
  for (const FaceContainerInfo& c : containers)
    bytes += kBytesPerFile + c.image_count * kBytesPerSubimage + c.face_count * 24 + c.tile_count * 21;
  return bytes;
}

namespace {

Status open_container(const std::filesystem::path& path, const FaceContainerInfo& info, bool direct,
                      Container& container) {
  FaceTexFile::Options options;
  options.direct = direct;
  SPILLWAY_ASSIGN(container.source, FaceTexSource::open(path, options));
  const FaceTexFile& file = container.source->file();
  if (file.tiles().size() != info.tile_count || file.format().tile_bytes() != info.tile_bytes ||
      file.images().size() != info.image_count)
    return error("{}: are not the face textures the manifest describes; pack the scene again", path.string());
  container.decoder = std::make_unique<FaceTexDecoder>(file.format());
  return {};
}

}  // namespace

Result<std::unique_ptr<TextureCache>> TextureCache::open(const std::filesystem::path& textures_directory,
                                                         std::span<const ImageInfo> images, Options options,
                                                         std::span<const FaceContainerInfo> containers,
                                                         std::span<const FaceTextureInfo> face_textures) {
  const uint64_t limit = options.memory_limit_bytes;
  const uint64_t staged = containers.empty() ? 0 : std::min(limit / 8, kMostStagedBytes);
  const uint64_t tiles = std::max<uint64_t>(limit - staged, 1 << 20);
  auto state = std::make_unique<State>(tiles);
  state->stage_limit_bytes = staged;
  uint64_t next_tile = 0;
  for (const ImageInfo& info : images) {
    Image image{info, {}, {}, {}};
    choose_decoding(image);
    for (uint32_t level = 0; level < info.levels; ++level) {
      image.level_first_tile.push_back(next_tile);
      next_tile += tiles_of_level(info, level);
    }
    const uint64_t count = image.level_first_tile.empty() ? 0 : next_tile - image.level_first_tile.front();
    SPILLWAY_ASSIGN(image.tiles,
                    state->cache.add_image((textures_directory / info.file_name).string(),
                                           {info.width, info.height, info.channels, info.texel_bytes}, count));
    state->images.push_back(std::move(image));
  }
  uint64_t tables = 0;
  for (const FaceContainerInfo& info : containers) {
    Container& container = state->containers.emplace_back();
    SPILLWAY_TRY(open_container(textures_directory / info.file_name, info, options.direct, container));
    SPILLWAY_ASSIGN(container.tiles, state->cache.add_face_tex(*container.source));
    tables += container.source->file().tables_bytes() + info.tile_count * 5;
  }
  for (const FaceTextureInfo& info : face_textures) {
    const Container& container = state->containers[info.container];
    const FaceTexFile& file = container.source->file();
    if (info.texture >= file.textures().size() || file.textures()[info.texture].face_count != info.face_count ||
        file.textures()[info.texture].shape != info.shape)
      return error("{}: texture {} is not the one the manifest describes; pack the scene again", file.path().string(),
                   info.texture);
    const FaceTexTexture& texture = file.textures()[info.texture];
    state->faces.push_back({&file, &texture, file.faces(texture), file.numbers(texture), container.decoder.get(),
                            &container.tiles, static_cast<uint32_t>(images.size() + state->faces.size())});
    state->faces.back().choose_tables();
    state->container_of.push_back(info.container);
  }
  const auto owners = static_cast<uint32_t>(images.size() + face_textures.size());
  state->cache.begin(owners, options.is_logged);
  state->staged.resize(owners), state->coming.resize(containers.size());
  const uint64_t claimed = std::min(limit, bytes_for_all(images, containers)) + bytes_beside_tiles(images, containers);
  const uint64_t counted = tables + staged;  // in buffers, which count for themselves
  state->claim = MemoryClaim(MemoryTag::textures, claimed > counted ? claimed - counted : 0);
  return std::unique_ptr<TextureCache>(new TextureCache(std::move(state)));
}

uint64_t TextureCache::tile_count(std::span<const ImageInfo> images, std::span<const FaceContainerInfo> containers) {
  uint64_t count = 0;
  for (const ImageInfo& image : images)
    for (uint32_t level = 0; level < image.levels; ++level) count += tiles_of_level(image, level);
  for (const FaceContainerInfo& c : containers) count += c.tile_count;
  return count;
}

void TextureCache::note_first_users(std::span<uint64_t> by_tile) {
  SPILLWAY_CHECK(by_tile.empty() || by_tile.size() == state_->cache.tile_count(), ==, true);
  state_->cache.note_first_users(by_tile);
}

Status TextureCache::look_up(std::span<const TextureRequest> requests, std::span<Texel> values,
                             std::span<const uint64_t> users) {
  State& s = *state_;
  TileThread& thread = s.thread();
  for (size_t i = 0; i < requests.size(); ++i) {
    float sum[4] = {0, 0, 0, 0};
    if (!users.empty()) thread.set_user(users[i]);
    ++thread.counters[requests[i].image].lookups;
    if (!s.look_up(thread, requests[i], sum))
      return error("{}: a tile cannot be read: {}; pack the scene again", s.images[requests[i].image].tiles.path,
                   s.cache.failure());
    values[i] = spread_channels(sum, s.images[requests[i].image].info.channels);
  }
  return {};
}

// ---- face textures ----

bool TextureCache::has_face_textures() const { return !state_->faces.empty(); }

Status TextureCache::look_up_faces(std::span<const FaceTextureRequest> requests, std::span<Texel> values,
                                   std::span<const uint64_t> users) {
  State& s = *state_;
  const size_t done = cache::look_up_faces(s.thread(), s.faces, requests, values, users);
  if (done == requests.size()) return {};
  const FaceTexture& texture = s.faces[requests[done].texture];
  if (requests[done].face >= texture.faces.size())
    return error("{}: face {} of {} is asked for; pack the scene again", texture.tiles->path, requests[done].face,
                 texture.faces.size());
  return error("{}: a tile cannot be read: {}; pack the scene again", texture.tiles->path, s.cache.failure());
}

void TextureCache::append_wanted(std::span<const FaceTextureRequest> requests, std::vector<WantedTile>& wanted) const {
  const State& s = *state_;
  std::vector<uint64_t> tiles;
  for (const FaceTextureRequest& request : requests) {
    const FaceTexture& texture = s.faces[request.texture];
    if (request.face >= texture.faces.size()) continue;  // look_up_faces refuses it
    const uint32_t container = s.container_of[request.texture];
    tiles.clear();
    append_face_tiles(texture, request, tiles);
    for (const uint64_t tile : tiles)
      if (!s.cache.probably_holds(texture.tiles->first_tile + tile, texture.tiles->tile_bytes) &&
          !std::ranges::binary_search(s.coming[container], tile) &&
          (wanted.empty() || wanted.back().tile != tile || wanted.back().owner != texture.owner))
        wanted.push_back({container, texture.owner, tile});
  }
}

Status TextureCache::begin_staging(std::vector<WantedTile> wanted) {
  State& s = *state_;
  SPILLWAY_TRY(finish_staging());
  s.cache.is_full();
  // By container, ascending, each once: its owner is the first of those that ask.
  const auto place = [](const WantedTile& w) { return std::pair(w.container, w.tile); };
  std::ranges::sort(wanted, {}, [](const WantedTile& w) { return std::tuple(w.container, w.tile, w.owner); });
  wanted.erase(std::ranges::unique(wanted, {}, place).begin(), wanted.end());
  std::vector<ReadsAhead::Read> reads;
  uint64_t left = s.stage_limit_bytes / 2;  // the other half is what is staged
  for (uint32_t c = 0; c < s.containers.size(); ++c) {
    const Container& container = s.containers[c];
    const auto some = std::ranges::equal_range(wanted, c, {}, &WantedTile::container);
    std::vector<uint64_t>& tiles = s.coming[c];  // also those for which there is no room
    tiles.clear();
    for (const WantedTile& w : some) tiles.push_back(w.tile);
    FaceTexSource::Stage stage = container.source->begin_stage(tiles, left);
    left -= stage.bytes;
    for (size_t i = 0; i < stage.tile_count; ++i) {
      s.staged[some[i].owner].bytes_read += container.source->file().tiles()[tiles[i]].size_bytes;
      s.cache.log_read(container.tiles.first_tile + tiles[i], 1);
    }
    for (ReadsAhead::Read& read : stage.reads) reads.push_back(std::move(read));
  }
  s.is_staging = true;
  s.reads.begin(std::move(reads));
  return {};
}

Status TextureCache::finish_staging() {
  State& s = *state_;
  if (!std::exchange(s.is_staging, false)) return {};
  SPILLWAY_TRY(s.reads.finish());
  for (const Container& container : s.containers) container.source->turn_stage();
  return {};
}

Status TextureCache::stage_faces(std::span<const FaceTextureRequest> requests) {
  constexpr size_t kBlock = 1024;
  std::vector<std::vector<WantedTile>> of_block(block_count(requests.size(), kBlock));
  parallel_blocks(requests.size(), kBlock, [&](size_t b, size_t first, size_t last) {
    append_wanted(requests.subspan(first, last - first), of_block[b]);
  });
  std::vector<WantedTile> wanted;
  for (const auto& block : of_block) wanted.insert(wanted.end(), block.begin(), block.end());
  SPILLWAY_TRY(begin_staging(std::move(wanted)));
  return finish_staging();
}

// ---- counters ----

void TextureCache::begin_wave() {
  (void)limit_for_waves();
  for (auto& thread : state_->threads)
    if (thread)
      for (TextureCounters& c : thread->counters) c.wave_decoded_bytes = 0;
  state_->cache.begin_wave();
}

std::vector<TextureCounters> TextureCache::counters_by_texture() const {
  std::vector<TextureCounters> sum = state_->staged;
  for (const auto& thread : state_->threads)
    if (thread)
      for (size_t i = 0; i < sum.size(); ++i) sum[i] += thread->counters[i];
  return sum;
}

TextureCache::WaveTileUse TextureCache::wave_tiles() const {
  return {state_->cache.touched_in_wave(), state_->cache.reads_in_wave()};
}

std::vector<uint32_t> TextureCache::file_bytes_of_tiles() const {
  std::vector<uint32_t> bytes;
  for (const Image& image : state_->images)
    for (uint32_t level = 0; level < image.info.levels; ++level)
      bytes.insert(bytes.end(), tiles_of_level(image.info, level), static_cast<uint32_t>(image.tiles.tile_bytes));
  for (const Container& container : state_->containers)
    for (const FaceTexTile& tile : container.source->file().tiles()) bytes.push_back(tile.size_bytes);
  return bytes;
}

TextureCounters TextureCache::counters() const {
  TextureCounters sum;
  for (const TextureCounters& c : counters_by_texture()) sum += c;
  return sum;
}

uint64_t TextureCache::limit_for_waves() const {
  state_->most_wave_bytes = std::max(state_->most_wave_bytes, counters().wave_decoded_bytes);
  return limit_for(state_->most_wave_bytes, !state_->containers.empty());
}

uint64_t TextureCache::limit_for_touched() const {
  uint64_t bytes = 0;
  const std::vector<TextureCounters> counters = counters_by_texture();
  const size_t image_count = state_->images.size();
  for (size_t i = 0; i < counters.size(); ++i) {
    const TileFile& tiles = i < image_count ? state_->images[i].tiles : *state_->faces[i - image_count].tiles;
    bytes += counters[i].tiles_touched * tiles.tile_bytes;
  }
  return limit_for(bytes, !state_->containers.empty());
}

}  // namespace spillway::cache
