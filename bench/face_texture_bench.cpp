// Face textures: what a tile miss costs by compression and tile size, lookups a second beside OpenImageIO's texture()
// on UV tiles, and a painted wall rendered within a twentieth of its textures.
//
//   face_texture_bench [--faces N] [--scratch DIR] [--threads N] [--part tiles|lookups|order|frame]

#include <OpenImageIO/imageio.h>
#include <OpenImageIO/texture.h>
#include <tbb/global_control.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <random>

#include "bench/support/or_give_up.h"
#include "cache/base/parallel.h"
#include "cache/facetex_writer.h"
#include "cache/texture_cache.h"
#include "pipeline/pack/scene_packer.h"
#include "pipeline/render/render_image.h"
#include "tests/support/face_mesh.h"
#include "tools/city/paint.h"

namespace spillway {
namespace {

namespace fs = std::filesystem;
using cache::FaceTexCodec;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

// What faces are painted with: noise that hardly compresses, or the city's walls at 16 texels a metre.
enum class Paint { noise, walls };
const char* name(Paint paint) { return paint == Paint::noise ? "noise" : "walls"; }

// A square wall of so many texels a side, or a piece of one.
std::vector<std::byte> wall_paint(uint32_t number, uint8_t ulog2, uint8_t vlog2) {
  using namespace tools::city;
  static constexpr Surface kSurfaces[] = {Surface::brick_red,     Surface::limestone,  Surface::concrete,
                                          Surface::plaster_cream, Surface::wood_green, Surface::brick_dark};
  WallGrid wall;
  wall.frame = {{0, 0, 0}, {1, 0}}, wall.width_m = 20, wall.top_m = 30, wall.key = number;
  wall.bay_m = 3, wall.half_window_m = 0.6, wall.sill_m = 0.9, wall.head_m = 2.4;
  const float x = static_cast<float>(number % 7), z = static_cast<float>(number % 5);
  const float width = static_cast<float>(1u << ulog2) / 16, height = static_cast<float>(1u << vlog2) / 16;
  const std::array<Float3, 4> corners = {
      Float3{x, 0, z}, {x + width, 0, z}, {x + width, 0, z + height}, {x, 0, z + height}};
  return painted_texels({.surface = kSurfaces[number % std::size(kSurfaces)], .size = {ulog2, vlog2}}, corners, wall);
}

// Paint with some structure: smooth, with noise of a few steps.
std::vector<std::byte> paint(std::mt19937& random, uint32_t width, uint32_t height, uint32_t channels) {
  std::vector<std::byte> texels(size_t{width} * height * channels);
  const double phase = random() % 100, step = 0.05 + 0.001 * static_cast<double>(random() % 100);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      for (uint32_t c = 0; c < channels; ++c)
        texels[(size_t{y} * width + x) * channels + c] = static_cast<std::byte>(static_cast<int>(
            120 + 80 * std::sin(step * x + phase) * std::cos(step * y + c) + static_cast<double>(random() % 8)));
  return texels;
}

uint8_t log2_of(uint32_t face) { return static_cast<uint8_t>(3 + face * 7 % 6); }  // 8 to 256 texels a side

void write_faces(const fs::path& path, uint32_t faces, FaceTexCodec codec, Paint what = Paint::noise) {
  cache::FaceTexFormat format;
  format.codec = codec;
  auto writer = value_of(cache::FaceTexWriter::create(path, format));
  const test::FaceGrid grid(faces, 1);
  const auto infos = grid.faces([](uint32_t f) { return std::pair(log2_of(f), log2_of(f)); });
  check(writer->begin_texture({"faces", cache::FaceShape::quad, {}, {}, infos}));
  std::mt19937 random(1);
  std::map<uint8_t, std::vector<std::vector<std::byte>>> walls;  // some of each size, over and over
  for (uint32_t f = 0; f < faces; ++f) {
    auto& of_size = walls[infos[f].ulog2];
    if (what == Paint::walls && of_size.size() < 12) of_size.push_back(wall_paint(f, infos[f].ulog2, infos[f].vlog2));
    check(writer->add_face(what == Paint::walls ? of_size[f / 6 % of_size.size()]
                                                : paint(random, 1u << infos[f].ulog2, 1u << infos[f].vlog2, 3)));
  }
  check(writer->finish());
}

std::unique_ptr<cache::TextureCache> open_faces(const fs::path& path, uint32_t faces, uint64_t limit) {
  const auto file = value_of(cache::FaceTexFile::open(path, {}));
  cache::FaceContainerInfo info{};
  path.filename().string().copy(info.file_name, sizeof info.file_name - 1);
  info.face_count = faces, info.tile_count = file.tiles().size();
  info.tile_bytes = static_cast<uint32_t>(file.format().tile_bytes()),
  info.image_count = static_cast<uint32_t>(file.images().size());
  const cache::FaceTextureInfo texture{0, 0, faces, cache::FaceShape::quad, 3, {}};
  return value_of(cache::TextureCache::open(path.parent_path(), {}, {.memory_limit_bytes = limit}, std::span(&info, 1),
                                            std::span(&texture, 1)));
}

enum class Where { inside, edge };

// `a_face` lookups a face, face after face.
std::vector<cache::FaceTextureRequest> sorted_requests(uint32_t faces, uint32_t a_face, Where where) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<cache::FaceTextureRequest> requests;
  for (uint32_t f = 0; f < faces; ++f) {
    const float border = 1.0f / static_cast<float>(1u << log2_of(f));
    for (uint32_t i = 0; i < a_face; ++i) {
      const float u = where == Where::edge ? unit(random) * 0.4f * border : border + unit(random) * (1 - 2 * border);
      requests.push_back(
          {0, f, u, border + unit(random) * (1 - 2 * border), 0, 0, unit(random), cache::FaceLevelChoice::stochastic});
    }
  }
  return requests;
}

double look_up_all(cache::TextureCache& textures, const std::vector<cache::FaceTextureRequest>& requests, bool stage) {
  std::vector<cache::Texel> values(requests.size());
  textures.begin_wave();
  const auto start = Clock::now();
  constexpr size_t kBatch = 1 << 14, kBlock = 256;
  for (size_t first = 0; first < requests.size(); first += kBatch) {
    const auto batch = std::span(requests).subspan(first, std::min(kBatch, requests.size() - first));
    if (stage) check(textures.stage_faces(batch));
    parallel_blocks(batch.size(), kBlock, [&](size_t, size_t b, size_t e) {
      check(textures.look_up_faces(batch.subspan(b, e - b), std::span(values).subspan(first + b, e - b)));
    });
  }
  return seconds_since(start);
}

// ---- what a miss costs ----

const char* codec_name(FaceTexCodec codec) {
  return codec == FaceTexCodec::none ? "none" : codec == FaceTexCodec::lz4 ? "LZ4-HC" : "zstd-1";
}

// One pass cold, one warm; the difference over the tiles read. Both threads work.
void miss_of_codecs(const fs::path& folder, uint32_t faces) {
  fmt::print("| container | file, MB | us a tile miss | M lookups/s, cold |\n|---|---|---|---|\n");
  for (const auto& [what, codec] : {std::pair{Paint::noise, FaceTexCodec::none},
                                    {Paint::noise, FaceTexCodec::lz4},
                                    {Paint::noise, FaceTexCodec::zstd},
                                    {Paint::walls, FaceTexCodec::none},
                                    {Paint::walls, FaceTexCodec::lz4},
                                    {Paint::walls, FaceTexCodec::zstd}}) {
    const fs::path path = folder / "miss.facetex";
    write_faces(path, faces, codec, what);
    const auto requests = sorted_requests(faces, 16, Where::inside);
    const auto textures = open_faces(path, faces, 4ull << 30);
    const double cold = look_up_all(*textures, requests, true), warm = look_up_all(*textures, requests, false);
    const double tiles = static_cast<double>(textures->counters().tiles_read);
    fmt::print("| .facetex 8 bit, {}, {} | {} | {:.1f} | {:.2f} |\n", name(what), codec_name(codec),
               fs::file_size(path) >> 20, (cold - warm) / tiles * 1e6,
               static_cast<double>(requests.size()) / cold * 1e-6);
  }
}

// UV images of the same kind of paint, through OpenImageIO's texture().
void write_uv(const fs::path& path, const char* compression, OIIO::TypeDesc type) {
  constexpr uint32_t kSize = 4096;
  std::mt19937 random(1);
  const auto texels = paint(random, kSize, kSize, 3);
  const auto output = OIIO::ImageOutput::create(path.string());
  OIIO::ImageSpec spec(kSize, kSize, 3, type);
  spec.tile_width = spec.tile_height = 64;
  spec.attribute("compression", compression);
  if (!output || !output->open(path.string(), spec) || !output->write_image(OIIO::TypeUInt8, texels.data()) ||
      !output->close())
    give_up(error("{}: cannot be written", path.string()));
}

constexpr int kWarmPasses = 25;  // they take hundredths of a second: the best counts

// Lookups of a UV image, tile after tile or in no order.
class UvLookups {
 public:
  static constexpr int kTiles = 64, kATile = 64;  // along each side; lookups in each

