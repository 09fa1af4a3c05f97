#include "cache/tile_cache.h"

#include <OpenImageIO/imagecache.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <bit>

namespace spillway::cache {
namespace {

// One cache for the life of the process. The library keeps what a thread knows of a cache under the cache's address:
// one that is made where another was destroyed finds the dead one's files in threads that served both, and aborts on
// its own assertion about memory in use.
OIIO::ImageCache& process_cache() {
  static OIIO::ImageCache* const cache = [] {
    OIIO::ImageCache* const made = OIIO::ImageCache::create(false);
    made->attribute("max_open_files", TileCache::kOpenHandles);
    made->attribute("autotile", 0);
    made->attribute("automip", 0);
    made->attribute("forcefloat", 0);
    return made;
  }();
  return *cache;
}

OIIO::ImageCache::Tile* library_tile(void* tile) { return static_cast<OIIO::ImageCache::Tile*>(tile); }

// A packed image through the library's own reader, its tiles counted.
class CountedInput final : public OIIO::ImageInput {
 public:
  const char* format_name() const override { return "counted"; }
  int supports(OIIO::string_view feature) const override { return reader_ ? reader_->supports(feature) : 0; }
  bool open(const std::string& name, OIIO::ImageSpec& spec) override {
    reader_ = OIIO::ImageInput::open(name);
    if (!reader_) {
      errorfmt("{}", OIIO::geterror());
      return false;
    }
    spec = m_spec = reader_->spec();
    return true;
  }
  bool close() override {
    reader_.reset();
    return true;
  }
  int current_subimage() const override { return reader_->current_subimage(); }
  int current_miplevel() const override { return reader_->current_miplevel(); }
  bool seek_subimage(int subimage, int miplevel) override {
    if (!reader_->seek_subimage(subimage, miplevel)) return false;
    m_spec = reader_->spec();
    return true;
  }
  OIIO::ImageSpec spec(int subimage, int miplevel) override { return reader_->spec(subimage, miplevel); }
  OIIO::ImageSpec spec_dimensions(int subimage, int miplevel) override {
    return reader_->spec_dimensions(subimage, miplevel);
  }
  bool read_native_scanline(int subimage, int miplevel, int y, int z, void* data) override {
    return reader_->read_native_scanline(subimage, miplevel, y, z, data) || tell();
  }
  bool read_native_tile(int subimage, int miplevel, int x, int y, int z, void* data) override {
    ReadTally& tally = thread_read_tally();
    const OIIO::ImageSpec spec = reader_->spec_dimensions(subimage, miplevel);
    tally.tiles += 1, tally.bytes += spec.tile_bytes(true);
    return reader_->read_native_tile(subimage, miplevel, x, y, z, data) || tell();
  }

