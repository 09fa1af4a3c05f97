#include "cache/facetex_source.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <map>
#include <mutex>

namespace spillway::cache {
namespace {

// Sources by path: an ImageInput knows nothing but a name.
struct Registry {
  std::mutex mutex;
  std::map<std::string, std::weak_ptr<const FaceTexSource>> sources;
};
Registry& registry() {
  static Registry* const made = new Registry;  // outlives every input
  return *made;
}

OIIO::TypeDesc type_of(FaceTexelType type) {
  switch (type) {
    case FaceTexelType::uint8:
      return OIIO::TypeUInt8;
    case FaceTexelType::uint16:
      return OIIO::TypeUInt16;
    case FaceTexelType::half:
      return OIIO::TypeHalf;
    case FaceTexelType::float32:
      break;
  }
  return OIIO::TypeFloat;
}

std::shared_ptr<const FaceTexSource> known_source(const std::string& name) {
  Registry& known = registry();
  const std::lock_guard lock(known.mutex);
  const auto found = known.sources.find(name);
  return found == known.sources.end() ? nullptr : found->second.lock();
}

class FaceTexInput final : public OIIO::ImageInput {
 public:
  const char* format_name() const override { return "facetex"; }
  int supports(OIIO::string_view feature) const override { return feature == "multiimage" ? 1 : 0; }
  bool valid_file(const std::string& name) const override { return FaceTexFile::is_face_tex(name); }

  bool open(const std::string& name, OIIO::ImageSpec& spec) override {
    source_ = known_source(name);
    if (source_ == nullptr) {
      auto opened = FaceTexSource::open(name, {});
      if (!opened) return tell(opened.error());
      source_ = std::move(*opened);
    }
    if (source_->file().images().empty()) return tell(spillway::error("{}: has no textures", name));
    seek_subimage(0, 0);
    spec = m_spec;
    return true;
  }
  bool close() override {
    source_.reset();
    return true;
  }
  int current_subimage() const override { return subimage_; }
  bool seek_subimage(int subimage, int miplevel) override {
    if (source_ == nullptr || subimage < 0 || static_cast<size_t>(subimage) >= source_->file().images().size() ||
        miplevel != 0)
      return false;
    subimage_ = subimage;
    m_spec = spec_of(subimage);
    return true;
  }
  // Without the base class's seek and lock: any number of threads ask at once.
  OIIO::ImageSpec spec(int subimage, int miplevel) override {
    const bool is_one = source_ != nullptr && subimage >= 0 &&
                        static_cast<size_t>(subimage) < source_->file().images().size() && miplevel == 0;
    return is_one ? spec_of(subimage) : OIIO::ImageSpec();
  }
  OIIO::ImageSpec spec_dimensions(int subimage, int miplevel) override { return spec(subimage, miplevel); }

  bool read_native_scanline(int, int, int, int, void*) override {
    return tell(spillway::error("a .facetex file is read in tiles"));
  }
  bool read_native_tile(int subimage, int miplevel, int x, int y, int, void* data) override {
    const auto images = source_->file().images();
    if (miplevel != 0 || subimage < 0 || static_cast<size_t>(subimage) >= images.size()) return false;
    const FaceTexImage& image = images[static_cast<size_t>(subimage)];
    const uint64_t tile = image.tile_at(static_cast<uint32_t>(x), static_cast<uint32_t>(y));
    const Status read =
        source_->read_tile(tile, {static_cast<std::byte*>(data), source_->file().format().tile_bytes()});
    return read ? true : tell(read.error());
  }

 private:
  bool tell(const Error& problem) {
    errorfmt("{}", problem.message);
    return false;
  }
  OIIO::ImageSpec spec_of(int subimage) const {
    const FaceTexFormat& format = source_->file().format();
    const FaceTexImage& image = source_->file().images()[static_cast<size_t>(subimage)];
    OIIO::ImageSpec spec(static_cast<int>(image.width), static_cast<int>(image.height),
                         static_cast<int>(format.channels), type_of(format.type));
    spec.tile_width = spec.tile_height = static_cast<int>(format.tile_edge());
    spec.alpha_channel = format.alpha_channel;
    spec.attribute("oiio:subimages", static_cast<int>(source_->file().images().size()));
    spec.attribute("oiio:subimagename",
                   fmt::format("{}x{}.level{}", 1u << source_->file().classes()[image.class_index].ulog2,
                               1u << source_->file().classes()[image.class_index].vlog2, image.level));
    spec.attribute("facetex:faces", static_cast<int>(std::min<uint64_t>(image.face_count, INT32_MAX)));
    spec.attribute("facetex:face_width", 1 << image.ulog2);
    spec.attribute("facetex:face_height", 1 << image.vlog2);
    if (format.encoding == FaceTexEncoding::srgb) spec.attribute("oiio:ColorSpace", "sRGB");
    if (format.encoding == FaceTexEncoding::gamma) spec.attribute("oiio:Gamma", format.gamma);
    return spec;
  }

