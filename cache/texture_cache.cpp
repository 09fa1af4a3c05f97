#include "cache/texture_cache.h"

#include <OpenImageIO/imagecache.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <mutex>

#include "cache/base/memory.h"

namespace spillway::cache {
namespace {

// Measured beside OpenImageIO's own limit: what it keeps of a file for ever, and of an open handle.
constexpr uint64_t kBytesPerFile = 20 << 10, kBytesPerHandle = 1 << 20;
constexpr int kOpenHandles = 64;

// Tiles a thread keeps at hand: more than a block's neighbours touch, little against any budget.
constexpr size_t kHeldTiles = 64;

uint64_t tile_bytes(const ImageInfo& image) { return uint64_t{kTileSize} * kTileSize * image.channels * image.texel_bytes; }
uint32_t tiles_across(uint32_t size) { return (size + kTileSize - 1) / kTileSize; }
uint64_t tiles_of_level(const ImageInfo& image, uint32_t level) {
  return uint64_t{tiles_across(level_size(image.width, level))} * tiles_across(level_size(image.height, level));
}

uint64_t overhead_bytes(size_t image_count) {
  return image_count * kBytesPerFile + std::min<size_t>(image_count, kOpenHandles) * kBytesPerHandle;
}

// log2 of x > 0, exact at powers of two and linear between: within 0.09 of a level, and the same on every machine.
float level_of(float x) {
  const auto bits = std::bit_cast<uint32_t>(x);
  const auto exponent = static_cast<float>(static_cast<int>(bits >> 23) - 127);
  return exponent + (std::bit_cast<float>((bits & 0x7fffff) | 0x3f800000) - 1);
}

// Where a texel index lands; -1: outside, black.
int wrapped(int i, int size, WrapMode wrap) {
  if (static_cast<uint32_t>(i) < static_cast<uint32_t>(size)) return i;
  switch (wrap) {
    case WrapMode::repeat: return ((i % size) + size) % size;
    case WrapMode::clamp: return std::clamp(i, 0, size - 1);
    case WrapMode::black: return -1;
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

struct Image {
  ImageInfo info;
  std::string path;
  OIIO::ImageCache::ImageHandle* handle = nullptr;
  std::vector<uint64_t> level_first_tile;  // in the scene-wide numbering of tiles
  const float* decode[4] = {};  // of each channel of eight bits
};

// Alpha is never encoded.
void choose_decoding(Image& image) {
  const ImageInfo& info = image.info;
  for (uint32_t c = 0; c < 4; ++c) {
    const bool encoded = info.encoding == TexelEncoding::srgb && c < 3 && !(info.channels == 2 && c == 1);
    image.decode[c] = encoded ? tables().srgb.data() : tables().linear.data();
  }
}

// A tile that a thread keeps at hand.
struct HeldTile {
  uint64_t number = UINT64_MAX;
  OIIO::ImageCache::Tile* tile = nullptr;
  const std::byte* pixels = nullptr;
};

struct ThreadTiles {
  OIIO::ImageCache* cache = nullptr;
  OIIO::ImageCache::Perthread* perthread = nullptr;
  std::array<HeldTile, kHeldTiles> held;
  uint64_t lookups = 0;

  ThreadTiles() = default;
  ThreadTiles(const ThreadTiles&) = delete;
  ThreadTiles& operator=(const ThreadTiles&) = delete;
  ThreadTiles(ThreadTiles&&) = delete;
  ~ThreadTiles() {
    for (HeldTile& h : held)
      if (h.tile) cache->release_tile(h.tile);
  }
};

}  // namespace

float linear_from_srgb(float e) {
  return e <= 0.04045f ? e / 12.92f : static_cast<float>(std::pow((static_cast<double>(e) + 0.055) / 1.055, 2.4));
}
float srgb_from_linear(float l) {
  return l <= 0.0031308f ? l * 12.92f : static_cast<float>(1.055 * std::pow(static_cast<double>(l), 1 / 2.4) - 0.055);
}

namespace {

// One cache for the life of the process. The library keeps what a thread knows of a cache under the cache's address: one
// that is made where another was destroyed finds the dead one's files in threads that served both, and aborts on its own
// assertion about memory in use.
OIIO::ImageCache& process_cache() {
  static OIIO::ImageCache* const cache = [] {
    OIIO::ImageCache* const made = OIIO::ImageCache::create(false);
    made->attribute("max_open_files", kOpenHandles);
    made->attribute("autotile", 0);
    made->attribute("automip", 0);
    made->attribute("forcefloat", 0);
    return made;
  }();
  return *cache;
}

// Counts since the process began.
struct LibraryCounts {
  uint64_t tiles_created = 0, bytes_read = 0;
};
LibraryCounts library_counts() {
  int created = 0;
  long long bytes = 0;
  process_cache().getattribute("stat:tiles_created", OIIO::TypeInt, &created);
  process_cache().getattribute("stat:bytes_read", OIIO::TypeDesc::INT64, &bytes);
  return {static_cast<uint64_t>(created), static_cast<uint64_t>(bytes)};
}

}  // namespace

struct TextureCache::State {
  OIIO::ImageCache* const cache = &process_cache();
  LibraryCounts counts_before = library_counts();
  std::vector<Image> images;
  std::unique_ptr<std::atomic<uint64_t>[]> touched;  // a bit a tile of the scene
  uint64_t tile_count = 0;
  std::atomic<uint64_t> tiles_touched{0}, unique_bytes{0};
  tbb::enumerable_thread_specific<ThreadTiles> threads;
  MemoryClaim claim;

  ~State() {
    threads.clear();
    for (const Image& image : images) cache->invalidate(OIIO::ustring(image.path), true);
  }

  void touch(uint64_t number, const ImageInfo& image) {
    const uint64_t bit = uint64_t{1} << (number % 64);
    if (touched[number / 64].fetch_or(bit) & bit) return;
    ++tiles_touched;
    unique_bytes += tile_bytes(image);
  }

  // The tile that holds texel (x, y) of a level; null when it cannot be read.
  const std::byte* tile(ThreadTiles& thread, const Image& image, uint32_t level, int x, int y) {
    const uint32_t across = tiles_across(level_size(image.info.width, level));
    const uint64_t number = image.level_first_tile[level] + uint64_t{static_cast<uint32_t>(y) / kTileSize} * across +
                            static_cast<uint32_t>(x) / kTileSize;
    HeldTile& held = thread.held[number % kHeldTiles];
    if (held.number == number) return held.pixels;
    if (held.tile) cache->release_tile(held.tile);
    held = {};
    OIIO::ImageCache::Tile* const tile =
        cache->get_tile(image.handle, thread.perthread, 0, static_cast<int>(level), x, y, 0);
    if (tile == nullptr) return nullptr;
    OIIO::TypeDesc format;
    const void* pixels = cache->tile_pixels(tile, format);
    if (pixels == nullptr) {
      cache->release_tile(tile);
      return nullptr;
    }
    held = {number, tile, static_cast<const std::byte*>(pixels)};
    touch(number, image.info);
    return held.pixels;
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
  bool add_wrapped(ThreadTiles& thread, const Image& image, uint32_t level, int x, int y, WrapMode wrap, float weight,
                   float* sum) {
    x = wrapped(x, static_cast<int>(level_size(image.info.width, level)), wrap);
    y = wrapped(y, static_cast<int>(level_size(image.info.height, level)), wrap);
    if (x < 0 || y < 0) return true;
    const std::byte* pixels = tile(thread, image, level, x, y);
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

  bool bilinear(ThreadTiles& thread, const Image& image, uint32_t level, const TextureRequest& r, float weight,
                float* sum) {
    const float u = r.wrap == WrapMode::repeat ? r.u - std::floor(r.u) : r.u;
    const float v = r.wrap == WrapMode::repeat ? r.v - std::floor(r.v) : r.v;
    // Far outside, clamped and black images repeat their border: keep the conversion to int in range.
    const float x = std::clamp(u, -4.0f, 5.0f) * static_cast<float>(level_size(image.info.width, level)) - 0.5f;
    const float y = std::clamp(1 - v, -4.0f, 5.0f) * static_cast<float>(level_size(image.info.height, level)) - 0.5f;
    if (r.filter == TexelFilter::point)
      return add_wrapped(thread, image, level, static_cast<int>(std::floor(x + 0.5f)),
                         static_cast<int>(std::floor(y + 0.5f)), r.wrap, weight, sum);
    const float floor_x = std::floor(x), floor_y = std::floor(y);
    const float fx = x - floor_x, fy = y - floor_y;
    const int ix = static_cast<int>(floor_x), iy = static_cast<int>(floor_y);
    const float w[4] = {weight * (1 - fx) * (1 - fy), weight * fx * (1 - fy), weight * (1 - fx) * fy, weight * fx * fy};
    if (!is_in_one_tile(image, level, ix, iy)) {
      for (int i = 0; i < 4; ++i)
        if (!add_wrapped(thread, image, level, ix + (i & 1), iy + (i >> 1), r.wrap, w[i], sum)) return false;
      return true;
    }
    const std::byte* pixels = tile(thread, image, level, ix, iy);
    if (pixels == nullptr) return false;
    const uint32_t at = place_in_tile(image, ix, iy), right = image.info.channels, below = kTileSize * right;
    for (uint32_t i = 0; i < 4; ++i) add_texel(image, pixels, at + (i & 1) * right + (i >> 1) * below, w[i], sum);
    return true;
  }

  // Levels as pbrt-v4 section 10.4.3 chooses them, the footprint measured along the longer axis.
  bool look_up(ThreadTiles& thread, const TextureRequest& r, float* sum) {
    const Image& image = images[r.image];
    const float texels = r.width_uv * static_cast<float>(std::max(image.info.width, image.info.height));
    const float coarsest = static_cast<float>(image.info.levels - 1);
    const float level = texels > 1 ? std::min(level_of(texels), coarsest) : 0;
    const auto fine = static_cast<uint32_t>(level);
    const float blend = level - static_cast<float>(fine);
    if (r.filter != TexelFilter::trilinear || blend == 0) return bilinear(thread, image, fine, r, 1, sum);
    return bilinear(thread, image, fine, r, 1 - blend, sum) && bilinear(thread, image, fine + 1, r, blend, sum);
  }
};

namespace {

// Grey goes to all colours, a missing alpha is one.
Texel spread(const float* sum, uint32_t channels) {
  switch (channels) {
    case 1: return {{sum[0], sum[0], sum[0], 1}};
    case 2: return {{sum[0], sum[0], sum[0], sum[1]}};
    case 3: return {{sum[0], sum[1], sum[2], 1}};
    default: return {{sum[0], sum[1], sum[2], sum[3]}};
  }
}

}  // namespace

TextureCache::TextureCache(std::unique_ptr<State> state) : state_(std::move(state)) {}
TextureCache::~TextureCache() = default;

uint64_t TextureCache::bytes_for_all(std::span<const ImageInfo> images) {
  uint64_t bytes = images.empty() ? 0 : overhead_bytes(images.size());
  for (const ImageInfo& image : images)
    for (uint32_t level = 0; level < image.levels; ++level) bytes += tiles_of_level(image, level) * tile_bytes(image);
  return bytes;
}

Result<std::unique_ptr<TextureCache>> TextureCache::open(const std::filesystem::path& textures_directory,
                                                         std::span<const ImageInfo> images, Options options) {
  auto state = std::make_unique<State>();
  const uint64_t overhead = overhead_bytes(images.size());
  const uint64_t tiles = options.memory_limit_bytes > overhead + (1 << 20) ? options.memory_limit_bytes - overhead : 1 << 20;
  state->cache->attribute("max_memory_MB", static_cast<float>(static_cast<double>(tiles) / (1 << 20)));
  for (const ImageInfo& info : images) {
    Image image{info, (textures_directory / info.file_name).string(), nullptr, {}, {}};
    choose_decoding(image);
    image.handle = state->cache->get_image_handle(OIIO::ustring(image.path));
    OIIO::ImageSpec spec;
    if (image.handle == nullptr || !state->cache->get_imagespec(image.handle, nullptr, spec))
      return error("{}: the packed image cannot be opened: {}; pack the scene again", image.path,
                   state->cache->geterror());
    const bool same = spec.width == static_cast<int>(info.width) && spec.height == static_cast<int>(info.height) &&
                      spec.nchannels == static_cast<int>(info.channels) && spec.tile_width == static_cast<int>(kTileSize) &&
                      spec.tile_height == static_cast<int>(kTileSize) &&
                      spec.format.size() == info.texel_bytes;
    if (!same) return error("{}: is not the image the manifest describes; pack the scene again", image.path);
    for (uint32_t level = 0; level < info.levels; ++level) {
      image.level_first_tile.push_back(state->tile_count);
      state->tile_count += tiles_of_level(info, level);
    }
    state->images.push_back(std::move(image));
  }
  state->touched = std::make_unique<std::atomic<uint64_t>[]>(state->tile_count / 64 + 1);
  state->claim = MemoryClaim(MemoryTag::textures, std::min(options.memory_limit_bytes, bytes_for_all(images)));
  return std::unique_ptr<TextureCache>(new TextureCache(std::move(state)));
}

Status TextureCache::look_up(std::span<const TextureRequest> requests, std::span<Texel> values) {
  State& s = *state_;
  ThreadTiles& thread = s.threads.local();
  if (thread.cache == nullptr) {
    thread.cache = s.cache;
    thread.perthread = s.cache->get_perthread_info();
  }
  thread.lookups += requests.size();
  for (size_t i = 0; i < requests.size(); ++i) {
    float sum[4] = {0, 0, 0, 0};
    if (!s.look_up(thread, requests[i], sum))
      return error("{}: a tile cannot be read: {}; pack the scene again", s.images[requests[i].image].path,
                   s.cache->geterror());
    values[i] = spread(sum, s.images[requests[i].image].info.channels);
  }
  return {};
}

TextureCounters TextureCache::counters() const {
  const State& s = *state_;
  TextureCounters c;
  for (const ThreadTiles& thread : s.threads) c.lookups += thread.lookups;
  c.tiles_touched = s.tiles_touched;
  c.unique_bytes = s.unique_bytes;
  const LibraryCounts now = library_counts();
  c.tiles_read = now.tiles_created - s.counts_before.tiles_created;
  c.tiles_read_again = c.tiles_read > c.tiles_touched ? c.tiles_read - c.tiles_touched : 0;
  c.bytes_read = now.bytes_read - s.counts_before.bytes_read;
  return c;
}

}  // namespace spillway::cache