 private:
  bool tell() {
    errorfmt("{}", reader_->geterror());
    return false;
  }
  OIIO::ImageInput::unique_ptr reader_;
};

OIIO::ImageInput* make_counted_input() { return new CountedInput; }
OIIO::ImageInput* make_face_tex() { return static_cast<OIIO::ImageInput*>(make_facetex_input()); }

}  // namespace

TextureCounters& operator+=(TextureCounters& a, const TextureCounters& b) {
  a.lookups += b.lookups;
  a.tiles_touched += b.tiles_touched, a.unique_bytes += b.unique_bytes;
  a.tiles_read += b.tiles_read, a.bytes_read += b.bytes_read;
  a.wave_tiles_touched += b.wave_tiles_touched, a.wave_unique_bytes += b.wave_unique_bytes;
  a.tiles_read_again += b.tiles_read_again;
  a.wave_decoded_bytes += b.wave_decoded_bytes;
  return a;
}

TextureCounters gained(TextureCounters now, const TextureCounters& before) {
  now.lookups -= before.lookups;
  now.tiles_touched -= before.tiles_touched, now.unique_bytes -= before.unique_bytes;
  now.tiles_read -= before.tiles_read, now.bytes_read -= before.bytes_read;
  now.wave_tiles_touched -= before.wave_tiles_touched, now.wave_unique_bytes -= before.wave_unique_bytes;
  now.tiles_read_again -= before.tiles_read_again;
  return now;
}

// ---- a thread ----

TileThread::TileThread(TileCache& cache)
    : counters(cache.owner_count_),
      cache_(cache),
      perthread_(process_cache().get_perthread_info()),
      held_mask_(cache.held_tiles_ - 1) {}

TileThread::~TileThread() {
  for (const Held& held : held_)
    if (held.tile) process_cache().release_tile(library_tile(held.tile));
}

void TileThread::begin_block() { wave_ = cache_.wave_.load(std::memory_order_relaxed); }

const std::byte* TileThread::fetch(const TileFile& file, uint32_t subimage, uint32_t level, uint32_t x, uint32_t y,
                                   uint64_t number, uint32_t owner) {
  Held& held = held_[number & held_mask_];
  TextureCounters& counts = counters[owner];
  if (held.number != number) {
    if (held.tile) process_cache().release_tile(library_tile(held.tile));
    held = {};
    const ReadTally before = thread_read_tally();
    OIIO::ImageCache::Tile* const tile = process_cache().get_tile(
        static_cast<OIIO::ImageCache::ImageHandle*>(file.handle), static_cast<OIIO::ImageCache::Perthread*>(perthread_),
        static_cast<int>(subimage), static_cast<int>(level), static_cast<int>(x), static_cast<int>(y), 0);
    const ReadTally& now = thread_read_tally();
    if (now.tiles != before.tiles) {
      cache_.reads_.fetch_add(1, std::memory_order_relaxed);
      counts.tiles_read += now.tiles - before.tiles, counts.bytes_read += now.bytes - before.bytes;
      if (TileCache::set(cache_.read_in_wave_, number)) ++counts.tiles_read_again;
      if (now.bytes != before.bytes) cache_.log_read(number, static_cast<uint32_t>(now.tiles - before.tiles));
    }
    if (tile == nullptr) return nullptr;
    OIIO::TypeDesc format;
    const void* pixels = process_cache().tile_pixels(tile, format);
    if (pixels == nullptr) {
      process_cache().release_tile(tile);
      return nullptr;
    }
    held = {number, 0, tile, static_cast<const std::byte*>(pixels)};
    std::atomic_ref(cache_.used_at_[number])
        .store(cache_.reads_.load(std::memory_order_relaxed), std::memory_order_relaxed);
  }
  const bool tells_all = !cache_.first_users_.empty();
  held.wave = tells_all ? UINT64_MAX : wave_;  // no wave's: the next lookup comes here again
  if (tells_all) cache_.note_user(number, user_);
  if (TileCache::set(cache_.touched_in_wave_, number)) return held.pixels;
  const uint64_t bytes = file.face_tex ? file.face_tex->tiles()[number - file.first_tile].size_bytes : file.tile_bytes;
  ++counts.wave_tiles_touched, counts.wave_unique_bytes += bytes, counts.wave_decoded_bytes += file.tile_bytes;
  if (!TileCache::set(cache_.touched_, number)) ++counts.tiles_touched, counts.unique_bytes += bytes;
  return held.pixels;
}

// ---- the cache ----

// Some builds of the library hold ten MiB at least: it is asked what it does.
TileCache::TileCache(uint64_t tile_limit_bytes) : limit_bytes_(std::max<uint64_t>(tile_limit_bytes, 1 << 20)) {
  process_cache().attribute("max_memory_MB", static_cast<float>(static_cast<double>(limit_bytes_) / (1 << 20)));
  float held_mib = 0;
  if (process_cache().getattribute("max_memory_MB", held_mib))
    limit_bytes_ = std::max(limit_bytes_, static_cast<uint64_t>(static_cast<double>(held_mib) * (1 << 20)));
}

TileCache::~TileCache() {
  for (const std::string& path : paths_) process_cache().invalidate(OIIO::ustring(path), true);
}

Result<TileFile> TileCache::add_image(const std::string& path, const ImageShape& shape, uint64_t tile_count) {
  TileFile file{path, nullptr, tile_count_,
                uint64_t{kTileSize} * kTileSize * shape.channels * shape.texel_bytes, nullptr};
  process_cache().add_file(OIIO::ustring(path), make_counted_input);
  file.handle = process_cache().get_image_handle(OIIO::ustring(path));
  paths_.push_back(path);
  OIIO::ImageSpec spec;
  if (file.handle == nullptr ||
      !process_cache().get_imagespec(static_cast<OIIO::ImageCache::ImageHandle*>(file.handle), nullptr, spec))
    return error("{}: the packed image cannot be opened: {}; pack the scene again", path, failure());
  const bool same = spec.width == static_cast<int>(shape.width) && spec.height == static_cast<int>(shape.height) &&
                    spec.nchannels == static_cast<int>(shape.channels) &&
                    spec.tile_width == static_cast<int>(kTileSize) &&
                    spec.tile_height == static_cast<int>(kTileSize) && spec.format.size() == shape.texel_bytes;
  if (!same) return error("{}: is not the image the manifest describes; pack the scene again", path);
  tile_count_ += tile_count, largest_tile_bytes_ = std::max(largest_tile_bytes_, file.tile_bytes);
  return file;
}

Result<TileFile> TileCache::add_face_tex(const FaceTexSource& source) {
  const std::string path = source.file().path().string();
  TileFile file{path, nullptr, tile_count_, source.file().format().tile_bytes(), &source.file()};
  process_cache().add_file(OIIO::ustring(path), make_face_tex);
  file.handle = process_cache().get_image_handle(OIIO::ustring(path));
  paths_.push_back(path);
  OIIO::ImageSpec spec;
  if (file.handle == nullptr ||
      !process_cache().get_imagespec(static_cast<OIIO::ImageCache::ImageHandle*>(file.handle), nullptr, spec))
    return error("{}: the face textures cannot be opened: {}; pack the scene again", path, failure());
  tile_count_ += source.file().tiles().size(), largest_tile_bytes_ = std::max(largest_tile_bytes_, file.tile_bytes);
  return file;
}

void TileCache::begin(uint32_t owner_count, bool is_logged) {
  owner_count_ = owner_count;
  const auto threads = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  held_tiles_ = std::bit_floor(std::clamp<uint64_t>(limit_bytes_ / 4 / threads / largest_tile_bytes_,
                                                    TileThread::kLeastHeldTiles, TileThread::kHeldTiles));
  for (Buffer<uint64_t>* bits : {&touched_, &touched_in_wave_, &read_in_wave_})
    *bits = Buffer<uint64_t>(MemoryTag::textures, tile_count_ / 64 + 1);
  used_at_ = Buffer<uint32_t>(MemoryTag::textures, tile_count_);
  if (is_logged) reads_of_tile_ = Buffer<uint32_t>(MemoryTag::trace_log, tile_count_);
}

bool TileCache::is_full() {
  long long used = 0;
  process_cache().getattribute("stat:cache_memory_used", OIIO::TypeDesc::INT64, &used);
  is_full_ = is_full_ || static_cast<double>(used) > 0.9 * static_cast<double>(limit_bytes_);
  return is_full_;
}

bool TileCache::probably_holds(uint64_t number, uint64_t tile_bytes) const {
  if (used_at_[number] == 0) return false;
  // The library's hand goes round: tiles begin to leave before as many others came as there is room for.
  const uint64_t stay = limit_bytes_ / tile_bytes * 3 / 4;
  return !is_full_ || reads_.load(std::memory_order_relaxed) - used_at_[number] < stay;
}

void TileCache::begin_wave() {
  wave_.fetch_add(1, std::memory_order_relaxed);
  for (Buffer<uint64_t>* bits : {&touched_in_wave_, &read_in_wave_}) std::fill(bits->begin(), bits->end(), 0);
  std::fill(reads_of_tile_.begin(), reads_of_tile_.end(), 0);
}

std::string TileCache::failure() const { return process_cache().geterror(); }

bool TileCache::set(Buffer<uint64_t>& bits, uint64_t number) {
  const uint64_t bit = uint64_t{1} << (number % 64);
  std::atomic_ref word(bits[number / 64]);
  return (word.load(std::memory_order_relaxed) & bit) != 0 || (word.fetch_or(bit) & bit) != 0;
}

void TileCache::note_user(uint64_t number, uint64_t user) {
  std::atomic_ref first(first_users_[number]);
  uint64_t known = first.load(std::memory_order_relaxed);
  while (user < known && !first.compare_exchange_weak(known, user, std::memory_order_relaxed)) continue;
}

}  // namespace spillway::cache