  UvLookups(const fs::path& path, bool sorted) : path_(path.string()) {
    system_->attribute("max_memory_MB", 4000.0f);
    system_->attribute("automip", 0);
    std::mt19937 random(3);
    std::uniform_real_distribution<float> unit(0.05f, 0.95f);
    for (int ty = 0; ty < kTiles; ++ty)
      for (int tx = 0; tx < kTiles; ++tx)
        for (int i = 0; i < kATile; ++i)
          places_.emplace_back((static_cast<float>(tx) + unit(random)) / kTiles,
                               (static_cast<float>(ty) + unit(random)) / kTiles);
    if (!sorted) std::shuffle(places_.begin(), places_.end(), random);
  }
  ~UvLookups() { OIIO::TextureSystem::destroy(system_); }
  UvLookups(const UvLookups&) = delete;
  UvLookups& operator=(const UvLookups&) = delete;

  [[nodiscard]] double count() const { return static_cast<double>(places_.size()); }
  // Seconds; the first pass reads all tiles.
  double pass() {
    const auto start = Clock::now();
    parallel_blocks(places_.size(), 256, [&](size_t, size_t first, size_t last) {
      OIIO::TextureOpt options;
      options.mipmode = OIIO::TextureOpt::MipModeNoMIP;
      options.interpmode = OIIO::TextureOpt::InterpBilinear;
      auto* const handle = system_->get_texture_handle(path_);
      auto* const perthread = system_->get_perthread_info();
      float value[3];
      for (size_t i = first; i < last; ++i)
        system_->texture(handle, perthread, options, places_[i].first, places_[i].second, 0, 0, 0, 0, 3, value);
    });
    return seconds_since(start);
  }