  std::shared_ptr<const FaceTexSource> source_;
  int subimage_ = 0;
};

}  // namespace

ReadTally& thread_read_tally() {
  static thread_local ReadTally tally;
  return tally;
}

Result<std::shared_ptr<FaceTexSource>> FaceTexSource::open(const std::filesystem::path& path,
                                                           FaceTexFile::Options options) {
  SPILLWAY_ASSIGN(FaceTexFile file, FaceTexFile::open(path, options));
  std::shared_ptr<FaceTexSource> source(new FaceTexSource(std::move(file)));
  Registry& known = registry();
  const std::lock_guard lock(known.mutex);
  // The first that is alive is the one that inputs find; its destructor may still be waiting for the lock.
  std::weak_ptr<const FaceTexSource>& first = known.sources[path.string()];
  if (first.expired()) first = source;
  return source;
}

FaceTexSource::~FaceTexSource() {
  Registry& known = registry();
  const std::lock_guard lock(known.mutex);
  const auto found = known.sources.find(file_.path().string());
  if (found != known.sources.end() && found->second.expired()) known.sources.erase(found);
}

Status FaceTexSource::read_tile(uint64_t number, std::span<std::byte> out) const {
  ReadTally& tally = thread_read_tally();
  tally.tiles += 1;
  const std::byte* const staged = staged_.find(number);
  if (staged != nullptr) return file_.decode_tile(number, {staged, file_.tiles()[number].size_bytes}, out);
  tally.bytes += file_.tiles()[number].size_bytes;
  return file_.read_tile(number, out);
}

const std::byte* FaceTexSource::Staged::find(uint64_t tile) const {
  const auto found = std::ranges::lower_bound(places, tile, {}, &Place::tile);
  return found != places.end() && found->tile == tile ? bytes.data() + found->at : nullptr;
}

FaceTexSource::Stage FaceTexSource::begin_stage(std::span<const uint64_t> tiles, uint64_t limit_bytes) {
  struct Run {
    uint64_t first, last, place;  // bytes of the file
  };
  const uint64_t block = file_.block_bytes();
  Stage stage;
  std::vector<Run> runs;
  next_staged_.places.clear();
  for (const uint64_t number : tiles) {
    const FaceTexTile& tile = file_.tiles()[number];
    const uint64_t first = tile.offset / block * block;
    const uint64_t last = (tile.offset + tile.size_bytes + block - 1) / block * block;
    const bool follows = !runs.empty() && first >= runs.back().first && first <= runs.back().last &&
                         last - runs.back().first <= std::max(kRunBytes, last - first);
    const uint64_t more = !follows ? last - first : last > runs.back().last ? last - runs.back().last : 0;
    if (stage.bytes + more > limit_bytes) break;
    if (!follows) runs.push_back({first, first, stage.bytes});
    runs.back().last += more;
    stage.bytes += more;
    next_staged_.places.push_back({number, runs.back().place + (tile.offset - runs.back().first)});
  }
  stage.tile_count = next_staged_.places.size();
  next_staged_.bytes.grow(MemoryTag::textures, stage.bytes);
  const uint64_t end = file_.size_bytes();
  for (const Run& run : runs)
    stage.reads.emplace_back([this, first = run.first, size = std::min(run.last, end) - run.first,
                              to = next_staged_.bytes.data() + run.place] { return file_.read(first, {to, size}); });
  return stage;
}

void FaceTexSource::turn_stage() {
  staged_.bytes.swap(next_staged_.bytes);
  staged_.places.swap(next_staged_.places);
  next_staged_.places.clear();
}

void* make_facetex_input() { return static_cast<OIIO::ImageInput*>(new FaceTexInput); }

}  // namespace spillway::cache
