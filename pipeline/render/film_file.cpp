#include "pipeline/render/film_file.h"

#include "cache/section_file.h"

// Format of the film file: sections (cache/section_file.h) of kind "SPWFILM ":
//   "header"     FilmFileHeader
//   "libraries"  text
//   per half h in {a, b} that the file holds:
//     "h.beauty"  int64[3] a pixel, row by row of the window      "h.ranges"  SampleRange[]
//     "h.faults"  uint64[3]: not finite, out of range, least (sink << 32 | sample)
//     "h.depth" int64, "h.depth_hits" uint32, "h.normal" int32[3], "h.albedo" int32[3]: of layers that the film has
//   "a.ids"      uint32[3] a pixel: mesh, material, instance

namespace spillway::pipeline {

struct FilmFileHeader {
  FilmShape shape;
  uint64_t settings_key;
  uint32_t halves;  // FilmHalves
  uint32_t reserved;
};
static_assert(sizeof(FilmFileHeader) == 48);

// What a film file says, checked; spans into the reader's bytes.
struct FilmFile {
  cache::SectionReader reader;
  FilmFileHeader header{};
  FilmIdentity identity;
  Film::HalfView halves[2];

  static Result<FilmFile> open(const std::filesystem::path& path);
  Status read_half(int half);
  template <class T>
  Status read_array(const std::string& name, size_t size, std::span<const T>& items) const;
  Status merge_into(Film& film) const;
  static void add_half(cache::SectionWriter& writer, const Film& film, int half);
};

void FilmFile::add_half(cache::SectionWriter& writer, const Film& film, int half) {
  const Film::HalfView v = film.view(half);
  const std::string prefix = half == 0 ? "a." : "b.";
  writer.add_array(prefix + "beauty", v.beauty);
  writer.add_array(prefix + "ranges", v.ranges);
  writer.add_array(prefix + "faults", v.faults);
  if (!v.depth.empty()) writer.add_array(prefix + "depth", v.depth);
  if (!v.depth.empty()) writer.add_array(prefix + "depth_hits", v.depth_hits);
  if (!v.normal.empty()) writer.add_array(prefix + "normal", v.normal);
  if (!v.albedo.empty()) writer.add_array(prefix + "albedo", v.albedo);
  if (!v.ids.empty()) writer.add_array(prefix + "ids", v.ids);
}

Status write_film(const Film& film, const std::filesystem::path& path, FilmHalves halves) {
  const MemoryClaim copies(MemoryTag::film, Film::bytes(film.shape()));  // the writer holds copies of its sections
  cache::SectionWriter writer(kFilmKind, kFilmVersion);
  const FilmFileHeader header{film.shape(), film.identity().settings_key, halves, 0};
  writer.add_array("header", std::span(&header, 1));
  writer.add_array("libraries", std::span<const char>(film.identity().library_versions));
  for (int half = 0; half < 2; ++half)
    if (halves & (1u << half)) FilmFile::add_half(writer, film, half);
  return writer.write(path);
}

template <class T>
Status FilmFile::read_array(const std::string& name, size_t size, std::span<const T>& items) const {
  SPILLWAY_ASSIGN(const std::span<const std::byte> raw, reader.bytes(name));
  if (raw.size() != size * sizeof(T))
    return error("{}: section '{}' has {} bytes where the image's size asks for {}; the file is damaged",
                 reader.path().string(), name, raw.size(), size * sizeof(T));
  items = {reinterpret_cast<const T*>(raw.data()), size};  // sections lie 64-aligned
  return {};
}

Status FilmFile::read_half(int half) {
  const std::string prefix = half == 0 ? "a." : "b.";
  const size_t pixels = header.shape.pixel_count();
  const auto size = [&](uint32_t layer, size_t n) { return header.shape.layers & layer ? n * pixels : 0; };
  Film::HalfView& v = halves[half];
  SPILLWAY_TRY(read_array(prefix + "beauty", 3 * pixels, v.beauty));
  SPILLWAY_TRY(read_array(prefix + "faults", 3, v.faults));
  SPILLWAY_ASSIGN(const std::span<const std::byte> ranges, reader.bytes(prefix + "ranges"));
  SPILLWAY_TRY(read_array(prefix + "ranges", ranges.size() / sizeof(SampleRange), v.ranges));
  if (header.shape.layers & kLayerDepth) {
    SPILLWAY_TRY(read_array(prefix + "depth", pixels, v.depth));
    SPILLWAY_TRY(read_array(prefix + "depth_hits", pixels, v.depth_hits));
  }
  if (header.shape.layers & kLayerNormal) SPILLWAY_TRY(read_array(prefix + "normal", size(kLayerNormal, 3), v.normal));
  if (header.shape.layers & kLayerAlbedo) SPILLWAY_TRY(read_array(prefix + "albedo", size(kLayerAlbedo, 3), v.albedo));
  if (half == 0 && (header.shape.layers & kLayerIds)) SPILLWAY_TRY(read_array("a.ids", size(kLayerIds, 3), v.ids));
  return {};
}

Result<FilmFile> FilmFile::open(const std::filesystem::path& path) {
  SPILLWAY_ASSIGN(cache::SectionReader reader,
                  cache::SectionReader::read(path, kFilmKind, kFilmVersion, MemoryTag::film));
  FilmFile file{std::move(reader), {}, {}, {}};
  std::span<const FilmFileHeader> header;
  SPILLWAY_TRY(file.read_array("header", 1, header));
  file.header = header[0];
  if (auto status = check_shape(file.header.shape); !status)
    return error("{}: {}; the file is damaged", path.string(), status.error().message);
  if (file.header.halves == 0 || file.header.halves > kBothHalves)
    return error("{}: says that it holds halves {:#x}; the file is damaged", path.string(), file.header.halves);
  SPILLWAY_ASSIGN(const std::span<const std::byte> libraries, file.reader.bytes("libraries"));
  file.identity.settings_key = file.header.settings_key;
  file.identity.library_versions.assign(reinterpret_cast<const char*>(libraries.data()), libraries.size());
  for (int half = 0; half < 2; ++half)
    if (file.header.halves & (1u << half)) SPILLWAY_TRY(file.read_half(half));
  return file;
}

Status FilmFile::merge_into(Film& film) const {
  const auto merge = [&]() -> Status {
    SPILLWAY_TRY(film.check_parts_of_one_image(header.shape, identity));
    for (int half = 0; half < 2; ++half) SPILLWAY_TRY(film.check_half(half, halves[half]));
    for (int half = 0; half < 2; ++half)
      if (header.halves & (1u << half)) film.merge_half(half, halves[half]);
    return {};
  };
  if (auto status = merge(); !status) return error("{}: {}", reader.path().string(), status.error().message);
  return {};
}

Result<Film> read_film(const std::filesystem::path& path) {
  SPILLWAY_ASSIGN(const FilmFile file, FilmFile::open(path));
  SPILLWAY_ASSIGN(Film film, Film::create(file.header.shape, file.identity));
  SPILLWAY_TRY(file.merge_into(film));
  return film;
}

Status merge_film_file(Film& film, const std::filesystem::path& path) {
  SPILLWAY_ASSIGN(const FilmFile file, FilmFile::open(path));
  return file.merge_into(film);
}

}  // namespace spillway::pipeline