 private:
  OIIO::TextureSystem* const system_ = OIIO::TextureSystem::create(false);
  const OIIO::ustring path_;
  std::vector<std::pair<float, float>> places_;
};

void miss_of_images(const fs::path& folder) {
  for (const auto& [name, compression, type] :
       {std::tuple{"uv.exr", "zips", OIIO::TypeHalf}, {"uv.tif", "none", OIIO::TypeUInt8}}) {
    write_uv(folder / name, compression, type);
    UvLookups uv(folder / name, true);
    const double cold = uv.pass(), warm = uv.pass();
    fmt::print("| texture(), {} {} | {} | {:.1f} | {:.2f} |\n", name, compression, fs::file_size(folder / name) >> 20,
               (cold - warm) / (UvLookups::kTiles * UvLookups::kTiles) * 1e6, uv.count() / cold * 1e-6);
  }
}

// Twelve tiles, over and over.
void unpack_tiles(Paint what, uint8_t log2, FaceTexCodec codec) {
  constexpr int kTiles = 12, kTimes = 300;
  const uint32_t size = 1u << log2;
  std::mt19937 random(5);
  std::vector<std::vector<std::byte>> packed;
  size_t whole = 0, in_file = 0;
  for (uint32_t t = 0; t < kTiles; ++t) {
    const auto tile = what == Paint::walls ? wall_paint(t, log2, log2) : paint(random, size, size, 3);
    packed.push_back(cache::compress_tile(codec, tile));
    whole += tile.size(), in_file += packed.back().size();
  }
  std::vector<std::byte> out(whole / kTiles);
  const auto start = Clock::now();
  for (int i = 0; i < kTimes; ++i)
    for (const auto& tile : packed)
      if (!cache::decompress_tile(codec, tile, out)) std::exit(1);
  const double us = seconds_since(start) / (kTiles * kTimes) * 1e6;
  fmt::print("| {0} x {0}, {1} | {2} | {3:.2f} of {4} bytes | {5:.1f} | {6:.2f} |\n", size, name(what),
             codec_name(codec), static_cast<double>(in_file) / static_cast<double>(whole), out.size(), us,
             us * 1e3 / (size * size));
}

// Unpacking alone, by tile size.
void tile_sizes() {
  fmt::print("\n| tile | compression | packed | us to unpack | ns a texel |\n|---|---|---|---|---|\n");
  for (const Paint what : {Paint::noise, Paint::walls})
    for (const uint8_t log2 : {uint8_t{5}, uint8_t{6}, uint8_t{7}})
      for (const FaceTexCodec codec : {FaceTexCodec::lz4, FaceTexCodec::zstd}) unpack_tiles(what, log2, codec);
}

// ---- lookups a second ----

void lookups(const fs::path& folder, uint32_t faces) {
  const fs::path path = folder / "lookups.facetex";
  write_faces(path, faces, FaceTexCodec::lz4);
  write_uv(folder / "uv.tif", "none", OIIO::TypeUInt8);
  const auto textures = open_faces(path, faces, 4ull << 30);
  UvLookups uv(folder / "uv.tif", true), uv_random(folder / "uv.tif", false);
  struct Row {
    std::string name;
    double count;
    std::function<double()> pass;
    double seconds = 0;
  };
  std::vector<Row> rows = {{"OpenImageIO texture(), UV tiles, sorted", uv.count(), [&] { return uv.pass(); }},
                           {"the same, random", uv_random.count(), [&] { return uv_random.pass(); }}};
  for (const Where where : {Where::inside, Where::edge})
    for (const bool sorted : {true, false}) {
      auto requests = sorted_requests(faces, 128, where);
      std::mt19937 random(4);
      if (!sorted) std::shuffle(requests.begin(), requests.end(), random);
      const auto count = static_cast<double>(requests.size());
      rows.push_back({fmt::format("face textures, {}, {}", where == Where::inside ? "inside faces" : "across edges",
                                  sorted ? "sorted" : "random"),
                      count, [&textures, requests = std::move(requests)] { return look_up_all(*textures, requests, false); }});
    }
  // In turns, so that what else happens on the machine happens to all; the first turn reads.
  for (Row& row : rows) row.pass(), row.seconds = row.pass();
  for (int turn = 1; turn < kWarmPasses; ++turn)
    for (Row& row : rows) row.seconds = std::min(row.seconds, row.pass());
  fmt::print("| lookups, everything in memory | M a second | of texture(), sorted |\n|---|---|---|\n");
  const double base = rows.front().count / rows.front().seconds;
  for (const Row& row : rows)
    fmt::print("| {} | {:.2f} | {:.2f} |\n", row.name, row.count / row.seconds * 1e-6, row.count / row.seconds / base);
}

// ---- a frame ----

// A wall of n x n quads, each with 32 x 32 texels, or grey.
Result<pipeline::Store> pack_wall(const fs::path& store, uint32_t n, bool painted) {
  using namespace pipeline;
  SPILLWAY_ASSIGN(const auto packer, ScenePacker::create(store, {}));
  SceneSettings settings;
  settings.camera.resolution_x_px = 640, settings.camera.resolution_y_px = 360;
  settings.camera.tan_half_fov_x = 0.5f, settings.camera.tan_half_fov_y = 0.28f;
  settings.camera.world_from_camera.m[2][3] = -2;
  settings.render.samples_per_pixel = 16, settings.render.max_depth = 3;
  packer->set_settings(settings);
  Material material;
  material.reflectance.constant = {0.5f, 0.5f, 0.5f};
  if (painted) {
    cache::FaceTexFormat format;
    const test::FaceGrid grid(n, n);
    const auto infos = grid.faces([](uint32_t) { return std::pair<uint8_t, uint8_t>{5, 5}; });
    SPILLWAY_ASSIGN(const FaceTextureId id,
                    packer->begin_face_texture(format, {"wall", cache::FaceShape::quad, {}, {}, infos}));
    std::mt19937 random(7);
    for (uint32_t f = 0; f < n * n; ++f) SPILLWAY_TRY(packer->add_face(paint(random, 32, 32, 3)));
    TextureNode node;
    node.kind = TextureKind::face, node.image = id.value;
    for (float& v : node.value) v = 1;
    SPILLWAY_ASSIGN(const TextureId texture, packer->add_texture(node));
    material.reflectance.texture = texture.value;
  }
  SPILLWAY_ASSIGN(const MaterialId wall, packer->add_material(material, "wall"));
  std::vector<Float3> positions;
  std::vector<uint32_t> indices;
  std::vector<TriangleFace> faces;
  for (uint32_t j = 0; j <= n; ++j)
    for (uint32_t i = 0; i <= n; ++i) {
      const float x = 2.4f * (static_cast<float>(i) / static_cast<float>(n) - 0.5f),
                  y = 2.4f * (static_cast<float>(j) / static_cast<float>(n) - 0.5f);
      positions.push_back({x, y, 0.5f * std::cos(2 * x) * std::cos(2 * y)});  // a bowl: paths meet it again
    }
  for (uint32_t f = 0; f < n * n; ++f) {
    const uint32_t a = f / n * (n + 1) + f % n;
    indices.insert(indices.end(), {a, a + 1, a + n + 2, a, a + n + 2, a + n + 1});
    faces.push_back({f, {0, 1, 2}, false, a + n + 1}), faces.push_back({f, {0, 2, 3}, false, a + 1});
  }
  MeshInput mesh;
  mesh.name = "wall", mesh.positions = positions, mesh.indices = indices, mesh.faces = faces, mesh.material = wall;
  SPILLWAY_TRY(packer->add_mesh(mesh));
  shading::Light sky{};
  sky.kind = shading::LightKind::infinite, sky.radiance = {1, 1, 1};
  SPILLWAY_TRY(packer->add_light(sky));
  SPILLWAY_TRY(packer->finish());
  return Store::open(store);
}

void print_frame(const char* what, const pipeline::RenderReport& r, double base) {
  uint64_t unique = 0;
  double worst = 0;
  for (const pipeline::WaveReport& w : r.waves) {
    unique += w.textures.wave_unique_bytes;
    if (w.textures.wave_unique_bytes > 0)
      worst = std::max(worst,
                       static_cast<double>(w.textures.bytes_read) / static_cast<double>(w.textures.wave_unique_bytes));
  }
  const uint64_t logged = r.io[static_cast<size_t>(cache::IoPurpose::textures)].read_bytes;
  fmt::print("| {} | {:.2f} | {:.2f} | {:.1f} | {:.1f} | {:.3f} | {} | {:.1f} | {:.1f} |\n", what, r.seconds,
             r.seconds / base, static_cast<double>(r.textures.bytes_read) / (1 << 20),
             static_cast<double>(unique) / (1 << 20), worst, r.textures.tiles_read_again,
             static_cast<double>(logged) / (1 << 20), static_cast<double>(r.process_io.read_chars) / (1 << 20));
}

void frame(const fs::path& folder, uint32_t n) {
  const auto plain = value_of(pack_wall(folder / "plain.store", n, false)),
             painted = value_of(pack_wall(folder / "painted.store", n, true));
  const auto& info = painted.face_containers()[0];
  const uint64_t bytes = info.tile_count * info.tile_bytes;
  fmt::print("{} faces of 32 x 32, {} MB of tiles; 640 x 360, 16 samples\n\n", n * n, bytes >> 20);
  fmt::print(
      "| | seconds | of the plain one | MiB read | unique by wave | read / unique, worst wave | tiles again in a wave "
      "| logged reads | process reads |\n|---|---|---|---|---|---|---|---|---|\n");
  pipeline::RenderOptions options;
  options.settings = plain.settings();
  const double base = value_of(pipeline::render_image(plain, options)).report.seconds;
  const double again = value_of(pipeline::render_image(plain, options)).report.seconds;
  const double constant = std::min(base, again);
  fmt::print("| constant colour | {:.2f} | 1 |\n", constant);
  options.settings = painted.settings();
  print_frame("textures in memory", value_of(pipeline::render_image(painted, options)).report, constant);
  for (const uint64_t part : {10, 20}) {
    options.plan.texture_bytes = bytes / part;
    print_frame(fmt::format("textures within {} %", 100 / part).c_str(),
                value_of(pipeline::render_image(painted, options)).report, constant);
  }
  options.read_ahead_textures = false;
  print_frame("the same, not read ahead", value_of(pipeline::render_image(painted, options)).report, constant);
}

// The lookups of sorted hits, and the same without an order, within a tenth of the tiles.
void order(const fs::path& folder, uint32_t faces) {
  write_faces(folder / "order.facetex", faces, FaceTexCodec::lz4);
  const auto file = value_of(cache::FaceTexFile::open(folder / "order.facetex", {}));
  const uint64_t limit = file.tiles().size() * file.format().tile_bytes() / 10 + (2 << 20);
  fmt::print("\n| order of lookups, a tenth in memory | read / unique | tiles again |\n|---|---|---|\n");
  for (const bool sorted : {true, false}) {
    const auto textures = open_faces(folder / "order.facetex", faces, limit);
    auto requests = sorted_requests(faces, 64, Where::inside);
    std::mt19937 random(4);
    if (!sorted) std::shuffle(requests.begin(), requests.end(), random), requests.resize(requests.size() / 4);
    look_up_all(*textures, requests, sorted);
    const auto c = textures->counters();
    fmt::print("| {} | {:.3f} | {} |\n", sorted ? "by face" : "none",
               static_cast<double>(c.bytes_read) / static_cast<double>(c.wave_unique_bytes), c.tiles_read_again);
  }
}

}  // namespace
}  // namespace spillway

int main(int argc, char** argv) {
  using namespace spillway;
  uint32_t faces = 6000;
  int threads = 2;
  std::string part, scratch = std::filesystem::temp_directory_path();
  CLI::App app("Face textures: tile misses, lookups, a frame.");
  app.add_option("--faces", faces);
  app.add_option("--threads", threads);
  app.add_option("--scratch", scratch);
  app.add_option("--part", part);
  CLI11_PARSE(app, argc, argv);
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, static_cast<size_t>(threads));
  const std::filesystem::path folder = std::filesystem::path(scratch) / "face_texture_bench";
  std::filesystem::create_directories(folder);
  if (part.empty() || part == "tiles") miss_of_codecs(folder, faces), miss_of_images(folder), tile_sizes();
  if (part.empty() || part == "lookups") lookups(folder, std::min(faces, 2000u));
  if (part.empty() || part == "order") order(folder, std::min(faces, 3000u));
  if (part.empty() || part == "frame") frame(folder, 160);
  std::filesystem::remove_all(folder);
  return 0;
}
